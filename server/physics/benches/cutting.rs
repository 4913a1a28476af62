//! Measures what cutting costs: `cargo bench -p scindo-physics --bench cutting`. `-- --quick` runs
//! everything once on a small body. One thread.
//!
//! - Insertion: a sweep through 1 000 elements of a body of 20 870 tets. Measured are the topology alone,
//!   the whole body with all that its next step needs, the same sweep in a body and in one four times as
//!   long, the same cut in a hundred advances, and building the uncut state.
//! - Steps: the cost of an enriched element (one that a cut divides) against a plain one, and the cost of
//!   a step after 100 cuts against the growth of the copies. Every solve makes the same number of
//!   iterations. The bodies compared are stepped in turns, so that a busy moment of the machine hits all
//!   of them.
//! - Snapping: a small cut along faces, and an advance that opens nothing yet, in a body and in one eight
//!   times as long.
//! - Skin: the time a skin takes to follow a cut, early and late in a hundred of them.

#![allow(clippy::unwrap_used)]

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, CuttingMethod, PcgSettings, Scheme};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_physics::operator::OperatorChoice;
use scindo_physics::skin::{Skin, SkinSettings};

const SIZE_M: f64 = 0.1;
const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const ITERATIONS: u32 = 25;

fn material(law: Law) -> Material {
    Material {
        young_pa: 1e5,
        poisson: 0.4,
        density_kg_m3: 1000.0,
        rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
        law,
    }
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let (cells, tets, elements) = if quick { (5, 700, 60) } else { (16, 20_870, 1_000) };
    let mesh = block(cells, tets);
    println!("{} tets, {} nodes", mesh.tets.len(), mesh.nodes.len());
    // A word that is not a flag selects parts by name.
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let wanted = |part: &str| words.is_empty() || words.iter().any(|word| part.contains(word.as_str()));
    if wanted("insertion") {
        insertion(&mesh, elements, if quick { 1 } else { 21 });
        longer_body(cells, elements, if quick { 1 } else { 9 });
    }
    if wanted("snapping") {
        snapping(cells, if quick { 1 } else { 9 });
    }
    if wanted("growth") {
        growth(&mesh, if quick { 1 } else { 5 });
    }
    if wanted("enriched") {
        enriched_elements(&mesh, if quick { 2 } else { 200 });
    }
    if wanted("hundred") {
        hundred_cuts(&mesh, if quick { 2 } else { 200 });
    }
    if wanted("skin") {
        skin(&mesh, if quick { 1 } else { 5 });
    }
}

/// A block with this many tets: the first ones of a lattice, which ends in an unfinished layer.
fn block(cells: usize, tets: usize) -> TetMesh {
    let mut whole = box_mesh(Vector3::zeros(), Vector3::repeat(SIZE_M), [cells; 3], BoxPattern::Tet6);
    whole.tets.truncate(tets);
    TetMesh::repaired(whole.nodes, whole.tets).expect("a part of a lattice is a mesh").0
}

fn body(mesh: &TetMesh, law: Law) -> Body {
    body_with(mesh, law, Scheme::ImplicitEuler)
}

fn body_with(mesh: &TetMesh, law: Law, scheme: Scheme) -> Body {
    let solver = PcgSettings { iterations: ITERATIONS, tolerance: 0.0 };
    let settings = BodySettings { solver, scheme, threads: 1, ..BodySettings::default() };
    // Held on faces that every cut reaches: a part in free fall would leave the solver nothing to do.
    let held = |n: &u32| mesh.nodes[*n as usize].z == 0.0 || mesh.nodes[*n as usize].y == 0.0;
    let clamp: Vec<u32> = (0..mesh.nodes.len() as u32).filter(held).collect();
    let mut body = Body::new(mesh.clone(), material(law), settings).expect("the material is usual");
    body.fix(&clamp, [true; 3], Vector3::zeros()).expect("the nodes are there");
    body
}

/// A blade along y at `x` [m]; the plane it moves in is oblique to the lattice.
fn blade(x: f64) -> [Vector3<f64>; 2] {
    [Vector3::new(x, -0.01, 0.0521 + 0.1 * x), Vector3::new(x, 0.11, 0.0532 + 0.1 * x)]
}

