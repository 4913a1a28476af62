//! Compares the cost of a step with the limits of the machine: `cargo bench -p scindo-physics --bench bar`.
//! `-- --quick` makes short runs, which only check that the figures exist and the motion is right.
//!
//! Lines are measured in turns, so that a busy moment of the machine hits all of them. The best time is
//! what the code can do; median and p99 are what it did here. The roof is the least time that an
//! iteration could take: that of streaming its bytes (at the bandwidth of the cache that holds them) or
//! of its operations.

#![allow(clippy::disallowed_methods, clippy::unwrap_used)] // a bench reads the clock
#![allow(unsafe_code)] // multiply-adds in registers
#![allow(non_snake_case)] // the symbols of the field: K, M

mod machine;
mod peak;

use std::time::Instant;

use machine::{LEVEL_NAMES, Machine};
use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, Method, PcgSettings, Scheme};
use scindo_physics::element::FixedCopy;
use scindo_physics::element::Simd;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_physics::operator::{
    BlockJacobi, Elastic, ElasticUpdate, LinearOperator, OperatorChoice, Stiffness, SystemOperator,
};
use scindo_physics::solver::Pcg;
use scindo_physics::team::Team;

const SOFT: Material = Material {
    young_pa: 1e5,
    poisson: 0.33,
    density_kg_m3: 100.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};
const LINEAR: Material = Material { law: Law::Linear, ..SOFT };
/// Ten iterations, however large the residual is.
const TEN: PcgSettings = PcgSettings { iterations: 10, tolerance: 0.0 };
const DOWN: Vector3<f64> = Vector3::new(0.0, -9.81, 0.0);
/// A line that has taken this long [s] in at least three turns takes no more.
const LONG_S: f64 = 10.0;
/// Bytes per copy that one solver iteration reads or writes: 13 vector entries of 16 bytes, and the mass.
const VECTOR_BYTES: usize = 13 * 16 + 4;

