//! The fast path: linear tetrahedra, matrix-free in single precision, one linear solve per step (two with
//! Newmark's method).

use nalgebra::Vector3;

use super::held_energy::HeldEnergy;
use super::{Outcome, SolveReport};
use crate::cut::{CutMesh, NewCopy};
use crate::element::{Simd, deformation_gradient, piece_energy};
use crate::integrator::{
    FreeMotion, Inertia, LinearStep, LooseParts, Multistep, Notice, Scheme, SpinGuard, State, StepInputs,
    StepOutcome, WEIGHTLESS, free_motions, why_no_equilibrium,
};
use crate::operator::{Elastic, FixedCopy, StiffModes, degenerate_elements};
use crate::reserve::{refill, resize_reserving};
use crate::team::Team;

/// A step that fails is tried again in 2 and then in 4 parts.
const MOST_HALVINGS: u32 = 2;

/// Largest turn [rad] of a free part in a step, or in a part of a divided step; a faster spin is slowed
/// to it. Little is lost: implicit Euler leaves less than a sixteenth of such a spin.
const LARGEST_TURN: f64 = 4.0;

/// If a free part turns by more than this in a step [rad], the energy of the free parts is checked after it.
///
/// A rigid part that spins far from a principal axis precesses. One linear solve mistakes that finite
/// rotation for strain and gains energy.
const NOTABLE_TURN: f64 = 0.5;

/// A step that gained energy is divided into 2, 4, … parts at most this often.
const MOST_SPIN_HALVINGS: u32 = 4;

/// Relative gain of energy that counts as rounding.
const GAIN: f64 = 1e-6;

/// State, operator and buffers of the fast path.
#[derive(Debug)]
pub(super) struct Fast {
    pub simd: Simd,
    pub elastic: Elastic,
    pub mass_f32: Vec<f32>,
    integrator: LinearStep,
    scheme: Scheme,
    multistep: Multistep,
    /// Rigid motions of held parts that the constraints leave free; found for equilibria only.
    free_motions: Vec<FreeMotion>,
    /// For the energy balance of Newmark's method.
    held: HeldEnergy,
    /// Degenerate elements of the mesh, ascending.
    degenerate: Vec<u32>,
    weightless: Vec<Weightless>,
    before: State,
    spin: SpinGuard,
}

/// A copy without mass, and the copies of its piece that carry it along.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Weightless {
    copy: u32,
    /// Copies of the same piece; those with mass count.
    piece: [u32; 4],
}

impl Fast {
    pub fn new(simd: Simd, mesh: &CutMesh, scheme: Scheme, at_start: bool) -> Self {
        Self {
            simd,
            elastic: Elastic::new(simd, mesh.mesh(), mesh.pieces(), mesh.n_copies()),
            mass_f32: Vec::new(),
            integrator: LinearStep::new(at_start),
            scheme,
            multistep: Multistep::new(scheme),
            free_motions: Vec::new(),
            held: HeldEnergy::default(),
            degenerate: degenerate_elements(mesh.mesh()),
            weightless: Vec::new(),
            before: State::default(),
            spin: SpinGuard::default(),
        }
    }

    /// Arranges the pieces after a cut that made the copies `new`. Earlier pieces keep their rotation,
    /// and all material keeps its history of earlier steps.
    pub fn follow_cut(&mut self, mesh: &CutMesh, new: &[NewCopy]) {
        self.multistep.inherit(new);
        self.elastic.follow(mesh.mesh(), mesh.pieces(), mesh.changed_pieces(), mesh.n_copies());
    }

    /// Arranges the pieces anew and forgets their rotations and the history of earlier steps.
    pub fn rebuild(&mut self, mesh: &CutMesh) {
        self.multistep.forget();
        let choice = self.elastic.choice();
        self.elastic = Elastic::new(self.simd, mesh.mesh(), mesh.pieces(), mesh.n_copies());
        self.elastic.set_choice(choice);
        self.degenerate = degenerate_elements(mesh.mesh());
    }

    /// Stiff motions of the degenerate elements, as these are cut now.
    pub fn stiff_modes(&self, mesh: &CutMesh) -> Option<StiffModes> {
        StiffModes::new(mesh.mesh(), mesh.pieces(), mesh.n_copies(), &self.degenerate)
    }

