//! How a body follows the refinement and coarsening of its cells between two steps.

use nalgebra::Vector3;
use scindo_matter::cut::NewCopy;
use scindo_matter::element::Points;
use scindo_matter::octree::{Activity, AdaptSettings, Family, Leaf, OUTSIDE, Restriction};
use scindo_matter::storage::reserve::resize_reserving;

use super::{Body, BodyError};
use crate::integrator::Adapted;
use crate::space::{OctreeRefinement, OctreeSpace};

/// What an adaptation changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AdaptReport {
    /// Leaves that were divided, for 2:1 balance too.
    pub divided: usize,
    /// Families of eight leaves that became one.
    pub joined: usize,
    /// Vertices that are new.
    pub appeared: usize,
    /// Vertices that vanished.
    pub vanished: usize,
    /// Change of the kinetic energy \[J\].
    pub kinetic_change_j: f64,
    /// Change of the elastic energy \[J\].
    pub elastic_change_j: f64,
    /// Change of the momentum [kg m/s]; only vertices held on all sides take any.
    pub momentum_change: Vector3<f64>,
}

impl AdaptReport {
    /// Whether anything changed.
    pub fn has_changed(&self) -> bool {
        self.divided + self.joined > 0
    }
}

impl Body {
    /// Divides and joins cells by `settings`, with `tools` at these places [m] and the estimated `error` of every
    /// cell in the energy norm [√J], if it is known. Call it between steps.
    ///
    /// Refinement keeps positions and velocities as fields. Coarsening samples positions and projects velocities;
    /// mass and momentum stay, and the changes of both kinds of energy are reported. Vertices of the uncut body
    /// keep their numbers, but [later ones](Self::renumberings) may get others. The epoch rises if anything changes.
    ///
    /// # Errors
    /// Settings out of range, or a body that is no octree.
    pub fn adapt(
        &mut self,
        settings: &AdaptSettings,
        tools: &[Vector3<f64>],
        error: Option<&[f64]>,
    ) -> Result<AdaptReport, BodyError> {
        if settings.is_off() {
            return Ok(AdaptReport::default());
        }
        let of = |e: scindo_matter::octree::AdaptError| (e.name, e.found, e.allowed);
        settings.check().map_err(of).map_err(|(name, found, allowed)| BodyError::Criterion {
            name,
            found,
            allowed,
        })?;
        let Some(octree) = self.space.octree() else {
            let (what, with) = ("adaptation of cells", self.space.name());
            return Err(BodyError::Combination { what, with, instead: "octree" });
        };
        let cells = octree.octree().cells().len();
        if let Some(found) = error.map(<[f64]>::len).filter(|found| *found != cells) {
            return Err(BodyError::ErrorLength { found, expected: cells });
        }
        let activity = Activity { x: &self.state.x, v: &self.state.v, tools, error };
        let mut plan = octree.plan(settings, &activity);
        if !self.asleep.is_empty() {
            let vertices = octree.octree().vertices();
            let awake = |leaf: u32| !vertices[leaf as usize].iter().any(|&v| self.is_asleep(v));
            plan.refine.retain(|&leaf| awake(leaf));
            plan.coarsen.retain(|family| awake(octree.octree().leaf(family.at)));
        }
        if plan.is_empty() {
            return Ok(AdaptReport::default());
        }
        self.change_cells(&plan.refine, &plan.coarsen)
    }

    /// How often coarsening has given vertices beyond those of the uncut body new numbers.
    pub fn renumberings(&self) -> u32 {
        self.renumbered
    }

