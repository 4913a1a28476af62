//! How a body is discretised and solved, and which combinations the fast path supports.

use scindo_algebra::assembly::Volumetric;
use scindo_algebra::operator::OperatorChoice;
use scindo_algebra::solver::multigrid::CycleShape;
use scindo_algebra::solver::{Curvature, LinearSettings, Method, NewtonSettings, PcgSettings, Precision};
use scindo_matter::cut::FrontRule;
use scindo_matter::cut::remesh::SnapSettings;
use scindo_matter::element::ElementKind;
use scindo_matter::element::Simd;
use scindo_matter::material::{Fibres, Law, Prony};

use super::{Ablation, BodyError, CuttingMethod, LooseRule, cost};
use crate::integrator::{DynamicsSettings, MassKind, Multistep, Scheme, SolverSettings};

/// Settings that are chosen when a body is made.
///
/// ```
/// use scindo_physics::body::{Arithmetic, BodySettings, ElementKind, Scheme};
/// use scindo_physics::material::Law;
///
/// let fast = BodySettings { scheme: Scheme::Bdf2, threads: 2, ..BodySettings::default() };
/// assert_eq!(fast.arithmetic(Law::Corotational), Arithmetic::Single);
///
/// let quadratic = BodySettings { element: ElementKind::Tet10, ..fast };
/// assert_eq!(quadratic.why_general(Law::Corotational), Some("element tet10"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BodySettings {
    /// When the solver of a step stops. On the fast path this is the linear solve; on the general path it
    /// is Newton's method and each of its linear solves.
    pub solver: PcgSettings,
    /// Number of threads that work on a step, the caller's included; at least 1, at most
    /// [`MOST_THREADS`](Self::MOST_THREADS).
    pub threads: usize,
    /// Instructions of the kernels, as far as the machine has them. Those of [`Simd::Baseline`] give the same bits on
    /// every machine of the architecture.
    pub simd: Simd,
    /// Finite element. All but [`ElementKind::Hex8`] can be cut.
    pub element: ElementKind,
    /// Whether the hexahedra of [`ElementKind::Hex8`] are equal cubes, which the kernels of cells take. A body finds
    /// out itself.
    pub cubes: bool,
    /// Families of fibres in the whole body.
    pub fibres: Fibres,
    /// Terms of a Prony series beside the law: viscoelasticity.
    pub prony: Prony,
    /// Whether the surface will be under [pressure](super::Body::add_pressure). Equilibria of a law that rotates then take
    /// the general path, where the pressure follows the surface.
    pub pressed: bool,
    /// Integration of the volumetric energy: a remedy against locking, or none.
    pub volumetric: Volumetric,
    /// Time integration scheme; [`Scheme::Static`] for equilibria.
    pub scheme: Scheme,
    /// How mass is distributed.
    pub mass: MassKind,
    /// Method of the linear solver.
    pub method: Method,
    /// Octree cells only: the level of multigrid that is simulated. With 1 and 2 composite elements 2 and 4 finest
    /// cells wide move the vertices of the finest cells; cuts, surface and materials stay as fine as these. Needs
    /// a method of multigrid on the fast path.
    pub simulate_level: u8,
    /// Shape of the cycles of a method of multigrid.
    pub cycle: CycleShape,
    /// Solve [`Scheme::Static`] by matrix-free relaxation: `solver.iterations` of it per step, continued
    /// from step to step. `method` is then unused.
    pub relaxation: bool,
    /// How the fast path applies the stiffness; [`OperatorChoice::Auto`] takes the cheaper way.
    pub operator: OperatorChoice,
    /// Arithmetic. `None` takes the fastest that the other settings allow, and mixed arithmetic where too
    /// many elements are too flat for single precision.
    pub arithmetic: Option<Arithmetic>,
    /// Largest number of Newton steps per time step; `None` for as many as law and scheme need.
    pub newton_steps: Option<u32>,
    /// Explicit schemes: most parts into which a step longer than the stable one is divided; 1 refuses such a step.
    pub most_substeps: u32,
    /// Inside elements or along their faces.
    pub cutting: CuttingMethod,
    /// How far a cut inside elements goes on ahead of the blade.
    pub front: FrontRule,
    /// What cuts along faces do besides opening them.
    pub snap: SnapSettings,
    /// What happens to parts that a cut leaves without a held node.
    pub loose: LooseRule,
    /// Parts of the method that are switched off; only for checking the tests themselves.
    #[doc(hidden)]
    pub ablation: Ablation,
}

