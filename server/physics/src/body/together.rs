//! Steps of several bodies that touch.

use nalgebra::Vector3;
use scindo_algebra::assembly::pressure::Pressure;
use scindo_algebra::solver::{PcgSettings, StopReason};
use scindo_matter::element::FixedCopy;
use smallvec::SmallVec;

use super::{Body, Notice, Outcome, PointSpring, Scheme, SolveReport};
use crate::integrator::{LooseParts, PairSpring, StepInputs, Together};
use crate::space::Space;

/// Bodies for which a group needs no memory beyond that of its last step.
const USUAL: usize = 64;

/// A group of bodies that touch, and the memory of their common steps.
///
/// ```
/// # use nalgebra::Vector3;
/// # use scindo_physics::body::{Body, BodySettings};
/// # use scindo_physics::material::{Law, Material, Rayleigh};
/// # use scindo_physics::mesh::{BoxPattern, box_mesh};
/// use scindo_physics::body::{Group, PairSpring, SpringKind};
/// use scindo_physics::element::MaterialPoint;
///
/// # let (law, rayleigh) = (Law::Corotational, Rayleigh::default());
/// # let material = Material { young_pa: 1e4, poisson: 0.4, density_kg_m3: 1e3, rayleigh, law };
/// # let block = |x: f64| {
/// #     let mesh = box_mesh(Vector3::new(x, 0.0, 0.0), Vector3::repeat(0.1), [2; 3], BoxPattern::Tet6);
/// #     Body::new(mesh, material, BodySettings::default())
/// # };
/// let (mut left, mut right) = (block(0.0)?, block(0.2)?);
/// // A spring pulls their first nodes together.
/// let node = MaterialPoint::new([(0, 1.0)]);
/// let pull = PairSpring {
///     bodies: [0, 1],
///     point: node,
///     corners: [node; 3],
///     barycentric: [1.0, 0.0, 0.0],
///     kind: SpringKind::Hold { target_m: Vector3::zeros() },
///     stiffness_n_m: 10.0,
///     max_force_n: 5.0,
/// };
/// let mut group = Group::default();
/// group.step(&mut [&mut left, &mut right], (0.01, Vector3::zeros()), &[&[], &[]], &[pull]);
/// assert!(left.momentum().x > 0.0);
/// assert!((left.momentum() + right.momentum()).norm() < 1e-12);
/// # Ok::<(), scindo_physics::body::BodyError>(())
/// ```
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Group {
    together: Together,
    forces: Vec<Vector3<f64>>,
    reports: Vec<SolveReport>,
}

impl Group {
    /// Advances all `bodies` by `dt_s` under gravity [m/s²], with the springs of each, and `pairs` between them or
    /// within one. The step is one linear solve with implicit Euler over all of them. If it does not stay finite, or
    /// a body cannot take part (its law needs Newton's method, or it is computed as equilibrium), each makes a step
    /// of its own without the pairs, and says so.
    ///
    /// Returns a report per body.
    pub fn step(
        &mut self,
        bodies: &mut [&mut Body],
        (dt_s, gravity): (f64, Vector3<f64>),
        springs: &[&[PointSpring]],
        pairs: &[PairSpring],
    ) -> &[SolveReport] {
        self.reports.clear();
        self.forces.clear();
        self.forces.resize(pairs.len(), Vector3::zeros());
        let usable = dt_s > 0.0 && dt_s.is_finite() && gravity.iter().all(|g| g.abs() < 1e12);
        let mut can = usable && bodies.len() == springs.len();
        for (body, springs) in bodies.iter_mut().zip(springs) {
            can = can && body.begin_together((dt_s, gravity), springs);
        }
        let solved = can.then(|| self.solve(bodies, (dt_s, gravity), springs, pairs)).flatten();
        let Some(report) = solved else {
            self.forces.fill(Vector3::zeros());
            for (body, springs) in bodies.iter_mut().zip(springs) {
                let mut report = body.step(dt_s, gravity, springs);
                if !pairs.is_empty() && report.outcome == Outcome::Advanced {
                    report.notice = Some(Notice::Parted);
                }
                self.reports.push(report);
            }
            return &self.reports;
        };
        for body in bodies.iter_mut() {
            let mut report = SolveReport { tolerance: body.settings.solver.tolerance, ..report };
            body.hold_within_range(&mut report);
            self.reports.push(report);
        }
        &self.reports
    }

