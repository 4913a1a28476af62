//! One body: what the world holds, steps, cuts, loads and measures.

mod adapting;
mod boundary;
mod cost;
mod cutting;
mod error;
pub mod estimate;
mod measures;
mod phases;
mod precision;
mod pressing;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod pressing_tests;
mod range;
mod settings;
mod sleep;
mod snapping;
mod statics;
mod together;
mod topology;
mod undo;
mod viscoelastic;

#[doc(hidden)]
pub use crate::integrator::Ablation;
pub use adapting::AdaptReport;
pub use boundary::FixedNode;
pub use error::BodyError;
pub use measures::StiffMotions;
pub use settings::{Arithmetic, BodySettings};
pub use snapping::{CuttingMethod, LooseRule};
pub use statics::{StaticReport, StaticSettings};
pub use together::Group;
pub use undo::BodyTopology;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use crate::integrator::{
    Dynamics, LinearlyImplicit, LocalConnectivity, LooseParts, ModelSolver, State, StepInputs, StepSolver,
};
pub use crate::integrator::{
    MassKind, Notice, Outcome, PairSpring, PointSpring, Scheme, SolveReport, SpringKind,
};
use crate::space::{Space, Tets};
use boundary::Boundary;
use precision::too_flat_for_single;
use range::{Beyond, Range};
use scindo_algebra::assembly::Model;
pub use scindo_algebra::assembly::Volumetric;
use scindo_algebra::assembly::pressure::Pressure;
pub use scindo_algebra::operator::OperatorChoice;
pub use scindo_algebra::solver::multigrid::CycleShape;
pub use scindo_algebra::solver::{Method, PcgSettings, StopReason};
pub use scindo_matter::cut::FrontRule;
use scindo_matter::cut::remesh::Snapper;
use scindo_matter::cut::{CutMesh, IncisionMark, Surface};
pub use scindo_matter::element::ElementKind;
use scindo_matter::element::FixedCopy;
use scindo_matter::material::{Material, Rayleigh, Regions};
use scindo_matter::mesh::{HexMesh, TetMesh};
use scindo_matter::skin::{Kept, OwnSurface, Skin, SkinSettings, SkinShape};
use scindo_matter::storage::reserve::{refill, resize_reserving};
use scindo_matter::team::Team;
use scindo_matter::team::phase::Phase;
use snapping::{FaceCut, SnapState};

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
///
/// ```
/// use nalgebra::Vector3;
/// use scindo_physics::body::{Body, BodySettings, Outcome};
/// use scindo_physics::material::{Law, Material, Rayleigh};
/// use scindo_physics::mesh::{BoxPattern, box_mesh};
///
/// let size = Vector3::new(0.2, 0.05, 0.05); // m
/// let mesh = box_mesh(Vector3::zeros(), size, [8, 2, 2], BoxPattern::Tet6);
/// let (law, rayleigh) = (Law::Corotational, Rayleigh::default());
/// let material = Material { young_pa: 1e5, poisson: 0.4, density_kg_m3: 1e3, rayleigh, law };
/// let mut body = Body::new(mesh, material, BodySettings::default())?;
///
/// // Held at its left end, it sags.
/// let left = (0..).zip(body.rest_positions()).filter(|(_, rest)| rest.x == 0.0);
/// let held: Vec<u32> = left.map(|(node, _)| node).collect();
/// body.fix(&held, [true; 3], Vector3::zeros())?;
/// let before = body.centre_of_mass();
/// let report = body.step(0.01, Vector3::new(0.0, 0.0, -9.81), &[]); // s, m/s²
/// assert_eq!(report.outcome, Outcome::Advanced);
/// assert!(body.centre_of_mass().z < before.z);
/// # Ok::<(), scindo_physics::body::BodyError>(())
/// ```
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Body {
    #[serde(with = "crate::space::saved_space")]
    space: Box<dyn Space>,
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
    /// Faces under pressure, as the body is cut now.
    pressure: Pressure,
    /// Scratch: predicted positions [m].
    #[serde(skip)]
    ahead: Vec<Vector3<f64>>,
    mass: Vec<f64>,
    /// The number that each copy and added node was split from; its own if it was there from the start.
    split_from: Vec<u32>,
    parts: LooseParts,
    connectivity: LocalConnectivity,
    range: Range,
    dynamics: Dynamics,
    #[serde(skip, default = "Team::alone")]
    team: Team,
    spring_forces: Vec<Vector3<f64>>,
    /// How often coarsening has given vertices new numbers.
    renumbered: u32,
    /// State of cuts that change the mesh; `None` for other bodies.
    snap: Option<Box<SnapState>>,
    /// A cut along faces that was begun and is not complete.
    under_way: Option<FaceCut>,
}