/// The arithmetic of a step. State and sums are always in double precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Arithmetic {
    /// Forces and solver in single precision: the fast path. Relative residuals below some 1e-6 are those
    /// of the solver's recurrence and not true ones.
    Single,
    /// Residuals and forces in double precision, the solver's work in single precision.
    Mixed,
    /// Everything in double precision.
    Double,
}

/// Smallest tolerance that single precision can reach.
const SINGLE_TOLERANCE: f64 = 1e-7;
/// Default numbers of Newton steps: for nonlinear laws in motion, and for equilibria.
const NEWTON_STEPS: u32 = 20;
const STATIC_NEWTON_STEPS: u32 = 100;
/// Linear solves of an equilibrium of the linear law in single precision: one, and further ones that
/// check whether the residual agrees with its recurrence.
const STATIC_SOLVES: u32 = 5;
/// Linear solves of an equilibrium with a line search, for the prediction of its cost: most take 5 to 30.
const DESCENT_SOLVES: f64 = 10.0;
/// Time of a step of a law that is nonlinear in the stretch in terms of one solve, for the prediction of its cost: 2.1 with
/// `neo-hookean`, 2.5 with `stvk`, on a bar of 12,800 tetrahedra.
const NONLINEAR_COST: f64 = 2.3;
/// Largest forcing term η of inexact Newton methods (Eisenstat, Walker 1996).
const FORCING: f64 = 0.1;

impl Default for BodySettings {
    fn default() -> Self {
        Self {
            solver: PcgSettings { iterations: 50, tolerance: 1e-3 },
            threads: 1,
            simd: Simd::detect(),
            element: ElementKind::Tet4,
            cubes: false,
            fibres: Fibres::default(),
            prony: Prony::default(),
            pressed: false,
            volumetric: Volumetric::Full,
            scheme: Scheme::ImplicitEuler,
            mass: MassKind::Lumped,
            method: Method::Pcg,
            simulate_level: 0,
            cycle: CycleShape::V,
            relaxation: false,
            operator: OperatorChoice::Auto,
            arithmetic: None,
            newton_steps: None,
            most_substeps: 256,
            cutting: CuttingMethod::Xfem,
            front: FrontRule::default(),
            snap: SnapSettings::default(),
            loose: LooseRule::Free,
            ablation: Ablation::default(),
        }
    }
}

impl BodySettings {
    /// Largest number of threads that may work on a step.
    pub const MOST_THREADS: usize = 64;
    /// Coarsest level that may be simulated.
    pub const COARSEST_SIMULATED: u8 = 2;

