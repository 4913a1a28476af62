//! Solvers on one system, and the errors they leave after every iteration.

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::assembly::{Model, Tangent, Volumetric};
use scindo_physics::operator::{LinearOperator, Padded, Preconditioner};
use scindo_physics::solver::multigrid::{Cycle, Multigrid, Smoother};
use scindo_physics::solver::{LinearSettings, LinearSolver, Method, Pcg, PcgSettings, Precision, StopReason};
use scindo_physics::team::Team;

use super::linear::{Seconds, System, TIMES, norm};
use crate::lab::Trouble;

type V = Vector3<f64>;

/// Single precision can reduce errors no further than about this.
pub const FLOOR: f64 = 3e-6;
/// Largest residual of a solution by which errors are measured.
pub const CONVERGED: f64 = 1e-7;
/// Iterations at most: of conjugate gradients alone, with SOR cycles and with Chebyshev cycles.
pub const PATIENCE: [usize; 3] = [8_000, 60, 200];

/// Errors over time.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Seconds before the first iteration.
    pub begin_s: f64,
    /// After every iteration: seconds since the beginning, and ‖e‖/‖e₀‖.
    pub points: Vec<(f64, f64)>,
}

impl Course {
    /// ‖e‖/‖e₀‖ after `k` iterations; 1 before the first.
    pub fn error(&self, k: usize) -> f64 {
        k.checked_sub(1).map_or(1.0, |i| self.points.get(i).map_or(f64::NAN, |point| point.1))
    }

    /// ‖e‖/‖e₀‖ after so many seconds.
    pub fn error_after(&self, seconds: f64) -> f64 {
        self.points.iter().take_while(|point| point.0 <= seconds).last().map_or(1.0, |point| point.1)
    }

    /// Seconds until the error has fallen so far; `None` if it never does.
    pub fn seconds_to(&self, error: f64) -> Option<f64> {
        self.points.iter().find(|point| point.1 <= error).map(|point| point.0)
    }
}

/// When a run ends.
#[derive(Clone, Copy, Debug)]
pub struct Until {
    /// Most iterations.
    pub iterations: usize,
    /// Least ‖e‖/‖e₀‖.
    pub error: f64,
    /// Least time [s].
    pub seconds: f64,
}

