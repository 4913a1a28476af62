//! One body: what the world holds, steps, cuts, loads and measures.

mod ablation;
mod boundary;
mod cost;
mod cutting;
mod error;
mod fast;
mod general;
mod held_energy;
mod measures;
mod precision;
mod range;
mod settings;
mod shape;
mod sleep;
mod snapping;
mod statics;
mod topology;
mod undo;

#[doc(hidden)]
pub use ablation::Ablation;
pub use boundary::FixedNode;
pub use error::BodyError;
pub use measures::StiffMotions;
pub use settings::{Arithmetic, BodySettings};
pub use snapping::{CuttingMethod, LooseRule};
pub use statics::{StaticReport, StaticSettings};
pub use undo::BodyTopology;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

pub use crate::assembly::{ElementKind, Volumetric};
use crate::cut::{CutMesh, IncisionMark, Surface};
use crate::element::Simd;
use crate::integrator::{DynamicsInputs, Inertia, LocalConnectivity, LooseParts, State, StepInputs};
pub use crate::integrator::{MassKind, Notice, PointSpring, Scheme, SpringKind};
use crate::material::{Material, Rayleigh};
use crate::mesh::{HexMesh, Tet10Mesh, TetMesh};
use crate::operator::FixedCopy;
pub use crate::operator::OperatorChoice;
use crate::reserve::{refill, resize_reserving};
use crate::skin::{Skin, SkinSettings, SkinShape};
use crate::snap::Snapper;
pub use crate::solver::{Method, PcgSettings, StopReason};
use crate::team::Team;
use boundary::Boundary;
use cutting::CutUnderWay;
use fast::Fast;
use general::General;
use precision::too_flat_for_single;
use range::{Beyond, Range};
use shape::Shape;
use snapping::SnapState;

/// Result of one step of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolveReport {
    /// Solver iterations, summed over all parts of the step.
    pub iterations: u32,
    /// √(rᵀM⁻¹r) relative to the right-hand side, in the worst part of the step; that of Newton's method
    /// if the step is nonlinear.
    pub residual: f64,
    /// Value that `residual` has to reach; 0 if nothing is solved, as in explicit integrators.
    pub tolerance: f64,
    /// Why the last linear or Newton solve stopped.
    pub stop: StopReason,
    /// Whether the body advanced, and if not, why.
    pub outcome: Outcome,
    /// Number of equal parts into which the step was divided.
    pub substeps: u32,
    /// Pieces with det F ≤ 0; on the general path, quadrature points.
    pub inverted_pieces: usize,
    /// Springs left out because one of their numbers is unusable.
    pub refused_springs: usize,
    /// Newton steps; 1 if the step is one linear solve, 0 for explicit integrators.
    pub newton_steps: u32,
    /// Halvings of the step length in all line searches.
    pub backtracks: u32,
    /// Estimated algebraic error of the last linear solve in the energy norm [√J]; 0 without an estimate.
    pub algebraic_error: f64,
    /// What the step did differently from what was requested.
    pub notice: Option<Notice>,
}

impl SolveReport {
    /// Whether the body advanced by a step whose residual is above its tolerance. The residual is
    /// √(rᵀM⁻¹r) over that of the loads on every path: after the linear solve if a step is one by design,
    /// after Newton's method otherwise.
    pub fn is_unconverged(&self) -> bool {
        self.outcome == Outcome::Advanced && self.tolerance > 0.0 && self.residual > self.tolerance
    }

    /// Whether the step failed as a whole and was made in parts. Sub-steps that an explicit integrator
    /// plans do not count.
    pub fn is_divided(&self) -> bool {
        let planned = matches!(self.notice, Some(Notice::Divided { .. }));
        self.outcome == Outcome::Advanced && self.substeps > 1 && !planned
    }
}

