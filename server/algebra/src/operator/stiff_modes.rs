//! Elements of the rest mesh so flat that one of their motions is far stiffer than the others, and the
//! change of variables that separates these motions.
//!
//! The motion of a tetrahedron's corners strains it by H = Σ u_a ⊗ g_a. If a corner is close to the plane
//! of the others, or to their edge or corner, its gradient g_a is large. The gradients of some others are
//! then nearly opposite, and the stiff motion is u_a relative to the mean of these. With this motion as a
//! variable of its own the others have g_b + λ_b g_a, which is as small as in a sound element. All
//! measures are relative to the element: nothing depends on units.
//!
//! Small pieces of quadratic tetrahedra have the opposite trouble. In a piece that is close to some corners a and far
//! from others, the barycentric coordinates L_b of the far ones are small. There the shape functions of b and of the
//! middles between a and b are almost linear in them, hence almost parallel, and some motions are far softer than their
//! diagonal blocks. The sum N_b + ¼ Σ_a N_ab = L_b (L_b − Σ_c L_c), over the other far corners c, is quadratic. So each of
//! these middles is moved relative to ¼ u_b, and iterations do not depend on the size of the piece.

use nalgebra::Vector3;
use scindo_matter::cut::Piece;
use scindo_matter::mesh::TetMesh;

use super::Substitution;

/// V |g|² / L above which a motion counts as stiff: the stiffness of a corner over that of the longest
/// edge. It is 0.2 in a sound tetrahedron, and 3 where its height is 1/16 of that.
const STIFF: f64 = 3.0;
/// A corner takes part in a stiff motion if its stiffness is at least this fraction of [`STIFF`].
const TAKES_PART: f64 = 0.1;
/// Least share of an element in the stiffness of a corner that is substituted for it: a sliver of an
/// element must not take a whole one along.
const LEAST_SHARE: f64 = 0.05;
/// Largest number of copies relative to which one copy is moved.
const MOST_LEADERS: usize = 8;

/// Elements of `mesh`, ascending, with a motion that is much stiffer than a sound element's.
pub fn degenerate_elements(mesh: &TetMesh) -> Vec<u32> {
    let stiff = |&e: &u32| {
        let e = e as usize;
        let g = mesh.gradients(e);
        let most = g.iter().map(Vector3::norm_squared).fold(0.0, f64::max);
        mesh.volume(e).abs() * most >= STIFF * mesh.longest_edge(e)
    };
    (0..mesh.tets.len() as u32).filter(stiff).collect()
}

/// A piece on a copy of a degenerate element.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct NearPiece {
    /// Index of the piece.
    pub piece: u32,
    /// Its four copies.
    pub copies: [u32; 4],
    /// Gradients of their shape functions at rest [1/m].
    pub g: [Vector3<f64>; 4],
    /// w V [m³].
    pub volume: f64,
    /// Limits above which a motion is stiff: of |g|² [1/m²], and of w V |g|² [m].
    stiff: [f64; 2],
}

/// The pieces of degenerate elements, and all that share a copy with them.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct StiffModes {
    near: Vec<NearPiece>,
    /// Which of them are of degenerate elements, the stiffest first.
    degenerate: Vec<u32>,
    /// Σ w V |g_a|² of every copy, over the pieces in `near` [m].
    stiffness: Vec<f64>,
    /// Mid-edge nodes of small pieces of quadratic tetrahedra, ascending, each with the far corner of its edge.
    middles: Vec<[u32; 2]>,
}

/// Part of the displacement of a far corner by which the middles at it move along.
const QUARTER: f64 = 0.25;

