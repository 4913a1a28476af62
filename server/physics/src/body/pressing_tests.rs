//! The force against the geometry, its potential and the load stiffness.

use fastrand::Rng;
use nalgebra::{Rotation3, Vector3};
use scindo_algebra::assembly::BlockCsr;
use scindo_algebra::assembly::pressure::{Follower, Pressure};
use scindo_matter::element::MaterialPoint;
use scindo_matter::material::{Law, Material, Rayleigh};
use scindo_matter::mesh::{BoxPattern, box_hexes, box_mesh};

use crate::body::{Body, BodySettings, ElementKind};

const PASCALS: f64 = 300.0;
const RUBBER: Material = Material {
    young_pa: 1e4,
    poisson: 0.4,
    density_kg_m3: 1e3,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::NeoHookean,
};

fn body(element: ElementKind) -> Body {
    let size = Vector3::new(0.3, 0.2, 0.1);
    let settings = BodySettings { element, ..BodySettings::default() };
    match element {
        ElementKind::Hex8 => Body::hex8(box_hexes(Vector3::zeros(), size, [3, 2, 1]), RUBBER, settings),
        _ => Body::new(box_mesh(Vector3::zeros(), size, [3, 2, 1], BoxPattern::Tet6), RUBBER, settings),
    }
    .unwrap()
}

/// The faces of a body all of whose nodes rest where `on` is true.
fn faces(body: &Body, on: impl Fn(&Vector3<f64>) -> bool) -> (Pressure, Vec<Vector3<f64>>) {
    let space = body.discretisation();
    let selected: Vec<bool> = body.rest_positions().iter().map(on).collect();
    let mut pressure = Pressure::default();
    let load = pressure.add_load(PASCALS);
    space.for_skin_faces(&selected, &mut |points| pressure.add_face(load, points));
    (pressure, body.rest_positions().to_vec())
}

fn deformed(rest: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut random = Rng::with_seed(7);
    rest.iter()
        .map(|X| {
            1.5 * X + Vector3::from_fn(|_, _| 0.04 * (random.f64() - 0.5)) + Vector3::new(4.0, -3.0, 2.0)
        })
        .collect()
}

fn forces(pressure: &Pressure, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut f = vec![Vector3::zeros(); x.len()];
    pressure.add_forces(x, &mut f);
    f
}

const KINDS: [ElementKind; 3] = [ElementKind::Tet4, ElementKind::Tet10, ElementKind::Hex8];

/// Force and moment of constant pressure on a closed surface vanish, and the force on every node follows a rotation.
#[test]
fn a_closed_surface_feels_no_resultant_and_forces_turn_with_it() {
    for kind in KINDS {
        let (pressure, rest) = faces(&body(kind), |_| true);
        let x = deformed(&rest);
        let f = forces(&pressure, &x);
        let size: f64 = f.iter().map(Vector3::norm).sum();
        let (sum, moment) = (f.iter().sum::<Vector3<f64>>(), x.iter().zip(&f).map(|(x, f)| x.cross(f)));
        assert!(sum.norm() < 1e-14 * size, "{kind:?}: {sum} of {size} N");
        let moment = moment.sum::<Vector3<f64>>();
        assert!(moment.norm() < 1e-13 * size * 5.0, "{kind:?}: {moment}");

        let (part, _) = faces(&body(kind), |X| X.z > 0.0999 && X.x < 0.21);
        let turn = Rotation3::new(Vector3::new(0.7, -1.9, 0.4));
        let turned: Vec<_> = x.iter().map(|x| turn * x).collect();
        let pairs = forces(&part, &x).into_iter().zip(forces(&part, &turned));
        let off = pairs.map(|(f, g)| (turn * f - g).norm()).fold(0.0, f64::max);
        assert!(off < 1e-14 * size, "{kind:?}: {off}");
    }
}

/// On a flat face the force is p times its area, shared as the shape functions are.
#[test]
fn a_flat_face_takes_pressure_times_area() {
    for kind in KINDS {
        let (top, rest) = faces(&body(kind), |X| X.z > 0.0999);
        let f = forces(&top, &rest);
        let sum: Vector3<f64> = f.iter().sum();
        assert!((sum - Vector3::new(0.0, 0.0, -PASCALS * 0.06)).norm() < 1e-12, "{kind:?}: {sum}");
        let corner = rest.iter().position(|X| X.norm() > 0.3741).unwrap();
        let share = f[corner].z / sum.z;
        let expected = match kind {
            ElementKind::Tet10 => 0.0, // ∫ N dA of a corner is 0
            ElementKind::Hex8 => 1.0 / 24.0,
            _ => 2.0 / 36.0, // two of twelve triangles meet there, in this division
        };
        assert!((share - expected).abs() < 1e-12, "{kind:?}: {share}");
    }
}

