//! The drooping bar of the thesis (Jeřábková 2007): static solutions of three laws on its own mesh.

use nalgebra::Vector3;
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::support::{clamped, equilibrium, material, reference, vector};

/// Displacements that agree to this part of the largest one.
const RELATIVE: f64 = 1e-6;

fn assert_bar(parity: bool, law: Law, key: &str) {
    let mesh =
        box_mesh(Vector3::zeros(), Vector3::new(1.0, 0.2, 0.2), [40, 8, 8], BoxPattern::Tet5 { parity });
    let model = Model::tet4(&mesh, &material(1e5, 0.33, 100.0, law), Volumetric::Full).unwrap();
    let weight: Vec<_> = model.lumped_mass(100.0).iter().map(|m| Vector3::new(0.0, -9.81 * m, 0.0)).collect();
    let x = equilibrium(&model, &weight, &clamped(&model, |X| X.x < 1e-9), model.rest());
    let u = |n: usize| x[n] - model.rest()[n];
    let expected = &reference("R3/bar.json")[if parity { "parity1" } else { "parity0" }][key];
    let tip: Vec<usize> = (0..model.n_nodes()).filter(|&n| model.rest()[n].x > 1.0 - 1e-9).collect();
    let mean = tip.iter().map(|&n| u(n)).sum::<Vector3<f64>>() / tip.len() as f64;
    let reference_mean = vector(&expected["tip_mean_u"]);
    println!("{law:?}, parity {parity}: mean tip {:.9} {:.9} m", mean.x, mean.y);
    let size = reference_mean.norm();
    assert!((mean - reference_mean).norm() < RELATIVE * size, "{mean} instead of {reference_mean}");
    assert!((mean.y / reference_mean.y - 1.0).abs() < RELATIVE);
    let energy = expected["strain_energy"].as_f64().unwrap();
    assert!((model.energy(&x) / energy - 1.0).abs() < RELATIVE);
    for (name, probe) in expected["probes"].as_object().unwrap() {
        let found = u(probe["node"].as_u64().unwrap() as usize);
        assert!((found - vector(&probe["u"])).norm() < RELATIVE * size, "{name}: {found}");
    }
}

#[test]
fn corotational() {
    assert_bar(false, Law::Corotational, "corot");
    assert_bar(true, Law::Corotational, "corot");
}

#[test]
fn st_venant_kirchhoff() {
    assert_bar(false, Law::StVenantKirchhoff, "stvk");
}

#[test]
fn linear() {
    assert_bar(false, Law::Linear, "linear");
}
