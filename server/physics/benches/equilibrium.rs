//! Measures what a nonlinear equilibrium costs: `cargo bench -p scindo-physics --bench equilibrium`.
//! `-- --quick` runs everything once on a small beam.
//!
//! Schoch's beam of 9 × 18 × 61 cells, cut through its elements to half its depth and bent by gravity: the
//! equilibrium of St. Venant–Kirchhoff's law over that of the linear law. Both are the first step of a body
//! on the general path, with the same solver, arithmetic and tolerance; that of the linear law is one linear
//! solve. They are measured in turns, so that a busy moment of the machine hits both.

#![allow(clippy::disallowed_methods)] // a bench reads the clock

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{
    Arithmetic, Body, BodySettings, Method, PcgSettings, Scheme, SolveReport, StopReason,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

const TOLERANCE: f64 = 1e-6;
const ACROSS: Vector3<f64> = Vector3::new(9.81, 0.0, 0.0);

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let (cells, rounds) = if quick { ([3, 6, 21], 1) } else { ([9, 18, 61], 9) };
    for threads in [1, 2] {
        for (method, arithmetic) in [
            (Method::Cholesky, Arithmetic::Mixed),
            (Method::Cholesky, Arithmetic::Double),
            (Method::Pcg, Arithmetic::Mixed),
            (Method::Pcg, Arithmetic::Double),
        ] {
            let settings = BodySettings {
                solver: PcgSettings { iterations: 20_000, tolerance: TOLERANCE },
                threads,
                scheme: Scheme::Static,
                method,
                arithmetic: Some(arithmetic),
                ..BodySettings::default()
            };
            ratio(cells, settings, rounds);
        }
    }
}

/// Prints the best times of both laws and their ratio.
fn ratio(cells: [usize; 3], settings: BodySettings, rounds: usize) {
    let one_solve = BodySettings { newton_steps: Some(1), ..settings };
    let laws = [(Law::Linear, one_solve), (Law::StVenantKirchhoff, settings)];
    let (mut best, mut work, mut tets) = ([f64::INFINITY; 2], [SolveReport::default(); 2], 0);
    for _ in 0..rounds {
        for (k, (law, settings)) in laws.into_iter().enumerate() {
            let mut body = beam(law, cells, settings);
            let start = Instant::now();
            work[k] = body.step(1.0, ACROSS, &[]);
            best[k] = best[k].min(start.elapsed().as_secs_f64());
            assert_eq!(work[k].stop, StopReason::Converged, "{law:?}: {:?}", work[k]);
            tets = body.n_pieces();
        }
    }
    let arithmetic = settings.arithmetic(Law::StVenantKirchhoff);
    println!(
        "equilibrium of StVK over its linear solve ({tets} tets, {:?} {arithmetic:?}), {} thr: {:.2} = {:.1} / \
         {:.1} ms, {} Newton steps, {} / {} iterations; target 5",
        settings.method,
        settings.threads,
        best[1] / best[0],
        best[1] * 1e3,
        best[0] * 1e3,
        work[1].newton_steps,
        work[1].iterations,
        work[0].iterations,
    );
}

/// The beam at rest, held at z = 0 and cut at z = 0.1 m.
fn beam(law: Law, cells: [usize; 3], settings: BodySettings) -> Body {
    let size = Vector3::new(0.03, 0.06, 0.2);
    let mesh = box_mesh(Vector3::zeros(), size, cells, BoxPattern::Tet5 { parity: false });
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 };
    let material = Material { young_pa: 3e5, poisson: 0.35, density_kg_m3: 1070.0, rayleigh, law };
    let clamp: Vec<u32> = (0..mesh.nodes.len() as u32).filter(|&n| mesh.nodes[n as usize].z == 0.0).collect();
    let mut body = Body::new(mesh, material, settings).expect("the settings go together");
    body.fix(&clamp, [true; 3], Vector3::zeros()).expect("the nodes are there");
    let blade = |x: f64| [Vector3::new(x, -0.01, 0.1), Vector3::new(x, 0.07, 0.1)];
    body.cut(&BladeSweep { segments: vec![blade(-0.01), blade(0.015)] }, 1).expect("the sweep is finite");
    body
}
