//! The history of earlier steps that BDF2 and Newmark's method need, and guards that replace a step by one of
//! implicit Euler where the scheme would fail.

use nalgebra::Vector3;
use scindo_algebra::operator::BLOCK;
use scindo_matter::cut::NewCopy;
use scindo_matter::material::Law;
use scindo_matter::octree::Restriction;
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::{Team, blocks};

use super::guard::{GAIN_ALPHA, GAIN_CONSERVING, GAIN_DISSIPATING, LARGEST_TURN, Ledger};
use super::history::History;
use super::increment::{Increment, bdf2_history, newmark_history};
use super::notice::Notice;
use super::scheme::Scheme;
use super::spin::SpinGuard;
use super::state::State;
use super::step_inputs::{StepHistory, StepInputs};

/// Most linear solves of a step whose equations are to hold, and of laws that are nonlinear in the stretch.
pub(super) const MOST_SOLVES: u32 = 8;
const NONLINEAR_SOLVES: u32 = 20;

/// A change of the elements that leaves the material whole.
#[derive(Clone, Copy, Debug)]
pub enum Adapted<'a> {
    /// Leaves were divided, which made these vertices.
    Refined(&'a [NewCopy]),
    /// Leaves were joined.
    Coarsened(&'a Restriction<'a>),
}

/// History of a scheme; empty for implicit Euler by one linear solve, which needs none.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
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
    /// Whether the energy of every scheme is judged, not only that of Newmark's method.
    judges_all: bool,
}

impl Multistep {
    /// An empty history of `scheme`. With `judges_all` the energy of every scheme is judged; otherwise only
    /// that of Newmark's method, which alone may gain it.
    pub fn new(scheme: Scheme, judges_all: bool) -> Self {
        Self { scheme, judges_all, ..Self::default() }
    }

    /// Whether states are kept from step to step.
    fn remembers(&self) -> bool {
        self.judges_all || self.scheme.remembers()
    }

    /// Whether energy is followed from step to step.
    pub fn judges_energy(&self) -> bool {
        (self.judges_all && self.scheme.is_implicit_motion()) || self.scheme.is_newmark()
    }

    /// Whether `state` is what the last step left, where that matters.
    pub fn continues(&self, state: &State) -> bool {
        !self.remembers() || self.history.continues(state)
    }

    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        if self.remembers() && !self.scheme.is_explicit() {
            for v in [&mut self.x_a, &mut self.x_v] {
                resize_reserving(v, n, Vector3::zeros());
            }
        }
        if self.scheme.remembers() {
            resize_reserving(&mut self.acceleration, n, Vector3::zeros());
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

    /// Tells that forces jump while positions and velocities continue. Newmark's method then needs a new
    /// acceleration: with the old one it would be of first order.
    pub fn forces_jump(&mut self) {
        if self.scheme.is_newmark() {
            self.history.forget();
        }
        self.stored_j = None;
    }

    /// Gives the copies `new`, which a cut made, the history of their parents. Forces jump where lips come
    /// apart.
    pub fn inherit(&mut self, new: &[NewCopy]) {
        if !self.remembers() {
            return;
        }
        self.forces_jump();
        self.history.inherit(new);
        if self.scheme.remembers() {
            NewCopy::inherit(new, &mut self.acceleration);
        }
    }

    /// Gives vertices that refinement made, or that are left after a coarsening, their history. The energy jumps,
    /// because the elements are others.
    pub fn adapt(&mut self, change: Adapted<'_>) {
        match change {
            Adapted::Refined(new) => self.inherit(new),
            Adapted::Coarsened(restriction) if self.remembers() => {
                self.forces_jump();
                self.history.coarsen(restriction);
                if self.scheme.remembers() {
                    restriction.project(&mut self.acceleration);
                }
            }
            Adapted::Coarsened(_) => {}
        }
        self.forget_energy();
    }

    /// See [`History::still`].
    pub fn still(&mut self, copies: &[u32], state: &State) {
        if self.remembers() {
            self.history.still(copies, state);
            if self.scheme.remembers() {
                copies.iter().for_each(|&c| self.acceleration[c as usize] = Vector3::zeros());
            }
            self.forget_energy();
        }
    }

    /// The scheme for this step, and the reason if it is not the chosen one.
    pub fn choose(
        &mut self,
        state: &State,
        (inputs, law): (&StepInputs<'_>, Law),
        spin: &mut SpinGuard,
    ) -> (Scheme, Option<Notice>) {
        let h = inputs.h;
        let mut turn = || match law != Law::Linear || self.judges_all {
            true => h * spin.fastest(state, inputs.mass, inputs.parts),
            false => 0.0,
        };
        let why = match self.scheme {
            Scheme::Bdf2 => {
                let touching = || inputs.contacts(|c| state.x[c] + h * state.v[c]);
                self.history.why_no_bdf2(h, turn, touching)
            }
            // Where several solves are made per step, the energy balance alone decides.
            scheme if scheme.is_newmark() && !self.judges_all => {
                let angle = Some(turn()).filter(|angle| *angle > LARGEST_TURN);
                angle.map(|angle_rad| Notice::Spinning { angle_rad })
            }
            _ => None,
        };
        match why {
            Some(notice) => (Scheme::ImplicitEuler, Some(notice)),
            None => (self.scheme, None),
        }
    }

    /// Whether Newmark's method needs the acceleration at the state it starts from.
    pub fn starts_newmark(&self, scheme: Scheme) -> bool {
        scheme.is_newmark() && !self.history.known
    }

    /// Buffer for that acceleration [m/s²].
    pub fn acceleration_mut(&mut self) -> &mut Vec<Vector3<f64>> {
        &mut self.acceleration
    }

    /// x_a and x_v of a step of `h` [s] with `scheme`; `None` for schemes without history, whose steps by one
    /// linear solve compute them on the fly.
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
            Scheme::Newmark { .. } | Scheme::GeneralisedAlpha { .. } => {
                let alpha = scheme.alpha()?;
                team.for_blocks(both, |block, (x_v, x_a)| {
                    for (i, (x_v, x_a)) in x_v.iter_mut().zip(x_a).enumerate() {
                        let c = block * BLOCK + i;
                        let now = [&state.x[c], &state.v[c], &acceleration[c]];
                        [*x_v, *x_a] = newmark_history(h, alpha, now);
                    }
                });
                Increment::alpha(h, alpha)
            }
            _ if !self.judges_all => return None,
            Scheme::Static => {
                self.x_v.copy_from_slice(&state.x);
                self.x_a.copy_from_slice(&state.x);
                Increment::NONE
            }
            _ => {
                self.x_v.copy_from_slice(&state.x);
                for (x_a, (x, v)) in self.x_a.iter_mut().zip(state.x.iter().zip(&state.v)) {
                    *x_a = x + h * v;
                }
                Increment::euler(h)
            }
        };
        Some(StepHistory { increment, x_a: &self.x_a, x_v: &self.x_v })
    }

