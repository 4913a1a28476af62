//! Families of fibres against closed forms: the modulus of a lamina off its axis, an orthotropic block, and finite
//! tension along fibres that stiffen.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::element::FixedCopy;
use scindo_physics::material::{Fibre, Fibres, Law};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};

use crate::support::{equilibrium, held, material};

const SIZE: Vector3<f64> = Vector3::new(1.2, 0.8, 1.0);
const YOUNG: f64 = 3.0;
const POISSON: f64 = 0.3;

fn models(law: Law, fibres: Fibres) -> Vec<Model> {
    let tets = box_mesh(Vector3::zeros(), SIZE, [4, 3, 3], BoxPattern::Tet5 { parity: false });
    let material = material(YOUNG, POISSON, 1.0, law);
    let mut models = vec![
        Model::tet4(&tets, &material, Volumetric::Full).unwrap(),
        Model::tet10(&tets, &material).unwrap(),
    ];
    let hexes = box_hexes(Vector3::zeros(), SIZE, [4, 3, 3]);
    models.push(Model::hex8(&hexes, &material, Volumetric::Full).unwrap());
    if law.splits() {
        models.push(Model::hex8(&hexes, &material, Volumetric::Selective).unwrap());
        models.push(Model::tet4(&tets, &material, Volumetric::NodeAveraged { kept: 0.05 }).unwrap());
    }
    models.into_iter().map(|model| model.with_fibres(fibres).unwrap()).collect()
}

fn along(direction: [f64; 3], stiffness_pa: f64, stiffening: f64) -> Fibre {
    Fibre { direction: direction.into(), stiffness_pa, stiffening }
}

/// The strain under tension `sigma` [Pa] along x, from the compliance matrix (Voigt, engineering shear strains) of an
/// isotropic matrix with families of fibres.
fn strain(fibres: &Fibres, sigma: f64) -> Matrix3<f64> {
    let (mu, lambda) =
        (YOUNG / (2.0 * (1.0 + POISSON)), YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)));
    let mut C = Matrix6::zeros();
    C.fixed_view_mut::<3, 3>(0, 0).fill(lambda);
    (0..3).for_each(|k| C[(k, k)] += 2.0 * mu);
    (3..6).for_each(|k| C[(k, k)] = mu);
    for Fibre { direction: a, stiffness_pa, .. } in fibres.iter() {
        let m = Vector6::new(a.x * a.x, a.y * a.y, a.z * a.z, a.y * a.z, a.x * a.z, a.x * a.y);
        C += *stiffness_pa * m * m.transpose();
    }
    let e = C.try_inverse().unwrap() * Vector6::new(sigma, 0.0, 0.0, 0.0, 0.0, 0.0);
    let (yz, xz, xy) = (0.5 * e[3], 0.5 * e[4], 0.5 * e[5]);
    Matrix3::new(e[0], xy, xz, xy, e[1], yz, xz, yz, e[2])
}

/// The forces of a uniform stress are in balance inside, and those on the faces across x are `sigma` times their area.
fn carries(model: &Model, x: &[Vector3<f64>], sigma: f64) {
    let mut f = vec![Vector3::zeros(); x.len()];
    model.internal_forces(x, &mut f);
    let mut pull = Vector3::zeros();
    for (X, f) in model.rest().iter().zip(&f) {
        if X.x > SIZE.x - 1e-9 {
            pull += f;
        } else if X.x > 1e-9 {
            assert!(f.amax() < 1e-12, "{:?}: {f} at {X}", model.kind());
        }
    }
    let expected = Vector3::new(sigma * SIZE.y * SIZE.z, 0.0, 0.0);
    assert!((pull - expected).amax() < 1e-11, "{:?} {:?}: {pull}", model.kind(), model.volumetric());
}

#[test]
fn a_lamina_pulled_off_its_axis_stretches_and_shears_as_its_compliance_says() {
    let mut moduli = Vec::new();
    for degrees in [0.0_f64, 15.0, 30.0, 45.0, 60.0, 90.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let fibres = Fibres::new([along([cos, sin, 0.0], 12.0, 0.0)]);
        let e = strain(&fibres, 0.1);
        moduli.push(0.1 / e[(0, 0)]);
        for model in models(Law::Linear, fibres) {
            let x: Vec<_> = model.rest().iter().map(|X| X + e * X).collect();
            carries(&model, &x, 0.1);
        }
    }
    assert!((moduli[0] - (YOUNG + 12.0)).abs() < 1e-9, "along the fibres: {moduli:?}");
    assert!(moduli[..5].windows(2).all(|pair| pair[0] > pair[1]), "{moduli:?}");
    assert!(moduli[5] > 1.05 * YOUNG, "fibres across the tension hinder the contraction: {moduli:?}");
}

