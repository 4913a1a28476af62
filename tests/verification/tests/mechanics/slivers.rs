//! Slivers cost no iterations: block-Jacobi conjugate gradients on bodies whose cut leaves pieces of
//! 1e-3 … 1e-15 of an element, against the same body uncut.

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, Outcome, PcgSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::support::material;

type V = Vector3<f64>;

const CELLS: usize = 6;
const SIDE: f64 = 0.1;
const STEPS: usize = 10;
/// Length of a step [s].
const H: f64 = 0.02;
const TOLERANCE: f64 = 1e-4;
const FRACTIONS: [f64; 5] = [1e-3, 1e-6, 1e-9, 1e-12, 1e-15];

/// Iterations of block-Jacobi conjugate gradients per linear system: where a step takes several Newton
/// steps, their mean.
#[derive(Clone, Copy, Debug)]
struct Count {
    first_step: f64,
    mean: f64,
    most: f64,
}

/// A cube held by its top that is cut at a distance of v^⅓ cells above a layer of nodes as far as
/// `reach`, so that pieces with one node have the volume fraction v, under a gravity that goes round: no
/// step is easy because the last one did its work.
fn iterations(law: Law, arithmetic: Arithmetic, cut: Option<(f64, f64)>) -> Count {
    let mesh = box_mesh(V::zeros(), V::repeat(SIDE), [CELLS; 3], BoxPattern::Tet6);
    let top: Vec<u32> =
        (0u32..).zip(&mesh.nodes).filter(|(_, X)| X.z > 0.999 * SIDE).map(|(n, _)| n).collect();
    let settings = BodySettings {
        solver: PcgSettings { iterations: 5_000, tolerance: TOLERANCE },
        arithmetic: Some(arithmetic),
        ..BodySettings::default()
    };
    let mut body = Body::new(mesh, material(3e5, 0.35, 1000.0, law), settings).unwrap();
    body.fix(&top, [true; 3], V::zeros()).unwrap();
    assert_eq!(body.is_fast(), arithmetic == Arithmetic::Single);
    if let Some((fraction, reach)) = cut {
        let z = SIDE / CELLS as f64 * (2.0 + fraction.cbrt());
        let blade = |x: f64| [V::new(x, -0.1, z), V::new(x, 0.2, z)];
        body.cut(&BladeSweep { segments: vec![blade(-0.1), blade(reach)] }, 1).unwrap();
        let least = body.tets().unwrap().pieces().iter().map(|p| p.fraction).fold(1.0, f64::min);
        assert!((least / fraction).ln().abs() < 0.1, "least fraction {least:e} instead of {fraction:e}");
    }
    let mut counts = Vec::new();
    for step in 0..STEPS {
        let angle = 1.3 * step as f64;
        let report = body.step(H, 9.81 * V::new(angle.cos(), angle.sin(), -0.5), &[]);
        assert_eq!(report.outcome, Outcome::Advanced);
        assert!(report.iterations < 5_000, "{report:?}");
        counts.push(f64::from(report.iterations) / f64::from(report.newton_steps));
    }
    Count {
        first_step: counts[0],
        mean: counts.iter().sum::<f64>() / STEPS as f64,
        most: counts.iter().copied().fold(0.0, f64::max),
    }
}

/// Compares the slivers with the uncut body, and with the same cut through the middle of elements.
fn compare(path: &str, law: Law, arithmetic: Arithmetic) {
    let uncut = iterations(law, arithmetic, None);
    println!("{path}, uncut: {uncut:.1?}");
    for (kind, reach) in [("cut off", 2.0 * SIDE), ("half cut", 0.501 * SIDE)] {
        let middle = iterations(law, arithmetic, Some((0.1, reach)));
        println!("{path}, {kind}, pieces of 0.1: {middle:.1?}, {:.2?} × uncut", ratios(&middle, &uncut));
        for fraction in FRACTIONS {
            let count = iterations(law, arithmetic, Some((fraction, reach)));
            let of_uncut = ratios(&count, &uncut);
            println!("{path}, {kind}, slivers of {fraction:e}: {count:.1?}, {of_uncut:.2?} × uncut");
            assert!(of_uncut.iter().all(|r| *r <= 1.5), "{path}, {kind}, {fraction:e}: {of_uncut:?}");
        }
    }
}

fn ratios(a: &Count, b: &Count) -> [f64; 3] {
    let of = |c: &Count| [c.first_step, c.mean, c.most];
    let (a, b) = (of(a), of(b));
    std::array::from_fn(|k| a[k] / b[k])
}

#[test]
fn fast_path() {
    compare("fast path, corotational", Law::Corotational, Arithmetic::Single);
    compare("fast path, linear", Law::Linear, Arithmetic::Single);
}

#[test]
fn general_path() {
    compare("general path, mixed", Law::Corotational, Arithmetic::Mixed);
    compare("general path, double", Law::Corotational, Arithmetic::Double);
}

#[test]
fn general_path_with_newton() {
    compare("general path, St. Venant–Kirchhoff", Law::StVenantKirchhoff, Arithmetic::Mixed);
}