/// Position [m] at which that blade has cut about `elements` elements, by bisection.
fn reach(mesh: &TetMesh, elements: usize) -> f64 {
    let uncut = CutMesh::new(mesh.clone()).expect("a block can be cut");
    let (mut short, mut long) = (0.0, 1.1 * SIZE_M);
    for _ in 0..12 {
        let middle = 0.5 * (short + long);
        let sweep = BladeSweep { segments: vec![blade(-0.01), blade(middle)] };
        let cut = uncut.clone().sweep(&uncut.rest_positions(), &sweep, 1);
        let cut = cut.expect("the sweep is well formed").elements_cut;
        if cut < elements { short = middle } else { long = middle }
    }
    long
}

fn insertion(mesh: &TetMesh, elements: usize, repeats: usize) {
    let build = best_and_median(repeats.min(9), || {
        let mesh = mesh.clone();
        timed(|| CutMesh::new(mesh)).1
    });
    say("uncut state", build, "");
    let sweep = BladeSweep { segments: vec![blade(-0.01), blade(reach(mesh, elements))] };
    let uncut = CutMesh::new(mesh.clone()).expect("a block can be cut");
    let x = uncut.rest_positions();
    let mut cut = 0;
    let topology = best_and_median(repeats, || {
        // Not a clone: a clone has no spare capacity for the cut.
        let mut mesh = CutMesh::new(mesh.clone()).expect("a block can be cut");
        let (report, seconds) = timed(|| mesh.sweep(&x, &sweep, 1));
        cut = report.expect("the sweep is well formed").elements_cut;
        seconds
    });
    say(&format!("sweep through {cut} elements, topology and surface"), topology, "");
    let kinds = [
        (Law::Linear, Scheme::ImplicitEuler, "target 5 ms"),
        (Law::Corotational, Scheme::ImplicitEuler, "target 5 ms"),
        (Law::StVenantKirchhoff, Scheme::Bdf2, "target 8 ms"),
    ];
    for (law, scheme, target) in kinds {
        let (mut first, mut later) = (Vec::new(), Vec::new());
        let whole = best_and_median(repeats, || {
            let mut body = body_with(mesh, law, scheme);
            body.step(0.01, DOWN, &[]);
            let (report, seconds) = timed(|| body.cut(&sweep, 1));
            cut = report.expect("the sweep is well formed").elements_cut;
            first.push(timed(|| body.step(0.01, DOWN, &[])).1);
            later.push(timed(|| body.step(0.01, DOWN, &[])).1);
            seconds
        });
        say(&format!("sweep through {cut} elements, whole body, {law:?}"), whole, target);
        say("  the first step after it", sorted(first), "");
        say("  the second step after it", sorted(later), "");
    }
}

/// A cut should cost what it cuts, whatever the size of the body: the same sweep in a body and in one
/// four times as long, in turns. A second sweep beside the first forces part of the stiffness to be
/// arranged anew.
fn longer_body(cells: usize, elements: usize, repeats: usize) {
    let block = |length: usize| {
        let size = Vector3::new(length as f64 * SIZE_M, SIZE_M, SIZE_M);
        box_mesh(Vector3::zeros(), size, [length * cells, cells, cells], BoxPattern::Tet6)
    };
    let meshes = [block(1), block(4)];
    let long = reach(&meshes[0], elements);
    let sweep = |height: f64| {
        let at = |x: f64| blade(x).map(|end| end + Vector3::new(0.0, 0.0, height));
        BladeSweep { segments: vec![at(-0.01), at(long)] }
    };
    let mut times = [const { [const { Vec::new() }; 2] }; 2];
    let mut cut = [0; 2];
    for _ in 0..repeats {
        for (mesh, times) in meshes.iter().zip(&mut times) {
            let mut body = body(mesh, Law::Corotational);
            for (k, times) in times.iter_mut().enumerate() {
                body.step(0.01, DOWN, &[]);
                let sweep = sweep(-0.0187 * k as f64);
                let (report, seconds) = timed(|| body.cut(&sweep, k as u32 + 1));
                cut[k] = report.expect("the sweep is well formed").elements_cut;
                times.push(seconds);
            }
        }
    }
    let times = times.map(|times| times.map(sorted));
    for (k, which) in ["first", "second"].into_iter().enumerate() {
        for (mesh, times) in meshes.iter().zip(&times) {
            say(&format!("{which} sweep, through {} elements of {}", cut[k], mesh.tets.len()), times[k], "");
        }
        let [best, median] = [0, 1].map(|i| times[1][k][i] / times[0][k][i]);
        println!("  {best:.2} × the time (median {median:.2}) in a body of four times the size");
    }
}