impl StiffModes {
    /// The modes of `pieces`, whose degenerate elements are `elements` (ascending); `None` without any.
    pub fn new(mesh: &TetMesh, pieces: &[Piece], n_copies: usize, elements: &[u32]) -> Option<Self> {
        if elements.is_empty() {
            return None;
        }
        let is_degenerate = |piece: &Piece| elements.binary_search(&piece.element).is_ok();
        let mut touched = vec![false; n_copies];
        for piece in pieces.iter().filter(|piece| is_degenerate(piece)) {
            piece.copies.iter().for_each(|&copy| touched[copy as usize] = true);
        }
        let mut near = Vec::new();
        let mut degenerate = Vec::new();
        let mut stiffness = vec![0.0; n_copies];
        for (p, piece) in (0u32..).zip(pieces) {
            if !piece.copies.iter().any(|&copy| touched[copy as usize]) {
                continue;
            }
            let e = piece.element as usize;
            let (g, whole) = (mesh.gradients(e), mesh.volume(e).abs());
            let volume = piece.fraction * whole;
            for (&copy, g) in piece.copies.iter().zip(&g) {
                stiffness[copy as usize] += volume * g.norm_squared();
            }
            if is_degenerate(piece) {
                let most = g.iter().map(Vector3::norm_squared).fold(0.0, f64::max);
                degenerate.push((near.len() as u32, volume * most));
            }
            let stiff = STIFF * mesh.longest_edge(e);
            near.push(NearPiece { piece: p, copies: piece.copies, g, volume, stiff: [stiff / whole, stiff] });
        }
        // The sort is stable: equally stiff pieces stay in order.
        degenerate.sort_by(|a, b| b.1.total_cmp(&a.1));
        let degenerate = degenerate.into_iter().map(|d| d.0).collect();
        Some(Self { near, degenerate, stiffness, middles: Vec::new() })
    }

    /// The modes of small pieces of quadratic tetrahedra on `n` copies and added nodes: `middles` lists mid-edge nodes,
    /// ascending, each with the far corner of its edge. `None` without any.
    pub fn of_middles(n: usize, middles: Vec<[u32; 2]>) -> Option<Self> {
        let (near, degenerate, stiffness) = (Vec::new(), Vec::new(), vec![0.0; n]);
        (!middles.is_empty()).then_some(Self { near, degenerate, stiffness, middles })
    }

    /// Pieces that share a copy with a degenerate element, ascending.
    pub fn near(&self) -> &[NearPiece] {
        &self.near
    }

    /// Number of copies that the modes are on.
    pub fn n_copies(&self) -> usize {
        self.stiffness.len()
    }

    /// Number of pieces of degenerate elements.
    pub fn n_degenerate(&self) -> usize {
        self.degenerate.len()
    }

    /// A substitution without stiff motions, and the number of degenerate pieces that keep one.
    /// Copies for which `held` is true are not substituted.
    pub fn substitution(&self, held: impl Fn(u32) -> bool) -> (Substitution, usize) {
        let mut T = Substitution::new(self.stiffness.len());
        let mut left = 0;
        let mut row = Vec::new();
        for &near in &self.degenerate {
            let piece = &self.near[near as usize];
            // One substitution may leave another stiff motion of the same piece.
            loop {
                row.clear();
                row.extend(piece.copies.iter().copied().zip(piece.g));
                T.gather(&mut row);
                row.retain(|&(copy, _)| !T.substitutes(copy));
                let most = row.iter().map(|r| r.1.norm_squared()).fold(0.0, f64::max);
                if most < piece.stiff[0] {
                    break;
                }
                let Some((a, g)) = self.pivot(piece, &row, most, &held) else {
                    // The diagonal block already tells how stiff a motion against held copies is. A
                    // sliver of an element is not stiff.
                    let moves = |r: &&(u32, Vector3<f64>)| {
                        !held(r.0) && r.1.norm_squared() >= TAKES_PART * piece.stiff[0]
                    };
                    let whole = piece.volume * most >= piece.stiff[1];
                    left += usize::from(whole && row.iter().filter(moves).count() > 1);
                    break;
                };
                let takes_part =
                    |r: &&(u32, Vector3<f64>)| r.0 != a && r.1.norm_squared() >= TAKES_PART * piece.stiff[0];
                if row.iter().filter(takes_part).count() > MOST_LEADERS {
                    left += 1;
                    break;
                }
                let lambda = |r: &(u32, Vector3<f64>)| (r.0, -r.1.dot(&g) / g.norm_squared());
                T.push(a, row.iter().filter(takes_part).map(lambda));
            }
        }
        for &[middle, corner] in self.middles.iter().filter(|middle| !held(middle[0])) {
            T.push(middle, std::iter::once((corner, QUARTER)));
        }
        T.finish();
        (T, left)
    }