    fn change_cells(&mut self, refine: &[u32], coarsen: &[Family]) -> Result<AdaptReport, BodyError> {
        let (kinetic_j, momentum) = (self.kinetic_energy(), self.momentum());
        // On the general path the model may have remedies against locking, whose energy belongs to all cells.
        let modelled_j = self.dynamics.model().map(|_| self.elastic_energy());
        let before = self.outline();
        let mut report = AdaptReport::default();
        let Self { space, .. } = self;
        if let (false, Some(octree)) = (refine.is_empty(), space.octree_mut()) {
            let OctreeRefinement { change, new_copies } = octree.refine(refine);
            (report.divided, report.appeared) = (change.divided, new_copies.len());
            self.follow_refinement(&new_copies);
            report.elastic_change_j += self.energy_of(&change.cells) - self.energy_before(change.earlier);
        }
        if !coarsen.is_empty() {
            self.coarsen(coarsen, &mut report);
        }
        if !report.has_changed() {
            return Ok(report);
        }
        self.dynamics.follow_elements(&mut self.team, &*self.space)?;
        self.carry_viscous(before);
        self.follow_topology();
        report.kinetic_change_j = self.kinetic_energy() - kinetic_j;
        if let Some(elastic_j) = modelled_j {
            report.elastic_change_j = self.elastic_energy() - elastic_j;
        }
        report.momentum_change = self.momentum() - momentum;
        Ok(report)
    }

    /// Elastic energy \[J\] of these leaves as they are now.
    fn energy_of(&self, cells: &[u32]) -> f64 {
        let leaves = |octree: &OctreeSpace| cells.iter().map(|&id| octree.octree().now(id)).collect();
        self.space.octree().map_or(0.0, |octree| self.energy_before(leaves(octree)))
    }

    /// Elastic energy \[J\] of leaves before a change, with their vertices where they are now.
    fn energy_before(&self, leaves: Vec<Leaf>) -> f64 {
        let energy =
            |octree: &OctreeSpace| octree.octree().some(leaves).energy(&self.material, &self.state.x);
        self.space.octree().map_or(0.0, energy)
    }

    /// Extends everything with a value per vertex by the vertices that refinement made.
    fn follow_refinement(&mut self, new: &[NewCopy]) {
        self.inherit(new);
        resize_reserving(&mut self.rest, self.space.n_copies(), Vector3::zeros());
        for new in new {
            self.rest[new.copy as usize] = new.inherited(&self.rest);
        }
        self.boundary.hold_between(new, self.space.node_of_copy());
        self.find_fixed();
        self.dynamics.adapt(Adapted::Refined(new));
    }

    /// Joins families of leaves, and carries everything with a value per vertex over.
    fn coarsen(&mut self, families: &[Family], report: &mut AdaptReport) {
        let mass = self.space.copy_masses(self.material.density_kg_m3);
        let Self { space, boundary, .. } = self;
        let node_of_copy = space.node_of_copy().to_vec();
        let Some(octree) = space.octree_mut() else { return };
        let mut change = octree.coarsen(families, &|vertex, carriers| {
            boundary.needs(node_of_copy[vertex as usize], carriers, &node_of_copy)
        });
        if change.joined == 0 {
            return;
        }
        (report.joined, report.vanished) = (change.joined, change.vanished.len());
        report.elastic_change_j -= self.energy_before(std::mem::take(&mut change.earlier));
        let restriction = Restriction::new(&change, &mass, &self.fixed);
        restriction.sample(&mut self.state.x);
        report.elastic_change_j += self.energy_of(&change.cells);
        restriction.project(&mut self.state.v);
        self.dynamics.adapt(Adapted::Coarsened(&restriction));
        self.boundary.renumber(&change);
        let new = |vertex: u32| change.vertex_of[vertex as usize];
        self.asleep.iter_mut().for_each(|held| held.copy = new(held.copy));
        // A vertex whose origin vanished comes from the origin of that.
        let surviving = |mut vertex: u32| {
            while new(vertex) == OUTSIDE {
                vertex = self.split_from[vertex as usize];
            }
            new(vertex)
        };
        let mut split_from: Vec<u32> = self.split_from.iter().map(|&from| surviving(from)).collect();
        change.keep(&mut split_from);
        self.split_from = split_from;
        self.renumbered += 1;
    }
}
