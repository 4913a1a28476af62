//! What equilibria add to a step by linear solves: the search that goes on from step to step, and the line search of
//! laws that rotate.

use nalgebra::Vector3;
use scindo_algebra::operator::Stiffness;
use scindo_algebra::solver::{LinearReport, StopReason};
use scindo_matter::team::Team;
use scindo_matter::team::phase::Phase;

use super::{LinearStep, active, system};
use crate::integrator::descent::Start;
use crate::integrator::state::State;
use crate::integrator::step_inputs::{LinearInputs, StepOutcome};

impl LinearStep {
    /// Whether nothing has changed from outside since the last step.
    pub(super) fn goes_on(&self, elastic: &dyn Stiffness, state: &State, inputs: &LinearInputs<'_>) -> bool {
        let made_for = Some((elastic.version(), inputs.mass_factor()));
        let same = |known| inputs.is_loaded_as(known) && self.made_for == made_for && self.ended == state.x;
        self.searched.as_ref().is_some_and(same)
    }

    /// Continues the search of the last step along its direction, as if both steps were one.
    pub(super) fn relax(
        &mut self,
        team: &mut Team,
        elastic: &mut dyn Stiffness,
        state: &mut State,
        inputs: &LinearInputs<'_>,
        spring_forces: &mut [Vector3<f64>],
    ) -> StepOutcome {
        team.begin(Phase::Predict);
        self.predicted.copy_from_slice(&state.x);
        self.delta.fill([0.0; 4]);
        self.translations.restart(inputs.step.parts);
        team.begin(Phase::Solve);
        let Self { pcg, preconditioner, delta, reference, grid, .. } = self;
        let mut A = system(elastic, &[], inputs);
        let until = (*reference, inputs.solver);
        let solve = match active(grid) {
            None => pcg.go_on(team, &mut A, preconditioner, delta, until),
            Some(grid) => pcg.go_on(team, &mut A, &mut grid.cycle(preconditioner.inverses()), delta, until),
        };
        let finite = solve.stop != StopReason::NonFinite && self.move_predictor(team, inputs);
        if finite {
            self.commit(team, state, inputs, spring_forces);
            self.ended.copy_from_slice(&state.x);
        }
        team.begin(Phase::Guards);
        // Convergence by the recurrence is checked in the next step, from forces.
        if !finite || solve.stop == StopReason::Converged {
            self.searched = None;
        }
        StepOutcome { solve, solves: 1, finite, ..StepOutcome::default() }
    }

    /// Shortens the step of the last solve until it lowers the potential. Returns whether the equilibrium is
    /// found or cannot be approached any more; the solve then says why. `known` iterations were made before.
    pub(super) fn descend(
        &mut self,
        team: &mut Team,
        inputs: &LinearInputs<'_>,
        known: u32,
        is_last: bool,
        solve: &mut LinearReport,
    ) -> bool {
        // What a solve reports is relative to its own start; the true residual was measured there.
        solve.residual = self.began;
        if solve.iterations == known || self.began <= inputs.solver.tolerance {
            solve.stop = StopReason::Converged;
            return true;
        }
        if self.descent.is_futile(self.began) {
            solve.stop = StopReason::Stagnated;
            return true;
        }
        if is_last {
            solve.stop = StopReason::IterationLimit;
            return true;
        }
        team.begin(Phase::Search);
        let start = Start { x: &self.predicted, f_int: &self.exact, stored: self.stored };
        let found = self.descent.search(inputs, &self.springs.springs, start, &self.delta);
        let Some(t) = found else {
            // Without the earlier steps the direction is one of descent.
            let retries = !self.descent.memory.is_empty();
            self.descent.memory.clear();
            self.delta.fill([0.0; 4]);
            solve.stop = StopReason::NoDescent;
            return !retries;
        };
        self.delta.iter_mut().flatten().for_each(|d| *d *= t as f32);
        self.descent.memory.stepped(&self.delta);
        false
    }

    /// Lets springs open, close or reach their cap where the predictor is now, so that their forces are those of
    /// the potential there.
    pub(super) fn choose_modes(&mut self, inputs: &LinearInputs<'_>) {
        self.springs.begin(&inputs.step, &self.predicted);
        for spring in &mut self.springs.springs {
            let point = spring.point(&self.predicted);
            spring.choose_mode(point);
        }
    }
}
