//! R4: the critical time step of meshes; a free-spinning cube under explicit integration.

use scindo_physics::integrator::{DynamicsSettings, MassKind, Notice, Outcome, Scheme};
use scindo_physics::material::Law;
use serde_json::Value;

use crate::bodies::{Run, V, held_at_zero, material, tet_box};

fn reference(file: &str) -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../reference/R4/").to_owned() + file;
    serde_json::from_reader(std::fs::File::open(path).unwrap()).unwrap()
}

fn explicit(scheme: Scheme) -> DynamicsSettings {
    DynamicsSettings { scheme, ..DynamicsSettings::default() }
}

#[test]
fn box_meshes_have_the_published_critical_steps() {
    let table = reference("omega_max.json");
    let cases = [
        ("R2 beam 6x12x40 5-tet lumped, z=0 fixed", [0.03, 0.06, 0.2], [6, 12, 40], (3e5, 0.35, 1070.0), 2),
        ("R3 bar 40x8x8 5-tet lumped, x=0 fixed", [1.0, 0.2, 0.2], [40, 8, 8], (1e5, 0.33, 100.0), 0),
    ];
    for (name, size, cells, (young, poisson, density), axis) in cases {
        let material = material(Law::Linear, young, poisson, density);
        let model = tet_box(size, cells, &material);
        let fixed = held_at_zero(&model, axis);
        let x = model.rest().to_vec();
        let mut run = Run::new(model, material, explicit(Scheme::SymplecticEuler));
        let omega = run.omega_max(&x, &fixed);
        let expected = table[name]["omega_max_global"].as_f64().unwrap();
        println!(
            "R4 (b) {name}: ω_max = {omega:.5}, reference {expected:.5}, {:.1e}",
            omega / expected - 1.0
        );
        assert!((omega / expected - 1.0).abs() < 1e-7);
        assert!(omega < table[name]["omega_max_element_bound"].as_f64().unwrap());
        // A step beyond it is divided, or refused with the state as it was.
        run.fixed = fixed;
        let h = 3.0 * 2.0 / omega;
        let report = run.step(h);
        assert!(matches!(report.notice, Some(Notice::Divided { substeps: 4, .. })), "{report:?}");
    }
}

#[test]
fn a_step_that_is_too_long_is_refused_in_words() {
    let material = material(Law::Corotational, 1e5, 0.3, 1000.0);
    let settings = DynamicsSettings { most_substeps: 1, ..explicit(Scheme::SymplecticEuler) };
    let mut run = Run::new(tet_box([0.1; 3], [2; 3], &material), material, settings);
    let before = run.state.clone();
    let report = run.step(0.02);
    assert_eq!((report.outcome, &run.state), (Outcome::Refused, &before));
    let words = report.notice.unwrap().to_string();
    assert!(words.contains("exceeds the stability limit"), "{words}");
}

/// Symplectic Euler with the velocities half a step behind is velocity Verlet.
#[test]
fn a_spinning_cube_keeps_its_energy_and_angular_momentum() {
    let table = reference("spinning_cube.json");
    for (law, name) in [(Law::Corotational, "corot"), (Law::StVenantKirchhoff, "stvk")] {
        let mut deviations = Vec::new();
        for run in table["runs"].as_array().unwrap().iter().filter(|run| run["law"] == name) {
            let number = |key: &str| run[key].as_f64().unwrap();
            let (h, steps, omega) = (number("dt"), number("steps") as usize, number("omega_max"));
            let [energy, drift, momentum] = spinning_cube(law, h, steps, omega, run);
            println!(
                "R4 (c) {name} h = {} Δt_c: |E/E0 − 1| ≤ {energy:.2e} (reference {:.2e}), drift {drift:.1e} \
                 ({:.1e}), |L − L0|/L0 ≤ {momentum:.1e} ({:.1e})",
                number("dt_over_dtc"),
                number("max_rel_energy_dev"),
                number("secular_energy_drift_rel"),
                number("max_rel_angmom_dev"),
            );
            assert!(energy < 1e-4 && drift < 1e-6 && momentum < 1e-11);
            assert!((energy / number("max_rel_energy_dev") - 1.0).abs() < 1e-3);
            deviations.push(energy);
        }
        let ratio = deviations[0] / deviations[1];
        assert!((3.5..4.5).contains(&ratio), "the deviation falls with h²: {ratio}");
    }
}

