//! The fast path: linear tetrahedra, matrix-free in single precision, one linear solve per step (two of
//! Newmark's method).

use nalgebra::Vector3;

use super::{Outcome, SolveReport};
use crate::cut::{CutMesh, NewCopy};
use crate::element::{Simd, deformation_gradient, piece_energy};
use crate::integrator::{
    FreeMotion, Inertia, LinearStep, LooseParts, Multistep, Notice, Scheme, SpinGuard, State, StepInputs,
    StepOutcome, WEIGHTLESS, free_motions, why_no_equilibrium,
};
use crate::material::Material;
use crate::operator::{BLOCK, Elastic, FixedCopy, Place, StiffModes, degenerate_elements};
use crate::reserve::{refill, resize_reserving};
use crate::team::{Team, blocks};

/// A step that fails is tried again in 2 and then in 4 parts.
const MOST_HALVINGS: u32 = 2;

/// A free part turns by at most this much [rad] in a step, or in a part of a divided one: implicit
/// Euler leaves less than a sixteenth of such a spin, and what more it had.
const LARGEST_TURN: f64 = 4.0;

/// Where a free part turns by more in a step [rad], the energy of the free parts is looked at after it:
/// a stiff part that turns far about another axis than one of its inertia turns on, from where it was
/// linearised, by a finite angle, which a single linear solve takes for a strain.
const NOTABLE_TURN: f64 = 0.5;

/// Such a step may be divided in 2, 4 and so on, this often.
const MOST_SPIN_HALVINGS: u32 = 4;

/// Part of the energy that may appear from nowhere: rounding.
const GAIN: f64 = 1e-6;

