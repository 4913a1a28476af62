//! What BDF2 and Newmark's method add to a step by linear solves: the history of earlier steps, and
//! guards that replace a step by one of implicit Euler where the scheme would fail.

use nalgebra::Vector3;

use super::State;
use super::dynamics::Scheme;
use super::guard::{GAIN_CONSERVING, LARGEST_TURN, Ledger};
use super::history::History;
use super::increment::{Increment, bdf2_history, newmark_history};
use super::notice::Notice;
use super::spin::SpinGuard;
use super::springs::ActiveSpring;
use super::step_inputs::{StepHistory, StepInputs};
use crate::cut::NewCopy;
use crate::material::Law;
use crate::operator::BLOCK;
use crate::reserve::resize_reserving;
use crate::team::{Team, blocks};

/// History of a scheme; empty for implicit Euler, which needs none.
#[derive(Debug, Default)]
pub struct Multistep {
    scheme: Scheme,
    history: History,
    /// Acceleration at the end of the last step, for Newmark's method [m/s²].
    acceleration: Vec<Vector3<f64>>,
    x_a: Vec<Vector3<f64>>,
    x_v: Vec<Vector3<f64>>,
    ledger: Ledger,
    /// Elastic energy at the end of the last step [J].
    stored_j: Option<f64>,
}

impl Multistep {
    /// An empty history of `scheme`.
    pub fn new(scheme: Scheme) -> Self {
        Self { scheme, ..Self::default() }
    }

    fn remembers(&self) -> bool {
        matches!(self.scheme, Scheme::Bdf2 | Scheme::Newmark { .. })
    }