    /// See [`LinearStep::stiff_motions`].
    pub fn stiff_motions(&self) -> [usize; 3] {
        self.integrator.stiff_motions()
    }

    /// Updates everything else derived from pieces, copies and their mass [kg].
    pub fn follow_topology(&mut self, mesh: &CutMesh, mass: &[f64]) {
        refill(&mut self.mass_f32, mass.iter().map(|&m| m as f32));
        self.weightless = find_weightless(mesh, mass);
        self.integrator.resize(mesh.n_copies());
        self.multistep.resize(mesh.n_copies());
        if self.multistep.is_newmark() {
            self.held.follow(mesh, &self.elastic);
        }
        self.integrator.set_stiff_modes(self.stiff_modes(mesh));
        // A step fills these and must not allocate.
        resize_reserving(&mut self.before.x, mesh.n_copies(), Vector3::zeros());
        resize_reserving(&mut self.before.v, mesh.n_copies(), Vector3::zeros());
    }

    /// Updates everything derived from the parts of a body with these rest positions [m] and masses [kg].
    pub fn follow_parts(
        &mut self,
        (rest, mass): (&[Vector3<f64>], &[f64]),
        parts: &LooseParts,
        fixed: &[FixedCopy],
    ) {
        self.spin.follow(rest, mass, parts);
        if self.scheme == Scheme::Static {
            self.free_motions = free_motions(parts, rest, fixed);
        }
    }

    /// The state before the last step.
    pub fn before(&self) -> &State {
        &self.before
    }

    /// Forgets the energy of earlier steps, because energy was put in or taken out.
    pub fn forget_energy(&mut self) {
        self.multistep.forget_energy();
    }

    /// See [`Multistep::still`].
    pub fn still(&mut self, copies: &[u32], state: &State) {
        self.multistep.still(copies, state);
    }

    /// Advances by the step of `inputs` with the scheme of the body, or with implicit Euler if a guard
    /// demands it.
    pub fn step(
        &mut self,
        team: &mut Team,
        mesh: &CutMesh,
        state: &mut State,
        inputs: &StepInputs<'_>,
        (rest, spring_forces): (&[Vector3<f64>], &mut Vec<Vector3<f64>>),
    ) -> SolveReport {
        self.before.copy_from(state);
        if matches!(inputs.inertia, Inertia::None { .. })
            && let Some(notice) = self.why_no_equilibrium(inputs, rest)
        {
            spring_forces.clear();
            spring_forces.resize(inputs.springs.len(), Vector3::zeros());
            return SolveReport { outcome: Outcome::Refused, notice: Some(notice), ..SolveReport::default() };
        }
        let (scheme, notice) = self.multistep.choose(state, inputs, &mut self.spin);
        if self.multistep.starts_newmark(scheme) {
            let Self { elastic, integrator, multistep, mass_f32, .. } = self;
            let inputs = StepInputs { mass_f32, ..*inputs };
            integrator.accelerate(team, elastic, state, &inputs, multistep.acceleration_mut());
        }
        if self.multistep.is_newmark() {
            let Self { multistep, elastic, held, .. } = self;
            let stored = || held.at(team, elastic, &state.x, inputs.material);
            multistep.begin_energy(state, inputs, rest, stored);
        }
        let mut report = self.attempts(team, mesh, state, (scheme, inputs), spring_forces);
        let mut made_with = if report.substeps == 1 { scheme } else { Scheme::ImplicitEuler };
        if self.multistep.is_newmark() {
            let driven = is_driven(&self.before, inputs.fixed);
            let may_repeat = made_with != Scheme::ImplicitEuler;
            let excess = match report.outcome {
                Outcome::Advanced => {
                    self.excess(team, state, inputs, rest, (driven, may_repeat)).filter(|_| may_repeat)
                }
                _ => None,
            };
            if let Some(excess_j) = excess {
                state.copy_from(&self.before);
                made_with = Scheme::ImplicitEuler;
                let iterations = report.iterations;
                report = self.attempts(team, mesh, state, (made_with, inputs), spring_forces);
                report.iterations += iterations;
                report.notice = report.notice.or(Some(Notice::EnergyGained { excess_j }));
                if report.outcome == Outcome::Advanced {
                    self.excess(team, state, inputs, rest, (driven, false));
                }
            }
            if report.outcome != Outcome::Advanced {
                self.multistep.forget_energy();
            }
        }
        let underheld = self.free_motions.first().map(|&motion| Notice::Underheld { motion, driven: false });
        report.notice = report.notice.or(notice).or(underheld);
        if report.outcome == Outcome::Advanced {
            self.multistep.push((&self.before, state), inputs, made_with);
        }
        report
    }

