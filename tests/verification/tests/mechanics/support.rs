//! What the cases share: materials, prescribed nodes, static equilibrium, reference files.

use std::path::PathBuf;

use nalgebra::Vector3;
use scindo_physics::assembly::Model;
use scindo_physics::element::FixedCopy;
use scindo_physics::integrator::{StaticProblem, find_equilibrium};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::solver::{
    Curvature, LinearSettings, Method, Newton, NewtonSettings, Precision, StopReason,
};
use scindo_physics::team::Team;

/// Residuals are brought below this part of the loads: what positions in double precision allow on
/// the finest meshes here (E h · 1e-16 m against the load of a node).
const TOLERANCE: f64 = 3e-9;

/// An undamped material.
pub(crate) fn material(young_pa: f64, poisson: f64, density_kg_m3: f64, law: Law) -> Material {
    Material { young_pa, poisson, density_kg_m3, rayleigh: Rayleigh::default(), law }
}

/// A node that is held in `axes` at `position_m`.
pub(crate) fn held(node: usize, axes: [bool; 3], position_m: Vector3<f64>) -> FixedCopy {
    FixedCopy { copy: node as u32, held: axes.into(), position_m: position_m.into() }
}

/// The nodes for which `choose` is true, held in all directions where they are at rest.
pub(crate) fn clamped(model: &Model, choose: impl Fn(&Vector3<f64>) -> bool) -> Vec<FixedCopy> {
    let rest = model.rest();
    (0..rest.len()).filter(|&n| choose(&rest[n])).map(|n| held(n, [true; 3], rest[n])).collect()
}

/// Whether the cases that take long were asked for.
pub(crate) fn long_tests() -> bool {
    std::env::var_os("SCINDO_LONG_TESTS").is_some()
}

/// Path of a file in `tests/reference`.
pub(crate) fn reference_path(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../reference").join(file)
}

/// A reference file in JSON.
pub(crate) fn reference(file: &str) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(reference_path(file)).unwrap()).unwrap()
}

/// A vector of a reference file.
pub(crate) fn vector(value: &serde_json::Value) -> Vector3<f64> {
    Vector3::from_fn(|i, _| value[i].as_f64().unwrap())
}

/// Static equilibrium of `model` under nodal `loads` [N] (none: no load) from `start`, with the held
/// nodes at their positions. Panics unless it converges to [`TOLERANCE`].
pub(crate) fn equilibrium(
    model: &Model,
    loads: &[Vector3<f64>],
    fixed: &[FixedCopy],
    start: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    equilibrium_by(Method::Pcg, model, loads, fixed, start)
}

/// The same with a method of choice for the linear systems.
pub(crate) fn equilibrium_by(
    method: Method,
    model: &Model,
    loads: &[Vector3<f64>],
    fixed: &[FixedCopy],
    start: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    let mut x = start.to_vec();
    let none = vec![Vector3::zeros(); x.len()];
    let mut problem = StaticProblem::new(model, if loads.is_empty() { &none } else { loads });
    let linear = LinearSettings {
        method,
        precision: Precision::Mixed,
        iterations: 20_000,
        tolerance: if model.law() == Law::Linear { 1e-11 } else { 1e-5 },
    };
    let settings =
        NewtonSettings { steps: 60, tolerance: TOLERANCE, halvings: 12, curvature: Curvature::Exact, linear };
    let mut team = Team::new(1).unwrap();
    let report = find_equilibrium(&mut Newton::new(settings), &mut team, &mut problem, fixed, &mut x);
    assert!(report.stop == StopReason::Converged, "{:?} {:?}: {report:?}", model.kind(), model.law());
    x
}