/// Largest deviation of energy and of angular momentum, relative, and drift of energy between the
/// first and the last tenth.
fn spinning_cube(law: Law, h: f64, steps: usize, omega_max: f64, reference: &Value) -> [f64; 3] {
    let material = material(law, 1e5, 0.3, 1000.0);
    let model = tet_box([0.1; 3], [4; 3], &material);
    let mut run = Run::new(model, material, explicit(Scheme::SymplecticEuler));
    run.spin(V::new(0.0, 0.0, 20.0));
    let x = run.state.x.clone();
    let omega = run.omega_max(&x, &[]);
    assert!((omega / omega_max - 1.0).abs() < 1e-8, "{omega} {omega_max}");
    let mass = run.masses.clone();
    let centre = run.centre_of_mass();
    let mut f = vec![V::zeros(); mass.len()];
    // Energy and angular momentum with the velocities at the time of the positions, which those of
    // the scheme are half a step behind.
    let mut measure = |run: &Run| {
        let elastic = run.model.internal_forces(&run.state.x, &mut f);
        let v: Vec<V> =
            run.state.v.iter().zip(&f).zip(&mass).map(|((v, f), m)| v - 0.5 * h / m * f).collect();
        let about_centre = |((x, v), m): ((&V, &V), &f64)| *m * (x - centre).cross(v);
        let angular: V = run.state.x.iter().zip(&v).zip(&mass).map(about_centre).sum();
        assert!(run.momentum().norm() < 1e-13);
        (elastic + run.kinetic_energy(&v), angular)
    };
    // At rest in shape there is no force, so the first velocities are those half a step earlier too.
    let (energy_0, angular_0) = measure(&run);
    assert!((energy_0 - 0.375).abs() < 1e-12 && (angular_0.z - 0.0375).abs() < 1e-13);
    let (mut energies, mut spin) = (Vec::new(), 0.0_f64);
    for _ in 0..steps {
        run.steps(h, 1);
        let (energy, angular) = measure(&run);
        energies.push(energy / energy_0 - 1.0);
        spin = spin.max((angular - angular_0).norm() / angular_0.norm());
    }
    let first = &reference["final_u_node0"];
    let u = run.state.x[0] - run.model.rest()[0];
    for k in 0..3 {
        assert!((u[k] - first[k].as_f64().unwrap()).abs() < 1e-9, "{u} {first}");
    }
    let tenth = energies.len() / 10;
    let mean = |e: &[f64]| e.iter().sum::<f64>() / e.len() as f64;
    let drift = (mean(&energies[energies.len() - tenth..]) - mean(&energies[..tenth])).abs();
    [energies.iter().fold(0.0, |m, e| e.abs().max(m)), drift, spin]
}

/// A consistent mass allows shorter steps than a lumped one, by √5 on a single tet and about that in a mesh.
#[test]
fn a_consistent_mass_shortens_the_critical_step() {
    let material = material(Law::Linear, 1e5, 0.3, 1000.0);
    let omega = |mass| {
        let settings = DynamicsSettings { mass, ..explicit(Scheme::SymplecticEuler) };
        let mut run = Run::new(tet_box([0.1; 3], [3; 3], &material), material, settings);
        let x = run.state.x.clone();
        run.omega_max(&x, &[])
    };
    let ratio = omega(MassKind::Consistent) / omega(MassKind::Lumped);
    assert!((1.5..2.3).contains(&ratio), "{ratio}");
}