/// A cut along faces should search only where the sweep is: a slit of four cells in a body and in one eight
/// times as long, in turns. The first advance goes through less than an element and opens nothing. The last
/// cut goes through the whole body.
fn snapping(cells: usize, repeats: usize) {
    let block = |length: usize| {
        let size = Vector3::new(length as f64 * SIZE_M, SIZE_M, SIZE_M);
        box_mesh(Vector3::zeros(), size, [length * cells, cells, cells], BoxPattern::Tet6)
    };
    let meshes = [block(1), block(8)];
    let cell = SIZE_M / cells as f64;
    let at = |x: f64| [Vector3::new(x, 0.031, 0.0521), Vector3::new(x, 0.031 + 4.0 * cell, 0.0532)];
    let across = |x: f64| [Vector3::new(x, -0.01, 0.0721), Vector3::new(x, 0.11, 0.0732)];
    let sweep = |ends: &[[Vector3<f64>; 2]]| BladeSweep { segments: ends.to_vec() };
    let sweeps = [
        ("advance that opens nothing", 1, sweep(&[at(-0.01), at(0.1 * cell)])),
        ("slit", 1, sweep(&[at(0.1 * cell), at(4.0 * cell)])),
        ("cut through the body", 2, sweep(&[across(-0.01), across(1.0)])),
    ];
    let mut times = [const { [const { Vec::new() }; 3] }; 2];
    for _ in 0..repeats {
        for (mesh, times) in meshes.iter().zip(&mut times) {
            let settings = BodySettings { cutting: CuttingMethod::Snap, ..BodySettings::default() };
            let mut body = Body::new(mesh.clone(), material(Law::Corotational), settings).expect("usual");
            for ((which, incision, sweep), times) in sweeps.iter().zip(times) {
                let (report, seconds) = timed(|| body.cut(sweep, *incision));
                let opened = report.expect("the sweep is well formed").faces_opened;
                assert_eq!(opened == 0, which.contains("nothing"), "{which}: {opened} faces");
                times.push(seconds);
            }
        }
    }
    let times = times.map(|times| times.map(sorted));
    for (k, (which, ..)) in sweeps.iter().enumerate() {
        for (mesh, times) in meshes.iter().zip(&times) {
            say(&format!("{which} along faces, in {} elements", mesh.tets.len()), times[k], "");
        }
        let [best, median] = [0, 1].map(|i| times[1][k][i] / times[0][k][i]);
        println!("  {best:.2} × the time (median {median:.2}) in a body of eight times the size");
    }
}

/// The same cut in a hundred advances, each of which continues the one before.
fn growth(mesh: &TetMesh, repeats: usize) {
    const ADVANCES: u32 = 100;
    let mut slowest = 0.0f64;
    let advance = best_and_median(repeats, || {
        let mut body = body(mesh, Law::Corotational);
        let mut sum = 0.0;
        slowest = 0.0;
        for k in 0..=ADVANCES {
            let place = -0.01 + 1.2 * SIZE_M * f64::from(k) / f64::from(ADVANCES);
            let sweep = BladeSweep { segments: vec![blade(place)] };
            let (report, seconds) = timed(|| body.cut(&sweep, 1));
            report.expect("the sweep is well formed");
            sum += seconds;
            slowest = slowest.max(seconds);
        }
        assert_eq!(body.components().len(), 2, "the plane takes the body apart");
        sum / f64::from(ADVANCES + 1)
    });
    say("one advance of a hundred, whole body", advance, &format!("slowest {:.3} ms", slowest * 1e3));
}

/// Times [s] of a step of several bodies stepped in turns: best and median of each. Two rounds warm up.
fn steps(bodies: &mut [&mut Body], repeats: usize) -> Vec<[f64; 2]> {
    let mut seconds = vec![Vec::new(); bodies.len()];
    for _ in 0..repeats + 2 {
        for (body, seconds) in bodies.iter_mut().zip(&mut seconds) {
            let (report, time) = timed(|| body.step(0.005, DOWN, &[]));
            assert_eq!(report.iterations, ITERATIONS, "{report:?}");
            seconds.push(time);
        }
    }
    seconds.into_iter().map(|mut s| sorted(s.split_off(2))).collect()
}

