//! Enriched elements and bodies held against published figures and against pieces on copies.

mod bodies;

mod critical_step;

use nalgebra::Vector3;
use scindo_physics::assembly::Model;
use scindo_physics::element::FixedCopy;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::tet_volume;

use super::cut_element::tet_stiffness;
use super::spectrum::largest_frequency;

fn material(young_pa: f64, poisson: f64, density_kg_m3: f64, law: Law) -> Material {
    Material { young_pa, poisson, density_kg_m3, rayleigh: Rayleigh::default(), law }
}

/// The nodes for which `choose` is true, held in all directions where they are at rest.
fn clamped(model: &Model, choose: impl Fn(&Vector3<f64>) -> bool) -> Vec<FixedCopy> {
    let held = (0u32..).zip(model.rest()).filter(|(_, X)| choose(X));
    held.map(|(copy, X)| FixedCopy { copy, held: [true; 3].into(), position_m: (*X).into() }).collect()
}

/// R4.
#[test]
fn single_tets_have_the_published_frequencies() {
    let v = Vector3::new;
    let shapes = [
        ("unit_corner", [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, 1.0)]),
        (
            "regular_edge1",
            [v(1.0, 1.0, 1.0), v(1.0, -1.0, -1.0), v(-1.0, 1.0, -1.0), v(-1.0, -1.0, 1.0)]
                .map(|x| x / 8_f64.sqrt()),
        ),
        ("kuhn_unit_cube", [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(1.0, 1.0, 1.0)]),
        ("five_central_unit_cube", [v(0.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(1.0, 0.0, 1.0), v(0.0, 1.0, 1.0)]),
    ];
    let materials = [
        ("E=1,nu=0,rho=1", 1.0, 0.0, 1.0),
        ("E=1,nu=0.25,rho=1", 1.0, 0.25, 1.0),
        ("E=1,nu=0.3,rho=1", 1.0, 0.3, 1.0),
        ("E=300000,nu=0.35,rho=1070", 3e5, 0.35, 1070.0),
        ("E=100000,nu=0.33,rho=100", 1e5, 0.33, 100.0),
    ];
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/reference/R4/omega_max.json");
    let table: serde_json::Value = serde_json::from_reader(std::fs::File::open(path).unwrap()).unwrap();
    let mut worst = 0.0_f64;
    for (shape, corners) in shapes {
        for (name, young, poisson, density) in materials {
            let stiffness = tet_stiffness(&corners, material(young, poisson, density, Law::Linear).lame());
            let m = density * tet_volume(&corners).abs();
            for (kind, entry) in [("lumped", [0.25, 0.0]), ("consistent", [0.1, 0.05])] {
                let mass = nalgebra::DMatrix::from_fn(12, 12, |r, c| {
                    let axis = f64::from(u8::from(r % 3 == c % 3));
                    m * axis * entry[usize::from(r / 3 != c / 3)]
                });
                let omega = largest_frequency(&stiffness, &mass).unwrap();
                let expected = table[format!("{shape}|{name}")][kind].as_f64().unwrap();
                worst = worst.max((omega / expected - 1.0).abs());
            }
        }
    }
    println!("R4 (b): 40 single tets, largest relative error of ω_max {worst:.1e}");
    assert!(worst < 1e-12);
}
