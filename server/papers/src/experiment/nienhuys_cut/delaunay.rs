//! Delaunay tetrahedra of a cloud of points, and a cylinder of them.
//!
//! Points are added one by one: tetrahedra whose circumsphere holds the new point are replaced by a star around it. The
//! points must be in general position, so the cylinder jitters them; predicates are then safe in double precision.
//!
//! # Source
//! Bowyer 1981: Computing Dirichlet tessellations. Watson 1981: Computing the n-dimensional Delaunay tessellation with
//! application to Voronoi polytopes.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::{Matrix4, Vector3};
use scindo_physics::mesh::{TET_FACES, TetMesh};
use scindo_study::trial::random::Random;

use crate::lab::Trouble;

type V = Vector3<f64>;

/// Points per ring of a layer, from the middle outwards: 33.
const RINGS: [usize; 4] = [1, 5, 10, 17];
/// Layers of points; 33 × 27 are the 891 nodes of the thesis.
const LAYERS: usize = 27;
/// Distance of layers and of rings [m].
pub(super) const SPACING_M: f64 = 0.01;
/// Part of the distance by which points are moved at random.
const JITTER: f64 = 0.2;
/// Rise of the domed ends over the distance; flat ends would not be in general position.
const DOME: f64 = 0.5;
/// Elements on the skin below this aspect ratio (least height over longest edge) are left out: between points of a
/// convex skin.
const PEEL: f64 = 0.05;
/// Distance of the corners of the first tetrahedron over the size of the cloud.
const FAR: f64 = 100.0;

/// A cylinder along z around the origin, of the 891 nodes of the thesis, and its height and radius [m].
///
/// # Errors
/// Points that are not in general position, which the fixed sequence of random numbers excludes.
pub(super) fn cylinder(seed: u64) -> Result<(TetMesh, [f64; 2]), Trouble> {
    let mut random = Random(seed);
    let (height, radius) = ((LAYERS - 1) as f64 * SPACING_M, (RINGS.len() - 1) as f64 * SPACING_M);
    let mut points = Vec::new();
    for layer in 0..LAYERS {
        let is_end = layer == 0 || layer == LAYERS - 1;
        for (ring, &count) in RINGS.iter().enumerate() {
            for k in 0..count {
                let mut shift = || JITTER * (2.0 * random.uniform() - 1.0);
                let is_skin = ring == RINGS.len() - 1;
                // Points of the skin stay on it.
                let r = SPACING_M * (ring as f64 + if is_skin { 0.0 } else { shift() });
                let angle = TAU * (k as f64 + 0.5 * (layer % 2) as f64 + shift()) / count as f64;
                let up = if is_end {
                    let out = DOME * (1.0 - (r / radius).powi(2));
                    if layer == 0 { -out } else { out }
                } else {
                    shift()
                };
                let z = SPACING_M * (layer as f64 + up) - 0.5 * height;
                points.push(V::new(r * angle.cos(), r * angle.sin(), z));
            }
        }
    }
    let mut mesh = delaunay(points, &mut random)?;
    peel(&mut mesh);
    mesh.check()?;
    Ok((mesh, [height, radius]))
}

/// The Delaunay tetrahedra of points in general position.
///
/// # Errors
/// Points that are not in general position.
pub(super) fn delaunay(points: Vec<V>, random: &mut Random) -> Result<TetMesh, Trouble> {
    let n = points.len();
    let size = points.iter().map(V::norm).fold(0.0, f64::max);
    let mut nodes = points;
    let corner = |x: f64, y: f64, z: f64| FAR * size * V::new(x, y, z);
    nodes.extend([
        corner(1.0, 1.0, 1.0),
        corner(-1.0, -1.0, 1.0),
        corner(-1.0, 1.0, -1.0),
        corner(1.0, -1.0, -1.0),
    ]);
    let first = n as u32;
    let mut tets = vec![upright([first, first + 1, first + 2, first + 3], &nodes)?];
    // A random order keeps the stars small.
    let mut order: Vec<u32> = (0..n as u32).collect();
    for i in (1..n).rev() {
        order.swap(i, (random.uniform() * (i + 1) as f64) as usize);
    }
    for p in order {
        let (inside, outside): (Vec<_>, Vec<_>) =
            tets.iter().partition(|tet| in_sphere(tet.map(|n| nodes[n as usize]), nodes[p as usize]));
        tets = outside;
        // Faces that only one of the removed tetrahedra has bound the star.
        let mut faces: BTreeMap<[u32; 3], ([u32; 3], usize)> = BTreeMap::new();
        for tet in inside {
            for face in TET_FACES.map(|face| face.map(|k| tet[k])) {
                let mut key = face;
                key.sort_unstable();
                faces.entry(key).or_insert((face, 0)).1 += 1;
            }
        }
        for ([a, b, c], _) in faces.into_values().filter(|(_, count)| *count == 1) {
            tets.push(upright([a, c, b, p], &nodes)?);
        }
    }
    tets.retain(|tet| tet.iter().all(|node| *node < first));
    nodes.truncate(n);
    Ok(TetMesh { nodes, tets })
}

