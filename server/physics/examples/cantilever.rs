//! A cantilever: a bar held at one end sags under its weight until it rests. Then it is cut.
//!
//! `cargo run -p scindo-physics --example cantilever`

#![allow(non_snake_case)] // X is where a node rests

use std::error::Error;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, PcgSettings, StaticSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

fn main() -> Result<(), Box<dyn Error>> {
    let size = Vector3::new(0.3, 0.05, 0.05); // m
    let mesh = box_mesh(Vector3::zeros(), size, [24, 4, 4], BoxPattern::Tet6);
    let material = Material {
        young_pa: 2e6,
        poisson: 0.4,
        density_kg_m3: 1000.0,
        rayleigh: Rayleigh { mass_1_s: 1.0, stiffness_s: 0.01 },
        law: Law::Corotational,
    };
    let solver = PcgSettings { iterations: 500, tolerance: 1e-4 };
    let mut body = Body::new(mesh, material, BodySettings { solver, ..BodySettings::default() })?;

    // Hold every node of the left face.
    let held: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| X.x == 0.0).map(|(node, _)| node).collect();
    body.fix(&held, [true; 3], Vector3::zeros())?;

    // Where it rests: Newton's method, no inertia.
    let gravity = Vector3::new(0.0, 0.0, -9.81); // m/s²
    let report =
        body.solve_static(gravity, &StaticSettings { tolerance: 1e-6, ..StaticSettings::default() })?;
    let tip = |body: &Body| {
        let depths = body.positions().iter().zip(body.rest_positions()).map(|(x, X)| X.z - x.z);
        1e3 * depths.fold(0.0, f64::max)
    };
    println!("{} elements; at rest the tip hangs {:.2} mm low", body.n_elements(), tip(&body));
    if !report.converged {
        return Err(format!("no equilibrium: {report:?}").into());
    }

    // Cut from above, two thirds of the way through, and watch it swing for half a second.
    let edge = |z: f64| [Vector3::new(0.1, -0.01, z), Vector3::new(0.1, 0.06, z)];
    let cut = body.cut(&BladeSweep { segments: vec![edge(0.1), edge(0.015)] }, 1)?;
    println!("the blade met {} elements; new copies of nodes: {}", cut.elements_cut, cut.new_copies.len());
    for step in 1..=50 {
        let report = body.step(0.01, gravity, &[]);
        if step % 10 == 0 {
            let (time_s, iterations) = (0.01 * f64::from(step), report.iterations);
            println!("{time_s:.1} s: tip {:.2} mm low, {iterations} iterations", tip(&body));
        }
    }
    Ok(())
}