    /// The copy to substitute, and its gradient: the largest, so that no λ exceeds 1, or a smaller one if
    /// that is held.
    fn pivot(
        &self,
        piece: &NearPiece,
        row: &[(u32, Vector3<f64>)],
        most: f64,
        held: &impl Fn(u32) -> bool,
    ) -> Option<(u32, Vector3<f64>)> {
        let fits = |&&(copy, g): &&(u32, Vector3<f64>)| {
            let squared = g.norm_squared();
            !held(copy)
                && squared >= TAKES_PART * most
                && piece.volume * squared >= LEAST_SHARE * self.stiffness[copy as usize]
        };
        let larger = |a: (u32, Vector3<f64>), b: &(u32, Vector3<f64>)| {
            if b.1.norm_squared() > a.1.norm_squared() { *b } else { a }
        };
        let mut fitting = row.iter().filter(fits);
        let first = *fitting.next()?;
        Some(fitting.fold(first, larger))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use scindo_matter::cut::CutMesh;
    use scindo_matter::mesh::{BoxPattern, box_mesh};

    type V = Vector3<f64>;

    fn tet(nodes: [V; 4]) -> TetMesh {
        let mut mesh = TetMesh { nodes: nodes.to_vec(), tets: vec![[0, 1, 2, 3]] };
        if mesh.volume(0) < 0.0 {
            mesh.tets[0].swap(0, 1);
        }
        mesh
    }

    fn modes(mesh: &TetMesh) -> Option<StiffModes> {
        let cut = CutMesh::new(mesh.clone()).unwrap();
        StiffModes::new(mesh, cut.pieces(), cut.n_copies(), &degenerate_elements(mesh))
    }

    #[test]
    fn sound_meshes_have_none() {
        for (cells, size) in [([3; 3], V::repeat(1.0)), ([2, 2, 2], V::new(1.0, 1.0, 0.1))] {
            for pattern in [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }] {
                assert!(modes(&box_mesh(V::zeros(), size, cells, pattern)).is_none());
            }
        }
    }

    #[test]
    fn one_motion_of_every_shape_is_taken_apart_in_any_unit() {
        let (x, y, z) = (V::x(), V::y(), V::z());
        for d in [1e-2, 1e-4, 1e-6] {
            let shapes = [
                ("cap", [V::zeros(), x, y, (x + y) / 3.0 + d * z], 3),
                ("sliver", [V::zeros(), x + y, x + d * z, y + d * z], 3),
                ("spade", [V::zeros(), x, y, 0.5 * x + d * z], 2),
                ("needle", [V::zeros(), x, y + 0.3 * z, y + (0.3 + d) * z], 1),
            ];
            for (name, nodes, leaders) in shapes {
                for unit in [1e-3, 1.0, 1e3] {
                    let mesh = tet(nodes.map(|X| unit * X));
                    let modes = modes(&mesh).unwrap();
                    let (T, left) = modes.substitution(|_| false);
                    assert_eq!((T.len(), left, T.columns().count()), (1, 0, leaders), "{name} {d} {unit}");
                    // What remains of the gradients is that of a sound element, but for one copy.
                    let piece = &modes.near()[0];
                    let mut row: Vec<(u32, V)> = piece.copies.iter().copied().zip(piece.g).collect();
                    T.gather(&mut row);
                    for (copy, g) in row {
                        assert_eq!(T.substitutes(copy), g.norm() > 20.0 / unit, "{name} {d}: {g}");
                        assert!(T.substitutes(copy) || g.norm() < 4.0 / unit);
                    }
                }
            }
        }
    }

    #[test]
    fn held_copies_are_led_by_none() {
        let mesh = tet([V::zeros(), V::x(), V::y(), V::new(0.3, 0.3, 1e-4)]);
        let modes = modes(&mesh).unwrap();
        let (T, left) = modes.substitution(|copy| copy == 3);
        assert!(T.len() == 1 && left == 0 && !T.substitutes(3));
        let (T, left) = modes.substitution(|_| true);
        assert!(T.is_empty() && left == 0);
    }

    #[test]
    fn a_sliver_of_a_degenerate_element_takes_no_whole_one_along() {
        let d = 1e-4;
        let mut mesh = tet([V::zeros(), V::x(), V::y(), V::new(0.3, 0.3, d)]);
        mesh.nodes.push(V::z());
        let [a, b, c, p] = mesh.tets[0];
        for [i, j] in [[a, b], [b, c], [c, a]] {
            mesh.tets.push([i, j, p, 4]);
        }
        mesh.check().unwrap();
        let mut pieces = CutMesh::new(mesh.clone()).unwrap().pieces().to_vec();
        let elements = degenerate_elements(&mesh);
        assert_eq!(elements, [0]);
        let whole = StiffModes::new(&mesh, &pieces, 5, &elements).unwrap().substitution(|_| false);
        assert_eq!(whole.0.len(), 1);
        pieces[0].fraction = 1e-12;
        let sliver = StiffModes::new(&mesh, &pieces, 5, &elements).unwrap().substitution(|_| false);
        assert!(sliver.0.is_empty() && sliver.1 == 0);
    }
}
