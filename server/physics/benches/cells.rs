//! Measures the stiffness of an octree's cells: `cargo bench -p scindo-physics --bench cells`. `-- --quick` makes
//! short runs.
//!
//! One application is both halves: the products of the chunks, and what the vertices gather. Beside it stand the
//! bytes and operations that it needs, and what the machine can do: a triad a = b + s c on arrays beyond the
//! caches, and multiply-adds in registers. The roof is the smaller of both bounds. Figures are the best of many rounds.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock

#[path = "bar/peak.rs"]
mod peak;

use std::hint::black_box;
use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::element::Simd;
use scindo_physics::material::{Lame, Law};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::operator::cells::CellStiffness;
use scindo_physics::operator::{ElasticUpdate, Padded, Stiffness, apply};
use scindo_physics::team::{Team, blocks};

const WITH: ElasticUpdate =
    ElasticUpdate { lame: Lame { mu: 4e4, lambda: 9e4 }, law: Law::Corotational, scale: 1e-4 };
/// Operations of one cell without hanging corners: rotations 2 · 120, transforms 2 · 72, sectors 120.
const OPERATIONS: f64 = 504.0;

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let (rounds, small) = if quick { (3, true) } else { (200, false) };
    let peak = 1e-9 * peak::multiply_adds(&mut Team::alone(), rounds.min(20));
    println!("1 thread: {peak:.0} Gflop/s of multiply-adds");
    let machine = [1, 2].map(|threads| {
        let bandwidth = triad(&mut Team::new(threads).unwrap(), rounds.min(20), small);
        println!("{threads} thread(s): triad {bandwidth:.1} GB/s");
        [bandwidth, threads as f64 * peak]
    });
    let uniform = OctreeSettings { cells: if small { 16 } else { 64 }, levels: 0 };
    let adaptive =
        if small { OctreeSettings { cells: 16, levels: 2 } } else { OctreeSettings { cells: 80, levels: 4 } };
    for (name, settings) in [("uniform", uniform), ("adaptive", adaptive)] {
        for simd in [Simd::detect(), Simd::Avx2] {
            measure(name, settings, rounds, machine, simd);
            if simd == Simd::Avx2 || Simd::detect() == Simd::Baseline {
                break;
            }
        }
    }
}

fn measure(name: &str, settings: OctreeSettings, rounds: usize, machine: [[f64; 2]; 2], simd: Simd) {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let octree = Octree::fill(&shape, settings, &|_| 0).unwrap();
    let (n, n_cells) = (octree.n_vertices(), octree.cells().len());
    let hanging = octree.hanging().iter().filter(|h| **h != 0).count();
    let start = Instant::now();
    let mut stiffness = CellStiffness::new(simd, &octree, &[]);
    let arranged = start.elapsed().as_secs_f64();
    let bytes = stiffness.operator().bytes() + n * 16 * 3;
    let [lanes, rows] = stiffness.operator().overheads(n);
    println!(
        "{name}, {simd:?}: {n_cells} cells ({hanging} with hanging corners), {n} vertices; arranged in {:.0} ms; {lanes:.3} \
         lanes per cell, {rows:.2} rows per vertex, {:.0} bytes per cell",
        arranged * 1e3,
        bytes as f64 / n_cells as f64
    );
    let bend =
        |p: &Vector3<f64>| p + 0.1 * Vector3::new((3.0 * p.y).sin(), 0.3 * p.z * p.z, (2.0 * p.x).cos());
    let positions: Vec<_> = octree.rest_positions().iter().map(bend).collect();
    let x: Vec<Padded> = (0..n).map(|n| [(0.3 * n as f32).sin(), 1.0, (0.7 * n as f32).cos(), 0.0]).collect();
    let mut y = vec![[0.0; 4]; n];
    let mut alone = 0.0;
    for threads in [1, 2] {
        let mut team = Team::new(threads).unwrap();
        let update = best(rounds.min(40), || {
            assert_eq!(stiffness.update(&mut team, &WITH, black_box(&positions), None), 0);
        });
        let first = best(rounds, || stiffness.multiply(&mut team, black_box(&x)));
        let whole = best(rounds, || apply(&mut stiffness, &mut team, black_box(&x), black_box(&mut y)));
        alone = if threads == 1 { whole } else { alone };
        // The roof: what the memory feeds, or what the units compute.
        let [bandwidth, peak] = machine[threads - 1];
        let operations = OPERATIONS * n_cells as f64;
        let roof = (operations / bytes as f64 * bandwidth).min(peak);
        println!(
            "  {threads} thread(s): {:6.1} M cells/s = {:.2} ms ({:.2} ms without the second half), {:.1} GB/s, \
             {:.0} Gflop/s = {:.0} % of the roof of {roof:.0}, {:.2} of one thread; update {:.1} ns per cell",
            n_cells as f64 / whole * 1e-6,
            whole * 1e3,
            first * 1e3,
            bytes as f64 / whole * 1e-9,
            operations / whole * 1e-9,
            operations / whole * 1e-7 / roof,
            alone / whole,
            update / n_cells as f64 * 1e9,
        );
    }
}

/// Shortest time of `work` [s].
fn best(rounds: usize, mut work: impl FnMut()) -> f64 {
    work();
    let mut best = f64::INFINITY;
    for _ in 0..rounds {
        let start = Instant::now();
        work();
        best = best.min(start.elapsed().as_secs_f64());
    }
    best
}

/// Bandwidth of a = b + s c [GB/s], three arrays of 256 MB together.
fn triad(team: &mut Team, rounds: usize, small: bool) -> f64 {
    const BLOCK: usize = 4096;
    let n = if small { 1 << 16 } else { 22 << 20 };
    let (mut a, b, c) = (vec![0.0_f32; n], vec![1.0_f32; n], vec![2.0_f32; n]);
    let seconds = best(rounds, || {
        let (b, c) = (black_box(&b), black_box(&c));
        team.for_blocks(blocks(&mut a, BLOCK), |k, a| {
            let (b, c) = (&b[k * BLOCK..][..a.len()], &c[k * BLOCK..][..a.len()]);
            for i in 0..a.len() {
                a[i] = b[i] + 3.0 * c[i];
            }
        });
        black_box(&mut a);
    });
    12.0 * n as f64 / seconds * 1e-9
}
