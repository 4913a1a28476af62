//! Measures cuts of octree cells: `cargo bench -p scindo-physics --bench octree`. `-- --quick` makes short runs, and
//! words choose parts: `grid`, `whole`, `advances`, `increments`, `same`.
//!
//! The model is the cube of Dick, Georgii and Westermann 2011, 80 finest cells across with four levels of coarser
//! ones. First a grid of 22 blades cuts it to half its depth, then a blade goes through it in small advances. Times
//! are those of everything that the next step needs, and of its parts. Last come the parts of the same increment on
//! bodies of two sizes, and the same advances of a blade through bodies of three: what only depends on the cut takes
//! the same time on all of them. Figures are the best of several rounds.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock

use std::hint::black_box;
use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, Method, PcgSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::Simd;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::octree::{BoxShape, CutLink, LinkKey, Octree, OctreeSettings, OctreeSurface};
use scindo_physics::operator::cells::CellStiffness;
use scindo_physics::solver::multigrid::Hierarchy;
use scindo_physics::space::OctreeSpace;
use scindo_physics::space::Space;
use scindo_physics::team::Team;

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
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let wanted = |part: &str| words.is_empty() || words.iter().any(|word| word == part);
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let uncut = Octree::fill(&shape, settings, &|_| 0).unwrap();
    println!("{} leaves, {} vertices", uncut.cells().len(), uncut.n_vertices());
    println!(
        "  fill             {:8.1} ms",
        best(rounds, || Octree::fill(&shape, settings, &|_| 0).unwrap())
    );
    if wanted("grid") {
        grid(&uncut, rounds);
    }
    for threads in [1, 2].into_iter().filter(|_| wanted("whole")) {
        whole_cut(&uncut, threads, rounds);
    }
    if wanted("advances") {
        advances(uncut, rounds);
    }
    for cells in if quick { [8, 16] } else { [34, 58] }.into_iter().filter(|_| wanted("increments")) {
        let settings = OctreeSettings { cells, levels: 0 };
        increment(Octree::fill(&shape, settings, &|_| 0).unwrap(), rounds);
    }
    for cells in if quick { [12, 16, 20] } else { [34, 58, 74] }.into_iter().filter(|_| wanted("same")) {
        let h = 1.0 / f64::from(cells);
        let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
        let settings = OctreeSettings { cells, levels: 0 };
        same_advances(Octree::fill(&shape, settings, &|_| 0).unwrap(), h, rounds.min(2));
    }
}

/// A blade that goes through a body to half its depth at once, with everything that the next step needs: the cut, and
/// the next step beside one before. The body is held at its base and hangs under its weight.
fn whole_cut(uncut: &Octree, threads: usize, rounds: usize) {
    let solver = PcgSettings { iterations: 4, tolerance: 0.0 };
    let settings = BodySettings { solver, method: Method::MgPcg, threads, ..BodySettings::default() };
    let mut times = [f64::INFINITY; 3];
    let mut pieces = (0, 0);
    for _ in 0..rounds {
        let mut body = Body::of_space(Box::new(OctreeSpace::new(uncut.clone())), SOFT, settings).unwrap();
        let held: Vec<u32> = (0..).zip(uncut.points()).filter(|(_, p)| p[2] == 0).map(|(v, _)| v).collect();
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        let timed = |run: &mut dyn FnMut()| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        };
        let step = |body: &mut Body| {
            timed(&mut || {
                body.step(0.01, Vector3::new(0.0, 0.0, -1.0), &[]);
            })
        };
        step(&mut body);
        let plain = step(&mut body);
        let known = body.n_elements();
        let cut = timed(&mut || {
            body.cut(&blade(0, 0.37, 1.1, 0.5), 1).unwrap();
        });
        let next = step(&mut body);
        pieces = (known, body.n_elements());
        times.iter_mut().zip([plain, cut, next]).for_each(|(best, ms)| *best = best.min(ms));
    }
    let [plain, cut, next] = times;
    println!(
        "a whole cut, {} -> {} cells, MgPcg, {threads} threads: {cut:.1} ms, the next step {next:.1} ms, the one \
         before {plain:.1} ms",
        pieces.0, pieces.1
    );
}