/// Cost of a step after planes have cut every second layer of cells: the more elements are enriched, the
/// more certain is the quotient. The linear law is measured matrix-free and assembled. An assembled
/// stiffness has no elements: an enriched one only adds pairs of neighbours. Its cost is therefore also
/// given in plain elements of the matrix-free product.
///
/// # Source
/// What an enriched element costs over a standard one: Jeřábková 2007, §3.3 (2.2 to 4 ×, by operations).
fn enriched_elements(mesh: &TetMesh, repeats: usize) {
    use OperatorChoice::{Assembled, MatrixFree};
    let mut by_the_tets = [f64::NAN; 2];
    for (law, choice) in
        [(Law::Corotational, MatrixFree), (Law::Linear, MatrixFree), (Law::Linear, Assembled)]
    {
        let (mut plain, mut cut) = (body(mesh, law), body(mesh, law));
        for k in 0..7 {
            let z = SIZE_M * (0.131 + 0.125 * f64::from(k));
            let at = |x: f64| [Vector3::new(x, -0.01, z), Vector3::new(x, 0.11, z + 0.0002)];
            cut.cut(&BladeSweep { segments: vec![at(-0.01), at(0.11)] }, k + 1).expect("well formed");
        }
        let mut same = body_of_pieces(&cut, law);
        assert!([&mut plain, &mut cut, &mut same].into_iter().all(|b| b.set_operator(choice)));
        let mut pieces = vec![0u32; mesh.tets.len()];
        cut.tets().unwrap().pieces().iter().for_each(|piece| pieces[piece.element as usize] += 1);
        let enriched = pieces.iter().filter(|&&n| n > 1).count();
        let share = enriched as f64 / mesh.tets.len() as f64;
        // Two bodies at a time: a third would push the others out of the cache.
        let [times, inherent] = [&mut cut, &mut same].map(|body| steps(&mut [&mut plain, body], repeats));
        let cost = |times: &[[f64; 2]], i: usize| (times[1][i] / times[0][i] - 1.0) / share + 1.0;
        // New copies per new piece, over nodes per tet.
        let copies = (cut.n_copies() as f64 / mesh.nodes.len() as f64 - 1.0) / share;
        say(&format!("step, {law:?} {choice:?}, uncut"), times[0], "");
        say(&format!("step, {law:?} {choice:?}, {enriched} elements enriched"), times[1], "");
        println!(
            "  an enriched element costs {:.2} × a plain one (median {:.2}); target 2.2",
            cost(&times, 0),
            cost(&times, 1)
        );
        println!(
            "  of which inherent: {:.2} (median {:.2}), an uncut mesh of the same pieces and copies; \
             a second piece brings {copies:.2} × the copies of a plain element",
            cost(&inherent, 0),
            cost(&inherent, 1)
        );
        if choice == MatrixFree {
            by_the_tets = times[0];
        } else {
            let in_tets = [0, 1].map(|i| cost(&times, i) * times[0][i] / by_the_tets[i]);
            println!("  and {:.2} × a plain one by the tets (median {:.2})", in_tets[0], in_tets[1]);
        }
    }
}

/// A hundred cuts all over the body: incisions that cross each other, and stabs that are hardly longer
/// than an element is wide. A stab separates elements but hardly a node, so it costs pieces, not copies.
fn hundred_cuts(mesh: &TetMesh, repeats: usize) {
    for (kind, length, depth) in [("incisions", 0.05, 0.04), ("stabs", 0.009, 0.025)] {
        for law in [Law::Linear, Law::Corotational] {
            let (mut plain, mut cut) = (body(mesh, law), body(mesh, law));
            let top = mesh.nodes.iter().fold(0.0_f64, |top, node| top.max(node.z));
            for k in 0..100 {
                let (row, column, turn) = (k / 10, k % 10, 2.4 * f64::from(k));
                let middle = [row, column].map(|n| SIZE_M * (0.055 + 0.099 * f64::from(n)));
                let at = |s: f64| {
                    let (x, y) = (middle[0] + s * turn.cos(), middle[1] + s * turn.sin());
                    [Vector3::new(x, y, top - depth), Vector3::new(x, y, top + 0.01)]
                };
                let sweep = BladeSweep { segments: vec![at(-0.5 * length), at(0.5 * length)] };
                cut.cut(&sweep, k + 1).expect("the sweep is well formed");
            }
            let growth = |n: fn(&Body) -> usize| n(&cut) as f64 / n(&plain) as f64;
            let copies = growth(|b| b.n_copies());
            let pieces = growth(|b| b.n_pieces());
            let lanes = growth(lanes);
            let times = steps(&mut [&mut plain, &mut cut], repeats);
            let slower = [0, 1].map(|i| times[1][i] / times[0][i]);
            say(&format!("step, {law:?}, after 100 {kind}"), times[1], "");
            println!(
                "  {:.3} × an uncut one (median {:.3}) with {copies:.3} × the copies, {pieces:.3} × the pieces \
                 in {lanes:.3} × the lanes",
                slower[0], slower[1]
            );
        }
    }
}

