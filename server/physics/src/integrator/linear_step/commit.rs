//! How a solve moves the predictor, and how a step ends.

use nalgebra::Vector3;
use scindo_algebra::operator::{BLOCK, block_of, padded, unpadded};
use scindo_matter::team::phase::Phase;
use scindo_matter::team::{Team, blocks};

use super::LinearStep;
use crate::integrator::springs::ActiveSpring;
use crate::integrator::state::State;
use crate::integrator::step_inputs::{Inertia, LinearInputs};

impl LinearStep {
    /// Moves the predictor back by `part` of its last move, of which the rest is left.
    pub(super) fn take_back(&mut self, part: f64) {
        for (x, last) in self.predicted.iter_mut().zip(&mut self.last) {
            let moved = unpadded(last);
            *x -= part * moved;
            *last = padded(&((1.0 - part) * moved));
        }
    }

    /// Moves the predictor to x⁺ = x̂ + δ. Returns whether all of it is finite.
    pub(super) fn move_predictor(&mut self, team: &mut Team, inputs: &LinearInputs<'_>) -> bool {
        team.begin(Phase::Commit);
        let bound = 1e15; // m: far outside any scene, far inside the range of single precision
        let (delta, shift, of_part) = (&self.delta, &self.translations.shift, &inputs.step.parts.of_copy);
        let moved = (blocks(&mut self.predicted, BLOCK), blocks(&mut self.last, BLOCK));
        team.for_blocks((moved, blocks(&mut self.partial, 1)), |block, ((next, last), partial)| {
            let known = block_of(delta, block).iter().zip(block_of(of_part, block));
            let mut finite = true;
            for ((next, last), (delta, &part)) in next.iter_mut().zip(last).zip(known) {
                let moved = shift[part as usize] + unpadded(delta);
                *last = padded(&moved);
                *next += moved;
                finite &= next.iter().all(|c| c.abs() < bound);
            }
            partial[0] = f64::from(u8::from(finite));
        });
        // δ is rounded to single precision, and an inclined direction mixes its components.
        for fixed in inputs.step.fixed.iter().filter(|fixed| fixed.held.is_inclined()) {
            fixed.held.place(&mut self.predicted[fixed.copy as usize], &fixed.position_m);
        }
        !self.partial.contains(&0.0)
    }

    /// Writes x⁺ and v⁺ to `state`, and the spring forces. Returns the work [J] that the internal forces did if x⁺ solves
    /// the equations of the step: Σ (M a⁺ − f_ext − f_springs)·(x⁺ − x).
    pub(super) fn commit(
        &mut self,
        team: &mut Team,
        state: &mut State,
        inputs: &LinearInputs<'_>,
        spring_forces: &mut [Vector3<f64>],
    ) -> f64 {
        self.springs.write(spring_forces, |s| s.law().force(s.point(&self.predicted)));
        let pushed: f64 = self.springs.springs.iter().map(|s| self.work_of(s, state)).sum();
        let (predicted, rate) = (&self.predicted, inputs.rate());
        let alpha = inputs.material.rayleigh.mass_1_s;
        let results =
            (blocks(&mut state.x, BLOCK), blocks(&mut state.v, BLOCK), blocks(&mut self.partial, 1));
        team.for_blocks(results, |block, (x, v, work)| {
            let first = block * BLOCK;
            let mut sum = 0.0;
            for (i, (x, v)) in x.iter_mut().zip(v).enumerate() {
                let (c, next) = (first + i, predicted[first + i]);
                let moved = next - *x;
                let (faster, a) = match &inputs.inertia {
                    Inertia::Remembered(h) => ((next - h.x_v[c]) * rate, (next - h.x_a[c]) * h.increment.A),
                    Inertia::Euler | Inertia::None { .. } => (moved * rate, (moved * rate - *v) * rate),
                };
                let inertia = inputs.step.mass[c] * (a + alpha * faster - inputs.step.gravity);
                sum += (inertia - inputs.step.load[c]).dot(&moved);
                (*x, *v) = (next, faster);
            }
            work[0] = sum;
        });
        self.partial.iter().sum::<f64>() - pushed
    }

    /// Work [J] of a spring in the step.
    pub(super) fn work_of(&self, spring: &ActiveSpring, state: &State) -> f64 {
        let to = spring.point(&self.predicted);
        spring.law().force(to).dot(&(to - spring.point(&state.x)))
    }
}