impl Body {
    /// A body at rest in the configuration of `mesh`, made of linear or quadratic tetrahedra as
    /// `settings` request.
    pub fn new(mesh: TetMesh, material: Material, settings: BodySettings) -> Result<Self, BodyError> {
        let mut tets = match (settings.element, settings.cutting) {
            (ElementKind::Tet4, CuttingMethod::Xfem) => Tets::linear(CutMesh::new(mesh)?),
            (ElementKind::Tet4, _) => {
                mesh.check()?;
                Tets::linear(CutMesh::new(Snapper::prepared(&mesh))?)
            }
            (ElementKind::Tet10, _) => Tets::quadratic(mesh)?,
            (ElementKind::Hex8 | ElementKind::Octree, _) => {
                let (what, with) = ("an element that is no tetrahedron", "a mesh of tetrahedra");
                return Err(BodyError::Combination { what, with, instead: "tet4 or tet10" });
            }
        };
        tets.set_exact(!settings.ablation.exact_predicates);
        tets.set_front_rule(settings.front);
        Self::at_rest(Box::new(tets), material, settings)
    }

    /// Likewise with regions of other materials, one entry of `regions` per tetrahedron of `mesh`.
    ///
    /// # Errors
    /// Regions of another number of elements. Cutting along faces, which replaces the elements, and node-averaged
    /// volume do not go with regions.
    pub fn with_regions(
        mesh: TetMesh,
        regions: Regions,
        material: Material,
        settings: BodySettings,
    ) -> Result<Self, BodyError> {
        if regions.is_empty() {
            return Self::new(mesh, material, settings);
        }
        let mut tets = match settings.element {
            ElementKind::Tet10 => Tets::quadratic(mesh)?,
            _ => Tets::linear(CutMesh::new(mesh)?),
        };
        tets.set_regions(regions)?;
        tets.set_exact(!settings.ablation.exact_predicates);
        tets.set_front_rule(settings.front);
        Self::of_space(Box::new(tets), material, settings)
    }

    /// A body of trilinear hexahedra at rest in the configuration of `mesh`. Its surface is that of the
    /// tetrahedra each hexahedron is split into, on the same nodes.
    pub fn hex8(mesh: HexMesh, material: Material, settings: BodySettings) -> Result<Self, BodyError> {
        Self::of_space(Box::new(Tets::hexahedra(mesh)?), material, settings)
    }

    /// A body at rest that is discretised by `space`, whose element takes the place of `settings.element`.
    ///
    /// # Errors
    /// Material or settings out of range or incompatible. Cutting along faces needs [`Body::new`], because it
    /// replaces the mesh.
    pub fn of_space(
        space: Box<dyn Space>,
        material: Material,
        settings: BodySettings,
    ) -> Result<Self, BodyError> {
        let settings = BodySettings { element: space.kind(), cubes: space.is_of_cubes(), ..settings };
        if settings.cutting.mesh_cut().is_some() && settings.element == ElementKind::Tet4 {
            let (what, with) = ("cutting that changes the mesh", "a discretisation that was made beforehand");
            return Err(BodyError::Combination {
                what,
                with,
                instead: "a mesh of tetrahedra, or cutting method xfem",
            });
        }
        Self::at_rest(space, material, settings)
    }

