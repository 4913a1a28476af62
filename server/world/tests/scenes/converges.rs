//! Every scene that ships meets its own tolerance, and what it warns of is meant.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

/// Least steps of a scene.
const STEPS: u64 = 40;

/// Scenes that mean a fixed number of iterations per step.
const FIXED: [&str; 2] = ["relaxing-block.toml", "relaxing-cuts.toml"];

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// The scene files of the folder, whichever there are.
fn shipped() -> Vec<PathBuf> {
    let entries = fs::read_dir(scenes()).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

/// What is wrong with the steps of a scene, until its last cut is made and its tools have gone through their
/// paths; nothing if all is well.
fn complaints(name: &str, mut sim: Simulation) -> Vec<String> {
    let mut found: Vec<String> = sim.warnings().to_vec();
    let cuts = sim.scene().cuts.iter().map(|cut| cut.at_s);
    let tools = sim.scene().tools.iter().filter_map(|tool| tool.path.last()).map(|point| point.at_s);
    let last_s = cuts.chain(tools).fold(0.0, f64::max);
    let steps = STEPS.max((last_s / sim.step_s()).ceil() as u64 + 10);
    let mut worst: f64 = 0.0;
    for _ in 0..steps {
        sim.step(&Inputs::default());
        let solves = sim.report().bodies.iter().map(|body| &body.solve);
        worst = solves
            .fold(worst, |worst, solve| worst.max(solve.residual / solve.tolerance.max(f64::MIN_POSITIVE)));
    }
    found.extend(sim.troubles());
    found.extend(sim.failures());
    for body in sim.bodies() {
        let counts = body.counts();
        let fixed = FIXED.contains(&name);
        if body.fixed_iterations != fixed {
            found.push(format!("fixed_iterations = {} is not listed in this test", body.fixed_iterations));
        }
        if !fixed && counts.unconverged > 0 {
            found.push(format!(
                "{} of {} steps unconverged, {worst} times the tolerance",
                counts.unconverged, counts.steps
            ));
        }
        if counts.refused + counts.divided + counts.rolled_back + counts.inverted > 0 {
            found.push(format!("{counts:?}"));
        }
    }
    found.into_iter().map(|text| format!("{name}: {text}")).collect()
}

#[test]
fn every_shipped_scene_meets_its_own_tolerance() {
    let run = |path: &Path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let scene = Scene::load(path).unwrap();
        complaints(&name, Simulation::new(&scene, scene.base_dir()).unwrap())
    };
    // Most scenes step on one thread; as many as there are cores step side by side.
    let (files, next, found) = (shipped(), AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(path) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let wrong = run(path);
                    found.lock().unwrap().extend(wrong);
                }
            });
        }
    });
    let mut found = found.into_inner().unwrap();
    found.sort();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// A user who sets nothing about the solver: stiff and soft, nearly incompressible, long, cut through. Every
/// step converges, and the only warning is of linear tetrahedra where they lock.
#[test]
fn whoever_sets_nothing_gets_a_converged_result() {
    for (cells, poisson, young, locks) in
        [("[12, 3, 3]", 0.3, 1e4, false), ("[12, 3, 3]", 0.49, 1e5, true), ("[40, 2, 2]", 0.45, 1e6, false)]
    {
        let text = format!(
            "schema = 1\nworld = {{ gravity_m_s2 = [0, 0, -9.81] }}\n\
             cut = [{{ body = \"b\", at_s = 0.1, sweep_m = [[[0.1, -0.01, 0.02], [0.1, -0.01, 0.06]], [[0.1, 0.06, 0.02], [0.1, 0.06, 0.06]]] }}]\n\
             [[body]]\nid = \"b\"\nmesh = {{ box = {{ min_m = [0, 0, 0], max_m = [0.2, 0.05, 0.05], cells = {cells} }} }}\n\
             young_pa = {young}\npoisson = {poisson}\ndensity_kg_m3 = 1000\n\
             fix = [{{ where = {{ slab = {{ axis = \"x\", from = 0, to = 0 }} }} }}, {{ where = {{ slab = {{ axis = \"x\", from = 1, to = 1 }} }} }}]\n"
        );
        let scene = Scene::from_toml(&text).unwrap();
        let found = complaints("a block", Simulation::new(&scene, Path::new("")).unwrap());
        let (warned, rest): (Vec<_>, Vec<_>) =
            found.into_iter().partition(|text| text.contains("linear tetrahedra lock at 0.49"));
        assert!(rest.is_empty(), "{cells} {poisson} {young}: {}", rest.join("\n"));
        assert_eq!(warned.len(), usize::from(locks), "{cells} {poisson} {young}: {warned:?}");
    }
}

/// A part that a cut frees falls out of the scene. It is put to sleep, once told, and leaves the view; the same
/// for any number of threads.
#[test]
fn a_part_that_falls_out_of_the_scene_sleeps() {
    let text = "schema = 1\nworld = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.02 }\n\
        cut = [{ body = \"b\", sweep_m = [[[0.11, -0.01, -0.01], [0.11, -0.01, 0.06]], [[0.11, 0.06, -0.01], [0.11, 0.06, 0.06]]] }]\n\
        [[body]]\nid = \"b\"\nmesh = { box = { min_m = [0, 0, 0], max_m = [0.2, 0.05, 0.05], cells = [8, 2, 2] } }\n\
        young_pa = 1e5\npoisson = 0.4\ndensity_kg_m3 = 1000\nfix = [{ where = { slab = { axis = \"x\", from = 0, to = 0 } } }]\n";
    let scene = Scene::from_toml(text).unwrap();
    let run = |threads| {
        let options = scindo_world::assemble::BuildOptions { threads, ..Default::default() };
        let mut sim = Simulation::with_options(&scene, Path::new(""), options).unwrap();
        let mut told = Vec::new();
        for _ in 0..100 {
            let report = sim.step(&Inputs::default());
            told.extend(report.events.iter().filter(|e| e.name == "part-asleep").map(|_| report.step));
        }
        (sim, told)
    };
    let (mut sim, told) = run(1);
    assert_eq!(told.len(), 1, "{told:?}");
    let lowest = |sim: &Simulation| sim.bodies()[0].body.positions().iter().map(|x| x.z).fold(0.0, f64::min);
    // Five diagonals of 0.21 m, and no more than what it falls from one look to the next.
    assert!(lowest(&sim) < -1.0 && lowest(&sim) > -6.0, "{}", lowest(&sim));
    let wants = scindo_world::inputs::Wants { surface: vec![true], ..Default::default() };
    let mut snapshot = scindo_world::snapshot::Snapshot::default();
    sim.snapshot_into(&wants, &mut snapshot);
    let shown = &snapshot.bodies[0];
    assert!(shown.positions.iter().all(|x| x[2] > -0.5), "nothing to look for far below");
    assert!(shown.topology.triangles.len() < sim.bodies()[0].body.surface().triangles.len());
    assert_eq!(run(2).0.bodies()[0].body.positions(), sim.bodies()[0].body.positions());
    sim.reset().unwrap();
    assert!(!sim.bodies()[0].body.sleeps() && lowest(&sim) > -0.01);
}
