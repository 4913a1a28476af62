//! R4: natural frequencies of the clamped beam, and rigid modes of a free cube.

use nalgebra::Vector3;
use scindo_physics::assembly::{Model, Tangent, Volumetric};
use scindo_physics::element::FixedCopy;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};
use scindo_physics::solver::{EigenError, EigenSettings, Modes, natural_frequencies};
use scindo_physics::team::Team;
use serde_json::Value;

fn reference(file: &str) -> Value {
    let path = format!("{}/../reference/R4/{file}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn material(young_pa: f64, poisson: f64, density_kg_m3: f64) -> Material {
    Material { young_pa, poisson, density_kg_m3, rayleigh: Rayleigh::default(), law: Law::Linear }
}

const BEAM: [f64; 3] = [0.03, 0.06, 0.2];

/// Frequencies [Hz] and modes of a model with consistent mass, with z = 0 held or all free.
fn modes(model: &Model, density: f64, hold: bool, settings: &EigenSettings) -> Result<Modes, EigenError> {
    let (mut K, mut M) = (model.pattern(), model.pattern());
    model.tangent(model.rest(), Tangent::Exact, &mut K);
    model.consistent_mass(density, &mut M);
    let clamp = |(copy, X): (u32, &Vector3<f64>)| {
        (hold && X.z < 1e-9).then_some(FixedCopy { copy, held: [true; 3].into(), position_m: (*X).into() })
    };
    let fixed: Vec<_> = (0..).zip(model.rest()).filter_map(clamp).collect();
    natural_frequencies(&mut Team::new(1).unwrap(), (&K, &M), &fixed, settings)
}

fn beam_reference() -> Vec<f64> {
    let all = reference("beam_eigenfrequencies.json");
    let list = all["freqs_Hz_by_polynomial_order"]["4"]["freqs"].as_array().unwrap().clone();
    list.iter().map(|f| f[0].as_f64().unwrap()).collect()
}

fn worst(found: &Modes, exact: &[f64]) -> f64 {
    let hz: Vec<f64> = found.omega.iter().map(|w| w / std::f64::consts::TAU).collect();
    println!("{} iterations: {hz:.4?}", found.iterations);
    hz.iter().zip(exact).map(|(f, e)| (f / e - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn ten_frequencies_of_the_beam_with_quadratic_tets() {
    let mesh = box_mesh(Vector3::zeros(), BEAM.into(), [3, 6, 20], BoxPattern::Tet5 { parity: false });
    let model = Model::tet10(&mesh, &material(3e5, 0.35, 1070.0)).unwrap();
    let found = modes(&model, 1070.0, true, &EigenSettings::default()).unwrap();
    let worst = worst(&found, &beam_reference());
    println!("Tet10, {} nodes: worst of ten {:.3} %", model.n_nodes(), 100.0 * worst);
    assert!(found.converged && worst < 5e-3, "{worst}");
}

#[test]
fn linear_tets_are_too_stiff_and_improve_with_the_mesh() {
    let error = |cells| {
        let mesh = box_mesh(Vector3::zeros(), BEAM.into(), cells, BoxPattern::Tet5 { parity: false });
        let model = Model::tet4(&mesh, &material(3e5, 0.35, 1070.0), Volumetric::Full).unwrap();
        let settings = EigenSettings { count: 4, ..EigenSettings::default() };
        let found = modes(&model, 1070.0, true, &settings).unwrap();
        assert!(found.omega[0] / std::f64::consts::TAU > 2.02559, "stiffer than the continuum");
        worst(&found, &beam_reference())
    };
    let (coarse, fine) = (error([3, 6, 20]), error([6, 12, 40]));
    println!("Tet4: {:.2} % at 10 mm, {:.2} % at 5 mm", 100.0 * coarse, 100.0 * fine);
    assert!(fine < 0.06 && coarse / fine > 3.0, "{coarse} {fine}");
}

#[test]
fn a_free_body_has_six_rigid_modes_and_a_held_solve_of_it_is_refused() {
    let mesh = box_hexes(Vector3::zeros(), Vector3::repeat(0.1), [3, 3, 3]);
    let model = Model::hex8(&mesh, &material(1e5, 0.3, 1e3), Volumetric::Full).unwrap();
    let shifted = EigenSettings { count: 9, shift: 1e4, ..EigenSettings::default() };
    let found = modes(&model, 1e3, false, &shifted).unwrap();
    println!("{:.5?}", found.omega);
    assert!(found.omega[..6].iter().all(|w| *w < 1e-2 * found.omega[6]));
    // A cube: its lowest elastic frequencies come in pairs.
    assert!((found.omega[6] / found.omega[7] - 1.0).abs() < 1e-6);
    let refused = modes(&model, 1e3, false, &EigenSettings { count: 9, ..EigenSettings::default() });
    assert!(matches!(refused, Err(EigenError::Indefinite)), "{:?}", refused.map(|m| m.omega));
}
