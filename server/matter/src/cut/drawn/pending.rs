//! Parts of an incision that have entered the material but not separated it yet. The cut lags the blade by at
//! most one element; these faces show how far the blade is.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use crate::element::MaterialPoint;
use crate::mesh::{TET_EDGES, TetMesh};

use crate::cut::shell::surface::bind;
use crate::cut::topology::crossings::Crossings;
use crate::cut::topology::fragments::{FragmentVertex, Fragments};
use crate::cut::topology::incision_sets::IncisionSets;
use crate::cut::topology::pieces::PieceTable;

/// The section of an incision through one fragment that it has not left yet.
#[derive(Clone, Debug, PartialEq)]
pub struct PendingFace {
    /// Number of the incision that it belongs to.
    pub incision: u32,
    /// Points where it crosses the fragment's edges and corners, in order around the section: two (a line),
    /// three or four points of the material.
    pub corners: Vec<MaterialPoint>,
}

/// Pairs of incision and fragment where the incision may be pending.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Pending {
    of: BTreeSet<(u32, u32)>,
}

impl Pending {
    /// Records whether the incision is pending in fragment `t`.
    pub(crate) fn set(&mut self, incision: u32, t: u32, pending: bool) {
        if pending {
            self.of.insert((incision, t));
        } else if !self.of.is_empty() {
            self.of.remove(&(incision, t));
        }
    }

    /// Fragment `new` was split from `old`. Incisions pending there may now be pending in both.
    pub(crate) fn inherit(&mut self, incisions: &[u32], old: u32, new: u32) {
        for &incision in incisions {
            if self.of.contains(&(incision, old)) {
                self.of.insert((incision, new));
            }
        }
    }

    /// Collects all incisions with something pending, ascending, into `out`.
    pub(crate) fn incisions(&self, out: &mut Vec<u32>) {
        out.clear();
        out.extend(self.of.iter().map(|p| p.0));
        out.dedup();
    }

    /// The pending faces, ordered by incision and fragment.
    pub(crate) fn faces(&self, body: &Pieces) -> Vec<PendingFace> {
        self.of.iter().filter_map(|&(incision, t)| body.face(incision, t)).collect()
    }
}

/// The state from which pending faces are computed.
pub(crate) struct Pieces<'a> {
    /// Rest mesh.
    pub mesh: &'a TetMesh,
    /// Fragment mesh.
    pub fragments: &'a Fragments,
    /// Pieces and their copies.
    pub pieces: &'a PieceTable,
    /// Crossings of edges.
    pub crossings: &'a Crossings,
    /// Table of incision sets.
    pub sets: &'a IncisionSets,
}

impl Pieces<'_> {
    fn face(&self, incision: u32, t: u32) -> Option<PendingFace> {
        let tet = self.fragments.tets[t as usize];
        let on = tet.map(|v| self.sets.contains(self.fragments.on[v as usize], incision));
        let vertex = |k: usize| &self.fragments.vertices[tet[k] as usize];
        let mut points: Vec<FragmentVertex> = TET_EDGES
            .into_iter()
            .filter(|&[i, j]| !on[i] && !on[j])
            .filter_map(|[i, j]| {
                let s = self.crossings.get(tet[i], tet[j], incision)?;
                Some(FragmentVertex::between(vertex(i), vertex(j), s))
            })
            .collect();
        if points.is_empty() {
            return None;
        }
        points.extend((0..4).filter(|&k| on[k]).map(|k| *vertex(k)));
        if points.len() < 2 {
            return None;
        }
        self.sort_around(&mut points);
        let piece = self.fragments.piece[t as usize];
        let corners = points.iter().map(|v| bind(self.mesh, self.pieces, piece, v)).collect();
        Some(PendingFace { incision, corners })
    }

    /// Sorts the points by their angle around their middle, in the rest configuration.
    fn sort_around(&self, points: &mut [FragmentVertex]) {
        let place = |v: &FragmentVertex| -> Vector3<f64> {
            let held = v.nodes.iter().zip(&v.weights).filter(|(_, w)| **w != 0.0);
            held.map(|(&n, &w)| self.mesh.nodes[n as usize] * w).sum()
        };
        let at: Vec<Vector3<f64>> = points.iter().map(place).collect();
        let middle = at.iter().sum::<Vector3<f64>>() / at.len() as f64;
        let u = at[0] - middle;
        let normal = at.iter().map(|p| u.cross(&(p - middle))).max_by(|p, q| p.norm().total_cmp(&q.norm()));
        let w = normal.unwrap_or_default().cross(&u);
        let scale = u.norm() / w.norm();
        if !scale.is_finite() {
            return;
        }
        let angle = |v: &FragmentVertex| {
            let d = place(v) - middle;
            (scale * d.dot(&w)).atan2(d.dot(&u))
        };
        points.sort_by(|p, q| angle(p).total_cmp(&angle(q)));
    }
}
