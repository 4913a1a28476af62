//! What a body does when its topology changes.

use nalgebra::Vector3;

use super::{Body, BodyError, General, Path};
use crate::assembly::ElementKind;
use crate::cut::{BladeSweep, CutReport, NewCopy};
use crate::integrator::LooseParts;
use crate::room::{refill, resize_with_room};

impl Body {
    /// Cuts along the surface the blade swept. New copies inherit the state of the copies they were
    /// split from, so the motion of the material does not change by the cut itself.
    pub fn cut(&mut self, blade: &BladeSweep, incision: u32) -> Result<CutReport, BodyError> {
        if self.shape.kind() != ElementKind::Tet4 {
            let with = if self.shape.kind() == ElementKind::Tet10 { "element tet10" } else { "element hex8" };
            return Err(BodyError::Combination { what: "a cut", with, instead: "tet4" });
        }
        if self.snap.is_some() {
            return self.snap_cut(blade, incision);
        }
        let report = self.cut_mesh.sweep(&self.state.x, blade, incision)?;
        if let Some(skin) = &mut self.skin {
            skin.follow(&self.cut_mesh);
        }
        // The surface may have changed alone, while a cut is still on its way through an element.
        if !self.cut_mesh.changed_pieces().is_empty() {
            self.inherit(&report);
            match &mut self.path {
                Path::Fast(fast) => {
                    fast.follow_cut(&self.cut_mesh);
                    self.follow_new_copies(&report.new_copies);
                }
                Path::General(_) => {
                    self.rebuild_general()?;
                    self.follow_topology();
                }
            }
        }
        Ok(report)
    }

    fn inherit(&mut self, report: &CutReport) {
        let n = self.cut_mesh.n_copies();
        resize_with_room(&mut self.state.x, n, Vector3::zeros());
        resize_with_room(&mut self.state.v, n, Vector3::zeros());
        for new in &report.new_copies {
            let (copy, parent) = (new.copy as usize, new.parent as usize);
            self.state.x[copy] = self.state.x[parent];
            self.state.v[copy] = self.state.v[parent];
        }
    }

    /// The model of the present pieces and copies; integrators start afresh from the present state.
    pub(super) fn rebuild_general(&mut self) -> Result<(), BodyError> {
        let general = General::new(&self.shape, &self.cut_mesh, &self.material, &self.settings)?;
        self.path = Path::General(Box::new(general));
        Ok(())
    }

    /// Everything that is derived from pieces and copies.
    pub(super) fn follow_topology(&mut self) {
        refill(&mut self.rest, self.shape.rest_positions(&self.cut_mesh).into_iter());
        self.follow_masses();
        self.follow_boundary();
    }

    /// The same on the fast path, after a cut of elements without further nodes that made the copies
    /// `new`: what belongs to copies that were there stays where it is.
    fn follow_new_copies(&mut self, new: &[NewCopy]) {
        let known = self.rest.len();
        resize_with_room(&mut self.rest, self.cut_mesh.n_copies(), Vector3::zeros());
        for (rest, new) in self.rest[known..].iter_mut().zip(new) {
            *rest = self.cut_mesh.mesh().nodes[self.cut_mesh.copy_node()[new.copy as usize] as usize];
        }
        self.follow_masses();
        self.boundary.fixed_copies(&self.cut_mesh, &self.rest, &mut self.fixed);
        self.boundary.loads_of_new_copies(&self.cut_mesh, &mut self.load);
        self.reunion.follow(&mut self.parts, &self.cut_mesh, new, &self.mass, &self.fixed);
        self.follow_parts();
    }

    /// Masses, and what the fast path derives from them.
    fn follow_masses(&mut self) {
        let density = self.material.density_kg_m3;
        match &self.path {
            Path::Fast(_) => refill(&mut self.mass, self.cut_mesh.copy_volume().iter().map(|v| density * v)),
            Path::General(general) => self.mass = general.model().lumped_mass(density),
        }
        if self.settings.ablation.piece_masses && self.is_fast() {
            self.share_masses_evenly();
        }
        if let Path::Fast(fast) = &mut self.path {
            fast.follow_topology(&self.cut_mesh, &self.mass);
        }
    }

    /// What [`Ablation::piece_masses`](super::Ablation) asks for.
    fn share_masses_evenly(&mut self) {
        let mut sum = vec![(0.0, 0.0); self.cut_mesh.mesh().nodes.len()];
        for (&node, m) in self.cut_mesh.copy_node().iter().zip(&self.mass) {
            let (mass, copies) = &mut sum[node as usize];
            (*mass, *copies) = (*mass + m, *copies + 1.0);
        }
        for (&node, m) in self.cut_mesh.copy_node().iter().zip(&mut self.mass) {
            let (mass, copies) = sum[node as usize];
            *m = mass / copies;
        }
    }

    /// Everything that is derived from constraints and loads.
    pub(super) fn follow_boundary(&mut self) {
        self.boundary.fixed_copies(&self.cut_mesh, &self.rest, &mut self.fixed);
        self.boundary.node_loads(&self.cut_mesh, self.rest.len(), &mut self.load);
        self.parts = match &self.path {
            Path::Fast(_) => LooseParts::new(self.cut_mesh.pieces(), &self.mass, &self.fixed),
            Path::General(general) => {
                let model = general.model();
                let elements = (0..model.n_elements()).map(|e| model.element(e));
                LooseParts::connected(elements, &self.mass, &self.fixed)
            }
        };
        self.follow_parts();
    }

    fn follow_parts(&mut self) {
        if let Path::Fast(fast) = &mut self.path {
            fast.follow_parts(&self.rest, &self.mass, &self.parts);
        }
    }
}