/// One line of the report.
struct Line {
    name: String,
    threads: usize,
    /// Makes one measurement. Returns the number of repetitions in it and their total time [s].
    run: Box<dyn FnMut() -> (f64, f64)>,
    /// Seconds per repetition.
    times: Vec<f64>,
    /// Number of pieces whose stiffness one repetition applies or updates; 0 if it does neither alone.
    pieces: usize,
    /// Per repetition: bytes streamed, working set [byte], operations [flop].
    work: (f64, usize, f64),
    target: &'static str,
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let machines = [1, 2].map(|threads| Machine::measure(threads, quick));
    println!("{:?}, L2 / L3 / DRAM triad and multiply-adds:", Simd::detect());
    for (machine, threads) in machines.iter().zip([1, 2]) {
        let [l2, l3, dram] = machine.bandwidth.map(|b| b * 1e-9);
        let flops = machine.flops * 1e-9;
        println!("  {threads} thread(s): {l2:.0} / {l3:.0} / {dram:.1} GB/s, {flops:.0} GFLOP/s");
    }
    // From whole steps down to their parts: solver iterations, the product with K, its update.
    let mut lines = Vec::new();
    for threads in [1, 2] {
        lines.push(steps(
            "bar, 10 iterations",
            bar(SOFT, 10, 0.0, threads, Simd::detect()),
            threads,
            "1.5 / 1.0 ms",
        ));
    }
    for simd in [Simd::Avx2, Simd::Baseline].into_iter().filter(|simd| *simd < Simd::detect()) {
        lines.push(steps(&format!("bar, 10 iterations, {simd:?}"), bar(SOFT, 10, 0.0, 1, simd), 1, ""));
    }
    // Finer meshes of the same bar.
    for (name, cells, target) in [("fine", [80, 16, 16], "9 ms"), ("finest", [136, 27, 27], "45 ms")] {
        let cells = if quick { [20, 4, 4] } else { cells };
        for threads in [1, 2] {
            let settings = BodySettings { solver: TEN, threads, ..BodySettings::default() };
            let body = clamped(boxed([1.0, 0.2, 0.2], cells), SOFT, settings);
            lines.push(steps(&format!("{name} bar, 10 iterations"), body, threads, target));
        }
    }
    // 1.3 times implicit Euler per linear solve; Newmark's method makes two of a body that turns.
    lines.push(steps("bar, BDF2, 10 iterations", swinging(Scheme::Bdf2), 1, "1.3 × Euler"));
    lines.push(steps("bar, Newmark, 2 × 10", swinging(Scheme::AVERAGE_ACCELERATION), 1, "2 × 1.3 × Euler"));
    for threads in [1, 2] {
        let body = bar(SOFT, 1000, 1e-6, threads, Simd::detect());
        lines.push(steps("bar, to 1e-6", body, threads, "25 ms"));
    }
    for threads in [1, 2] {
        let body = bar_by(Method::TwoLevelPcg, [40, 8, 8], threads);
        lines.push(steps("bar, to 1e-6, two-level", body, threads, "8 ms"));
    }
    // The gain grows with the number of tetrahedra.
    for (method, way) in [(Method::Pcg, ""), (Method::TwoLevelPcg, ", two-level")] {
        let fine = if quick { [20, 4, 4] } else { [80, 16, 16] };
        lines.push(steps(&format!("fine bar, to 1e-6{way}"), bar_by(method, fine, 1), 1, ""));
        let finest = if quick { [20, 4, 4] } else { [136, 27, 27] };
        lines.push(steps(&format!("finest bar, to 1e-6{way}"), bar_by(method, finest, 1), 1, ""));
    }
    for threads in [1, 2] {
        lines.push(steps("Hippo-sized linear block", block(threads), threads, "1.2 ms"));
    }
    for threads in [1, 2] {
        lines.push(static_cube(threads));
    }
    let bar_mesh = || boxed([1.0, 0.2, 0.2], [40, 8, 8]);
    for threads in [1, 2] {
        for choice in [OperatorChoice::MatrixFree, OperatorChoice::Assembled] {
            lines.push(applications("bar", bar_mesh(), choice, threads, ""));
        }
    }
    let large = || boxed([0.4, 0.6, 0.41], if quick { [10, 10, 10] } else { [40, 60, 41] });
    for threads in [1, 2] {
        for choice in [OperatorChoice::MatrixFree, OperatorChoice::Assembled] {
            lines.push(applications("492 000 tets", large(), choice, threads, "100 M/s"));
        }
    }
    for choice in [OperatorChoice::MatrixFree, OperatorChoice::Assembled] {
        lines.push(updates(bar_mesh(), choice));
    }
    // A word that is not a flag selects lines by name.
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    lines.retain(|line| wanted.is_empty() || wanted.iter().any(|word| line.name.contains(word.as_str())));
    // In turns, each for at least 20 ms, so that a busy moment hits every line.
    for _ in 0..if quick { 3 } else { 60 } {
        for line in &mut lines {
            // Steps of seconds are not repeated as often.
            if line.times.len() >= 3 && line.times.iter().sum::<f64>() > LONG_S {
                continue;
            }
            let start = Instant::now();
            loop {
                let (repetitions, seconds) = (line.run)();
                line.times.push(seconds / repetitions);
                if quick || start.elapsed().as_secs_f64() >= 0.02 {
                    break;
                }
            }
        }
    }
    lines.iter_mut().for_each(|line| line.print(&machines[line.threads - 1]));
}

impl Line {
    fn print(&mut self, machine: &Machine) {
        self.times.sort_by(f64::total_cmp);
        let n = self.times.len();
        let [best, median, p99] = [0, n / 2, n * 99 / 100].map(|i| self.times[i]);
        let (bytes, working_set, flops) = self.work;
        let roof = machine.roof(bytes, working_set, flops, self.threads);
        let level = LEVEL_NAMES[Machine::level(working_set, self.threads)];
        print!(
            "{:<42} {} thr: best {:>8.1} µs, median {:>8.1}, p99 {:>8.1}; roof {:>7.1} ({level}) = {:.2} of best",
            self.name,
            self.threads,
            best * 1e6,
            median * 1e6,
            p99 * 1e6,
            roof * 1e6,
            roof / best
        );
        if self.pieces > 0 {
            let rate = |t: f64| self.pieces as f64 / t * 1e-6;
            print!("; {:.0} (median {:.0}) million tets/s", rate(best), rate(median));
        } else if self.name.contains("iteration of") {
            print!("; {:.0} (median {:.0}) iterations/s", 1.0 / best, 1.0 / median);
        }
        println!("{}{}", if self.target.is_empty() { "" } else { "; target " }, self.target);
    }
}

fn boxed(size: [f64; 3], cells: [usize; 3]) -> TetMesh {
    box_mesh(Vector3::zeros(), size.into(), cells, BoxPattern::Tet5 { parity: false })
}

