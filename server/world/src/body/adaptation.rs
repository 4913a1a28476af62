//! Cells of a body that are divided and joined between steps, as its scene asks for.

use nalgebra::Vector3;
use scindo_physics::body::estimate::CellRecovery;
use scindo_physics::body::{AdaptReport, Body, BodyError};

use super::region;
use crate::scene::checked::{AdaptSpec, Region};

/// What adaptations did since the start or the last reset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct AdaptCounts {
    /// Steps that began with other cells than the step before ended with.
    pub changes: u64,
    /// Cells that were divided into eight, for 2:1 balance too.
    pub divided: u64,
    /// Groups of eight cells that were joined.
    pub joined: u64,
    /// Most cells at any time.
    pub most_cells: usize,
}

/// Settings, memory and counts of one body.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct Adaptation {
    spec: AdaptSpec,
    /// Where the body is held, one region per `fix` of the scene.
    held: Vec<Region>,
    recovery: CellRecovery,
    pub(super) counts: AdaptCounts,
}

impl Adaptation {
    pub(crate) fn new(spec: AdaptSpec, held: Vec<Region>) -> Self {
        Self { spec, held, recovery: CellRecovery::default(), counts: AdaptCounts::default() }
    }

    /// Whether step number `step`, from 1, begins with an adaptation.
    fn is_due(&self, step: u64) -> bool {
        let after = step.saturating_sub(1);
        after.is_multiple_of(u64::from(self.spec.every_steps)) || self.estimates(step)
    }

    /// Whether the error of the cells is estimated before step number `step`.
    fn estimates(&self, step: u64) -> bool {
        let after = step.saturating_sub(1);
        self.spec.settings.error.is_some() && after.is_multiple_of(u64::from(self.spec.error_every_steps))
    }

    /// Distance of tools below which cells are divided before step number `step` [m]; `None` if tools do not
    /// count then.
    pub(crate) fn near_m(&self, step: u64) -> Option<f64> {
        self.spec.settings.distance_m.filter(|_| self.is_due(step)).map(|[near, _]| near)
    }

    /// Adapts the cells of `body` before step number `step`, with tools at these places [m].
    ///
    /// # Errors
    /// As [`Body::adapt`].
    pub(crate) fn adapt(
        &mut self,
        body: &mut Body,
        step: u64,
        tools: &[Vector3<f64>],
    ) -> Result<AdaptReport, BodyError> {
        // A cut under way names cells as they were when it began.
        if !self.is_due(step) || body.is_being_cut() {
            return Ok(AdaptReport::default());
        }
        let estimated = self.estimates(step) && body.cell_error(&mut self.recovery).is_some();
        let error = estimated.then(|| self.recovery.eta());
        let report = body.adapt(&self.spec.settings, tools, error)?;
        let counts = &mut self.counts;
        counts.changes += u64::from(report.has_changed());
        counts.divided += report.divided as u64;
        counts.joined += report.joined as u64;
        counts.most_cells = counts.most_cells.max(body.n_elements());
        Ok(report)
    }

    /// Nodes of `body` in each region that is held, as the cells are now.
    pub(crate) fn held_nodes<'a>(&'a self, body: &'a Body) -> impl Iterator<Item = Vec<u32>> + 'a {
        let bounds = body.bounds();
        self.held.iter().map(move |held| region::select(body.rest_positions(), bounds, held))
    }
}
