//! What a body does when its topology changes.

use nalgebra::Vector3;

use super::Body;
use crate::cut::{BladeSweep, CutError, CutReport};
use crate::integrator::LooseParts;
use crate::operator::Elastic;

/// A copy lighter than this [kg] has no inertia that single precision could hold.
const WEIGHTLESS: f64 = 1e-30;

/// A copy without mass, and the copies of its piece that carry it along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weightless {
    copy: u32,
    /// Copies of the same piece; those with mass count.
    piece: [u32; 4],
}

impl Body {
    /// Cuts along the surface the blade swept. New copies inherit the state of the copies they were
    /// split from, so the motion of the material does not change by the cut itself.
    pub fn cut(&mut self, blade: &BladeSweep, incision: u32) -> Result<CutReport, CutError> {
        let epoch = self.cut_mesh.epoch();
        let pieces = self.cut_mesh.pieces().to_vec();
        let report = self.cut_mesh.sweep(&self.state.x, blade, incision)?;
        // The surface may have changed alone, while a cut is still on its way through an element.
        if report.epoch != epoch && self.cut_mesh.pieces() != pieces {
            self.inherit(&report);
            let mesh = &self.cut_mesh;
            self.elastic.follow(mesh.mesh(), &pieces, mesh.pieces(), mesh.n_copies());
            self.follow_topology();
        }
        Ok(report)
    }

    fn inherit(&mut self, report: &CutReport) {
        let n = self.cut_mesh.n_copies();
        self.state.x.resize(n, Vector3::zeros());
        self.state.v.resize(n, Vector3::zeros());
        for new in &report.new_copies {
            let (copy, parent) = (new.copy as usize, new.parent as usize);
            self.state.x[copy] = self.state.x[parent];
            self.state.v[copy] = self.state.v[parent];
        }
    }

    /// Arranges the pieces anew, without memory of their rotations.
    pub(super) fn rebuild_elastic(&mut self) {
        let mesh = &self.cut_mesh;
        self.elastic = Elastic::new(self.simd, mesh.mesh(), mesh.pieces(), mesh.n_copies());
    }

    /// Everything that is derived from pieces and copies.
    pub(super) fn follow_topology(&mut self) {
        let density = self.material.density_kg_m3;
        self.mass = self.cut_mesh.copy_volume().iter().map(|v| density * v).collect();
        self.mass_f32 = self.mass.iter().map(|&m| m as f32).collect();
        self.weightless = self.find_weightless();
        self.integrator.resize(self.cut_mesh.n_copies());
        self.before = self.state.clone();
        self.follow_boundary();
    }

    fn find_weightless(&self) -> Vec<Weightless> {
        if self.mass.iter().all(|&m| m > WEIGHTLESS) {
            return Vec::new();
        }
        let mut found: Vec<Weightless> = Vec::new();
        for piece in self.cut_mesh.pieces() {
            for copy in piece.copies {
                if self.mass[copy as usize] <= WEIGHTLESS && found.iter().all(|w| w.copy != copy) {
                    found.push(Weightless { copy, piece: piece.copies });
                }
            }
        }
        found
    }

    /// Moves copies without mass along with the rest of their piece: no force would do it.
    pub(super) fn carry_weightless(&mut self) {
        for Weightless { copy, piece } in &self.weightless {
            let rest = |c: u32| self.cut_mesh.mesh().nodes[self.cut_mesh.copy_node()[c as usize] as usize];
            let (mut moved, mut v, mut hosts) = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for &host in piece.iter().filter(|&&c| self.mass[c as usize] > WEIGHTLESS) {
                moved += self.state.x[host as usize] - rest(host);
                v += self.state.v[host as usize];
                hosts += 1.0;
            }
            let fixed = self.fixed.binary_search_by_key(copy, |f| f.copy).is_ok();
            if hosts > 0.0 && !fixed {
                self.state.x[*copy as usize] = rest(*copy) + moved / hosts;
                self.state.v[*copy as usize] = v / hosts;
            }
        }
    }

    /// Everything that is derived from constraints and loads.
    pub(super) fn follow_boundary(&mut self) {
        self.fixed = self.boundary.fixed_copies(&self.cut_mesh);
        self.load = self.boundary.copy_loads(&self.cut_mesh);
        self.parts = LooseParts::new(self.cut_mesh.pieces(), &self.mass, &self.fixed);
    }
}