/// `mesh`, clamped at x = 0.
fn clamped(mesh: TetMesh, material: Material, settings: BodySettings) -> Body {
    let clamp: Vec<u32> = (0..mesh.nodes.len() as u32).filter(|&n| mesh.nodes[n as usize].x == 0.0).collect();
    let mut body = Body::new(mesh, material, settings).unwrap();
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    body
}

/// The drooping bar of 12 800 tets, h = 40 ms.
fn bar(material: Material, iterations: u32, tolerance: f64, threads: usize, simd: Simd) -> Body {
    let solver = PcgSettings { iterations, tolerance };
    let settings = BodySettings { solver, threads, simd, ..BodySettings::default() };
    clamped(boxed([1.0, 0.2, 0.2], [40, 8, 8]), material, settings)
}

/// The same bar, of these cells, converged to 1e-6 by `method`.
fn bar_by(method: Method, cells: [usize; 3], threads: usize) -> Body {
    let solver = PcgSettings { iterations: 3000, tolerance: 1e-6 };
    let settings = BodySettings { solver, threads, method, ..BodySettings::default() };
    clamped(boxed([1.0, 0.2, 0.2], cells), SOFT, settings)
}

/// The same bar on one thread with another scheme.
fn swinging(scheme: Scheme) -> Body {
    let settings = BodySettings { solver: TEN, scheme, ..BodySettings::default() };
    let body = clamped(boxed([1.0, 0.2, 0.2], [40, 8, 8]), SOFT, settings);
    assert!(body.is_fast());
    body
}

/// 21 000 linear tets and 5 610 nodes, as many as the hippopotamus of the thesis.
fn block(threads: usize) -> Body {
    let settings = BodySettings { solver: TEN, threads, ..BodySettings::default() };
    clamped(boxed([1.0, 0.42, 0.08], [50, 21, 4]), LINEAR, settings)
}

/// Work of one solver iteration: bytes streamed, working set [byte], operations [flop].
fn iteration_work(elastic: &Elastic, n: usize) -> (f64, usize, f64) {
    let bytes = elastic.bytes() + n * VECTOR_BYTES;
    let stiffness = if elastic.assembled() {
        elastic.bytes() as f64 / 40.0 * 44.0
    } else {
        elastic.n_pieces() as f64 * 136.0
    };
    (bytes as f64, elastic.bytes() + n * (9 * 16), stiffness + (n * 50) as f64)
}

/// Times whole steps.
fn steps(name: &str, mut body: Body, threads: usize, target: &'static str) -> Line {
    let (tets, n) = (body.n_pieces(), body.positions().len());
    let mut elastic = updated(&body, OperatorChoice::Auto, &mut Team::new(1).unwrap());
    elastic.set_choice(OperatorChoice::Auto);
    let (bytes, working_set, flops) = iteration_work(&elastic, n);
    // The last step of the warm-up tells how many iterations a measured step makes.
    let mut iterations = 0;
    for _ in 0..5 {
        iterations = body.step(0.04, DOWN, &[]).iterations;
    }
    let its = f64::from(iterations);
    let name = format!("step of {name} ({tets} tets, {iterations} its)");
    let run = move || {
        let start = Instant::now();
        body.step(0.04, DOWN, &[]);
        let seconds = start.elapsed().as_secs_f64();
        assert!(body.positions().iter().all(|x| x.y.is_finite()));
        (1.0, seconds)
    };
    let rotates = !elastic.assembled();
    let update = if rotates { (tets * 156) as f64 } else { elastic.bytes() as f64 };
    let update_flops = tets as f64 * if rotates { 700.0 } else { 66.0 };
    let work = (its * bytes + update + (n * 300) as f64, working_set, its * flops + update_flops);
    Line { name, threads, run: Box::new(run), times: Vec::new(), pieces: 0, work, target }
}

fn updated(body: &Body, choice: OperatorChoice, team: &mut Team) -> Elastic {
    let (mesh, material) = (body.tets().unwrap().mesh(), body.material());
    let n = body.n_copies();
    let mut elastic = Elastic::new(Simd::detect(), mesh, body.tets().unwrap().pieces(), n);
    elastic.set_choice(choice);
    let with = ElasticUpdate { lame: material.lame(), law: material.law, scale: 1.0 };
    let (mut f, mut blocks) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
    elastic.update_all(team, &with, body.positions(), &mut f, &mut blocks);
    elastic
}

