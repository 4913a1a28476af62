//! How a body follows a change of its topology.

use nalgebra::Vector3;

use super::{Body, BodyError, General, Path};
use crate::assembly::ElementKind;
use crate::cut::{
    BladeSweep, CutError, CutLimits, CutReport, NewCopy, Piece, SweepUnderWay, Work, swept_area,
};
use crate::integrator::LooseParts;
use crate::reserve::{refill, resize_reserving};

/// Pairs of sweep triangle and element that cost as much as one fragment, in a cut along faces.
const SNAP_PAIRS_PER_FRAGMENT: usize = 4;

/// Largest number of pairs of blade segment and element in a cut along faces that was begun. Such a cut is
/// made at once.
const MAX_SNAP_PAIRS: usize = 4_000_000;

/// A cut that was begun and is not complete.
#[derive(Debug)]
pub(super) enum CutUnderWay {
    /// Pieces and copies: the sweep, and the positions it began with [m].
    Pieces(SweepUnderWay, Vec<Vector3<f64>>),
    /// Along faces: the sweep and its incision.
    Faces(BladeSweep, u32),
}

impl Body {
    /// Begins a cut at the present positions; [`go_on_cutting`](Self::go_on_cutting) makes it in parts.
    /// However the body moves meanwhile, the same material comes apart as if [`cut`](Self::cut) were made
    /// now, to the bit.
    ///
    /// # Errors
    /// As [`cut`](Self::cut). Also if the body is cut into as much as [`CutLimits::of_mesh`] allows, or
    /// is being cut.
    pub fn begin_cut(&mut self, blade: &BladeSweep, incision: u32) -> Result<(), BodyError> {
        self.may_be_cut()?;
        let mesh = self.cut_mesh.mesh();
        let n_elements = mesh.tets.len();
        self.under_way = Some(if self.snap.is_some() {
            blade.check()?;
            let (found, limit) = (blade.segments.len() * n_elements, MAX_SNAP_PAIRS);
            if found > limit {
                let segments = (limit / n_elements.max(1)).max(2);
                return Err(CutError::TooManySegments { found: blade.segments.len(), limit: segments }.into());
            }
            CutUnderWay::Faces(blade.clone(), incision)
        } else {
            let limits = CutLimits::of_mesh(n_elements, mesh.nodes.len());
            let sweep = self.cut_mesh.begin_sweep(&self.state.x, blade, incision, limits)?;
            CutUnderWay::Pieces(sweep, self.state.x.clone())
        });
        Ok(())
    }

    /// Continues the cut that was begun, until `work` is used up. Returns the report when the cut is
    /// complete; `None` before that, and if no cut was begun.
    ///
    /// # Errors
    /// As [`cut`](Self::cut).
    pub fn go_on_cutting(&mut self, work: &mut Work) -> Result<Option<CutReport>, BodyError> {
        match self.under_way.take() {
            None => Ok(None),
            Some(CutUnderWay::Faces(blade, incision)) => {
                work.book(blade.segments.len() * self.cut_mesh.mesh().tets.len() / SNAP_PAIRS_PER_FRAGMENT);
                self.snap_cut(&blade, incision).map(Some)
            }
            Some(CutUnderWay::Pieces(mut sweep, x)) => {
                if !self.cut_mesh.detect(&x, &mut sweep, work) {
                    self.under_way = Some(CutUnderWay::Pieces(sweep, x));
                    return Ok(None);
                }
                let report = self.cut_mesh.complete(sweep, work);
                self.follow_cut(&report)?;
                Ok(Some(report))
            }
        }
    }

    /// Whether a cut was begun and is not complete.
    pub fn is_being_cut(&self) -> bool {
        self.under_way.is_some()
    }

    fn may_be_cut(&self) -> Result<(), BodyError> {
        if self.shape.kind() != ElementKind::Tet4 {
            let with = if self.shape.kind() == ElementKind::Tet10 { "element tet10" } else { "element hex8" };
            return Err(BodyError::Combination { what: "a cut", with, instead: "tet4" });
        }
        if self.under_way.is_some() {
            return Err(CutError::UnderWay.into());
        }
        Ok(())
    }

    /// Cuts along the surface the blade swept. New copies inherit the state of the copies they were split
    /// from, so the cut itself does not change the motion of the material.
    pub fn cut(&mut self, blade: &BladeSweep, incision: u32) -> Result<CutReport, BodyError> {
        self.may_be_cut()?;
        if self.snap.is_some() {
            return self.snap_cut(blade, incision);
        }
        let report = self.cut_mesh.sweep(&self.state.x, blade, incision)?;
        self.follow_cut(&report)?;
        Ok(report)
    }