    /// The setting that keeps a body of this law from the fast path; `None` if it can be taken.
    ///
    /// The fast path takes single precision and a few linear solves per step, without an assembled tangent.
    pub fn why_general(&self, law: Law) -> Option<&'static str> {
        let reasons = [
            (self.element == ElementKind::Tet10, "element tet10"),
            (self.element == ElementKind::Hex8 && !self.cubes, "element hex8 without equal cubes"),
            (
                !law.is_hookean() && self.element != ElementKind::Tet4,
                "a law that is nonlinear in the stretch, in other elements than tet4",
            ),
            (!self.fibres.is_empty(), "fibres"),
            (!self.prony.is_empty(), "viscoelasticity"),
            (self.scheme.is_explicit(), "an explicit integrator"),
            (self.pressed && Self { pressed: false, ..*self }.descends(law), "a pressure in equilibrium"),
            (self.pressed && !law.is_hookean(), "a pressure and a law that is nonlinear in the stretch"),
            (
                self.scheme == Scheme::Static && law != Law::Linear && !self.descends(law),
                "the static integrator with a law that rotates",
            ),
            (
                !matches!(self.method, Method::Pcg | Method::TwoLevelPcg) && !self.method.is_multigrid(),
                "a solver other than pcg, two-level-pcg or multigrid",
            ),
            (self.mass == MassKind::Consistent, "consistent mass"),
            (
                matches!(self.mass, MassKind::Menouillard | MassKind::Floored),
                "a mass that is not lumped by the shape functions",
            ),
            (self.volumetric != Volumetric::Full, "a locking remedy"),
            (
                self.newton_steps.is_some_and(|steps| steps > 1) && !self.descends(law),
                "more than one Newton step",
            ),
        ];
        reasons.iter().find(|(general, _)| *general).map(|(_, why)| *why)
    }

    /// Whether the fast path finds equilibria of this law by solves with a line search. Only octree cells do: the
    /// general path would assemble their tangent.
    fn descends(&self, law: Law) -> bool {
        self.scheme == Scheme::Static
            && self.element == ElementKind::Octree
            && law == Law::Corotational
            && self.fibres.is_empty()
            && self.prony.is_empty()
            && self.simulate_level == 0
            && !self.relaxation
            && !self.pressed
    }

    /// The arithmetic of a body of this law: the requested one; else single precision if the fast path
    /// can be taken and reach the tolerance; else mixed. It is double if nothing is solved.
    pub fn arithmetic(&self, law: Law) -> Arithmetic {
        let fast = self.why_general(law).is_none() && self.reaches_single();
        self.arithmetic.unwrap_or(match (self.scheme.is_explicit() || (self.relaxation && !fast), fast) {
            (true, _) => Arithmetic::Double,
            (false, true) => Arithmetic::Single,
            (false, false) => Arithmetic::Mixed,
        })
    }

    /// A tolerance of 0 requests a fixed number of iterations, which single precision can do.
    fn reaches_single(&self) -> bool {
        self.solver.tolerance >= SINGLE_TOLERANCE || self.solver.tolerance == 0.0
    }

    /// Largest number of Newton steps per time step. Laws that are linear in the stretch need one linear
    /// solve from the predictor; Newmark's method needs two.
    pub fn newton_steps(&self, law: Law) -> u32 {
        let easy = self.is_easy(law);
        self.newton_steps.unwrap_or(match self.scheme {
            Scheme::Static => STATIC_NEWTON_STEPS,
            scheme if scheme.is_newmark() && easy => 2,
            _ if easy => 1,
            _ => NEWTON_STEPS,
        })
    }

    /// Whether the material is linear in the stretch. Fibres and viscoelasticity are in the linear law only.
    fn is_easy(&self, law: Law) -> bool {
        let plain = self.fibres.is_empty() && self.prony.is_empty();
        law == Law::Linear || (law == Law::Corotational && plain)
    }

    /// Largest number of linear solves in a step of the fast path.
    pub(super) fn solves(&self, law: Law) -> u32 {
        match self.scheme {
            Scheme::Static if self.relaxation => 1,
            Scheme::Static if self.descends(law) => self.newton_steps(law),
            Scheme::Static => STATIC_SOLVES,
            _ if self.newton_steps == Some(1) && !law.is_hookean() => 1,
            scheme => Multistep::solves(scheme, law),
        }
    }

    /// Whether a step is a fixed number of linear solves by design and has converged when the last of
    /// them has. This holds for the motion of laws that are linear in the stretch, unless more than one
    /// Newton step is requested. Every other step has converged when Newton's method has.
    pub fn is_linearised(&self, law: Law) -> bool {
        let easy = self.is_easy(law) && self.newton_steps.is_none();
        let implicit = !self.scheme.is_explicit() && self.scheme != Scheme::Static;
        implicit && (easy || self.newton_steps == Some(1))
    }

    /// Settings of Newton's method on the general path.
    pub(super) fn newton(&self, law: Law) -> NewtonSettings {
        let steps = self.newton_steps(law);
        let precision =
            if self.arithmetic(law) == Arithmetic::Double { Precision::Double } else { Precision::Mixed };
        // The last of a fixed number of solves has to reach the tolerance by itself.
        let last = steps == 1 || self.is_linearised(law);
        let tolerance = if last { self.solver.tolerance } else { FORCING };
        let linear =
            LinearSettings { method: self.method, precision, iterations: self.solver.iterations, tolerance };
        // Without inertia the projected tangent costs three times as many steps as the exact one.
        let curvature = if self.scheme == Scheme::Static { Curvature::Exact } else { Curvature::Definite };
        let halvings = match self.ablation.line_search {
            true => NewtonSettings::UNCHECKED,
            false => NewtonSettings::default().halvings,
        };
        NewtonSettings { steps, halvings, tolerance: self.solver.tolerance, curvature, linear }
    }

    /// Whether the elements are cubical cells, whose stiffness is applied without a matrix.
    pub fn has_cells(&self) -> bool {
        self.element == ElementKind::Octree || (self.element == ElementKind::Hex8 && self.cubes)
    }

    /// How the fast path applies the stiffness of `pieces` pieces; never [`OperatorChoice::Auto`].
    pub fn operator(&self, law: Law, pieces: usize) -> OperatorChoice {
        if self.has_cells() {
            return OperatorChoice::MatrixFree;
        }
        match self.operator {
            OperatorChoice::Auto => cost::cheapest(law, pieces, (self.solver, self.method)),
            asked => asked,
        }
    }

    /// Predicted time [s] of a step of the fast path on one thread.
    pub fn fast_seconds(&self, law: Law, pieces: usize) -> f64 {
        let solves = match self.scheme {
            Scheme::Static if self.descends(law) => DESCENT_SOLVES,
            Scheme::Static => 1.0,
            _ if !law.is_hookean() => NONLINEAR_COST,
            _ => f64::from(self.solves(law)),
        };
        let solve = if self.has_cells() {
            let cycle = self.method.is_multigrid().then_some(self.cycle);
            cost::cell_step_seconds(pieces, self.solver, cycle)
        } else {
            let assembled = self.operator(law, pieces) == OperatorChoice::Assembled;
            cost::step_seconds(law, pieces, (self.solver, self.method), assembled)
        };
        solves * solve
    }

    /// When the solvers of a step stop. An equilibrium by linear solves may use all the iterations that
    /// Newton's method would get.
    pub(super) fn step_solver(&self, law: Law) -> SolverSettings {
        let steps = match self.scheme {
            Scheme::Static if !self.relaxation && !self.descends(law) => self.newton_steps(law),
            _ => 1,
        };
        let iterations = self.solver.iterations.saturating_mul(steps);
        SolverSettings {
            newton: self.newton(law),
            linear: (self.solves(law), PcgSettings { iterations, ..self.solver }),
            method: self.method,
            simulate_level: self.simulate_level,
            cycle: self.cycle,
            relaxation: self.relaxation.then_some(self.solver.iterations),
        }
    }

    /// Settings of steps with a discrete model.
    pub(super) fn dynamics(&self, law: Law) -> DynamicsSettings {
        let SolverSettings { newton, relaxation, .. } = self.step_solver(law);
        DynamicsSettings {
            scheme: self.scheme,
            mass: self.mass,
            linearised: self.is_linearised(law),
            newton,
            relaxation,
            most_substeps: self.most_substeps,
            ablation: self.ablation,
        }
    }

    /// Checks that every setting is in its range and compatible with the others and with `law`.
    pub fn check(&self, law: Law) -> Result<(), BodyError> {
        let setting = |name, found: f64, allowed| Err(BodyError::Setting { name, found, allowed });
        if !(1..=Self::MOST_THREADS).contains(&self.threads) {
            return setting("threads", self.threads as f64, "1 … 64");
        }
        if !(1..=1_000_000).contains(&self.solver.iterations) {
            return setting("solver.iterations", f64::from(self.solver.iterations), "1 … 1 000 000");
        }
        if !(0.0..1.0).contains(&self.solver.tolerance) {
            return setting("solver.tolerance", self.solver.tolerance, "0 ≤ tolerance < 1");
        }
        if self.newton_steps.is_some_and(|steps| !(1..=10_000).contains(&steps)) {
            return setting("solver.newton_steps", self.newton_steps.map_or(0.0, f64::from), "1 … 10 000");
        }
        // Next come combinations that do not go together, whatever their values.
        let refused = |what, with, instead| Err(BodyError::Combination { what, with, instead });
        // Meshes of linear tetrahedra are the only ones that a cut can change.
        let changes = self.cutting.mesh_cut().is_some();
        match (self.cutting, self.element, self.loose) {
            (_, ElementKind::Tet10, _) if changes => {
                return refused("cutting that changes the mesh", "element tet10", "tet4");
            }
            (_, ElementKind::Hex8, _) if changes => {
                return refused("cutting that changes the mesh", "element hex8", "tet4");
            }
            (_, ElementKind::Octree, _) if changes => {
                return refused("cutting that changes the mesh", "element octree", "cutting method links");
            }
            (CuttingMethod::Xfem, _, LooseRule::Pinned) => {
                return refused("pinning loose parts", "cutting method xfem", "cutting method snap");
            }
            (method, ..) if method != CuttingMethod::Snap && self.snap != SnapSettings::default() => {
                return refused(
                    "a choice of moved nodes or of cleaning",
                    "this cutting method",
                    "cutting method snap",
                );
            }
            _ => {}
        }
        if self.method == Method::TwoLevelPcg
            && matches!(self.element, ElementKind::Octree | ElementKind::Hex8)
        {
            return refused("the two-level preconditioner", self.element.name(), "mg-pcg");
        }
        if self.cycle != CycleShape::V && !self.method.is_multigrid() {
            return refused("a W-cycle", "a solver without levels", "mg-pcg or multigrid");
        }
        self.check_level(law)?;
        if !self.prony.is_empty() {
            let why = [
                (changes, "cutting that changes the mesh", "cutting method xfem"),
                (self.scheme.is_explicit(), "an explicit integrator", "an implicit one"),
                (self.relaxation, "relaxation", "a solver of the static integrator"),
                (
                    matches!(self.scheme, Scheme::GeneralisedAlpha { .. }),
                    "generalised-alpha, whose forces are not those of the end of a step",
                    "bdf2",
                ),
            ];
            if let Some((_, with, instead)) = why.into_iter().find(|why| why.0) {
                return refused("viscoelasticity", with, instead);
            }
        }
        // Last, because nearly every setting decides whether a body can do with single precision.
        match (self.arithmetic, self.why_general(law)) {
            (Some(Arithmetic::Single), Some(with)) => {
                Err(BodyError::Combination { what: "single precision", with, instead: "mixed or double" })
            }
            _ if self.relaxation && self.scheme != Scheme::Static => Err(BodyError::Combination {
                what: "relaxation",
                with: "inertia",
                instead: "the static integrator",
            }),
            (Some(Arithmetic::Mixed), _) if self.relaxation => {
                Err(BodyError::Combination { what: "mixed precision", with: "relaxation", instead: "double" })
            }
            (Some(Arithmetic::Mixed), _) if self.scheme.is_explicit() => Err(BodyError::Combination {
                what: "mixed precision",
                with: "an explicit integrator, which solves nothing",
                instead: "double",
            }),
            _ => Ok(()),
        }
    }

    /// Checks that the simulated level goes with the other settings.
    fn check_level(&self, law: Law) -> Result<(), BodyError> {
        if self.simulate_level == 0 {
            return Ok(());
        }
        if self.simulate_level > Self::COARSEST_SIMULATED {
            let found = f64::from(self.simulate_level);
            return Err(BodyError::Setting { name: "simulate_level", found, allowed: "0, 1, 2" });
        }
        let why = [
            (self.element != ElementKind::Octree, "elements other than octree cells", "element octree"),
            (!self.method.is_multigrid(), "a solver without levels", "mg-pcg or multigrid"),
            (self.relaxation, "relaxation", "mg-pcg or multigrid"),
        ];
        let why = why.into_iter().find(|why| why.0).map(|(_, with, instead)| (with, instead));
        let general = || self.why_general(law).map(|with| (with, "the fast path, or level 0"));
        let slow = self.arithmetic(law) != Arithmetic::Single;
        let arithmetic = || slow.then_some(("arithmetic other than single", "single precision, or level 0"));
        match why.or_else(general).or_else(arithmetic) {
            Some((with, instead)) => {
                Err(BodyError::Combination { what: "simulating a coarse level", with, instead })
            }
            None => Ok(()),
        }
    }
}
