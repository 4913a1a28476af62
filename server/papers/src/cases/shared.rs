//! Helpers of the cases that come with the program.

use scindo_study::case::LAWS;
use scindo_study::design::axes::{Axis, Factor, precisions, threads, tolerances, words};
use scindo_world::scene::Scene;

/// The axes law, element, mesh, solver, tolerance, precision and threads.
pub(super) fn axes(bodies: &[String], law: &str, element: Axis, mesh: Axis, tolerance: f64) -> Vec<Axis> {
    vec![
        words(Factor::Law, bodies, "law", &LAWS, law),
        element,
        mesh,
        words(Factor::Solver, bodies, "solver.method", &["pcg", "cg", "cholesky"], "pcg"),
        tolerances(bodies, &[1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10], tolerance),
        precisions(bodies),
        threads(&[1, 2]),
    ]
}

/// The labels of an axis.
pub(super) fn labels(axes: &[Axis], factor: Factor) -> Vec<String> {
    let axis = axes.iter().find(|axis| axis.factor == factor);
    axis.map(|axis| axis.settings.iter().map(|s| s.label.clone()).collect()).unwrap_or_default()
}

/// Converts literals to labels.
pub(super) fn names(labels: &[&str]) -> Vec<String> {
    labels.iter().map(|label| (*label).to_owned()).collect()
}

/// Parses a scene that is part of the program. Panics if it is invalid.
pub(super) fn load(text: &str, overrides: &[String]) -> Scene {
    let scene = Scene::from_toml(text).and_then(|scene| scene.apply_sets(overrides));
    scene.expect("the file is part of the program and a test reads it")
}