/// On a closed surface f = −p ∂V/∂x, and its work is −p ΔV, whatever the way.
#[test]
fn the_work_on_a_closed_surface_is_that_of_its_volume() {
    for kind in KINDS {
        let body = body(kind);
        let (pressure, rest) = faces(&body, |_| true);
        let x = deformed(&rest);
        let volume = |x: &[Vector3<f64>]| pressure.potential(x, &Vector3::new(4.0, -3.0, 2.0)) / PASCALS;
        assert!((volume(&rest) / 0.006 - 1.0).abs() < 1e-12, "{kind:?}");
        let work = pressure.work(&rest, &x);
        let expected = -PASCALS * (volume(&x) - volume(&rest));
        assert!((work - expected).abs() < 1e-9 * expected.abs(), "{kind:?}: {work} {expected}");
        let mut g = vec![Vector3::zeros(); x.len()];
        pressure.add_gradient(&x, &Vector3::new(4.0, -3.0, 2.0), &mut g);
        for (f, g) in forces(&pressure, &x).iter().zip(&g) {
            assert!((f + g).norm() < 1e-12, "{kind:?}: {f} {g}");
        }
    }
}

/// Differences of the potential give its gradient and those of the gradient its second derivative, on a part of the
/// surface. The gradient at the iterate is minus the force.
#[test]
fn the_potential_around_the_iterate_is_consistent() {
    for kind in KINDS {
        let body = body(kind);
        let (pressure, rest) = faces(&body, |X| X.z > 0.0999 && X.x < 0.21);
        let (x, h) = (deformed(&rest), 1e-6);
        let mut follower = Follower::default();
        follower.begin(&pressure, &x);
        let mut g = vec![Vector3::zeros(); x.len()];
        follower.add_to(&pressure, &x, Some(&mut g));
        let scale = forces(&pressure, &x).iter().map(Vector3::norm).fold(0.0, f64::max);
        for (f, g) in forces(&pressure, &x).iter().zip(&g) {
            assert!((f + g).norm() < 1e-12 * scale, "{kind:?}: {f} {g}");
        }
        // Away from the iterate.
        let mut y: Vec<_> =
            x.iter().enumerate().map(|(i, x)| x + Vector3::new(0.0, 0.01, 1e-3 * i as f64)).collect();
        let mut H = body.discrete_model().unwrap().pattern();
        follower.add_hessian(&pressure, &y, &mut H);
        let value = |y: &[Vector3<f64>]| {
            let mut g = vec![Vector3::zeros(); y.len()];
            (follower.add_to(&pressure, y, Some(&mut g)), g)
        };
        let (_, at_y) = value(&y);
        let loaded: Vec<usize> = (0..x.len()).filter(|&n| forces(&pressure, &x)[n].norm() > 0.0).collect();
        assert!(loaded.len() >= 9);
        let stiffness = PASCALS * 0.1;
        for &n in &loaded {
            for axis in 0..3 {
                y[n][axis] += h;
                let (above, g_above) = value(&y);
                y[n][axis] -= 2.0 * h;
                let (below, g_below) = value(&y);
                y[n][axis] += h;
                let slope = (above - below) / (2.0 * h);
                assert!((slope - at_y[n][axis]).abs() < 1e-7 * scale, "{kind:?}: {slope} {}", at_y[n][axis]);
                for &m in &loaded {
                    let found = (g_above[m] - g_below[m]) / (2.0 * h);
                    let column = block(&H, m, n).column(axis).into_owned();
                    assert!((found - column).norm() < 1e-7 * stiffness, "{kind:?}: {found} {column}");
                    assert!((block(&H, m, n) - block(&H, n, m).transpose()).norm() < 1e-12 * stiffness);
                }
            }
        }
    }
}

fn block(H: &BlockCsr<f64>, a: usize, b: usize) -> nalgebra::Matrix3<f64> {
    H.position(a, b as u32)
        .map_or_else(nalgebra::Matrix3::zeros, |at| nalgebra::Matrix3::from_row_slice(&H.blocks[at]))
}

/// On a closed surface the second derivative of the potential is the whole load stiffness −∂f/∂x.
#[test]
fn the_load_stiffness_of_a_closed_surface_is_that_of_the_force() {
    for kind in KINDS {
        let body = body(kind);
        let (pressure, rest) = faces(&body, |_| true);
        let (mut x, h) = (deformed(&rest), 1e-6);
        let mut follower = Follower::default();
        follower.begin(&pressure, &x);
        let mut H = body.discrete_model().unwrap().pattern();
        follower.add_hessian(&pressure, &x, &mut H);
        for (n, axis) in [(0, 0), (5, 2), (11, 1)] {
            x[n][axis] += h;
            let above = forces(&pressure, &x);
            x[n][axis] -= 2.0 * h;
            let below = forces(&pressure, &x);
            x[n][axis] += h;
            for m in 0..x.len() {
                let found = (above[m] - below[m]) / (2.0 * h);
                let column = block(&H, m, n).column(axis).into_owned();
                assert!((found + column).norm() < 1e-6 * PASCALS, "{kind:?}: {found} {column}");
            }
        }
    }
}

/// Other numbers of points than those of a face add nothing.
#[test]
fn unknown_faces_are_left_out() {
    let mut pressure = Pressure::default();
    let load = pressure.add_load(1.0);
    pressure.add_face(load, &[MaterialPoint::new([(0, 1.0)]); 5]);
    assert!(pressure.is_empty() && forces(&pressure, &[Vector3::x()]) == [Vector3::zeros()]);
}
