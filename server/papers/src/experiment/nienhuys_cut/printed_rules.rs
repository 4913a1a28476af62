//! What the rules of the thesis select and flatten, taken literally: nearest nodes mark faces without regard to sides, and
//! every node of such a face is projected, whatever becomes of its elements.
//!
//! # Source
//! Nienhuys 2003, §3.2.1 and §3.2.2.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Vector3};
use scindo_physics::mesh::TetMesh;

use super::delaunay::flatness;

type V = Vector3<f64>;

/// An element is degenerate below this aspect ratio (§3.3).
pub(super) const FLAT: f64 = 0.01;
/// How far outside an element or a face a place may lie, in barycentric coordinates: rounding.
const ROUNDING: f64 = 1e-9;
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Counts of a cut by the printed rules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    /// Selected faces.
    pub faces: usize,
    /// Elements whose four nodes are marked, from which a face is taken at random; here the first.
    pub undecided: usize,
    /// Nodes that could not be projected.
    pub failed: usize,
    /// Elements flatter than [`FLAT`], inverted or not.
    pub flat: usize,
    /// Elements of negative volume that are not flat.
    pub inverted: usize,
}

/// Cuts `mesh` by the plane through `point` with the unit `normal`.
pub(super) fn cut(mesh: &TetMesh, point: V, normal: V) -> Counts {
    let side = |n: u32| (mesh.nodes[n as usize] - point).dot(&normal);
    let mut counts = Counts::default();
    let mut faces: BTreeSet<[u32; 3]> = BTreeSet::new();
    for tet in &mesh.tets {
        let mut marked = BTreeSet::new();
        for [i, j] in EDGES {
            let [a, b] = [tet[i].min(tet[j]), tet[i].max(tet[j])];
            let (s, r) = (side(a), side(b));
            if (s >= 0.0) != (r >= 0.0) {
                // Halved edges choose the node with the lower number.
                marked.insert(if s.abs() <= r.abs() * (1.0 + ROUNDING) { a } else { b });
            }
        }
        let marked: Vec<u32> = marked.into_iter().collect();
        counts.undecided += usize::from(marked.len() == 4);
        if let [a, b, c, ..] = marked[..] {
            faces.insert([a, b, c]);
        }
    }
    counts.faces = faces.len();
    let mut x = mesh.nodes.clone();
    counts.failed = project(mesh, &mut x, &faces, (point, normal));
    for tet in &mesh.tets {
        let aspect = flatness(&tet.map(|n| x[n as usize]));
        counts.flat += usize::from(aspect.abs() < FLAT);
        counts.inverted += usize::from(aspect <= -FLAT);
    }
    counts
}

/// Projects the nodes of the faces onto the plane, one after another. Returns how many of them could not be.
fn project(mesh: &TetMesh, x: &mut [V], faces: &BTreeSet<[u32; 3]>, (point, normal): (V, V)) -> usize {
    let nodes: BTreeSet<u32> = faces.iter().flatten().copied().collect();
    let mut skin: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
    for face in mesh.boundary_faces() {
        face.nodes.iter().for_each(|n| skin.entry(*n).or_default().push(face.nodes));
    }
    let mut around: BTreeMap<u32, Vec<[u32; 4]>> = BTreeMap::new();
    for tet in &mesh.tets {
        tet.iter().filter(|n| nodes.contains(n)).for_each(|n| around.entry(*n).or_default().push(*tet));
    }
    let mut failed = 0;
    for n in nodes {
        let from = x[n as usize];
        let to = match skin.get(&n) {
            None => {
                let w = from - normal * (from - point).dot(&normal);
                around[&n].iter().any(|tet| holds(&tet.map(|n| x[n as usize]), w)).then_some(w)
            }
            Some(faces) => faces
                .iter()
                .filter_map(|face| within(&face.map(|n| x[n as usize]), from, (point, normal)))
                .min_by(|a, b| (a - from).norm().total_cmp(&(b - from).norm())),
        };
        match to {
            Some(to) => x[n as usize] = to,
            None => failed += 1,
        }
    }
    failed
}

fn holds(x: &[V; 4], p: V) -> bool {
    let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
    let Some(inverse) = edges.try_inverse() else { return false };
    let w = inverse * (p - x[0]);
    w.min() >= -ROUNDING && w.sum() <= 1.0 + ROUNDING
}

/// The foot of the perpendicular from `from`, a corner of the face, to the line where its plane meets the sweep, if it
/// lies in the face.
fn within(face: &[V; 3], from: V, (point, normal): (V, V)) -> Option<V> {
    let up = (face[1] - face[0]).cross(&(face[2] - face[0])).try_normalize(0.0)?;
    let way = (normal - up * up.dot(&normal)).try_normalize(ROUNDING)?;
    let w = from - way * ((from - point).dot(&normal) / way.dot(&normal));
    let inside = (0..3).all(|k| {
        let (a, b) = (face[k], face[(k + 1) % 3]);
        (b - a).cross(&(w - a)).dot(&up) >= -ROUNDING * (b - a).norm_squared()
    });
    inside.then_some(w)
}

#[cfg(test)]
mod tests {
    use scindo_physics::mesh::{BoxPattern, box_mesh};

    use super::*;

    /// A plane a little off the middle layer of nodes: its faces are that layer, and nothing is flattened.
    #[test]
    fn a_plane_along_a_layer_flattens_nothing() {
        let mesh = box_mesh(V::zeros(), V::new(1.0, 1.0, 1.0), [4; 3], BoxPattern::Octahedral6);
        let counts = cut(&mesh, V::new(0.0, 0.0, 0.51), V::z());
        assert_eq!(counts, Counts { faces: 32, ..Counts::default() });
    }
}