    /// Force of every pair spring of the last step on its point [N], in the order given.
    pub fn forces(&self) -> &[Vector3<f64>] {
        &self.forces
    }

    /// The common solve; `None` if it did not stay finite, with all bodies as before.
    fn solve(
        &mut self,
        bodies: &mut [&mut Body],
        step: (f64, Vector3<f64>),
        springs: &[&[PointSpring]],
        pairs: &[PairSpring],
    ) -> Option<SolveReport> {
        let mut members: SmallVec<[_; USUAL]> = SmallVec::new();
        let mut settings = PcgSettings { iterations: 0, tolerance: f64::INFINITY };
        for (body, springs) in bodies.iter_mut().zip(springs) {
            let solver = body.settings.solver;
            // As many bodies in a row have as many times the nodes along the way.
            settings.iterations += solver.iterations;
            settings.tolerance = settings.tolerance.min(solver.tolerance);
            let Body { space, dynamics, team, state, spring_forces, load, fixed, mass, parts, rest, .. } =
                &mut **body;
            let inputs = inputs(step, (mass, load, fixed, parts), springs, rest, &**space);
            members.push(dynamics.member(team, state, inputs, spring_forces)?);
        }
        let found = self.together.step(&mut members, pairs, &mut self.forces, settings);
        let inverted_pieces = members.iter().map(|member| member.inverted_pieces).sum();
        drop(members);
        let interrupted = found.solve.stop == StopReason::Interrupted;
        for (body, springs) in bodies.iter_mut().zip(springs) {
            let Body { space, dynamics, state, load, fixed, mass, parts, rest, .. } = &mut **body;
            let inputs = inputs(step, (mass, load, fixed, parts), springs, rest, &**space);
            dynamics.end_together(state, &inputs, found.finite && !interrupted);
        }
        let report = SolveReport {
            scheme: Scheme::ImplicitEuler,
            substeps: 1,
            newton_steps: 1,
            iterations: found.solve.iterations,
            residual: found.solve.residual,
            stop: found.solve.stop,
            outcome: if interrupted { Outcome::Interrupted } else { Outcome::Advanced },
            refused_springs: found.refused,
            inverted_pieces,
            ..SolveReport::default()
        };
        found.finite.then_some(report)
    }
}

/// What acts on a body in a step.
fn inputs<'a>(
    (h, gravity): (f64, Vector3<f64>),
    (mass, load, fixed, parts): (&'a [f64], &'a [Vector3<f64>], &'a [FixedCopy], &'a LooseParts),
    springs: &'a [PointSpring],
    rest: &'a [Vector3<f64>],
    space: &'a dyn Space,
) -> StepInputs<'a> {
    StepInputs {
        h,
        gravity,
        mass,
        load,
        pressure: Pressure::none(),
        fixed,
        parts,
        springs,
        rest,
        points: space,
    }
}

impl Body {
    /// Whether a step of this body can be solved together with those of others.
    pub fn can_step_together(&mut self) -> bool {
        self.dynamics.can_step_together()
    }

    fn begin_together(&mut self, step: (f64, Vector3<f64>), springs: &[PointSpring]) -> bool {
        self.predict_pressure(step.0);
        let Self { space, dynamics, state, load, fixed, mass, parts, rest, .. } = self;
        dynamics.begin_together(state, &inputs(step, (mass, load, fixed, parts), springs, rest, &**space))
    }
}