/// Number of groups of pieces of one element that share all four copies; a kernel computes one lane per
/// group.
fn lanes(body: &Body) -> usize {
    let mut groups: Vec<(u32, [u32; 4])> =
        body.tets().unwrap().pieces().iter().map(|piece| (piece.element, piece.copies)).collect();
    groups.sort_unstable();
    groups.dedup();
    groups.len()
}

/// An uncut body with an element for every piece of `cut` and a node for every copy, numbered along the
/// longest axis. An iteration does the same work without any cut.
fn body_of_pieces(cut: &Body, law: Law) -> Body {
    let x = cut.rest_positions();
    let mut order: Vec<u32> = (0..x.len() as u32).collect();
    let key = |c: u32| x[c as usize].map(|x| (1e9 * x).round() as i64);
    order.sort_by_key(|&c| (key(c).z, key(c).y, key(c).x, c));
    let mut number = vec![0; x.len()];
    (0u32..).zip(&order).for_each(|(n, &c)| number[c as usize] = n);
    let nodes = order.iter().map(|&c| x[c as usize]).collect();
    let mut pieces: Vec<_> = cut.tets().unwrap().pieces().to_vec();
    pieces.sort_by_key(|piece| piece.element);
    let tets = pieces.iter().map(|piece| piece.copies.map(|c| number[c as usize])).collect();
    body(&TetMesh { nodes, tets }, law)
}

/// Time a skin takes to follow a cut: a hundred equal cuts side by side, the first ten against the last.
fn skin(mesh: &TetMesh, repeats: usize) {
    let settings = SkinSettings { divisions: 3, snapping: 0.25 };
    let top = mesh.nodes.iter().fold(0.0_f64, |top, node| top.max(node.z));
    let run = || {
        let mut cut = CutMesh::new(mesh.clone()).expect("a block can be cut");
        let mut skin = Skin::new(&cut, settings, None, &mut |p, _| *p).expect("the settings are usual");
        let mut x = cut.rest_positions();
        let seconds = (0..100u32).map(|k| {
            let at = |s: f64| {
                let x = SIZE_M * (0.02 + 0.097 * f64::from(k % 10) + 0.08 * s);
                let y = SIZE_M * (0.04 + 0.097 * f64::from(k / 10));
                [Vector3::new(x, y, top - 0.03), Vector3::new(x, y + 1e-4, top + 0.01)]
            };
            let sweep = BladeSweep { segments: vec![at(0.0), at(1.0)] };
            let report = cut.sweep(&x, &sweep, k + 1).expect("the sweep is well formed");
            report.new_copies.iter().for_each(|new| x.push(x[new.parent as usize]));
            timed(|| skin.follow(&cut)).1
        });
        seconds.collect::<Vec<f64>>()
    };
    let runs: Vec<Vec<f64>> = (0..repeats).map(|_| run()).collect();
    for (which, cuts) in [("first", 0..10), ("last", 90..100)] {
        let mean = |run: &Vec<f64>| run[cuts.clone()].iter().sum::<f64>() / 10.0;
        say(&format!("skin, the {which} ten of 100 cuts"), sorted(runs.iter().map(mean).collect()), "");
    }
}

fn say(what: &str, [best, median]: [f64; 2], more: &str) {
    println!("{what:<62} best {:8.3} ms, median {:8.3} ms  {more}", best * 1e3, median * 1e3);
}

/// The result of the work and the seconds it took.
#[allow(clippy::disallowed_methods, reason = "a benchmark reads the clock; the library does not")]
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

fn best_and_median(repeats: usize, mut run: impl FnMut() -> f64) -> [f64; 2] {
    sorted((0..repeats).map(|_| run()).collect())
}

fn sorted(mut seconds: Vec<f64>) -> [f64; 2] {
    seconds.sort_by(f64::total_cmp);
    [seconds[0], seconds[seconds.len() / 2]]
}
