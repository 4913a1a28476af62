//! Checks of what must hold in every cut state, whatever was cut.

use std::collections::{BTreeMap, BTreeSet};

use super::cut_mesh::CutMesh;
use super::shell::surface::Surface;
use crate::storage::disjoint::{find, join};

/// Violations of the invariants of cut states: counts must be zero, errors must be at rounding level.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Flaws {
    /// Defects that keep the surface from being closed and 2-manifold ([`Surface::n_defects`]).
    pub surface: usize,
    /// Largest |Σ w_c − 1| over the fractions w_c of an element's pieces.
    pub fractions: f64,
    /// The larger of two relative volume errors |V / V_mesh − 1|: V summed over the copies, and V enclosed by
    /// the surface.
    pub volume: f64,
    /// Difference between two counts of loose parts: by connected material, and by shared copies.
    pub parts: usize,
}

impl Flaws {
    /// Measures all flaws of one cut state.
    pub fn of(mesh: &CutMesh) -> Self {
        let rest = mesh.mesh();
        let total: f64 = rest.volumes().iter().sum();
        let mut fraction = vec![0.0; rest.tets.len()];
        mesh.pieces().iter().for_each(|piece| fraction[piece.element as usize] += piece.fraction);
        let worst = |values: &[f64]| values.iter().fold(0.0_f64, |worst, v| worst.max(*v));
        let off: Vec<f64> = fraction.iter().map(|w| (w - 1.0_f64).abs()).collect();
        let copies: f64 = mesh.copy_volume().iter().sum();
        let enclosed = mesh.surface().volume(&mesh.rest_positions());
        Self {
            surface: mesh.surface().n_defects(),
            fractions: worst(&off),
            volume: worst(&[(copies / total - 1.0).abs(), (enclosed / total - 1.0).abs()]),
            parts: mesh.components().len().abs_diff(parts_by_copies(mesh)),
        }
    }

    /// Adds the defects of `other` and keeps the larger of every other flaw.
    pub fn merge(&mut self, other: Flaws) {
        self.surface += other.surface;
        self.fractions = self.fractions.max(other.fractions);
        self.volume = self.volume.max(other.volume);
        self.parts = self.parts.max(other.parts);
    }
}

impl Surface {
    /// Number of directed edges without an opposite or present twice, and of vertices whose link is not one
    /// cycle.
    pub fn n_defects(&self) -> usize {
        let mut wrong = 0;
        let mut edges = BTreeSet::new();
        // Per vertex a, for every triangle at it, the opposite edge from b to c.
        let mut link: BTreeMap<u32, BTreeMap<u32, u32>> = BTreeMap::new();
        for t in &self.triangles {
            for k in 0..3 {
                let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
                wrong += usize::from(!edges.insert((a, b)));
                link.entry(a).or_default().insert(b, c);
            }
        }
        wrong += edges.iter().filter(|&&(a, b)| !edges.contains(&(b, a))).count();
        for next in link.values() {
            let Some(&first) = next.keys().next() else { continue };
            // The vertex is manifold if one cycle passes every edge of its link.
            let (mut at, mut length) = (first, 0);
            while let Some(&b) = next.get(&at) {
                (at, length) = (b, length + 1);
                if at == first || length > next.len() {
                    break;
                }
            }
            wrong += usize::from(length != next.len());
        }
        wrong
    }

    /// Number of closed shells. Two shells share no vertex.
    pub fn n_shells(&self) -> usize {
        let mut root: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for t in &self.triangles {
            join(&mut root, t[0], t[1]);
            join(&mut root, t[0], t[2]);
        }
        (0..root.len() as u32).filter(|&v| find(&mut root, v) == v).count()
    }
}

fn parts_by_copies(mesh: &CutMesh) -> usize {
    let mut root: Vec<u32> = (0..mesh.n_copies() as u32).collect();
    for piece in mesh.pieces() {
        for &copy in &piece.copies[1..] {
            join(&mut root, piece.copies[0], copy);
        }
    }
    (0..root.len() as u32).filter(|&c| find(&mut root, c) == c).count()
}
