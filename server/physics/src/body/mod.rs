//! One body: what the world holds, steps, cuts, loads and measures.

mod boundary;
mod cutting;
mod error;
mod measures;
mod statics;

pub use boundary::FixedNode;
pub use error::BodyError;
pub use statics::{StaticReport, StaticSettings};

use nalgebra::Vector3;

use crate::cut::CutMesh;
use crate::element::Simd;
use crate::integrator::{ImplicitEuler, LooseParts, State, StepInputs, StepOutcome};
pub use crate::integrator::{PointSpring, SpringKind};
use crate::material::Material;
use crate::mesh::TetMesh;
use crate::operator::{Elastic, FixedCopy};
pub use crate::solver::{PcgSettings, StopReason};
use crate::team::Team;
use boundary::Boundary;
use cutting::Weightless;

/// A step that fails is tried again in 2 and then in 4 parts.
const MOST_HALVINGS: u32 = 2;

/// How a body is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySettings {
    /// When the linear solver stops.
    pub solver: PcgSettings,
    /// Number of threads that work on a step, the caller's included; at least 1, at most 64.
    pub threads: usize,
    /// Use only instructions that every machine has, for the same bits everywhere.
    pub portable: bool,
}

impl Default for BodySettings {
    fn default() -> Self {
        Self { solver: PcgSettings { iterations: 50, tolerance: 1e-3 }, threads: 1, portable: false }
    }
}

/// How a step of a body went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolveReport {
    /// Solver iterations, all parts of the step together.
    pub iterations: u32,
    /// √(rᵀM⁻¹r) relative to the right-hand side, worst part of the step.
    pub residual: f64,
    /// Why the solver stopped last.
    pub stop: StopReason,
    /// What became of the step.
    pub outcome: Outcome,
    /// Into how many equal parts the step was divided.
    pub substeps: u32,
    /// Pieces with det F ≤ 0.
    pub inverted_pieces: usize,
    /// Springs that were left out because a number in them is not usable.
    pub refused_springs: usize,
}

/// What became of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// The body advanced by the whole step.
    #[default]
    Advanced,
    /// No subdivision stayed finite: the body is where it was, and at rest.
    Held,
    /// The step length or the gravity is not usable; nothing was changed.
    Refused,
}

/// A deformable, cuttable body.
#[derive(Debug)]
pub struct Body {
    cut_mesh: CutMesh,
    material: Material,
    settings: BodySettings,
    simd: Simd,
    state: State,
    boundary: Boundary,
    fixed: Vec<FixedCopy>,
    load: Vec<Vector3<f64>>,
    mass: Vec<f64>,
    mass_f32: Vec<f32>,
    parts: LooseParts,
    weightless: Vec<Weightless>,
    elastic: Elastic,
    integrator: ImplicitEuler,
    team: Team,
    spring_forces: Vec<Vector3<f64>>,
    before: State,
}

impl Body {
    /// A body at rest in the configuration of `mesh`.
    pub fn new(mesh: TetMesh, material: Material, settings: BodySettings) -> Result<Self, BodyError> {
        material.check()?;
        settings.check()?;
        let cut_mesh = CutMesh::new(mesh)?;
        let simd = if settings.portable { Simd::Baseline } else { Simd::detect() };
        let elastic = Elastic::new(simd, cut_mesh.mesh(), cut_mesh.pieces(), cut_mesh.n_copies());
        let mut body = Self {
            state: State::default(),
            boundary: Boundary::default(),
            fixed: Vec::new(),
            load: Vec::new(),
            mass: Vec::new(),
            mass_f32: Vec::new(),
            parts: LooseParts::default(),
            weightless: Vec::new(),
            integrator: ImplicitEuler::default(),
            team: Team::new(settings.threads).map_err(BodyError::Threads)?,
            spring_forces: Vec::new(),
            before: State::default(),
            cut_mesh,
            material,
            settings,
            simd,
            elastic,
        };
        body.return_to_rest();
        body.follow_topology();
        Ok(body)
    }

    /// Advances by `dt_s` with implicit Euler under gravity [m/s²], loads, constraints and springs.
    ///
    /// The state stays finite whatever happens: a step that does not is taken back and tried again
    /// in smaller parts, then given up and reported.
    pub fn step(&mut self, dt_s: f64, gravity: Vector3<f64>, springs: &[PointSpring]) -> SolveReport {
        let usable = dt_s > 0.0 && dt_s.is_finite() && gravity.iter().all(|g| g.abs() < 1e12);
        if !usable {
            self.hold_forces(springs.len());
            return SolveReport { outcome: Outcome::Refused, ..SolveReport::default() };
        }
        self.before.copy_from(&self.state);
        let mut report = SolveReport::default();
        for halvings in 0..=MOST_HALVINGS {
            report.substeps = 1 << halvings;
            if self.try_step(dt_s / f64::from(report.substeps), gravity, springs, &mut report) {
                self.carry_weightless();
                return report;
            }
            self.state.copy_from(&self.before);
        }
        self.state.v.fill(Vector3::zeros());
        self.hold_forces(springs.len());
        SolveReport { outcome: Outcome::Held, ..report }
    }