/// How a step ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// The body advanced by the whole step.
    #[default]
    Advanced,
    /// The body is where it was, and at rest. No subdivision stayed finite, or a part was drawn out far
    /// beyond its size; the notice says which.
    Held,
    /// The stop flag was raised; the body is as it was before the step.
    Interrupted,
    /// The step length or the gravity is unusable, or there is no equilibrium; nothing was changed.
    Refused,
}

/// Material constants that may change while a body moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Young's modulus E [Pa].
    pub young_pa: f64,
    /// Poisson's ratio ν.
    pub poisson: f64,
    /// Damping D = α M + β K̂.
    pub rayleigh: Rayleigh,
}

/// A deformable, cuttable body.
#[derive(Debug)]
pub struct Body {
    cut_mesh: CutMesh,
    skin: Option<Skin>,
    shape: Shape,
    /// Rest position of every node [m]: copies first, then the nodes that the element adds.
    rest: Vec<Vector3<f64>>,
    material: Material,
    settings: BodySettings,
    state: State,
    boundary: Boundary,
    fixed: Vec<FixedCopy>,
    /// Share of the prescribed displacements that is applied now, 1 at first.
    prescribed_share: f64,
    /// Copies of parts that were put to sleep, ascending; they are among `fixed` too.
    asleep: Vec<FixedCopy>,
    load: Vec<Vector3<f64>>,
    mass: Vec<f64>,
    /// The copy that each copy was split from; itself if it was there from the start.
    split_from: Vec<u32>,
    parts: LooseParts,
    connectivity: LocalConnectivity,
    range: Range,
    path: Path,
    team: Team,
    spring_forces: Vec<Vector3<f64>>,
    /// State of cutting along faces; `None` for other bodies.
    snap: Option<Box<SnapState>>,
    under_way: Option<CutUnderWay>,
}

/// The two ways to compute a step.
#[derive(Debug)]
enum Path {
    Fast(Box<Fast>),
    General(Box<General>),
}

impl Body {
    /// A body at rest in the configuration of `mesh`, made of linear or quadratic tetrahedra as
    /// `settings` request.
    pub fn new(mesh: TetMesh, material: Material, settings: BodySettings) -> Result<Self, BodyError> {
        let shape = match settings.element {
            ElementKind::Tet4 => Shape::Tet4,
            ElementKind::Tet10 => {
                mesh.check()?;
                Shape::Tet10(Tet10Mesh::new(&mesh))
            }
            ElementKind::Hex8 => {
                let (what, with) = ("element hex8", "a mesh of tetrahedra");
                return Err(BodyError::Combination { what, with, instead: "tet4 or tet10" });
            }
        };
        let mesh = match settings.cutting {
            CuttingMethod::Xfem => mesh,
            CuttingMethod::Snap => {
                mesh.check()?;
                Snapper::prepared(&mesh)
            }
        };
        Self::with_shape(CutMesh::new(mesh)?, shape, material, settings)
    }

    /// A body of trilinear hexahedra at rest in the configuration of `mesh`. Its surface is that of the
    /// tetrahedra each hexahedron is split into, on the same nodes.
    pub fn hex8(mesh: HexMesh, material: Material, settings: BodySettings) -> Result<Self, BodyError> {
        mesh.check()?;
        let settings = BodySettings { element: ElementKind::Hex8, ..settings };
        Self::with_shape(CutMesh::new(mesh.to_tets())?, Shape::Hex8(mesh), material, settings)
    }