    /// Brings the body up to date after a cut of pieces and copies.
    fn follow_cut(&mut self, report: &CutReport) -> Result<(), BodyError> {
        if let Some(skin) = &mut self.skin {
            skin.follow(&self.cut_mesh);
        }
        // While a cut is still on its way through an element, only the surface changes.
        if !self.cut_mesh.changed_pieces().is_empty() {
            self.inherit(report);
            match &mut self.path {
                Path::Fast(fast) => {
                    fast.follow_cut(&self.cut_mesh, &report.new_copies);
                    self.follow_new_copies(&report.new_copies);
                }
                Path::General(_) => {
                    self.follow_general(&report.new_copies)?;
                    self.follow_topology();
                }
            }
        }
        Ok(())
    }

    /// Area [m²] of the sweep inside the body at its present positions; parts that are already cut count too.
    pub fn swept_area(&self, blade: &BladeSweep) -> f64 {
        let mut seen = vec![false; self.cut_mesh.mesh().tets.len()];
        let first_of_element = |p: &&Piece| !std::mem::replace(&mut seen[p.element as usize], true);
        let pieces = self.cut_mesh.pieces().iter().filter(first_of_element);
        let tets: Vec<[u32; 4]> = pieces.map(|piece| piece.copies).collect();
        swept_area(&tets, &self.state.x, blade)
    }

    /// Area [m²] at rest of the cut that an incision has opened, counting one of its two lips.
    pub fn opened_area(&self, incision: u32) -> f64 {
        let surface = self.cut_mesh.surface();
        let lips = surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag == incision);
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| surface.vertices[v as usize].position(&self.rest));
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        0.5 * lips.map(|(triangle, _)| area(triangle)).sum::<f64>()
    }

    fn inherit(&mut self, report: &CutReport) {
        let n = self.cut_mesh.n_copies();
        resize_reserving(&mut self.state.x, n, Vector3::zeros());
        resize_reserving(&mut self.state.v, n, Vector3::zeros());
        for new in &report.new_copies {
            let (copy, parent) = (new.copy as usize, new.parent as usize);
            self.state.x[copy] = self.state.x[parent];
            self.state.v[copy] = self.state.v[parent];
        }
        let known = self.split_from.len();
        resize_reserving(&mut self.split_from, n, 0);
        for (from, new) in self.split_from[known..].iter_mut().zip(&report.new_copies) {
            *from = new.parent;
        }
    }

    /// Rebuilds the model after a cut that made the copies `new`; integrators continue.
    fn follow_general(&mut self, new: &[NewCopy]) -> Result<(), BodyError> {
        let general = General::new(&self.shape, &self.cut_mesh, &self.material, &self.settings)?;
        if let Path::General(before) = std::mem::replace(&mut self.path, Path::General(Box::new(general)))
            && let Path::General(general) = &mut self.path
        {
            general.dynamics.continue_from(before.dynamics, new);
        }
        Ok(())
    }

    /// Rebuilds the model from the present pieces and copies; integrators start afresh from the present
    /// state.
    pub(super) fn rebuild_general(&mut self) -> Result<(), BodyError> {
        let general = General::new(&self.shape, &self.cut_mesh, &self.material, &self.settings)?;
        self.path = Path::General(Box::new(general));
        Ok(())
    }

    /// Updates everything derived from pieces and copies.
    pub(super) fn follow_topology(&mut self) {
        refill(&mut self.rest, self.shape.rest_positions(&self.cut_mesh).into_iter());
        self.follow_masses();
        self.follow_boundary();
    }

    /// The same on the fast path, after a cut that made the copies `new`, for elements without added
    /// nodes. The data of earlier copies stays in place.
    fn follow_new_copies(&mut self, new: &[NewCopy]) {
        let known = self.rest.len();
        resize_reserving(&mut self.rest, self.cut_mesh.n_copies(), Vector3::zeros());
        for (rest, new) in self.rest[known..].iter_mut().zip(new) {
            *rest = self.cut_mesh.mesh().nodes[self.cut_mesh.copy_node()[new.copy as usize] as usize];
        }
        self.follow_masses();
        self.find_fixed();
        self.boundary.loads_of_new_copies(&self.cut_mesh, &mut self.load);
        self.connectivity.follow(&mut self.parts, &self.cut_mesh, new, &self.mass, &self.fixed);
        self.follow_parts();
    }

    /// Updates the masses, and what the fast path derives from them.
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

    /// Applies [`Ablation::piece_masses`](super::Ablation): the copies of a node get equal masses.
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

    /// Updates everything derived from constraints and loads.
    pub(super) fn follow_boundary(&mut self) {
        self.find_fixed();
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
            fast.follow_parts((&self.rest, &self.mass), &self.parts, &self.fixed);
        }
        self.range.follow(&self.rest, &self.parts, &self.fixed);
    }
}