    fn at_rest(space: Box<dyn Space>, material: Material, settings: BodySettings) -> Result<Self, BodyError> {
        material.check()?;
        settings.check(material.law)?;
        let mut settings = settings;
        // Single precision is a default, so it yields where flat elements would turn forces into noise.
        if settings.arithmetic.is_none()
            && settings.arithmetic(material.law) == Arithmetic::Single
            && space.tets().is_some_and(|tets| too_flat_for_single(tets.mesh()))
        {
            settings.arithmetic = Some(Arithmetic::Mixed);
        }
        let solver = step_solver(&*space, &material, &settings)?;
        let dynamics = Dynamics::new(settings.scheme, material.law, solver)?;
        let snap = space.tets().zip(settings.cutting.mesh_cut());
        let mut body = Self {
            snap: snap.map(|(tets, how)| Box::new(SnapState::new(tets.mesh(), how, settings.snap))),
            rest: Vec::new(),
            state: State::default(),
            boundary: Boundary::default(),
            fixed: Vec::new(),
            prescribed_share: 1.0,
            asleep: Vec::new(),
            load: Vec::new(),
            pressure: Pressure::default(),
            ahead: Vec::new(),
            mass: Vec::new(),
            split_from: Vec::new(),
            parts: LooseParts::default(),
            connectivity: LocalConnectivity::with_capacity(space.n_copies()),
            range: Range::default(),
            team: Team::new(settings.threads).map_err(BodyError::Threads)?,
            spring_forces: Vec::new(),
            under_way: None,
            renumbered: 0,
            space,
            material,
            settings,
            dynamics,
        };
        body.return_to_rest();
        body.relax_viscous();
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
        self.team.begin(Phase::Guards);
        self.predict_pressure(dt_s);
        let mut report = self.advance(dt_s, gravity, springs);
        self.team.begin(Phase::Guards);
        if let Some(Notice::Pivot { displacement }) = &mut report.notice {
            let (copy, axis) = (*displacement / 3, *displacement % 3);
            *displacement = 3 * self.space.node_of(copy) + axis;
        }
        if report.outcome == Outcome::Advanced {
            self.hold_within_range(&mut report);
        }
        report
    }

    fn advance(&mut self, dt_s: f64, gravity: Vector3<f64>, springs: &[PointSpring]) -> SolveReport {
        let implicit = self.pressure_is_implicit();
        let Self { space, dynamics, team, state, spring_forces, load, fixed, mass, parts, rest, .. } = self;
        let points = &**space;
        let pressure = if implicit { &self.pressure } else { Pressure::none() };
        let inputs =
            StepInputs { h: dt_s, gravity, mass, load, pressure, fixed, parts, springs, rest, points };
        let report = dynamics.step(team, state, &inputs, spring_forces);
        let solves = !self.settings.scheme.is_explicit();
        let tolerance = if solves { self.settings.solver.tolerance } else { 0.0 };
        SolveReport { tolerance, ..report }
    }

    /// Takes a step back that drew a part of the body out of any sensible range.
    fn hold_within_range(&mut self, report: &mut SolveReport) {
        let before = self.dynamics.before();
        let Some(Beyond { stretch, size_m }) = self.range.beyond(&before.x, &self.state.x, &self.parts)
        else {
            return;
        };
        self.state.copy_from(before);
        self.state.v.fill(Vector3::zeros());
        self.spring_forces.fill(Vector3::zeros());
        self.dynamics.restart();
        self.dynamics.follow_viscous(&mut self.team, &self.state);
        report.outcome = Outcome::Held;
        report.notice = Some(Notice::OutOfRange { stretch, size_m });
    }

    /// Sets a flag that ends steps and static solves under way when it is raised; the body then stays as
    /// it was.
    pub fn set_stop_flag(&mut self, flag: Arc<AtomicBool>) {
        self.team.set_stop_flag(flag);
    }

    /// Works with `team` from now on, in place of threads of its own. A stop flag stays.
    pub fn set_team(&mut self, mut team: Team) {
        if let Some(flag) = self.team.stop_flag() {
            team.set_stop_flag(Arc::clone(flag));
        }
        self.settings.threads = team.threads();
        self.team = team;
    }

    /// Works from now on with the threads of `other`, which gets others in exchange.
    pub fn take_team_of(&mut self, other: &mut Body) {
        std::mem::swap(&mut self.team, &mut other.team);
        self.settings.threads = self.team.threads();
    }

    /// Force on the body [N] of every spring of the last step, in the order given, from the same solve.
    pub fn spring_forces(&self) -> &[Vector3<f64>] {
        &self.spring_forces
    }

    /// Whether steps are linear solves, matrix-free in single precision.
    pub fn is_fast(&self) -> bool {
        self.dynamics.model().is_none()
    }

    /// Rest position of every node [m]: copies, then the nodes that quadratic elements add.
    pub fn rest_positions(&self) -> &[Vector3<f64>] {
        &self.rest
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
        own: Option<&OwnSurface<'_>>,
        shape: &mut SkinShape<'_>,
    ) -> Result<(), BodyError> {
        if self.snap.is_some() {
            let with = "cutting that changes the mesh";
            return Err(BodyError::Combination { what: "a skin", with, instead: "cutting method xfem" });
        }
        if self.space.can_carry_skin(own.is_some()) {
            return Ok(self.space.put_on_skin(settings, own, shape)?);
        }
        let what = if own.is_some() { "a skin" } else { "a divided skin" };
        Err(BodyError::Combination { what, with: self.space.name(), instead: "tet4" })
    }