    fn with_shape(
        cut_mesh: CutMesh,
        shape: Shape,
        material: Material,
        settings: BodySettings,
    ) -> Result<Self, BodyError> {
        material.check()?;
        settings.check(material.law)?;
        settings.scheme.check()?;
        let mut settings = settings;
        // Single precision is a default, so it yields where flat elements would turn forces into noise.
        if settings.arithmetic.is_none()
            && settings.arithmetic(material.law) == Arithmetic::Single
            && too_flat_for_single(cut_mesh.mesh())
        {
            settings.arithmetic = Some(Arithmetic::Mixed);
        }
        let mut cut_mesh = cut_mesh;
        cut_mesh.set_exact(!settings.ablation.exact_predicates);
        let path = if settings.arithmetic(material.law) == Arithmetic::Single {
            let simd = if settings.portable { Simd::Baseline } else { Simd::detect() };
            let mut fast = Fast::new(simd, &cut_mesh, settings.scheme, settings.ablation.predictor);
            fast.elastic.set_choice(settings.operator(material.law, cut_mesh.pieces().len()));
            Path::Fast(Box::new(fast))
        } else {
            Path::General(Box::new(General::new(&shape, &cut_mesh, &material, &settings)?))
        };
        let snap = settings.cutting == CuttingMethod::Snap;
        let mut body = Self {
            snap: snap.then(|| Box::new(SnapState::new(cut_mesh.mesh()))),
            rest: Vec::new(),
            state: State::default(),
            boundary: Boundary::default(),
            fixed: Vec::new(),
            prescribed_share: 1.0,
            asleep: Vec::new(),
            load: Vec::new(),
            mass: Vec::new(),
            split_from: Vec::new(),
            parts: LooseParts::default(),
            connectivity: LocalConnectivity::with_capacity(cut_mesh.n_copies()),
            range: Range::default(),
            team: Team::new(settings.threads).map_err(BodyError::Threads)?,
            spring_forces: Vec::new(),
            under_way: None,
            skin: None,
            cut_mesh,
            shape,
            material,
            settings,
            path,
        };
        body.return_to_rest();
        body.follow_topology();
        Ok(body)
    }

    /// Advances by `dt_s` under gravity [m/s²], loads, constraints and springs.
    ///
    /// The state stays finite whatever happens. A step that does not stay finite is taken back and tried
    /// again in smaller parts; if these fail too it is given up and reported. A step that draws a part of
    /// the body out to many times its size is also taken back and reported.
    pub fn step(&mut self, dt_s: f64, gravity: Vector3<f64>, springs: &[PointSpring]) -> SolveReport {
        let usable = dt_s > 0.0 && dt_s.is_finite() && gravity.iter().all(|g| g.abs() < 1e12);
        if !usable {
            self.spring_forces.clear();
            self.spring_forces.resize(springs.len(), Vector3::zeros());
            return SolveReport { outcome: Outcome::Refused, ..SolveReport::default() };
        }
        let mut report = self.advance(dt_s, gravity, springs);
        if let Some(Notice::Pivot { displacement }) = &mut report.notice {
            let (copy, axis) = (*displacement / 3, *displacement % 3);
            let node = self.cut_mesh.copy_node().get(copy as usize).copied().unwrap_or(copy);
            *displacement = 3 * node + axis;
        }
        if report.outcome == Outcome::Advanced {
            self.hold_within_range(&mut report);
        }
        report
    }

    /// Makes the step on the path of this body.
    fn advance(&mut self, dt_s: f64, gravity: Vector3<f64>, springs: &[PointSpring]) -> SolveReport {
        let Self { cut_mesh, team, state, spring_forces, load, fixed, mass, parts, rest, .. } = self;
        let report = match &mut self.path {
            Path::Fast(fast) => {
                let inputs = StepInputs {
                    h: dt_s,
                    gravity,
                    mass,
                    mass_f32: &[],
                    load,
                    fixed,
                    parts,
                    springs,
                    material: &self.material,
                    solver: self.settings.solver(self.material.law),
                    inertia: match self.settings.scheme {
                        Scheme::Static => Inertia::None { mesh: cut_mesh, relax: self.settings.relaxation },
                        _ => Inertia::Euler,
                    },
                    solves: self.settings.solves(self.material.law),
                };
                fast.step(team, cut_mesh, state, &inputs, (rest, spring_forces))
            }
            Path::General(general) => {
                let inputs = DynamicsInputs { h: dt_s, gravity, load, fixed, springs };
                general.step(team, state, &inputs, spring_forces)
            }
        };
        let solves = !self.settings.scheme.is_explicit();
        let tolerance = if solves { self.settings.solver.tolerance } else { 0.0 };
        SolveReport { tolerance, ..report }
    }