    /// Whether acceleration and energy are followed from step to step.
    pub fn is_newmark(&self) -> bool {
        matches!(self.scheme, Scheme::Newmark { .. })
    }

    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        if self.remembers() {
            for v in [&mut self.x_a, &mut self.x_v, &mut self.acceleration] {
                resize_reserving(v, n, Vector3::zeros());
            }
        }
    }

    /// Forgets earlier steps.
    pub fn forget(&mut self) {
        self.history.forget();
        self.forget_energy();
    }

    /// Forgets the energy of earlier steps, which has changed from outside.
    pub fn forget_energy(&mut self) {
        self.ledger.forget();
        self.stored_j = None;
    }

    /// Gives the copies `new`, which a cut made, the history of their parents. Positions and velocities
    /// continue, but forces jump where lips come apart. Newmark's method therefore needs a new
    /// acceleration: with the old one it would be of first order.
    pub fn inherit(&mut self, new: &[NewCopy]) {
        if !self.remembers() {
            return;
        }
        if self.is_newmark() {
            self.history.forget();
        }
        self.history.inherit(new);
        for copy in new {
            let parent = self.acceleration[copy.parent as usize];
            self.acceleration.push(parent);
        }
        self.stored_j = None;
    }

    /// See [`History::still`].
    pub fn still(&mut self, copies: &[u32], state: &State) {
        if self.remembers() {
            self.history.still(copies, state);
            copies.iter().for_each(|&c| self.acceleration[c as usize] = Vector3::zeros());
            self.forget_energy();
        }
    }

    /// The scheme for this step, and the reason if it is not the chosen one.
    pub fn choose(
        &mut self,
        state: &State,
        inputs: &StepInputs<'_>,
        spin: &mut SpinGuard,
    ) -> (Scheme, Option<Notice>) {
        if !self.remembers() {
            return (self.scheme, None);
        }
        if !self.history.continues(state) {
            self.forget();
        }
        let h = inputs.h;
        let mut turn = || match inputs.material.law.rotates() {
            true => h * spin.fastest(state, inputs.mass, inputs.parts),
            false => 0.0,
        };
        let touching = || contacts(inputs, |c| state.x[c] + h * state.v[c]);
        let why = if self.is_newmark() {
            Some(turn()).filter(|angle| *angle > LARGEST_TURN).map(|angle_rad| Notice::Spinning { angle_rad })
        } else {
            self.history.why_no_bdf2(h, turn, touching)
        };
        match why {
            Some(notice) => (Scheme::ImplicitEuler, Some(notice)),
            None => (self.scheme, None),
        }
    }

    /// Whether Newmark's method needs the acceleration at the state it starts from.
    pub fn starts_newmark(&self, scheme: Scheme) -> bool {
        matches!(scheme, Scheme::Newmark { .. }) && !self.history.known
    }

    /// Buffer for that acceleration [m/s²].
    pub fn acceleration_mut(&mut self) -> &mut Vec<Vector3<f64>> {
        &mut self.acceleration
    }

    /// x_a and x_v of a step of `h` [s] with `scheme`; `None` for implicit Euler.
    pub fn extrapolate(
        &mut self,
        team: &mut Team,
        state: &State,
        (scheme, h): (Scheme, f64),
    ) -> Option<StepHistory<'_>> {
        let (history, acceleration) = (&self.history, &self.acceleration);
        let both = (blocks(&mut self.x_v, BLOCK), blocks(&mut self.x_a, BLOCK));
        let increment = match scheme {
            Scheme::Bdf2 => {
                team.for_blocks(both, |block, (x_v, x_a)| {
                    for (i, (x_v, x_a)) in x_v.iter_mut().zip(x_a).enumerate() {
                        let c = block * BLOCK + i;
                        let (now, before) = (state, &history.before);
                        let before = [&before.x[c], &before.v[c]];
                        [*x_v, *x_a] = bdf2_history(h, [&now.x[c], &now.v[c]], before);
                    }
                });
                Increment::bdf2(h)
            }
            Scheme::Newmark { beta, gamma } => {
                team.for_blocks(both, |block, (x_v, x_a)| {
                    for (i, (x_v, x_a)) in x_v.iter_mut().zip(x_a).enumerate() {
                        let c = block * BLOCK + i;
                        let now = [&state.x[c], &state.v[c], &acceleration[c]];
                        [*x_v, *x_a] = newmark_history(h, (beta, gamma), now);
                    }
                });
                Increment::newmark(h, beta, gamma)
            }
            _ => return None,
        };
        Some(StepHistory { increment, x_a: &self.x_a, x_v: &self.x_v })
    }

    /// Linear solves per step. Where the body may turn, Newmark's method needs two: with one it gains energy.
    pub fn solves(scheme: Scheme, law: Law) -> u32 {
        if matches!(scheme, Scheme::Newmark { .. }) && law.rotates() { 2 } else { 1 }
    }

    /// Begins the energy balance of a step from `state`. At `rest` [m] the loads have done no work;
    /// `stored` computes the elastic energy [J].
    pub fn begin_energy(
        &mut self,
        state: &State,
        inputs: &StepInputs<'_>,
        rest: &[Vector3<f64>],
        stored: impl FnOnce() -> f64,
    ) {
        let stored_j = *self.stored_j.get_or_insert_with(stored);
        self.ledger.begin(kinetic(state, inputs) + stored_j + load_energy(&state.x, inputs, rest));
    }

    /// Ends the energy balance at `state` after a step from `before`. Returns the energy [J] gained
    /// without work, if it is more than a conserving scheme may gain. `driven` tells that prescribed
    /// copies moved and put energy in. A step that may be made again is booked only if it gained none.
    pub fn end_energy(
        &mut self,
        (before, state): (&State, &State),
        inputs: &StepInputs<'_>,
        (rest, stored_j): (&[Vector3<f64>], f64),
        (driven, may_repeat): (bool, bool),
    ) -> Option<f64> {
        let kinetic_before = kinetic(before, inputs);
        let moved = state.x.iter().zip(&before.x).enumerate();
        let exchanged: f64 = moved.map(|(c, (x, from))| force(c, inputs).dot(&(x - from))).sum();
        let allowed = GAIN_CONSERVING * (kinetic_before + self.stored_j.unwrap_or(0.0) + exchanged.abs());
        let H = kinetic(state, inputs) + stored_j + load_energy(&state.x, inputs, rest);
        let excess = if driven { None } else { self.ledger.excess(H, allowed) };
        if excess.is_none() || !may_repeat {
            self.stored_j = Some(stored_j);
            self.ledger.end(H, driven);
        }
        excess
    }

    /// Records a step from `before` to `state` that was made with `scheme`.
    pub fn push(&mut self, (before, state): (&State, &State), inputs: &StepInputs<'_>, scheme: Scheme) {
        if !self.remembers() {
            return;
        }
        if self.is_newmark() {
            let increment = match scheme {
                Scheme::Newmark { beta, gamma } => Increment::newmark(inputs.h, beta, gamma),
                _ => Increment::euler(inputs.h),
            };
            for (c, a) in self.acceleration.iter_mut().enumerate() {
                let from = match scheme {
                    Scheme::Newmark { .. } => self.x_a[c],
                    _ => before.x[c] + inputs.h * before.v[c],
                };
                *a = increment.A * (state.x[c] - from);
            }
        }
        self.history.push(before, state, inputs.h);
        self.history.contacts = contacts(inputs, |c| state.x[c]);
    }
}

/// Number of springs that push or pull when their copies are at `x`.
fn contacts(inputs: &StepInputs<'_>, x: impl Fn(usize) -> Vector3<f64>) -> usize {
    let usable = inputs.springs.iter().filter_map(|spring| ActiveSpring::usable(spring, inputs.mass.len()));
    let point = |spring: &ActiveSpring| spring.carriers().map(|(c, w)| w * x(c)).sum();
    usable.filter(|spring| spring.potential(point(spring)).energy > 0.0).count()
}

/// Gravity and load on copy `c` [N].
fn force(c: usize, inputs: &StepInputs<'_>) -> Vector3<f64> {
    inputs.mass[c] * inputs.gravity + inputs.load[c]
}

/// ½ vᵀ M v [J].
fn kinetic(state: &State, inputs: &StepInputs<'_>) -> f64 {
    state.v.iter().zip(inputs.mass).map(|(v, m)| 0.5 * m * v.norm_squared()).sum()
}

/// Energy of springs and loads at `x` [J].
fn load_energy(x: &[Vector3<f64>], inputs: &StepInputs<'_>, rest: &[Vector3<f64>]) -> f64 {
    let loads: f64 = x.iter().zip(rest).enumerate().map(|(c, (x, X))| force(c, inputs).dot(&(x - X))).sum();
    let springs = inputs.springs.iter().filter_map(|spring| ActiveSpring::usable(spring, x.len()));
    springs.map(|spring| spring.potential(spring.point(x)).energy).sum::<f64>() - loads
}