/// Solvers that iterate on the finest level.
#[derive(Debug)]
pub enum Solver<'a> {
    /// Conjugate gradients with block-Jacobi.
    Jacobi,
    /// Cycles alone.
    Cycles(&'a mut Multigrid),
    /// Conjugate gradients with a cycle as preconditioner.
    Preconditioned(&'a mut Multigrid),
}

impl<'a> Solver<'a> {
    /// Cycles of `multigrid`, alone or in conjugate gradients.
    pub fn of(multigrid: &'a mut Multigrid, in_gradients: bool) -> Self {
        if in_gradients { Self::Preconditioned(multigrid) } else { Self::Cycles(multigrid) }
    }
}

/// Runs are not timed again once they have taken so long together [s].
pub const LONG_ENOUGH: f64 = 3.0;

/// Three cycles as in a step of the paper, from u = 0, whatever error they leave; the fastest of several times.
pub fn three_cycles(
    system: &mut System,
    multigrid: &mut Multigrid,
    in_gradients: bool,
    exact: &[V],
) -> Course {
    let until = Until { iterations: 3, error: -1.0, seconds: 0.0 };
    fastest_course((TIMES, LONG_ENOUGH), || run(system, Solver::of(multigrid, in_gradients), exact, until))
}

/// Conjugate gradients with block-Jacobi; the fastest of three times.
pub fn block_jacobi(system: &mut System, exact: &[V], until: Until) -> Course {
    fastest_course((3, f64::INFINITY), || run(system, Solver::Jacobi, exact, until))
}

/// A course that is run up to so many times and until it has taken so long altogether [s], with the least seconds after
/// every iteration: other work on the machine only makes them more.
fn fastest_course((times, enough_s): (usize, f64), mut course: impl FnMut() -> Course) -> Course {
    let mut fastest = course();
    let length = |course: &Course| course.points.last().map_or(0.0, |point| point.0);
    let mut total = length(&fastest);
    for _ in 1..times {
        if total > enough_s {
            break;
        }
        let again = course();
        total += length(&again);
        for (known, point) in fastest.points.iter_mut().zip(again.points) {
            known.0 = known.0.min(point.0);
        }
    }
    fastest
}

/// Seconds of a step as in the paper, which are those of rotations, operators of all levels and three cycles; and those
/// of its parts.
pub fn step_of_three(system: &mut System, smoother: Smoother, in_gradients: bool) -> (f64, Seconds) {
    let operator_s = system.update();
    let (mut multigrid, seconds) = system.multigrid(smoother);
    let none = vec![V::zeros(); system.unknowns() / 3];
    let course = three_cycles(system, &mut multigrid, in_gradients, &none);
    (operator_s + seconds.coarse + course.points.last().map_or(f64::NAN, |point| point.0), seconds)
}

/// ‖u − exact‖ relative to ‖exact‖, which is the error at the start, from u = 0.
fn error(u: &[Padded], exact: &[V], size: f64) -> f64 {
    let off = |(u, e): (&Padded, &V)| (V::new(u[0].into(), u[1].into(), u[2].into()) - e).norm_squared();
    u.iter().zip(exact).map(off).sum::<f64>().sqrt() / size
}

/// Runs a solver from u = 0. The clock stands still while errors are computed.
pub fn run(system: &mut System, solver: Solver<'_>, exact: &[V], until: Until) -> Course {
    match solver {
        Solver::Jacobi => gradients(system, None, exact, until),
        Solver::Preconditioned(multigrid) => gradients(system, Some(multigrid), exact, until),
        Solver::Cycles(multigrid) => cycles(system, multigrid, exact, until),
    }
}

fn gradients(system: &mut System, multigrid: Option<&mut Multigrid>, exact: &[V], until: Until) -> Course {
    let b = system.right_hand_side();
    let mut pcg = Pcg::default();
    pcg.resize(b.len());
    pcg.r.copy_from_slice(&b);
    let mut u = vec![[0.0; 4]; b.len()];
    let (mut A, jacobi, team) = system.parts();
    match multigrid {
        None => iterate(team, &mut A, jacobi, (&mut pcg, &mut u), exact, until),
        Some(multigrid) => {
            let mut M = Cycle { multigrid, inverse: jacobi.inverses(), largest: 0.0 };
            iterate(team, &mut A, &mut M, (&mut pcg, &mut u), exact, until)
        }
    }
}

fn iterate(
    team: &mut Team,
    A: &mut impl LinearOperator,
    M: &mut impl Preconditioner,
    (pcg, u): (&mut Pcg, &mut [Padded]),
    exact: &[V],
    until: Until,
) -> Course {
    let size = norm(exact);
    let mut course = Course::default();
    let started = Instant::now();
    let rz = pcg.precondition(team, A, M);
    let mut seconds = started.elapsed().as_secs_f64();
    let reference = rz.max(0.0).sqrt();
    let one = PcgSettings { iterations: 1, tolerance: 0.0 };
    for k in 0..until.iterations {
        let started = Instant::now();
        let report = match k {
            0 => pcg.run(team, A, M, u, (rz, reference, one)),
            _ => pcg.go_on(team, A, M, u, (reference, one)),
        };
        seconds += started.elapsed().as_secs_f64();
        let error = error(u, exact, size);
        course.points.push((seconds, error));
        let broken = matches!(report.stop, StopReason::NonFinite | StopReason::NonPositiveCurvature);
        if broken || !error.is_finite() || (error <= until.error && seconds >= until.seconds) {
            break;
        }
    }
    course
}

fn cycles(system: &mut System, multigrid: &mut Multigrid, exact: &[V], until: Until) -> Course {
    let mut r = system.right_hand_side();
    let (mut u, mut z, mut q) = (vec![[0.0; 4]; r.len()], vec![[0.0; 4]; r.len()], vec![[0.0; 4]; r.len()]);
    let size = norm(exact);
    let (mut A, jacobi, team) = system.parts();
    let (mut course, mut seconds) = (Course::default(), 0.0);
    for _ in 0..until.iterations {
        let started = Instant::now();
        multigrid.cycle(team, &mut A, (jacobi.inverses(), 0.0), &r, &mut z);
        A.apply(team, &z, &mut q);
        for ((u, r), (z, q)) in u.iter_mut().zip(&mut r).zip(z.iter().zip(&q)) {
            for k in 0..3 {
                u[k] += z[k];
                r[k] -= q[k];
            }
        }
        seconds += started.elapsed().as_secs_f64();
        let error = error(&u, exact, size);
        course.points.push((seconds, error));
        // Without a solution to compare with, the cycles are only timed.
        if (size > 0.0 && !error.is_finite()) || (error <= until.error && seconds >= until.seconds) {
            break;
        }
    }
    course
}

/// Iterations of conjugate gradients with a cycle until √(rᵀVr) has fallen by `tolerance`; `None` if they do not
/// converge.
pub fn iterations(system: &mut System, multigrid: &mut Multigrid, tolerance: f64) -> Option<u32> {
    let b = system.right_hand_side();
    let mut pcg = Pcg::default();
    pcg.resize(b.len());
    pcg.r.copy_from_slice(&b);
    let mut u = vec![[0.0; 4]; b.len()];
    let (mut A, jacobi, team) = system.parts();
    let mut M = Cycle { multigrid, inverse: jacobi.inverses(), largest: 0.0 };
    let rz = pcg.precondition(team, &mut A, &mut M);
    let settings = PcgSettings { iterations: 1_000, tolerance };
    let report = pcg.run(team, &mut A, &mut M, &mut u, (rz, rz.max(0.0).sqrt(), settings));
    (report.stop == StopReason::Converged).then_some(report.iterations)
}

/// ‖e_k‖/‖e₀‖ of k cycles from u = 0, e₀ = −`exact`: e ← e − V A e, scaled into the range of single precision.
/// The rounding of a solution does not end it.
pub fn decay(system: &mut System, multigrid: &mut Multigrid, exact: &[V], n: usize) -> Vec<f64> {
    let mut scale = 1.0 / norm(exact);
    let mut e: Vec<Padded> = exact
        .iter()
        .map(|u| [(u.x * scale) as f32, (u.y * scale) as f32, (u.z * scale) as f32, 0.0])
        .collect();
    scale = 1.0;
    let (mut r, mut z) = (e.clone(), e.clone());
    let (mut A, jacobi, team) = system.parts();
    let mut norms = vec![1.0];
    for _ in 0..n {
        A.apply(team, &e, &mut r);
        multigrid.cycle(team, &mut A, (jacobi.inverses(), 0.0), &r, &mut z);
        let mut sum = 0.0;
        for (e, z) in e.iter_mut().zip(&z) {
            for k in 0..3 {
                e[k] -= z[k];
                sum += f64::from(e[k]) * f64::from(e[k]);
            }
        }
        let now = sum.sqrt();
        scale *= now;
        norms.push(scale);
        e.iter_mut().flatten().for_each(|e| *e = (f64::from(*e) / now) as f32);
    }
    norms
}

/// The mean factor per cycle between two numbers of cycles.
pub fn rate(norms: &[f64], [from, to]: [usize; 2]) -> f64 {
    match (norms.get(from), norms.get(to)) {
        (Some(a), Some(b)) if to > from => (b / a).powf(1.0 / (to - from) as f64),
        _ => f64::NAN,
    }
}

/// The solution by sparse Cholesky factorisation in double precision, and the seconds of analysis, factorisation and
/// solution. Assembly is not timed: every solver begins with the equations.
///
/// # Errors
/// A body that cannot be assembled, or a factorisation that fails.
pub fn cholesky(system: &System) -> Result<(Vec<V>, f64), Trouble> {
    let model = Model::octree(system.octree(), system.material(), Volumetric::Full)?;
    let mut A = model.pattern();
    model.tangent(model.rest(), Tangent::Exact, &mut A);
    let [mass_factor, scale] = system.factors();
    A.blocks.iter_mut().flatten().for_each(|k| *k *= scale);
    A.add_diagonal(mass_factor, system.mass());
    let settings = LinearSettings {
        method: Method::Cholesky,
        precision: Precision::Double,
        iterations: 1,
        tolerance: 1e-12,
    };
    let mut solver = LinearSolver::new(settings);
    let mut team = Team::new(1)?;
    let mut u = vec![V::zeros(); system.load().len()];
    let started = Instant::now();
    solver.set_matrix(&A, &system.fixed);
    let report = solver.solve(&mut team, &A, system.load(), &mut u, None);
    let seconds = started.elapsed().as_secs_f64();
    if report.stop == StopReason::NonFinite {
        return Err("the factorisation failed".into());
    }
    Ok((u, seconds))
}