    /// Takes a step back that drew a part of the body out of any sensible range.
    fn hold_within_range(&mut self, report: &mut SolveReport) {
        let before = match &self.path {
            Path::Fast(fast) => fast.before(),
            Path::General(general) => general.before(),
        };
        let Some(Beyond { stretch, size_m }) = self.range.beyond(&before.x, &self.state.x, &self.parts)
        else {
            return;
        };
        self.state.x.copy_from_slice(&before.x);
        self.state.v.fill(Vector3::zeros());
        self.spring_forces.fill(Vector3::zeros());
        if let Path::General(general) = &mut self.path {
            general.dynamics.restart();
        }
        report.outcome = Outcome::Held;
        report.notice = Some(Notice::OutOfRange { stretch, size_m });
    }

    /// Sets a flag that ends steps and static solves under way when it is raised; the body then stays as
    /// it was.
    pub fn set_stop_flag(&mut self, flag: Arc<AtomicBool>) {
        self.team.set_stop_flag(flag);
    }

    /// Force on the body [N] of every spring of the last step, in the order given, from the same solve.
    pub fn spring_forces(&self) -> &[Vector3<f64>] {
        &self.spring_forces
    }

    /// Whether the body takes the fast path: single precision, matrix-free.
    pub fn is_fast(&self) -> bool {
        matches!(self.path, Path::Fast(_))
    }

    /// Rest position of every node [m]: copies, then the nodes that quadratic elements add.
    pub fn rest_positions(&self) -> &[Vector3<f64>] {
        &self.rest
    }

    /// Nodes and shape functions (Σ = 1) of the point with barycentric coordinates `weights` in tet `tet`
    /// of the mesh, whose piece is on `copies`.
    pub fn carriers(&self, tet: u32, copies: [u32; 4], weights: [f64; 4]) -> Vec<(u32, f64)> {
        self.shape.carriers(tet, copies, weights)
    }