/// The tetrahedron, whose corners must be in positive order.
fn upright(tet: [u32; 4], nodes: &[V]) -> Result<[u32; 4], Trouble> {
    let [a, b, c, d] = tet.map(|n| nodes[n as usize]);
    match (b - a).dot(&(c - a).cross(&(d - a))) > 0.0 {
        true => Ok(tet),
        false => Err("the points of the cylinder are not in general position".into()),
    }
}

/// Whether the circumsphere of a tetrahedron in positive order holds `p`.
fn in_sphere(x: [V; 4], p: V) -> bool {
    let rows = x.map(|x| x - p);
    let row = |k: usize| [rows[k].x, rows[k].y, rows[k].z, rows[k].norm_squared()];
    Matrix4::from_fn(|i, j| row(i)[j]).determinant() < 0.0
}

/// Leaves out flat elements on the skin, as long as the skin stays one: elements with two faces on it, whose other edge
/// lies inside.
fn peel(mesh: &mut TetMesh) {
    loop {
        let skin: Vec<[u32; 3]> = mesh.boundary_faces().iter().map(|face| face.nodes).collect();
        let mut of_edge: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for [a, b, c] in &skin {
            for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
                of_edge.entry([*p.min(q), *p.max(q)]).or_default().push(*r);
            }
        }
        let is_loose = |tet: &[u32; 4]| {
            let x = tet.map(|n| mesh.nodes[n as usize]);
            flatness(&x) < PEEL
                && of_edge.iter().any(|(edge, apexes)| {
                    let [r, s] = apexes[..] else { return false };
                    let has = |n: &u32| tet.contains(n);
                    edge.iter().all(has)
                        && r != s
                        && has(&r)
                        && has(&s)
                        && !of_edge.contains_key(&[r.min(s), r.max(s)])
                })
        };
        // One at a time, because each changes the skin.
        match mesh.tets.iter().position(is_loose) {
            Some(t) => mesh.tets.remove(t),
            None => return,
        };
    }
}

/// Least height over longest edge of a tetrahedron.
pub(super) fn flatness(x: &[V; 4]) -> f64 {
    let six_volumes = (x[1] - x[0]).dot(&(x[2] - x[0]).cross(&(x[3] - x[0])));
    let area = |[a, b, c]: [usize; 3]| (x[b] - x[a]).cross(&(x[c] - x[a])).norm();
    let largest = TET_FACES.into_iter().map(area).fold(0.0, f64::max);
    let edges = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
    let longest = edges.map(|(i, j)| (x[i] - x[j]).norm()).fold(0.0, f64::max);
    six_volumes / (largest * longest).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// No circumsphere holds another point, and the elements fill the hull.
    #[test]
    fn spheres_are_empty_and_the_hull_is_full() {
        let mut random = Random(3);
        // On a sphere, so that all points are on the hull, and some inside.
        let mut points: Vec<V> = (0..60).map(|_| random.vector(1.0).normalize()).collect();
        points.extend((0..40).map(|_| random.vector(0.4)));
        let mesh = delaunay(points.clone(), &mut random).unwrap();
        for tet in &mesh.tets {
            let x = tet.map(|n| mesh.nodes[n as usize]);
            let others = (0u32..).zip(&points).filter(|(n, _)| !tet.contains(n));
            assert!(others.into_iter().all(|(_, p)| !in_sphere(x, *p)));
        }
        let volume: f64 = mesh.volumes().iter().sum();
        let skin = mesh.boundary_faces();
        let enclosed: f64 = skin
            .iter()
            .map(|face| {
                let [a, b, c] = face.nodes.map(|n| mesh.nodes[n as usize]);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum();
        assert!((volume / enclosed - 1.0).abs() < 1e-9, "{volume} {enclosed}");
        // Euler: a closed triangulation of 60 points has 2 · 60 − 4 faces.
        assert_eq!(skin.len(), 116);
    }

    #[test]
    fn the_cylinder_has_the_nodes_of_the_thesis_and_a_closed_skin() {
        let (mesh, [height, radius]) = cylinder(1).unwrap();
        assert_eq!(mesh.nodes.len(), 891);
        let full = 0.5 * TAU * radius * radius * height;
        let volume: f64 = mesh.volumes().iter().sum();
        assert!((volume / full - 1.0).abs() < 0.05, "{volume} {full}");
        let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for face in mesh.boundary_faces() {
            let [a, b, c] = face.nodes;
            for (p, q) in [(a, b), (b, c), (c, a)] {
                *edges.entry([p.min(q), p.max(q)]).or_default() += if p < q { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|sum| *sum == 0));
        let flattest =
            mesh.tets.iter().map(|tet| flatness(&tet.map(|n| mesh.nodes[n as usize]))).fold(1.0, f64::min);
        assert!(flattest > 0.0 && cylinder(1).unwrap().0 == mesh);
    }
}
