//! Steps by linear solves from the predictor: linear tetrahedra, matrix-free in single precision. One solve per
//! step, two with Newmark's method.

use nalgebra::Vector3;
use scindo_algebra::assembly::ModelError;
use scindo_algebra::operator::{ElasticUpdate, Stiffness};
use scindo_algebra::solver::multigrid::{CoarsestSolve, CycleShape, LevelReport};
use scindo_algebra::solver::{Method, PcgSettings, StopReason};
use scindo_matter::element::{Points, Simd};
use scindo_matter::material::Material;
use scindo_matter::storage::reserve::{refill, resize_reserving};
use scindo_matter::team::Team;

use super::ablation::Ablation;
use super::course::Course;
use super::linear_step::LinearStep;
use super::multistep::MOST_SOLVES;
use super::notice::Notice;
use super::report::{Outcome, SolveReport};
use super::scheme::Scheme;
use super::state::{State, WEIGHTLESS};
use super::step_inputs::{Inertia, LinearInputs, StepInputs, StepOutcome};
use super::step_solver::{SolverSettings, StepSolver};
use super::together::Member;
use crate::space::OctreeSpace;
use crate::space::Space;

/// Residual above which the equations of a step in motion are not solved at all.
const UNSOLVED: f64 = 0.01;

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

/// Strain of a whole body that forces in single precision do not tell from none.
const ROUNDED_STRAIN: f64 = 1e-5;

/// Stiffness and buffers of steps by linear solves.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct LinearlyImplicit {
    scheme: Scheme,
    material: Material,
    solves: u32,
    pcg: PcgSettings,
    method: Method,
    simulate_level: usize,
    cycle: CycleShape,
    relaxes: bool,
    /// Whether steps of any scheme take as many solves as their equations need.
    careful: bool,
    /// Whether the iterations of the last solve were too few. More solves would leave as much.
    limited: bool,
    #[serde(with = "scindo_algebra::operator::saved_stiffness")]
    stiffness: Box<dyn Stiffness>,
    /// Whether the stiffness uses only instructions that every machine has.
    simd: Simd,
    mass_f32: Vec<f32>,
    step: LinearStep,
    weightless: Vec<Weightless>,
    /// Whether the levels of multigrid have followed the last change of the topology.
    levels_follow: bool,
}

/// A copy without mass, and the copies of its piece that carry it along.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Weightless {
    copy: u32,
    /// Copies of the same piece; those with mass count.
    piece: Box<[u32]>,
}

impl LinearlyImplicit {
    /// Steps with `stiffness`, which was made for the instructions `simd`.
    pub fn new(
        (scheme, material): (Scheme, Material),
        settings: SolverSettings,
        (stiffness, simd): (Box<dyn Stiffness>, Simd),
        ablation: Ablation,
    ) -> Self {
        let (solves, pcg) = settings.linear;
        Self {
            scheme,
            material,
            solves,
            pcg,
            method: settings.method,
            simulate_level: usize::from(settings.simulate_level),
            cycle: settings.cycle,
            relaxes: settings.relaxation.is_some(),
            careful: false,
            limited: false,
            stiffness,
            simd,
            mass_f32: Vec::new(),
            step: LinearStep::new(ablation),
            weightless: Vec::new(),
            levels_follow: false,
        }
    }