    /// What a skin of triangles of its own lies on; see [`Space::skin_ground`].
    pub fn skin_ground(&self) -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
        self.space.skin_ground()
    }

    /// How much of its own surface the skin consists of, if it has one.
    pub fn kept(&self) -> Option<Kept> {
        self.space.kept()
    }

    /// The skin, if the body has one.
    pub fn skin(&self) -> Option<&Skin> {
        self.space.skin()
    }

    /// See [`Skin::spoil`].
    #[doc(hidden)]
    pub fn spoil_skin(&mut self) {
        self.space.spoil_skin();
    }

    /// The surface that is shown and touched, closed and 2-manifold. It consists of the skin, or without
    /// one the boundary of the elements, and of the lips of cuts. It changes only when the
    /// [`epoch`](Self::epoch) does.
    pub fn surface(&self) -> &Surface {
        self.space.surface()
    }

    /// Lines that incisions have drawn on the [`surface`](Self::surface) without opening it yet. They may
    /// change with every cut, even one that leaves the topology alone.
    pub fn incision_marks(&self) -> Vec<IncisionMark> {
        self.space.incision_marks()
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
        let solver = BodySettings { arithmetic, ..settings }.step_solver(self.material.law);
        self.dynamics.set_solver(solver);
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
        self.dynamics.set_material(material);
        Ok(())
    }

    /// Chooses how the stiffness is applied from the next step on; results agree to single precision.
    /// [`OperatorChoice::Auto`] takes the cheaper way. Returns `false`, and changes nothing, if the body
    /// takes the general path, which always assembles.
    pub fn set_operator(&mut self, choice: OperatorChoice) -> bool {
        let Some(stiffness) = self.dynamics.stiffness_mut() else { return false };
        self.settings.operator = choice;
        stiffness.set_choice(self.settings.operator(self.material.law, self.space.n_pieces()));
        true
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
        self.dynamics.follow_viscous(&mut self.team, &self.state);
        Ok(())
    }

    /// Takes parts of the method out of a body that has just been made, for a check that their lack is noticed. Parts
    /// that act when the body is made stay.
    ///
    /// # Errors
    /// A solver that cannot be made.
    #[doc(hidden)]
    pub fn ablate(&mut self, ablation: Ablation) -> Result<(), BodyError> {
        self.settings.ablation = ablation;
        let solver = step_solver(&*self.space, &self.material, &self.settings)?;
        self.dynamics = Dynamics::new(self.settings.scheme, self.material.law, solver)?;
        self.follow_topology();
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
        self.space.reset()?;
        self.boundary.forget_refinement(self.space.n_nodes());
        self.return_to_rest();
        self.dynamics.rebuild(&*self.space)?;
        self.relax_viscous();
        self.follow_topology();
        Ok(())
    }

    fn return_to_rest(&mut self) {
        refill(&mut self.rest, self.space.rest_positions().into_iter());
        refill(&mut self.split_from, 0..self.rest.len() as u32);
        refill(&mut self.state.x, self.rest.iter().copied());
        self.state.v.fill(Vector3::zeros());
        resize_reserving(&mut self.state.v, self.rest.len(), Vector3::zeros());
        self.spring_forces.clear();
    }

    /// Lets all springs of a viscoelastic body relax.
    fn relax_viscous(&mut self) {
        let strains = self.dynamics.model().map_or(0, Model::n_strains);
        refill(&mut self.state.viscous, std::iter::repeat_n([0.0; 6], strains));
        self.dynamics.follow_viscous(&mut self.team, &self.state);
    }
}

/// The way to solve the equations of a step that the settings choose.
fn step_solver(
    space: &dyn Space,
    material: &Material,
    settings: &BodySettings,
) -> Result<Box<dyn StepSolver>, BodyError> {
    let (law, scheme) = (material.law, settings.scheme);
    let stiffness = match settings.arithmetic(law) {
        Arithmetic::Single => space.stiffness(settings.simd),
        Arithmetic::Mixed | Arithmetic::Double => None,
    };
    let Some(mut stiffness) = stiffness else {
        let dynamics = settings.dynamics(law);
        let of_model = (settings.volumetric, settings.fibres, settings.prony);
        return Ok(Box::new(ModelSolver::of_space(space, *material, of_model, dynamics)?));
    };
    stiffness.set_choice(settings.operator(law, space.n_pieces()));
    let (solver, stiffness) = (settings.step_solver(law), (stiffness, settings.simd));
    Ok(Box::new(LinearlyImplicit::new((scheme, *material), solver, stiffness, settings.ablation)))
}
