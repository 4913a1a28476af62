//! How a body follows a change of its topology.

use nalgebra::Vector3;
use scindo_matter::cut::{BladeSweep, CutError, CutReport, NewCopy, Work};
use scindo_matter::storage::reserve::{refill, resize_reserving};

use super::snapping::FaceCut;
use super::viscoelastic::Outline;
use super::{Body, BodyError};
use crate::integrator::LooseParts;

/// Pairs of sweep triangle and element that cost as much as one fragment, in a cut along faces.
const SNAP_PAIRS_PER_FRAGMENT: usize = 4;

/// Largest number of pairs of blade segment and element in a cut along faces that was begun. Such a cut is
/// made at once.
const MAX_SNAP_PAIRS: usize = 4_000_000;

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
        if self.snap.is_none() {
            return Ok(self.space.begin_cut(&mut self.team, &self.state.x, blade, incision)?);
        }
        blade.check()?;
        let n_elements = self.space.n_elements();
        let (found, limit) = (blade.segments.len() * n_elements, MAX_SNAP_PAIRS);
        if found > limit {
            let segments = (limit / n_elements.max(1)).max(2);
            return Err(CutError::TooManySegments { found: blade.segments.len(), limit: segments }.into());
        }
        self.under_way = Some(FaceCut { blade: blade.clone(), incision });
        Ok(())
    }

    /// Continues the cut that was begun, until `work` is used up. Returns the report when the cut is
    /// complete; `None` before that, and if no cut was begun.
    ///
    /// # Errors
    /// As [`cut`](Self::cut).
    pub fn go_on_cutting(&mut self, work: &mut Work) -> Result<Option<CutReport>, BodyError> {
        if let Some(FaceCut { blade, incision }) = self.under_way.take() {
            work.book(blade.segments.len() * self.space.n_elements() / SNAP_PAIRS_PER_FRAGMENT);
            return self.snap_cut(&blade, incision).map(Some);
        }
        let before = self.outline();
        let report = self.space.go_on_cutting(&mut self.team, work);
        if let Some(report) = &report {
            self.follow_cut(report, before)?;
        }
        Ok(report)
    }

    /// Whether a cut was begun and is not complete.
    pub fn is_being_cut(&self) -> bool {
        self.under_way.is_some() || self.space.is_being_cut()
    }

    fn may_be_cut(&self) -> Result<(), BodyError> {
        if !self.space.can_be_cut() {
            let with = self.space.name();
            return Err(BodyError::Combination { what: "a cut", with, instead: "tet4, tet10 or octree" });
        }
        if self.is_being_cut() {
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
        let before = self.outline();
        let report = self.space.cut(&mut self.team, &self.state.x, blade, incision)?;
        self.follow_cut(&report, before)?;
        Ok(report)
    }

    /// Brings the body up to date after a cut of pieces and copies.
    fn follow_cut(&mut self, report: &CutReport, before: Option<Outline>) -> Result<(), BodyError> {
        // While a cut is still on its way through an element, only the surface changes.
        if self.space.has_changed() {
            self.inherit(&report.new_copies);
            self.dynamics.follow_cut(&mut self.team, &*self.space, &report.new_copies)?;
            self.carry_viscous(before);
            if self.space.n_added() == 0 {
                self.follow_new_copies(&report.new_copies);
            } else {
                self.follow_topology();
            }
        }
        Ok(())
    }

    /// Area [m²] of the sweep inside the body at its present positions; parts that are already cut count too.
    pub fn swept_area(&self, blade: &BladeSweep) -> f64 {
        self.space.swept_area(&self.state.x, blade)
    }

    /// Area [m²] at rest of the cut that an incision has opened, counting one of its two lips.
    pub fn opened_area(&self, incision: u32) -> f64 {
        let surface = self.space.element_surface();
        let lips = surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag == incision);
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| surface.vertices[v as usize].position(&self.rest));
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        0.5 * lips.map(|(triangle, _)| area(triangle)).sum::<f64>()
    }

    /// Gives the nodes `new` the state of those they were split from. Nodes that the element adds move up behind the
    /// new copies of the mesh's nodes.
    pub(super) fn inherit(&mut self, new: &[NewCopy]) {
        let known = self.split_from.len();
        for values in [&mut self.state.x, &mut self.state.v] {
            resize_reserving(values, known + new.len(), Vector3::zeros());
            values.truncate(known);
            NewCopy::inherit(new, values);
        }
        let n_copies = self.space.n_copies() as u32;
        let copies = new.iter().filter(|new| new.copy < n_copies).count() as u32;
        let moved_up = |number: u32| if number < n_copies - copies { number } else { number + copies };
        if self.space.n_added() > 0 {
            self.split_from.iter_mut().for_each(|from| *from = moved_up(*from));
            self.asleep.iter_mut().for_each(|held| held.copy = moved_up(held.copy));
        }
        resize_reserving(&mut self.split_from, known + new.len(), 0);
        self.split_from.truncate(known);
        let added = self.split_from.split_off((n_copies - copies) as usize);
        self.split_from.extend(new[..copies as usize].iter().map(|new| new.parent));
        self.split_from.extend(added);
        self.split_from.extend(new[copies as usize..].iter().map(|new| new.parent));
    }

    /// Updates everything derived from pieces and copies.
    pub(super) fn follow_topology(&mut self) {
        refill(&mut self.rest, self.space.rest_positions().into_iter());
        self.follow_masses();
        self.follow_boundary();
    }

    /// The same after a cut that made the copies `new`, for elements without added nodes. The data of earlier
    /// copies stays in place.
    fn follow_new_copies(&mut self, new: &[NewCopy]) {
        resize_reserving(&mut self.rest, self.space.n_copies(), Vector3::zeros());
        for new in new {
            self.rest[new.copy as usize] = new.inherited(&self.rest);
        }
        let Self { dynamics, space, mass, material, settings, .. } = self;
        if settings.ablation.piece_masses || !dynamics.reweigh(&**space, material.density_kg_m3, mass) {
            self.follow_masses();
        }
        self.boundary.hold_between(new, self.space.node_of_copy());
        self.find_fixed();
        if self.boundary.pressures.is_empty() {
            self.boundary.loads_of_new_copies(&*self.space, &mut self.load);
        } else {
            self.bind_pressures();
            self.gather_loads();
        }
        let Self { connectivity, parts, space, mass, fixed, .. } = self;
        if connectivity.follow(parts, &**space, new, mass, fixed) {
            self.dynamics.follow_parts();
            self.range.follow_new(&self.rest, new, &self.parts, &self.fixed);
        } else {
            self.follow_parts();
        }
    }

    /// Updates the masses, and what the integrator derives from them.
    fn follow_masses(&mut self) {
        let Self { dynamics, space, mass, .. } = self;
        dynamics.solver().lumped_masses(&**space, self.material.density_kg_m3, mass);
        if self.settings.ablation.piece_masses && self.is_fast() {
            self.share_masses_evenly();
        }
        self.dynamics.follow_masses(&*self.space, &self.mass);
    }

    /// Applies [`Ablation::piece_masses`](super::Ablation): the copies of a node get equal masses.
    fn share_masses_evenly(&mut self) {
        let mut sum = vec![(0.0, 0.0); self.space.n_nodes()];
        for (&node, m) in self.space.node_of_copy().iter().zip(&self.mass) {
            let (mass, copies) = &mut sum[node as usize];
            (*mass, *copies) = (*mass + m, *copies + 1.0);
        }
        for (&node, m) in self.space.node_of_copy().iter().zip(&mut self.mass) {
            let (mass, copies) = sum[node as usize];
            *m = mass / copies;
        }
    }

    /// Updates everything derived from constraints and loads.
    pub(super) fn follow_boundary(&mut self) {
        self.find_fixed();
        self.bind_pressures();
        self.gather_loads();
        self.parts = LooseParts::connected(|visit| self.space.for_groups(visit), &self.mass, &self.fixed);
        self.follow_parts();
    }

    fn follow_parts(&mut self) {
        self.dynamics.follow_parts();
        self.range.follow(&self.rest, &self.parts, &self.fixed);
    }
}
