//! The drooping bar of 12 800 tets: milliseconds per step with ten solver iterations and fresh
//! rotations, and element applications per second. `cargo bench -p scindo-physics` measures,
//! `-- --quick` makes a short run that only checks that the figures exist and the motion is right.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, PcgSettings};
use scindo_physics::element::Simd;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::operator::{Elastic, ElasticUpdate, LinearOperator};
use scindo_physics::team::Team;

const MATERIAL: Material = Material {
    young_pa: 1e5,
    poisson: 0.33,
    density_kg_m3: 100.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let steps = if quick { 20 } else { 500 };
    println!("bar: 12 800 tets, 3 321 nodes, 10 PCG iterations, h = 40 ms, {:?}", Simd::detect());
    for (threads, portable) in [(1, false), (2, false), (1, true)] {
        let (mut body, clamp) =
            bar(BodySettings { solver: PcgSettings { iterations: 10, tolerance: 0.0 }, threads, portable });
        let mut times: Vec<f64> = (0..steps)
            .map(|_| {
                let start = Instant::now();
                body.step(0.04, Vector3::new(0.0, -9.81, 0.0), &[]);
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        assert!(body.centre_of_mass().y < 0.1 && body.positions().iter().all(|x| x.y.is_finite()));
        assert!(clamp.iter().all(|&n| body.positions()[n as usize].x == 0.0));
        println!(
            "  step, {threads} thread(s){}: best {:.3} ms, median {:.3} ms, p99 {:.3} ms",
            if portable { ", portable" } else { "" },
            times[0],
            times[steps / 2],
            times[steps * 99 / 100],
        );
    }
    for threads in [1, 2] {
        applications(threads, if quick { 50 } else { 4000 });
    }
}

fn bar(settings: BodySettings) -> (Body, Vec<u32>) {
    let mesh = box_mesh(
        Vector3::zeros(),
        Vector3::new(1.0, 0.2, 0.2),
        [40, 8, 8],
        BoxPattern::Tet5 { parity: false },
    );
    let clamp: Vec<u32> = (0..mesh.nodes.len() as u32).filter(|&n| mesh.nodes[n as usize].x == 0.0).collect();
    let mut body = Body::new(mesh, MATERIAL, settings).unwrap();
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    (body, clamp)
}

/// y = K̂ x over and over.
fn applications(threads: usize, times: usize) {
    let (body, _) = bar(BodySettings::default());
    let mesh = body.cut_mesh();
    let n = mesh.n_copies();
    let mut team = Team::new(threads).unwrap();
    let mut elastic = Elastic::new(Simd::detect(), mesh.mesh(), mesh.pieces(), n);
    let with = ElasticUpdate { lame: MATERIAL.lame(), law: MATERIAL.law, scale: 1.0 };
    let (mut f, mut blocks) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
    let [update, _] = timed(times, || {
        elastic.update(&mut team, &with, body.positions(), &mut f, &mut blocks);
    });
    let x = vec![[0.3, -0.1, 0.2, 0.0]; n];
    let [best, median] = timed(times, || elastic.apply(&mut team, &x, &mut f));
    let pieces = mesh.pieces().len() as f64;
    println!(
        "  apply, {threads} thread(s): best {:.1} µs = {:.0} million pieces/s, median {:.1} µs; update best {:.0} µs",
        best * 1e6,
        pieces / best * 1e-6,
        median * 1e6,
        update * 1e6,
    );
    assert!(f.iter().flatten().all(|f| f.abs() < 1.0), "a translation gives no force");
}

/// Shortest and median duration [s] of `times` runs.
fn timed(times: usize, mut run: impl FnMut()) -> [f64; 2] {
    let mut durations: Vec<f64> = (0..times)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .collect();
    durations.sort_by(f64::total_cmp);
    [durations[0], durations[times / 2]]
}