/// A blade eight cells wide that advances by half a cell at a time into the middle of a body with cells of side `h`:
/// the cut, and the next step beside one before which nothing was cut.
fn same_advances(uncut: Octree, h: f64, rounds: usize) {
    let solver = PcgSettings { iterations: 10, tolerance: 1e-3 };
    let settings = BodySettings { solver, method: Method::MgPcg, ..BodySettings::default() };
    let (mut opened, mut after, mut plain) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..rounds {
        let mut body = Body::of_space(Box::new(OctreeSpace::new(uncut.clone())), SOFT, settings).unwrap();
        let timed = |body: &mut Body| {
            let start = Instant::now();
            body.step(0.01, Vector3::zeros(), &[]);
            start.elapsed().as_secs_f64() * 1e3
        };
        timed(&mut body);
        for k in 0..20 {
            plain.push(timed(&mut body));
            let z = 1.0 + h - 0.5 * h * f64::from(k);
            let segment = [Vector3::new(0.51, 0.5, z), Vector3::new(0.51, 0.5 + 8.0 * h, z)];
            let start = Instant::now();
            let report = body.cut(&BladeSweep { segments: vec![segment] }, 1).unwrap();
            let ms = start.elapsed().as_secs_f64() * 1e3;
            let next = timed(&mut body);
            if report.faces_opened > 0 {
                opened.push(ms);
                after.push(next);
            }
        }
    }
    let at = |times: &mut Vec<f64>, share: f64| {
        times.sort_by(f64::total_cmp);
        times[((times.len() - 1) as f64 * share) as usize]
    };
    println!(
        "an advance of a blade 8 cells wide that opens links, {} cells, MgPcg: median {:.2} ms, 90 % below {:.2} ms; \
         the next step {:.1} ms, others {:.1} ms",
        uncut.cells().len(),
        at(&mut opened, 0.5),
        at(&mut opened, 0.9),
        at(&mut after, 0.5),
        at(&mut plain, 0.5),
    );
}

/// The parts of one increment of the same size on bodies of finest cells: a strip of links is cut that is two cells
/// wide and eight deep.
fn increment(uncut: Octree, rounds: usize) {
    let middle = uncut.lattice().size.map(|n| n as i32 / 2);
    let cut = CutLink { at: [0.5; 2], normal: [Vector3::x(); 2], incision: 1 };
    let links: Vec<(LinkKey, CutLink)> =
        (0..16).map(|k| (([middle[0], middle[1] + k / 2, middle[2] + k % 2], 0), cut)).collect();
    let (x, surface) = (uncut.rest_positions(), OctreeSurface::build(&uncut));
    let kernel = || CellStiffness::new(Simd::detect(), &uncut, &[]);
    println!(
        "an increment of {} links on {} cells, {} vertices",
        links.len(),
        uncut.cells().len(),
        uncut.n_vertices()
    );
    let report = |part: &str, ms: f64| println!("  {part:<34} {ms:8.3} ms");
    let z = |k: i32| f64::from(middle[2] + k) * uncut.lattice().h;
    let y = |k: i32| f64::from(middle[1] + k) * uncut.lattice().h;
    let edge = |k: i32| {
        let p = (f64::from(middle[0]) + 0.1) * uncut.lattice().h;
        [Vector3::new(p, y(0), z(k)), Vector3::new(p, y(8), z(k))]
    };
    let sweep = BladeSweep { segments: vec![edge(0), edge(2)] };
    let space = OctreeSpace::new(uncut.clone());
    let mut team = Team::alone();
    let whole = prepared(rounds, || space.clone(), |space| space.cut(&mut team, &x, &sweep, 1).unwrap());
    report("search, division, volumes, surface", whole);
    let divided = prepared(rounds, || uncut.clone(), |octree| octree.cut(&links));
    report("division and numbering", divided);
    let mut octree = uncut.clone();
    let change = octree.cut(&links);
    let followed = prepared(rounds, || surface.clone(), |s| s.follow(&octree, &change.cells, &change.moved));
    report("surface", followed);
    let followed = prepared(rounds, kernel, |kernel| kernel.follow_cut(&octree, &change.cells));
    report("kernel", followed);
    report("volumes anew", best(rounds, || octree.vertex_volumes()));
    report("levels anew", best(rounds, || Hierarchy::new(&octree)));
}

/// Best time of a few rounds [ms] without that of `prepare`.
fn prepared<S, T>(rounds: usize, prepare: impl Fn() -> S, mut run: impl FnMut(&mut S) -> T) -> f64 {
    (0..rounds.max(1))
        .map(|_| {
            let mut state = prepare();
            let start = Instant::now();
            black_box(run(&mut state));
            start.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min)
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
            let report = space.cut(&mut Team::alone(), &at, &blade, incision).unwrap();
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
        let report = space.cut(&mut Team::alone(), &at, &blade, incision).unwrap();
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