    /// The reason why the body has no equilibrium, found before the step.
    fn why_no_equilibrium(&self, inputs: &StepInputs<'_>, rest: &[Vector3<f64>]) -> Option<Notice> {
        if self.free_motions.is_empty() && !inputs.parts.any_free() {
            return None;
        }
        let force = |(m, f): (&f64, &Vector3<f64>)| *m * inputs.gravity + f;
        let f_ext: Vec<_> = inputs.mass.iter().zip(inputs.load).map(force).collect();
        let held = (&self.free_motions[..], inputs.parts);
        why_no_equilibrium(held, inputs.material.law, rest, &f_ext, !inputs.springs.is_empty())
    }

    /// [`Multistep::end_energy`].
    fn excess(
        &mut self,
        team: &mut Team,
        state: &State,
        inputs: &StepInputs<'_>,
        rest: &[Vector3<f64>],
        how: (bool, bool),
    ) -> Option<f64> {
        let Self { multistep, elastic, held, before, .. } = self;
        let stored = held.at(team, elastic, &state.x, inputs.material);
        multistep.end_energy((before, state), inputs, (rest, stored), how)
    }

    /// Makes the step with one scheme. If the result is not finite or a free part gained energy, the step
    /// is taken back and tried again in smaller parts with implicit Euler. If no attempt stays finite, the
    /// body is held.
    fn attempts(
        &mut self,
        team: &mut Team,
        mesh: &CutMesh,
        state: &mut State,
        (scheme, inputs): (Scheme, &StepInputs<'_>),
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> SolveReport {
        let dt_s = inputs.h;
        let mut report = SolveReport::default();
        // Springs do work that is not known here, so the energy cannot be checked.
        let turns = inputs.springs.is_empty()
            && self.spin.exceeds(state, inputs.mass, inputs.parts, (dt_s, NOTABLE_TURN));
        let start = if turns { free_energy(mesh, state, inputs) } else { (0.0, 0.0) };
        let (mut failed, mut gained) = (0, false);
        for halvings in 0..=MOST_SPIN_HALVINGS {
            report.substeps = 1 << halvings;
            let scheme = if report.substeps == 1 { scheme } else { Scheme::ImplicitEuler };
            let solves = if scheme == Scheme::ImplicitEuler { 1 } else { inputs.solves };
            let inputs =
                StepInputs { h: dt_s / f64::from(report.substeps), mass_f32: &[], solves, ..*inputs };
            let slowed = self.spin.limit(state, inputs.mass, inputs.parts, (inputs.h, LARGEST_TURN));
            report.notice = match slowed {
                Some(angle_rad) => Some(Notice::SpinLimited { angle_rad, largest_rad: LARGEST_TURN }),
                None => gained.then_some(Notice::SpinDivided { substeps: report.substeps }),
            };
            let finite = self.try_step(team, state, (scheme, &inputs), &mut report, spring_forces);
            // An interrupted step is taken back, so that the state is that of a whole step.
            if team.told_to_stop() {
                state.copy_from(&self.before);
                spring_forces.clear();
                spring_forces.resize(inputs.springs.len(), Vector3::zeros());
                return SolveReport { outcome: Outcome::Interrupted, ..report };
            }
            if finite {
                let (now, put_in) = if turns { free_energy(mesh, state, &inputs) } else { (0.0, 0.0) };
                // Gravity and loads may do work; any further gain comes from the linearisation.
                let (gain, work) = (now - start.0, put_in - start.1);
                if gain - work <= GAIN * (start.0 + work.abs()) || halvings == MOST_SPIN_HALVINGS {
                    self.carry_weightless(mesh, state, inputs.mass, inputs.fixed);
                    return report;
                }
                gained = true;
            } else {
                failed += 1;
            }
            state.copy_from(&self.before);
            if failed > MOST_HALVINGS {
                break;
            }
        }
        // No attempt stayed finite: the body stays where it was, at rest.
        state.v.fill(Vector3::zeros());
        spring_forces.clear();
        spring_forces.resize(inputs.springs.len(), Vector3::zeros());
        SolveReport { outcome: Outcome::Held, ..report }
    }

    /// Makes all parts of a step; returns `false` as soon as one is not finite.
    fn try_step(
        &mut self,
        team: &mut Team,
        state: &mut State,
        (scheme, inputs): (Scheme, &StepInputs<'_>),
        report: &mut SolveReport,
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> bool {
        (report.residual, report.algebraic_error) = (0.0, 0.0);
        for _ in 0..report.substeps {
            let Self { elastic, integrator, multistep, mass_f32, .. } = self;
            let history = multistep.extrapolate(team, state, (scheme, inputs.h));
            let inertia = history.map_or(inputs.inertia, Inertia::Remembered);
            let inputs = StepInputs { mass_f32, inertia, ..*inputs };
            let StepOutcome { solve, solves, inverted_pieces, refused_springs, finite } =
                integrator.step(team, elastic, state, &inputs, spring_forces);
            report.newton_steps += solves;
            report.iterations += solve.iterations;
            report.residual = report.residual.max(solve.residual);
            report.stop = solve.stop;
            // δ minimises s times an energy, so its norm is in √J times √s.
            report.algebraic_error = report.algebraic_error.max(solve.algebraic_error / inputs.root_s());
            report.inverted_pieces = inverted_pieces;
            report.refused_springs = refused_springs;
            if !finite {
                return false;
            }
            if team.told_to_stop() {
                break;
            }
        }
        true
    }

    /// Moves copies without mass along with the rest of their piece: no force would move them.
    fn carry_weightless(&self, mesh: &CutMesh, state: &mut State, mass: &[f64], fixed: &[FixedCopy]) {
        for Weightless { copy, piece } in &self.weightless {
            let rest = |c: u32| mesh.mesh().nodes[mesh.copy_node()[c as usize] as usize];
            let (mut moved, mut v, mut hosts) = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for &host in piece.iter().filter(|&&c| mass[c as usize] > WEIGHTLESS) {
                moved += state.x[host as usize] - rest(host);
                v += state.v[host as usize];
                hosts += 1.0;
            }
            let fixed = fixed.binary_search_by_key(copy, |f| f.copy).is_ok();
            if hosts > 0.0 && !fixed {
                state.x[*copy as usize] = rest(*copy) + moved / hosts;
                state.v[*copy as usize] = v / hosts;
            }
        }
    }
}

/// Whether prescribed copies move in a step from `before`.
fn is_driven(before: &State, fixed: &[FixedCopy]) -> bool {
    let moves = |f: &FixedCopy| (0..3).any(|k| f.axes[k] && f.position_m[k] != before.x[f.copy as usize][k]);
    fixed.iter().any(moves)
}

/// Kinetic and elastic energy of the free parts, and Σ f·x of gravity and loads on them [J].
fn free_energy(mesh: &CutMesh, state: &State, inputs: &StepInputs<'_>) -> (f64, f64) {
    let free = |copy: usize| inputs.parts.free[inputs.parts.of_copy[copy] as usize];
    let (mut energy, mut loads) = (0.0, 0.0);
    for c in (0..inputs.mass.len()).filter(|&c| free(c)) {
        energy += 0.5 * inputs.mass[c] * state.v[c].norm_squared();
        loads += (inputs.mass[c] * inputs.gravity + inputs.load[c]).dot(&state.x[c]);
    }
    let (law, lame) = (inputs.material.law, inputs.material.lame());
    for piece in mesh.pieces().iter().filter(|piece| free(piece.copies[0] as usize)) {
        let (e, x) = (piece.element as usize, piece.copies.map(|copy| state.x[copy as usize]));
        let F = deformation_gradient(&x, &mesh.mesh().gradients(e));
        energy += piece_energy(law, lame, &F, piece.fraction * mesh.mesh().volume(e));
    }
    (energy, loads)
}

fn find_weightless(mesh: &CutMesh, mass: &[f64]) -> Vec<Weightless> {
    if mass.iter().all(|&m| m > WEIGHTLESS) {
        return Vec::new();
    }
    let mut found: Vec<Weightless> = Vec::new();
    for piece in mesh.pieces() {
        for copy in piece.copies {
            if mass[copy as usize] <= WEIGHTLESS && found.iter().all(|w| w.copy != copy) {
                found.push(Weightless { copy, piece: piece.copies });
            }
        }
    }
    found
}