    /// Makes all parts of a step; returns `false` as soon as one is not finite.
    fn try_step(
        &mut self,
        team: &mut Team,
        (course, state): (&mut Course, &mut State),
        (scheme, inputs): (Scheme, &StepInputs<'_>),
        (report, spring_forces): (&mut SolveReport, &mut [Vector3<f64>]),
    ) -> bool {
        (report.residual, report.rounding) = (0.0, 0.0);
        (report.algebraic_error, report.internal_work_j) = (0.0, 0.0);
        for _ in 0..report.substeps {
            let inertia = match course.multistep.extrapolate(team, state, (scheme, inputs.h)) {
                Some(history) => Inertia::Remembered(history),
                None if scheme == Scheme::Static => Inertia::None { relax: self.relaxes },
                None => Inertia::Euler,
            };
            let solves = match scheme {
                _ if self.careful && !self.limited && scheme != Scheme::Static => {
                    self.solves.max(MOST_SOLVES)
                }
                Scheme::ImplicitEuler if self.material.law.is_hookean() => 1,
                _ => self.solves,
            };
            let Self { step, stiffness, mass_f32, material, pcg, .. } = self;
            let conserves = scheme.is_newmark() && material.law.rotates() && !self.limited;
            let inputs =
                LinearInputs { step: *inputs, mass_f32, material, solver: *pcg, inertia, solves, conserves };
            let outcome = step.step(team, &mut **stiffness, state, &inputs, spring_forces);
            let StepOutcome { solve, solves, inverted_pieces, refused_springs, backtracks, work_j, .. } =
                outcome;
            report.newton_steps += solves;
            report.iterations += solve.iterations;
            report.residual = report.residual.max(solve.residual);
            report.rounding = report.rounding.max(outcome.rounding);
            report.stop = solve.stop;
            self.limited = solve.stop == StopReason::IterationLimit;
            // δ minimises s times an energy, so its norm is in √J times √s.
            report.algebraic_error = report.algebraic_error.max(solve.algebraic_error / inputs.root_s());
            report.inverted_pieces = inverted_pieces;
            report.refused_springs = refused_springs;
            report.backtracks += backtracks;
            report.internal_work_j += work_j;
            if !outcome.finite {
                return false;
            }
            if team.told_to_stop() {
                break;
            }
        }
        true
    }

    /// Stopping criteria of its linear solves.
    pub fn solver(&self) -> PcgSettings {
        self.pcg
    }

    /// Follows a change of the number of copies and of how they are joined.
    fn follow_copies(&mut self, space: &dyn Space, n_copies: usize) {
        self.step.resize(n_copies);
        self.step.set_stiff_modes(space.stiff_modes());
        self.step.set_method(self.method);
        self.complete_levels(space);
    }

    /// Makes the levels of multigrid anew where they could not follow a cut.
    fn complete_levels(&mut self, space: &dyn Space) {
        if std::mem::take(&mut self.levels_follow) {
            return;
        }
        let hierarchy = if self.method.is_multigrid() { space.hierarchy(self.simulate_level) } else { None };
        self.step.set_hierarchy(hierarchy, self.simulate_level, self.cycle);
    }

    /// Kinetic and elastic energy of the free parts, and Σ f·x of gravity and loads on them [J].
    fn free_energy(&self, state: &State, inputs: &StepInputs<'_>) -> (f64, f64) {
        let free = |copy: usize| inputs.parts.free[inputs.parts.of_copy[copy] as usize];
        let (mut energy, mut loads) = (0.0, 0.0);
        for c in (0..inputs.mass.len()).filter(|&c| free(c)) {
            energy += 0.5 * inputs.mass[c] * state.v[c].norm_squared();
            loads += (inputs.mass[c] * inputs.gravity + inputs.load[c]).dot(&state.x[c]);
        }
        inputs.points.for_points(&state.x, &mut |point| {
            if free(point.nodes[0] as usize) {
                let lame = inputs.points.lame(point.region, &self.material);
                energy += point.weight * self.material.law.energy(&point.F, lame);
            }
        });
        (energy, loads)
    }
}

impl StepSolver for LinearlyImplicit {
    /// Makes the step with `scheme`. If the result is not finite or a free part gained energy, the step is
    /// tried again in smaller parts with implicit Euler.
    fn attempt(
        &mut self,
        team: &mut Team,
        course: &mut Course,
        state: &mut State,
        (scheme, inputs): (Scheme, &StepInputs<'_>),
        (report, spring_forces): (&mut SolveReport, &mut [Vector3<f64>]),
    ) {
        let (h, notice) = (inputs.h, report.notice);
        // Springs do work that is not known here, so the energy cannot be checked.
        let turns = inputs.springs.is_empty()
            && course.spin.exceeds(state, inputs.mass, inputs.parts, (h, NOTABLE_TURN));
        let start = if turns { self.free_energy(state, inputs) } else { (0.0, 0.0) };
        let (mut failed, mut gained) = (0, false);
        for halvings in 0..=MOST_SPIN_HALVINGS {
            report.substeps = 1 << halvings;
            // Parts of a step are made with implicit Euler.
            report.scheme =
                if halvings == 0 || scheme == Scheme::Static { scheme } else { Scheme::ImplicitEuler };
            let inputs = StepInputs { h: h / f64::from(report.substeps), ..*inputs };
            let limit = (inputs.h, LARGEST_TURN);
            let slowed = course.spin.limit(state, inputs.mass, inputs.parts, limit);
            report.notice = match slowed {
                Some(angle_rad) => Some(Notice::SpinLimited { angle_rad, largest_rad: LARGEST_TURN }),
                None if gained => Some(Notice::SpinDivided { substeps: report.substeps }),
                None => notice,
            };
            let scheme = report.scheme;
            let finite = self.try_step(team, (course, state), (scheme, &inputs), (report, spring_forces));
            if team.told_to_stop() {
                return;
            }
            // The equations of a nonlinear law are solved where a shorter step begins closer to them.
            let unsolved = report.rounding > 0.0 && report.residual > UNSOLVED.max(report.rounding);
            if finite && !(unsolved && failed < MOST_HALVINGS) {
                let (now, put_in) = if turns { self.free_energy(state, &inputs) } else { (0.0, 0.0) };
                // Gravity and loads may do work; any further gain comes from the linearisation.
                let (gain, work) = (now - start.0, put_in - start.1);
                if gain - work <= GAIN * (start.0 + work.abs()) || halvings == MOST_SPIN_HALVINGS {
                    return self.carry_weightless(state, &inputs);
                }
                gained = true;
            } else {
                failed += 1;
            }
            state.copy_from(&course.before);
            if failed > MOST_HALVINGS {
                break;
            }
        }
        report.outcome = Outcome::Held;
    }

    fn be_careful(&mut self, careful: bool) {
        self.careful = careful;
    }

    fn accelerate(
        &mut self,
        team: &mut Team,
        state: &State,
        inputs: &StepInputs<'_>,
        acceleration: &mut [Vector3<f64>],
    ) {
        let Self { step, stiffness, mass_f32, material, pcg, .. } = self;
        let inertia = Inertia::Euler;
        let (solves, conserves) = (1, false);
        let inputs =
            LinearInputs { step: *inputs, mass_f32, material, solver: *pcg, inertia, solves, conserves };
        step.accelerate(team, &mut **stiffness, state, &inputs, acceleration);
    }

    fn elastic_energy(&mut self, team: &mut Team, state: &State, points: &dyn Points) -> f64 {
        let (material, x) = (&self.material, &state.x);
        let with = ElasticUpdate { lame: material.lame(), law: material.law, scale: 1.0 };
        self.stiffness.energy(team, &with, x).unwrap_or_else(|| points.energy(material, x))
    }

    fn rounding_energy(&self, mass: &[f64]) -> f64 {
        let Material { young_pa, density_kg_m3, .. } = self.material;
        young_pa * ROUNDED_STRAIN.powi(2) * mass.iter().sum::<f64>() / density_kg_m3
    }

    fn set_material(&mut self, material: Material) {
        self.material = material;
    }

    fn set_solver(&mut self, settings: SolverSettings) {
        (self.solves, self.pcg) = settings.linear;
        self.method = settings.method;
        self.step.set_method(self.method);
        self.relaxes = settings.relaxation.is_some();
    }

    fn follow_cut(&mut self, team: &mut Team, space: &dyn Space) -> Result<(), ModelError> {
        let Self { step, stiffness, .. } = self;
        let mut follow = || space.follow_stiffness(&mut **stiffness);
        let is_multigrid = self.method.is_multigrid();
        self.levels_follow = match space.octree().and_then(OctreeSpace::last_cut).filter(|_| is_multigrid) {
            Some(cut) => step.follow_cut(team, cut, &mut follow),
            None => {
                follow();
                false
            }
        };
        Ok(())
    }

    /// The pieces are arranged anew, without rotations.
    fn rebuild(&mut self, space: &dyn Space) -> Result<(), ModelError> {
        let choice = self.stiffness.choice();
        if let Some(stiffness) = space.stiffness(self.simd) {
            self.stiffness = stiffness;
        }
        self.stiffness.set_choice(choice);
        (self.levels_follow, self.limited) = (false, false);
        Ok(())
    }

    fn follow_masses(&mut self, space: &dyn Space, mass: &[f64]) {
        refill(&mut self.mass_f32, mass.iter().map(|&m| m as f32));
        self.weightless = find_weightless(space, mass);
        self.follow_copies(space, mass.len());
    }

    fn reweigh(&mut self, space: &dyn Space, density_kg_m3: f64, mass: &mut Vec<f64>) -> bool {
        let Some(copies) = space.reweighed().filter(|_| self.weightless.is_empty()) else { return false };
        let volumes = space.copy_volumes();
        resize_reserving(mass, volumes.len(), 0.0);
        resize_reserving(&mut self.mass_f32, volumes.len(), 0.0);
        for copy in copies.iter().map(|&copy| copy as usize) {
            mass[copy] = density_kg_m3 * volumes[copy];
            self.mass_f32[copy] = mass[copy] as f32;
        }
        if copies.iter().any(|&copy| mass[copy as usize] <= WEIGHTLESS) {
            return false;
        }
        self.follow_copies(space, mass.len());
        true
    }

    fn lumped_masses(&self, space: &dyn Space, density_kg_m3: f64, mass: &mut Vec<f64>) {
        refill(mass, space.copy_masses(density_kg_m3).into_iter());
    }

    fn stiff_motions(&self) -> [usize; 3] {
        self.step.stiff_motions()
    }

    fn levels(&self) -> Option<(Vec<LevelReport>, CoarsestSolve)> {
        self.step.levels()
    }

    fn can_step_together(&self) -> bool {
        self.scheme != Scheme::Static && self.material.law.is_hookean() && self.step.can_be_shared()
    }

    fn member<'a>(
        &'a mut self,
        team: &'a mut Team,
        (course, state): (&mut Course, &'a mut State),
        inputs: StepInputs<'a>,
        spring_forces: &'a mut [Vector3<f64>],
    ) -> Option<Member<'a>> {
        if !self.can_step_together() {
            return None;
        }
        let _ = course.spin.limit(state, inputs.mass, inputs.parts, (inputs.h, LARGEST_TURN));
        let Self { step, stiffness, mass_f32, material, pcg, .. } = self;
        let inputs = LinearInputs {
            step: inputs,
            mass_f32,
            material,
            solver: *pcg,
            inertia: Inertia::Euler,
            solves: 1,
            conserves: false,
        };
        Some(Member {
            step,
            team,
            elastic: &mut **stiffness,
            state,
            inputs,
            spring_forces,
            inverted_pieces: 0,
        })
    }

