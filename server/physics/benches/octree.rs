//! Measures cuts of octree cells: `cargo bench -p scindo-physics --bench octree`. `-- --quick` makes short runs.
//!
//! The model is the cube of Dick, Georgii and Westermann 2011, 80 finest cells across with four levels of coarser
//! ones. First a grid of 22 blades cuts it to half its depth, then a blade goes through it in small advances. Times
//! are those of everything that the next step needs, and of its parts. Figures are the best of several rounds.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock

use std::hint::black_box;
use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, Method, PcgSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::Simd;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::multigrid::Hierarchy;
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings, OctreeSpace, OctreeSurface};
use scindo_physics::operator::cells::CellStiffness;
use scindo_physics::space::Space;

const SOFT: Material = Material {
    young_pa: 1e5,
    poisson: 0.3,
    density_kg_m3: 1e3,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let (settings, rounds) = if quick {
        (OctreeSettings { cells: 16, levels: 2 }, 1)
    } else {
        (OctreeSettings { cells: 80, levels: 4 }, 5)
    };
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let uncut = Octree::fill(&shape, settings, &|_| 0).unwrap();
    println!("{} leaves, {} vertices", uncut.cells().len(), uncut.n_vertices());
    println!(
        "  fill             {:8.1} ms",
        best(rounds, || Octree::fill(&shape, settings, &|_| 0).unwrap())
    );
    grid(&uncut, rounds);
    advances(uncut, rounds);
}

/// The grid of blades in one sweep, as it folds back and forth outside the body.
fn grid(uncut: &Octree, rounds: usize) {
    let cells = uncut.lattice().size[0] as f64;
    let planes = [7, 13, 21, 27, 33, 41, 47, 53, 61, 67, 73].map(|p| f64::from(p) / 80.0);
    let planes = planes.map(|p| (p * cells).round() / cells);
    let x = uncut.rest_positions();
    let blades = |axis: usize| planes.map(|p| blade(axis, p, 1.1, 0.5));
    let whole = best(rounds, || {
        let mut space = OctreeSpace::new(uncut.clone());
        let start = Instant::now();
        let mut at = x.clone();
        for (incision, blade) in (1..).zip(blades(0).into_iter().chain(blades(1))) {
            let report = space.cut(&at, &blade, incision).unwrap();
            report.new_copies.iter().for_each(|new| at.push(new.inherited(&at)));
        }
        (start.elapsed().as_secs_f64(), space)
    });
    let (_, space) = whole_of(uncut, &x, blades(0).into_iter().chain(blades(1)));
    let octree = space.octree();
    println!(
        "a grid of 22 blades to half depth: {} leaves, {} vertices",
        octree.cells().len(),
        octree.n_vertices()
    );
    println!("  cuts, with surface {:6.1} ms (copy of the uncut state included)", whole);
    println!("  surface anew     {:8.1} ms", best(rounds, || OctreeSurface::build(octree)));
    println!(
        "  kernels anew     {:8.1} ms",
        best(rounds, || CellStiffness::new(Simd::detect(), octree, &[]))
    );
    println!("  levels anew      {:8.1} ms", best(rounds, || Hierarchy::new(octree)));
}

fn whole_of(
    uncut: &Octree,
    x: &[Vector3<f64>],
    blades: impl Iterator<Item = BladeSweep>,
) -> (Vec<Vector3<f64>>, OctreeSpace) {
    let (mut space, mut at) = (OctreeSpace::new(uncut.clone()), x.to_vec());
    for (incision, blade) in (1..).zip(blades) {
        let report = space.cut(&at, &blade, incision).unwrap();
        report.new_copies.iter().for_each(|new| at.push(new.inherited(&at)));
    }
    (at, space)
}

/// A blade that advances by half a finest cell at a time through a body that is ready for the next step after each.
fn advances(uncut: Octree, rounds: usize) {
    let h = uncut.lattice().h;
    for method in [Method::Pcg, Method::MgPcg] {
        let solver = PcgSettings { iterations: 10, tolerance: 1e-3 };
        let settings = BodySettings { solver, method, ..BodySettings::default() };
        let mut times = Vec::new();
        for _ in 0..rounds.min(2) {
            let mut body = Body::of_space(Box::new(OctreeSpace::new(uncut.clone())), SOFT, settings).unwrap();
            body.step(0.01, Vector3::zeros(), &[]);
            for k in 0..40 {
                let z = 1.0 + h - 0.5 * h * f64::from(k);
                let segment = [Vector3::new(0.37, 0.3, z), Vector3::new(0.37, 0.6, z)];
                let start = Instant::now();
                body.cut(&BladeSweep { segments: vec![segment] }, 1).unwrap();
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        times.sort_by(f64::total_cmp);
        let of = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        println!(
            "an advance of half a cell, blade of 0.3, {method:?}: median {:.1} ms, 90 % below {:.1} ms",
            of(0.5),
            of(0.9)
        );
    }
}

fn blade(axis: usize, p: f64, from: f64, to: f64) -> BladeSweep {
    let at = |along: f64, z: f64| {
        if axis == 0 { Vector3::new(p, along, z) } else { Vector3::new(along, p, z) }
    };
    BladeSweep { segments: [from, to].map(|z| [at(-0.1, z), at(1.1, z)]).to_vec() }
}

/// Best time of a few rounds [ms].
fn best<T>(rounds: usize, mut run: impl FnMut() -> T) -> f64 {
    (0..rounds.max(1))
        .map(|_| {
            let start = Instant::now();
            black_box(run());
            start.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min)
}