/// What the fast path remembers and works with.
#[derive(Debug)]
pub(super) struct Fast {
    pub simd: Simd,
    pub elastic: Elastic,
    pub mass_f32: Vec<f32>,
    integrator: LinearStep,
    scheme: Scheme,
    multistep: Multistep,
    /// Of an equilibrium: rigid motions of held parts that nothing holds.
    free_motions: Vec<FreeMotion>,
    /// Where the rotation of every piece is kept, for the energy of Newmark's method.
    places: Vec<Place>,
    partial: Vec<f64>,
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
            places: Vec::new(),
            partial: Vec::new(),
            degenerate: degenerate_elements(mesh.mesh()),
            weightless: Vec::new(),
            before: State::default(),
            spin: SpinGuard::default(),
        }
    }

    /// Arranges the pieces after a cut that made the copies `new`; those that were there before keep their
    /// rotation, and all of the material what is remembered of earlier steps.
    pub fn follow_cut(&mut self, mesh: &CutMesh, new: &[NewCopy]) {
        self.multistep.inherit(new);
        self.elastic.follow(mesh.mesh(), mesh.pieces(), mesh.changed_pieces(), mesh.n_copies());
    }

    /// Arranges the pieces anew, without memory of their rotations and of earlier steps.
    pub fn rebuild(&mut self, mesh: &CutMesh) {
        self.multistep.forget();
        let choice = self.elastic.choice();
        self.elastic = Elastic::new(self.simd, mesh.mesh(), mesh.pieces(), mesh.n_copies());
        self.elastic.set_choice(choice);
        self.degenerate = degenerate_elements(mesh.mesh());
    }

    /// The stiff motions of degenerate elements, as they are cut now.
    pub fn stiff_modes(&self, mesh: &CutMesh) -> Option<StiffModes> {
        StiffModes::new(mesh.mesh(), mesh.pieces(), mesh.n_copies(), &self.degenerate)
    }

    /// [`LinearStep::stiff_motions`].
    pub fn stiff_motions(&self) -> [usize; 3] {
        self.integrator.stiff_motions()
    }

    /// Everything else that is derived from pieces, copies and their mass [kg].
    pub fn follow_topology(&mut self, mesh: &CutMesh, mass: &[f64]) {
        refill(&mut self.mass_f32, mass.iter().map(|&m| m as f32));
        self.weightless = find_weightless(mesh, mass);
        self.integrator.resize(mesh.n_copies());
        self.multistep.resize(mesh.n_copies());
        if self.multistep.is_newmark() {
            self.places = self.elastic.places();
            self.partial.resize(mesh.pieces().len().div_ceil(BLOCK), 0.0);
        }
        self.integrator.set_stiff_modes(self.stiff_modes(mesh));
        // A step fills them; it must not have to make room.
        resize_reserving(&mut self.before.x, mesh.n_copies(), Vector3::zeros());
        resize_reserving(&mut self.before.v, mesh.n_copies(), Vector3::zeros());
    }

    /// Everything that is derived from the parts of a body with these rest positions [m] and masses [kg].
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

    /// What was remembered of earlier steps no longer holds: energy was put in or taken out.
    pub fn forget_energy(&mut self) {
        self.multistep.forget_energy();
    }

    /// [`Multistep::still`].
    pub fn still(&mut self, copies: &[u32], state: &State) {
        self.multistep.still(copies, state);
    }

    /// Advances by the step of `inputs` with the scheme of the body, or with implicit Euler where a guard
    /// asks for it.
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
            let Self { multistep, elastic, places, partial, .. } = self;
            let stored = || held_energy(team, mesh, (elastic, places), &state.x, (inputs.material, partial));
            multistep.begin_energy(state, inputs, rest, stored);
        }
        let mut report = self.attempts(team, mesh, state, (scheme, inputs), spring_forces);
        let mut made_with = if report.substeps == 1 { scheme } else { Scheme::ImplicitEuler };
        if self.multistep.is_newmark() {
            let driven = is_driven(&self.before, inputs.fixed);
            let excess = match report.outcome {
                Outcome::Advanced => self.excess(team, mesh, state, inputs, (rest, driven)),
                _ => None,
            };
            if let (Some(excess_j), true) = (excess, made_with != Scheme::ImplicitEuler) {
                state.copy_from(&self.before);
                made_with = Scheme::ImplicitEuler;
                let iterations = report.iterations;
                report = self.attempts(team, mesh, state, (made_with, inputs), spring_forces);
                report.iterations += iterations;
                report.notice = report.notice.or(Some(Notice::EnergyGained { excess_j }));
            }
            if excess.is_some() || report.outcome != Outcome::Advanced {
                // The energy that is there now is what there is.
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

    /// What keeps the body from an equilibrium, before the step.
    fn why_no_equilibrium(&self, inputs: &StepInputs<'_>, rest: &[Vector3<f64>]) -> Option<Notice> {
        if self.free_motions.is_empty() && !inputs.parts.any_free() {
            return None;
        }
        let force = |(m, f): (&f64, &Vector3<f64>)| *m * inputs.gravity + f;
        let f_ext: Vec<_> = inputs.mass.iter().zip(inputs.load).map(force).collect();
        let held = (&self.free_motions[..], inputs.parts);
        why_no_equilibrium(held, inputs.material.law, rest, &f_ext, !inputs.springs.is_empty())
    }

    /// Energy [J] that a step of Newmark's method put in from nowhere.
    fn excess(
        &mut self,
        team: &mut Team,
        mesh: &CutMesh,
        state: &State,
        inputs: &StepInputs<'_>,
        (rest, driven): (&[Vector3<f64>], bool),
    ) -> Option<f64> {
        let Self { multistep, elastic, places, partial, before, .. } = self;
        let stored = held_energy(team, mesh, (elastic, places), &state.x, (inputs.material, partial));
        multistep.end_energy((before, state), inputs, (rest, stored), driven)
    }

    /// Makes the step with one scheme; where that does not stay finite it is taken back and tried again in
    /// smaller parts with implicit Euler, then given up.
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
        // Springs put in energy that is not known here.
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
            if team.told_to_stop() {
                state.copy_from(&self.before);
                spring_forces.clear();
                spring_forces.resize(inputs.springs.len(), Vector3::zeros());
                return SolveReport { outcome: Outcome::Interrupted, ..report };
            }
            if finite {
                let (now, put_in) = if turns { free_energy(mesh, state, &inputs) } else { (0.0, 0.0) };
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
        state.v.fill(Vector3::zeros());
        spring_forces.clear();
        spring_forces.resize(inputs.springs.len(), Vector3::zeros());
        SolveReport { outcome: Outcome::Held, ..report }
    }

    /// Makes all parts of a step; `false` as soon as one does not stay finite.
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
            // δ minimises an energy times s, so that its norm is √J times √s.
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

    /// Moves copies without mass along with the rest of their piece: no force would do it.
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

/// Elastic energy [J] at `x` [m] with the rotations of the last update, by one entry of `partial` per block of
/// pieces. Where these are not those of `x`, it is a little more than the energy.
fn held_energy(
    team: &mut Team,
    mesh: &CutMesh,
    (elastic, places): (&Elastic, &[Place]),
    x: &[Vector3<f64>],
    (material, partial): (&Material, &mut [f64]),
) -> f64 {
    let lame = material.lame();
    team.for_blocks(blocks(partial, 1), |block, partial| {
        let first = block * BLOCK;
        let pieces = &mesh.pieces()[first..mesh.pieces().len().min(first + BLOCK)];
        partial[0] = pieces
            .iter()
            .zip(&places[first..])
            .map(|(piece, place)| {
                let e = piece.element as usize;
                let F = deformation_gradient(
                    &piece.copies.map(|copy| x[copy as usize]),
                    &mesh.mesh().gradients(e),
                );
                let volume = piece.fraction * mesh.mesh().volume(e);
                if !material.law.rotates() {
                    return piece_energy(material.law, lame, &F, volume);
                }
                let R = elastic.rotation(*place).map(f64::from);
                let stretch = R.tr_mul(&F).trace() - 3.0;
                volume * (lame.mu * (F - R).norm_squared() + 0.5 * lame.lambda * stretch * stretch)
            })
            .sum();
    });
    partial.iter().sum()
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