    /// Most linear solves per step. Laws that are nonlinear in the stretch need several, until the equations of the step
    /// hold, and where the body may turn Newmark's method does, too: it has no damping of its own, so that what one solve
    /// leaves would add up.
    pub fn solves(scheme: Scheme, law: Law) -> u32 {
        match law {
            Law::StVenantKirchhoff | Law::NeoHookean => NONLINEAR_SOLVES,
            Law::Corotational if scheme.is_newmark() => MOST_SOLVES,
            Law::Corotational | Law::Linear => 1,
        }
    }

    /// Begins the energy balance of a step, with the kinetic energy and that of loads and springs [J]; `stored`
    /// computes the elastic energy [J] if it is not known. Returns kinetic and elastic energy.
    pub fn begin_energy(&mut self, kinetic_j: f64, loads_j: f64, stored: impl FnOnce() -> f64) -> f64 {
        let stored_j = *self.stored_j.get_or_insert_with(stored);
        self.ledger.begin(kinetic_j + stored_j + loads_j);
        kinetic_j + stored_j
    }

    /// Ends the energy balance of a step with energy `H` and elastic energy `stored_j` [J]. Returns the energy
    /// [J] gained without work, if it is more than `scheme` may gain of the `size_j` [J] that take part.
    /// `driven` tells that prescribed nodes moved and put energy in. A step that may be made again is booked
    /// only if it gained none.
    pub fn end_energy(
        &mut self,
        (H, stored_j, size_j): (f64, f64, f64),
        scheme: Scheme,
        (driven, may_repeat): (bool, bool),
    ) -> Option<f64> {
        let gain = match scheme {
            Scheme::ImplicitEuler => GAIN_DISSIPATING,
            Scheme::GeneralisedAlpha { .. } => GAIN_ALPHA,
            _ => GAIN_CONSERVING,
        };
        let excess = if driven { None } else { self.ledger.excess(H, gain * size_j) };
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
        match scheme.alpha() {
            Some(alpha) => {
                let A = Increment::newmark(inputs.h, alpha.beta, alpha.gamma).A;
                let known = before.x.iter().zip(&before.v).zip(&state.x);
                for (a, ((x, v), next)) in self.acceleration.iter_mut().zip(known) {
                    let x_a = x + inputs.h * v + inputs.h * inputs.h * (0.5 - alpha.beta) * *a;
                    *a = A * (next - x_a);
                }
            }
            None if self.scheme.is_newmark() => {
                let A = Increment::euler(inputs.h).A;
                let known = before.x.iter().zip(&before.v).zip(&state.x);
                for (a, ((x, v), next)) in self.acceleration.iter_mut().zip(known) {
                    *a = A * (next - (x + inputs.h * v));
                }
            }
            None => {}
        }
        self.history.push(before, state, inputs.h);
        if self.scheme == Scheme::Bdf2 {
            self.history.contacts = inputs.contacts(|c| state.x[c]);
        }
    }
}