#[test]
fn three_families_make_a_block_orthotropic() {
    let fibres = Fibres::new([
        along([1.0, 0.0, 0.0], 9.0, 0.0),
        along([0.0, 1.0, 0.0], 2.0, 0.0),
        along([0.0, 0.0, 1.0], 0.5, 0.0),
    ]);
    let e = strain(&fibres, 0.1);
    assert!(e[(1, 1)].abs() < 0.8 * e[(2, 2)].abs(), "the stiffer side contracts less: {e}");
    for model in models(Law::Linear, fibres) {
        let x: Vec<_> = model.rest().iter().map(|X| X + e * X).collect();
        carries(&model, &x, 0.1);
    }
}

/// Ends that are held along x only, and what keeps the block from moving across.
fn drawn(model: &Model, stretch: f64) -> Vec<FixedCopy> {
    let mut fixed = Vec::new();
    for (n, X) in model.rest().iter().enumerate() {
        let (at_end, on_axis) = (X.x < 1e-9 || X.x > SIZE.x - 1e-9, X.y < 1e-9 && X.z < 1e-9);
        let axes = [at_end, X.y < 1e-9, X.z < 1e-9];
        if at_end || on_axis || axes[1] || axes[2] {
            fixed.push(held(n, axes, Vector3::new(stretch * X.x, X.y, X.z)));
        }
    }
    fixed
}

/// St. Venant–Kirchhoff's matrix under tension along x with free sides has S = E ε, so P = λ (E ε + k₁ ε exp(k₂ ε²)).
#[test]
fn finite_tension_along_fibres_has_the_stress_of_their_energy() {
    let (k1, k2) = (2.0, 1.5);
    for stretch in [0.9, 1.15, 1.4] {
        let strain: f64 = 0.5 * (stretch * stretch - 1.0);
        let fibres = if strain > 0.0 { k1 * strain * (k2 * strain * strain).exp() } else { 0.0 };
        let expected = stretch * (YOUNG * strain + fibres) * SIZE.y * SIZE.z;
        for model in models(Law::StVenantKirchhoff, Fibres::new([along([3.0, 0.0, 0.0], k1, k2)])) {
            // A sudden displacement would stretch the elements at the ends so far that exp(k₂ ε²) rules everything.
            let start: Vec<_> = model.rest().iter().map(|X| Vector3::new(stretch * X.x, X.y, X.z)).collect();
            let x = equilibrium(&model, &[], &drawn(&model, stretch), &start);
            let mut f = vec![Vector3::zeros(); x.len()];
            model.internal_forces(&x, &mut f);
            let ends = model.rest().iter().zip(&f).filter(|(X, _)| X.x > SIZE.x - 1e-9);
            let pull: f64 = ends.map(|(_, f)| f.x).sum();
            let error = (pull / expected - 1.0).abs();
            assert!(error < 1e-7, "{:?} at {stretch}: {pull} N, expected {expected}", model.kind());
        }
    }
}

#[test]
fn energy_forces_and_tangent_of_a_model_belong_together() {
    let fibres = Fibres::new([along([1.0, 0.4, 0.1], 5.0, 0.8), along([0.0, 0.3, 1.0], 2.0, 0.0)]);
    for law in Law::ALL {
        for model in models(law, fibres) {
            let bent = |X: &Vector3<f64>| {
                Vector3::new(1.15 * X.x, 1.05 * X.y, 1.08 * X.z)
                    + 0.04 * Vector3::new(X.y * X.z, X.x * X.x, X.x * X.y)
            };
            let x: Vec<_> = model.rest().iter().map(bent).collect();
            let mut K = model.pattern();
            model.tangent(&x, scindo_physics::material::Tangent::Exact, &mut K);
            let step: Vec<_> =
                (0..x.len()).map(|i| Vector3::new((i as f64).sin(), (2.0 * i as f64).cos(), 0.3)).collect();
            let (mut forward, mut backward, mut f) = (
                vec![Vector3::zeros(); x.len()],
                vec![Vector3::zeros(); x.len()],
                vec![Vector3::zeros(); x.len()],
            );
            model.internal_forces(&x, &mut f);
            let h = 1e-6;
            let moved =
                |sign: f64| -> Vec<_> { x.iter().zip(&step).map(|(x, s)| x + sign * h * s).collect() };
            let high = model.internal_forces(&moved(1.0), &mut forward);
            let low = model.internal_forces(&moved(-1.0), &mut backward);
            assert!((model.energy(&moved(1.0)) - high).abs() < 1e-12 * high.abs());
            let work: f64 = f.iter().zip(&step).map(|(f, s)| f.dot(s)).sum();
            assert!(((high - low) / (2.0 * h) - work).abs() < 1e-6 * (1.0 + work.abs()), "{law:?}");
            let mut product = vec![Vector3::zeros(); x.len()];
            K.multiply(&step, &mut product);
            let size = product.iter().map(|p| p.norm()).fold(0.0, f64::max);
            for ((a, b), p) in forward.iter().zip(&backward).zip(&product) {
                assert!(((a - b) / (2.0 * h) - p).norm() < 1e-6 * size, "{law:?} {:?}", model.kind());
            }
        }
    }
}
