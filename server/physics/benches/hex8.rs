//! Compares steps of hexahedra on the kernels of cells with those of the general path:
//! `cargo bench -p scindo-physics --bench hex8`. `-- --quick` makes short runs. Both are measured in turns, so that
//! a busy moment of the machine hits both.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, Method, PcgSettings};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::box_hexes;

const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A bar of cubes, clamped at x = 0, in implicit Euler to 1e-4.
fn bar(across: usize, law: Law, method: Method, arithmetic: Option<Arithmetic>) -> Body {
    let mesh = box_hexes(Vector3::zeros(), Vector3::new(1.0, 0.25, 0.25), [4 * across, across, across]);
    let clamp: Vec<u32> = (0..mesh.nodes.len() as u32).filter(|&n| mesh.nodes[n as usize].x == 0.0).collect();
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.002 };
    let material = Material { young_pa: 1e5, poisson: 0.35, density_kg_m3: 1000.0, rayleigh, law };
    let solver = PcgSettings { iterations: 2000, tolerance: 1e-4 };
    let settings = BodySettings { method, arithmetic, solver, ..BodySettings::default() };
    let mut body = Body::hex8(mesh, material, settings).unwrap();
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    body
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    for (name, law) in [("linear", Law::Linear), ("corotational", Law::Corotational)] {
        for across in if quick { vec![4] } else { vec![5, 10] } {
            let mut bodies = [
                ("general path, pcg", bar(across, law, Method::Pcg, Some(Arithmetic::Mixed))),
                ("kernel of cells, pcg", bar(across, law, Method::Pcg, None)),
                ("kernel of cells, mg-pcg", bar(across, law, Method::MgPcg, None)),
            ];
            let mut times: [Vec<f64>; 3] = Default::default();
            let mut iterations = [0; 3];
            for step in 0..if quick { 2 } else { 30 } {
                for (k, (_, body)) in bodies.iter_mut().enumerate() {
                    let start = Instant::now();
                    let report = body.step(0.01, DOWN, &[]);
                    // The first steps fill caches.
                    if step > 0 {
                        times[k].push(start.elapsed().as_secs_f64());
                        iterations[k] += report.iterations;
                    }
                }
            }
            println!("{name}, {} cubes:", bodies[0].1.n_elements());
            let median = times.each_mut().map(|times| {
                times.sort_by(f64::total_cmp);
                times[times.len() / 2]
            });
            for (k, (way, _)) in bodies.iter().enumerate() {
                println!(
                    "  {way:<24} {:8.2} ms per step, {:5.1} iterations; {:5.1} times as fast",
                    median[k] * 1e3,
                    f64::from(iterations[k]) / times[k].len() as f64,
                    median[0] / median[k]
                );
            }
        }
    }
}