    fn carry_weightless(&self, state: &mut State, inputs: &StepInputs<'_>) {
        let rest = |c: u32| inputs.rest[c as usize];
        for Weightless { copy, piece } in &self.weightless {
            let (mut moved, mut v, mut hosts) = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for &host in piece.iter().filter(|&&c| inputs.mass[c as usize] > WEIGHTLESS) {
                moved += state.x[host as usize] - rest(host);
                v += state.v[host as usize];
                hosts += 1.0;
            }
            let fixed = inputs.fixed.binary_search_by_key(copy, |f| f.copy).is_ok();
            if hosts > 0.0 && !fixed {
                state.x[*copy as usize] = rest(*copy) + moved / hosts;
                state.v[*copy as usize] = v / hosts;
            }
        }
    }

    fn stiffness_mut(&mut self) -> Option<&mut dyn Stiffness> {
        Some(&mut *self.stiffness)
    }
}

fn find_weightless(space: &dyn Space, mass: &[f64]) -> Vec<Weightless> {
    if mass.iter().all(|&m| m > WEIGHTLESS) {
        return Vec::new();
    }
    let mut found: Vec<Weightless> = Vec::new();
    space.for_groups(&mut |piece| {
        for &copy in piece {
            if mass[copy as usize] <= WEIGHTLESS && found.iter().all(|w| w.copy != copy) {
                found.push(Weightless { copy, piece: piece.into() });
            }
        }
    });
    found
}