    /// Position of every node [m], in the order of [`rest_positions`](Self::rest_positions).
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.state.x
    }

    /// Velocity of every node [m/s].
    pub fn velocities(&self) -> &[Vector3<f64>] {
        &self.state.v
    }

    /// Lumped mass of every node [kg].
    pub fn masses(&self) -> &[f64] {
        &self.mass
    }

    /// Puts a skin finer than the elements on the uncut body; see [`Skin::new`].
    pub fn put_on_skin(
        &mut self,
        settings: SkinSettings,
        shape: &mut SkinShape<'_>,
    ) -> Result<(), BodyError> {
        if self.snap.is_some() {
            let with = "cutting along element faces";
            return Err(BodyError::Combination { what: "a skin", with, instead: "cutting method xfem" });
        }
        if self.shape.kind() == ElementKind::Tet4 {
            self.skin = Some(Skin::new(&self.cut_mesh, settings, shape)?);
            return Ok(());
        }
        let with = if self.shape.kind() == ElementKind::Tet10 { "element tet10" } else { "element hex8" };
        Err(BodyError::Combination { what: "a skin", with, instead: "tet4" })
    }

    /// The skin, if the body has one.
    pub fn skin(&self) -> Option<&Skin> {
        self.skin.as_ref()
    }

    /// See [`Skin::spoil`].
    #[doc(hidden)]
    pub fn spoil_skin(&mut self) {
        self.skin.iter_mut().for_each(Skin::spoil);
    }

    /// The surface that is shown and touched, closed and 2-manifold. It consists of the skin, or without
    /// one the boundary of the elements, and of the lips of cuts. It changes only when the
    /// [`epoch`](Self::epoch) does.
    pub fn surface(&self) -> &Surface {
        self.skin.as_ref().map_or(self.cut_mesh.surface(), Skin::surface)
    }

    /// Lines that incisions have drawn on the [`surface`](Self::surface) without opening it yet. They may
    /// change with every cut, even one that leaves the topology alone.
    pub fn incision_marks(&self) -> Vec<IncisionMark> {
        match &self.skin {
            Some(skin) => skin.incision_marks(&self.cut_mesh),
            None => self.cut_mesh.incision_marks(),
        }
    }

    /// Material with its present constants; see [`set_constants`](Self::set_constants).
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Settings the body was made with, and later changes to solver and operator.
    pub fn settings(&self) -> &BodySettings {
        &self.settings
    }

    /// Changes when the solver stops, from the next step on.
    pub fn set_solver(&mut self, solver: PcgSettings) -> Result<(), BodyError> {
        // The path is chosen when the body is made, so the arithmetic stays.
        let arithmetic = Some(self.settings.arithmetic(self.material.law));
        let settings = BodySettings { solver, ..self.settings };
        BodySettings { arithmetic, ..settings }.check(self.material.law)?;
        self.settings = settings;
        if let Path::General(general) = &mut self.path {
            let newton = BodySettings { arithmetic, ..settings }.newton(self.material.law);
            general.dynamics.set_solver(newton, settings.relaxation_iterations());
        }
        Ok(())
    }

    /// Changes elastic constants and damping, from the next step on. Positions and velocities stay. A
    /// call with the present constants changes nothing.
    ///
    /// # Errors
    /// A constant outside its range ([`Material::check`]); the body is then as it was.
    pub fn set_constants(&mut self, constants: Constants) -> Result<(), BodyError> {
        let Constants { young_pa, poisson, rayleigh } = constants;
        let material = Material { young_pa, poisson, rayleigh, ..self.material };
        material.check()?;
        if material == self.material {
            return Ok(());
        }
        self.material = material;
        match &mut self.path {
            // The fast path receives its constants with every step.
            Path::Fast(fast) => fast.forget_energy(),
            Path::General(general) => general.dynamics.set_material(material),
        }
        Ok(())
    }

    /// Chooses how the stiffness is applied from the next step on; results agree to single precision.
    /// [`OperatorChoice::Auto`] takes the cheaper way. Returns `false`, and changes nothing, if the body
    /// takes the general path, which always assembles.
    pub fn set_operator(&mut self, choice: OperatorChoice) -> bool {
        match &mut self.path {
            Path::Fast(fast) => {
                self.settings.operator = choice;
                let pieces = self.cut_mesh.pieces().len();
                fast.elastic.set_choice(self.settings.operator(self.material.law, pieces));
                true
            }
            Path::General(_) => false,
        }
    }

    /// Connected parts of the body, by copy.
    pub fn parts(&self) -> &LooseParts {
        &self.parts
    }

    /// Replaces positions [m] and velocities [m/s] of all nodes.
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

    /// Returns the body to its start: uncut, undeformed, at rest. Constraints and loads stay, and the
    /// epoch rises. A cut under way is dropped.
    pub fn reset(&mut self) -> Result<(), BodyError> {
        self.asleep.clear();
        self.under_way = None;
        if self.snap.is_some() {
            return self.snap_reset();
        }
        self.cut_mesh.reset()?;
        if let Some(skin) = &mut self.skin {
            skin.follow(&self.cut_mesh);
        }
        self.return_to_rest();
        match &mut self.path {
            Path::Fast(fast) => fast.rebuild(&self.cut_mesh),
            Path::General(_) => self.rebuild_general()?,
        }
        self.follow_topology();
        Ok(())
    }

    fn return_to_rest(&mut self) {
        refill(&mut self.rest, self.shape.rest_positions(&self.cut_mesh).into_iter());
        refill(&mut self.split_from, 0..self.cut_mesh.n_copies() as u32);
        refill(&mut self.state.x, self.rest.iter().copied());
        self.state.v.fill(Vector3::zeros());
        resize_reserving(&mut self.state.v, self.rest.len(), Vector3::zeros());
        self.spring_forces.clear();
    }
}