/// Times solver iterations on the static linear cube of 11³ × 6 tets, clamped at one side.
fn static_cube(threads: usize) -> Line {
    const ITERATIONS: u32 = 200;
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [11; 3], BoxPattern::Tet6);
    let body = clamped(mesh, LINEAR, BodySettings::default());
    let n = body.positions().len();
    let mut team = Team::new(threads).unwrap();
    let mut elastic = updated(&body, OperatorChoice::Auto, &mut team);
    let fixed: Vec<FixedCopy> = body
        .fixed_nodes()
        .iter()
        .map(|f| FixedCopy { copy: f.node, held: f.held, position_m: [0.0; 3] })
        .collect();
    let with = ElasticUpdate { lame: LINEAR.lame(), law: LINEAR.law, scale: 1.0 };
    let (mut f, mut diagonal) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
    elastic.update_all(&mut team, &with, body.positions(), &mut f, &mut diagonal);
    let mut M = BlockJacobi::default();
    M.resize(n);
    M.update(&mut team, &diagonal, &fixed);
    let work = iteration_work(&elastic, n);
    let mut pcg = Pcg::default();
    pcg.resize(n);
    let mass: Vec<f32> = body.masses().iter().map(|&m| m as f32).collect();
    let settings = PcgSettings { iterations: ITERATIONS, tolerance: 0.0 };
    let name = format!("iteration of CG, cube ({} tets)", body.n_pieces());
    let run = move || {
        let mut x = vec![[0.0; 4]; n];
        for (r, m) in pcg.r.iter_mut().zip(&mass) {
            *r = [0.0, -9.81 * m, 0.0, 0.0];
        }
        fixed.iter().for_each(|f| pcg.r[f.copy as usize] = [0.0; 4]);
        let mut K = SystemOperator {
            elastic: &mut elastic,
            mass: &mass,
            mass_factor: 0.0,
            springs: &[],
            fixed: &fixed,
        };
        let start = Instant::now();
        let report = pcg.solve(&mut team, &mut K, &mut M, &mut x, (1.0, settings));
        let seconds = start.elapsed().as_secs_f64();
        assert!(report.iterations == ITERATIONS, "{report:?}");
        (f64::from(ITERATIONS), seconds)
    };
    Line {
        name,
        threads,
        run: Box::new(run),
        times: Vec::new(),
        pieces: 0,
        work,
        target: "20 000 iterations/s",
    }
}

/// Times y = K̂ x.
fn applications(
    name: &str,
    mesh: TetMesh,
    choice: OperatorChoice,
    threads: usize,
    target: &'static str,
) -> Line {
    let body = Body::new(mesh, SOFT, BodySettings::default()).unwrap();
    let (pieces, n) = (body.n_pieces(), body.positions().len());
    let mut team = Team::new(threads).unwrap();
    let mut elastic = updated(&body, choice, &mut team);
    let (bytes, _, flops) = iteration_work(&elastic, n);
    let work = (bytes - (n * (VECTOR_BYTES - 48)) as f64, elastic.bytes() + n * 64, flops - (n * 50) as f64);
    let x = vec![[0.3, -0.1, 0.2, 0.0]; n];
    let mut y = x.clone();
    let run = move || {
        let start = Instant::now();
        elastic.apply(&mut team, &x, &mut y);
        let seconds = start.elapsed().as_secs_f64();
        assert!(y.iter().flatten().all(|f| f.abs() < 1.0), "a translation gives no force");
        (1.0, seconds)
    };
    let name = format!("application to {name}, {choice:?}");
    Line { name, threads, run: Box::new(run), times: Vec::new(), pieces, work, target }
}

/// Times an update: rotations, forces, gradients and diagonal blocks.
fn updates(mesh: TetMesh, choice: OperatorChoice) -> Line {
    let body = Body::new(mesh, SOFT, BodySettings::default()).unwrap();
    let (pieces, n) = (body.n_pieces(), body.positions().len());
    let mut team = Team::new(1).unwrap();
    let mut elastic = updated(&body, choice, &mut team);
    let with = ElasticUpdate { lame: SOFT.lame(), law: SOFT.law, scale: 1.0 };
    let (mut f, mut blocks) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
    let x: Vec<Vector3<f64>> =
        body.positions().iter().map(|x| x + 0.02 * Vector3::new(x.y, x.z, x.x)).collect();
    let run = move || {
        let start = Instant::now();
        elastic.update_all(&mut team, &with, &x, &mut f, &mut blocks);
        (1.0, start.elapsed().as_secs_f64())
    };
    let work = ((pieces * 156) as f64, pieces * 120, pieces as f64 * 700.0);
    let name = format!("update of bar, {choice:?}");
    Line { name, threads: 1, run: Box::new(run), times: Vec::new(), pieces, work, target: "" }
}
