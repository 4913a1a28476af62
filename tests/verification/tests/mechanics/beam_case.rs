//! Supports and loads of Schoch's beam cases, on the half of the beam with y ≤ 0.03 m, in any element.
//! The symmetry plane is held along y. References: `tests/reference/R2`.

use nalgebra::Vector3;
use scindo_physics::assembly::Model;
use scindo_physics::element::ElementKind;
use scindo_physics::element::FixedCopy;
use scindo_physics::material::Law;
use scindo_physics::solver::Method;

use crate::support::{clamped, equilibrium_by, held};

pub(crate) const DENSITY: f64 = 1070.0;
/// The cut lies at z = 0.1 m, x up to the front [m].
pub(crate) const CUT_Z: f64 = 0.1;
pub(crate) const FRONT_X: f64 = 0.015;
/// The strip that is loaded in `tc2force` and `tc2strip`: z = 0.2 m, x up to this [m].
pub(crate) const STRIP_X: f64 = 0.005;

/// Whether a rest position lies on the strip.
pub(crate) fn on_strip(X: &Vector3<f64>) -> bool {
    X.z > 0.2 - 1e-9 && X.x < STRIP_X + 1e-9
}

/// ∫ N_a dA over the strip {z = 0.2, x ≤ 0.005} [m²].
fn strip_areas(model: &Model) -> Vec<f64> {
    let mut areas = vec![0.0; model.n_nodes()];
    for e in 0..model.n_elements() {
        let face: Vec<usize> =
            model.element(e).iter().map(|&n| n as usize).filter(|&n| on_strip(&model.rest()[n])).collect();
        let X = |k: usize| model.rest()[face[k]];
        match (model.kind(), face.len()) {
            (ElementKind::Tet4, 3) => {
                let area = 0.5 * (X(1) - X(0)).cross(&(X(2) - X(0))).norm();
                face.iter().for_each(|&n| areas[n] += area / 3.0);
            }
            (ElementKind::Hex8, 4) => {
                let area = (X(1) - X(0)).cross(&(X(2) - X(0))).norm();
                face.iter().for_each(|&n| areas[n] += area / 4.0);
            }
            // Corners come before middles; a quadratic triangle has ∫ N = 0 there and A/3 here.
            (ElementKind::Tet10, 6) => {
                let area = 0.5 * (X(1) - X(0)).cross(&(X(2) - X(0))).norm();
                face[3..].iter().for_each(|&n| areas[n] += area / 3.0);
            }
            _ => {}
        }
    }
    areas
}

/// Equilibrium of the half model in a case, its linear systems solved by `method`.
pub(crate) fn solve(method: Method, model: &Model, case: &str) -> Vec<Vector3<f64>> {
    let rest = model.rest();
    let mut fixed = clamped(model, |X| X.z < 1e-9);
    let middle = |n: &usize| rest[*n].y > 0.03 - 1e-9 && rest[*n].z > 1e-9;
    fixed.extend((0..rest.len()).filter(middle).map(|n| held(n, [false, true, false], rest[n])));
    let mut loads = vec![Vector3::zeros(); rest.len()];
    if case.starts_with("tc1") {
        let integrals = loads.iter_mut().zip(model.shape_integrals());
        integrals.for_each(|(f, v)| f.x = DENSITY * 9.81 * v);
    }
    if case.starts_with("tc2force") {
        let traction = 5.0 / (STRIP_X * 0.06);
        loads.iter_mut().zip(strip_areas(model)).for_each(|(f, a)| f.z = traction * a);
    }
    if !case.starts_with("tc2strip") {
        return equilibrium_by(method, model, &loads, &fixed, rest);
    }
    let axes = if case.contains("xyz") { [true; 3] } else { [false, false, true] };
    let strip: Vec<usize> = (0..rest.len()).filter(|&n| on_strip(&rest[n])).collect();
    let steps = if model.law() == Law::Linear { 1 } else { 2 };
    let mut x = rest.to_vec();
    for step in 1..=steps {
        let pull = Vector3::new(0.0, 0.0, 0.02 * f64::from(step) / f64::from(steps));
        let mut now = fixed.clone();
        now.retain(|f: &FixedCopy| !strip.contains(&(f.copy as usize)));
        now.extend(strip.iter().map(|n| held(*n, [axes[0], axes[1] || middle(n), axes[2]], rest[*n] + pull)));
        x = equilibrium_by(method, model, &loads, &now, &x);
    }
    x
}