    /// Makes all parts of a step; `false` as soon as one does not stay finite.
    fn try_step(
        &mut self,
        h: f64,
        gravity: Vector3<f64>,
        springs: &[PointSpring],
        report: &mut SolveReport,
    ) -> bool {
        report.residual = 0.0;
        for _ in 0..report.substeps {
            let inputs = StepInputs {
                h,
                gravity,
                mass: &self.mass,
                mass_f32: &self.mass_f32,
                load: &self.load,
                fixed: &self.fixed,
                parts: &self.parts,
                springs,
                material: &self.material,
                solver: self.settings.solver,
            };
            let Self { team, elastic, state, spring_forces, .. } = self;
            let StepOutcome { solve, inverted_pieces, refused_springs, finite } =
                self.integrator.step(team, elastic, state, &inputs, spring_forces);
            report.iterations += solve.iterations;
            report.residual = report.residual.max(solve.residual);
            report.stop = solve.stop;
            report.inverted_pieces = inverted_pieces;
            report.refused_springs = refused_springs;
            if !finite {
                return false;
            }
        }
        true
    }

    fn hold_forces(&mut self, n_springs: usize) {
        self.spring_forces.clear();
        self.spring_forces.resize(n_springs, Vector3::zeros());
    }

    /// Force on the body [N] of every spring of the last step, in its order, from the same solve.
    pub fn spring_forces(&self) -> &[Vector3<f64>] {
        &self.spring_forces
    }

    /// Position of every copy [m].
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.state.x
    }

    /// Velocity of every copy [m/s].
    pub fn velocities(&self) -> &[Vector3<f64>] {
        &self.state.v
    }

    /// Mass of every copy [kg].
    pub fn masses(&self) -> &[f64] {
        &self.mass
    }

    /// Mesh, pieces, copies and surface.
    pub fn cut_mesh(&self) -> &CutMesh {
        &self.cut_mesh
    }

    /// Material constants.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Settings of the solver.
    pub fn settings(&self) -> &BodySettings {
        &self.settings
    }

    /// Changes when the linear solver stops, from the next step on.
    pub fn set_solver(&mut self, solver: PcgSettings) -> Result<(), BodyError> {
        let settings = BodySettings { solver, ..self.settings };
        settings.check()?;
        self.settings = settings;
        Ok(())
    }

    /// Connected parts of the body, by copy.
    pub fn parts(&self) -> &LooseParts {
        &self.parts
    }

    /// Replaces positions [m] and velocities [m/s] of all copies.
    pub fn set_state(&mut self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Result<(), BodyError> {
        let expected = self.state.x.len();
        for found in [x.len(), v.len()] {
            if found != expected {
                return Err(BodyError::StateLength { found, expected });
            }
        }
        if let Some(copy) = (0..expected).find(|&c| !x[c].iter().chain(v[c].iter()).all(|s| s.abs() < 1e12)) {
            return Err(BodyError::StateValue { copy });
        }
        self.state.x.copy_from_slice(x);
        self.state.v.copy_from_slice(v);
        Ok(())
    }

    /// Back to the start: uncut, undeformed, at rest. Constraints and loads stay; the epoch rises.
    pub fn reset(&mut self) -> Result<(), BodyError> {
        self.cut_mesh.reset()?;
        self.return_to_rest();
        self.rebuild_elastic();
        self.follow_topology();
        Ok(())
    }

    fn return_to_rest(&mut self) {
        self.state.x = self.cut_mesh.rest_positions();
        self.state.v = vec![Vector3::zeros(); self.state.x.len()];
        self.spring_forces.clear();
    }
}

impl BodySettings {
    /// Tells whether every setting is in its range.
    pub fn check(&self) -> Result<(), BodyError> {
        let setting = |name, found: f64, allowed| Err(BodyError::Setting { name, found, allowed });
        if !(1..=64).contains(&self.threads) {
            return setting("threads", self.threads as f64, "1 … 64");
        }
        if !(1..=1_000_000).contains(&self.solver.iterations) {
            return setting("solver.iterations", f64::from(self.solver.iterations), "1 … 1 000 000");
        }
        if !(0.0..1.0).contains(&self.solver.tolerance) {
            return setting("solver.tolerance", self.solver.tolerance, "0 ≤ tolerance < 1");
        }
        Ok(())
    }
}
