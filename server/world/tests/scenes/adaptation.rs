//! Scenes whose octree cells are divided near tools and joined behind them.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::AdaptReport;
use scindo_world::inputs::{CutRequest, Inputs, Wants};
use scindo_world::results::Results;
use scindo_world::scene::Scene;
use scindo_world::simulation::{Simulation, Stage};
use scindo_world::snapshot::Snapshot;

use crate::{run, start_with};

/// A finger comes down on a block, presses it, and leaves to the side.
const PRESSED: &str = r#"
    schema = 1
    [world]
    gravity_m_s2 = [0, 0, -9.81]
    step_s = 0.01
    [[body]]
    id = "block"
    element = "octree"
    mesh = { box = { min_m = [0, 0, 0], max_m = [0.16, 0.08, 0.08], cells = [32, 16, 16] } }
    octree = { levels = 2, adapt = { distance_m = [0.02, 0.03], every_steps = 2 } }
    solver = { method = "mg-pcg" }
    young_pa = 2e4
    poisson = 0.3
    density_kg_m3 = 1000
    rayleigh = { stiffness_s = 0.01 }
    [[body.fix]]
    where = { slab = { axis = "z", from = 0, to = 0.3 } }
    [[tool]]
    id = "finger"
    shape = { sphere = { radius_m = 0.01 } }
    path = [
      { at_s = 0.0, tip_m = [0.06, 0.04, 0.14] },
      { at_s = 0.2, tip_m = [0.06, 0.04, 0.085] },
      { at_s = 0.5, tip_m = [0.08, 0.04, 0.083] },
      { at_s = 0.6, tip_m = [0.08, 0.04, 0.20] },
      { at_s = 0.9, tip_m = [0.50, 0.04, 0.20] },
    ]
    [[probe]]
    id = "inside"
    body = "block"
    point_m = [0.071, 0.043, 0.062]
"#;

fn cells(sim: &Simulation) -> usize {
    sim.bodies()[0].body.n_elements()
}

#[test]
fn cells_are_fine_under_a_finger_and_coarse_again_behind_it() {
    let mut sim = start_with(PRESSED, 1);
    let directory = tempfile::tempdir().unwrap();
    let mut results = Results::begin(directory.path(), &Scene::from_toml(PRESSED).unwrap(), &sim).unwrap();
    let (coarse, rest) = (cells(&sim), sim.bodies()[0].body.rest_positions().to_vec());
    let held = sim.bodies()[0].fix_groups.clone();
    let (mut most, mut snapshot) = (0, Snapshot::default());
    let mut epoch = sim.bodies()[0].epoch();
    for k in 0..100 {
        let before = sim.probe_position(&sim.probes()[0]);
        sim.step(&Inputs::default());
        let adapted = sim.report().bodies[0].adapted;
        let body = &sim.bodies()[0];
        assert!(adapted.momentum_change.norm() <= 1e-12 * (1.0 + body.body.momentum().norm()), "{adapted:?}");
        // Viewers learn of new carriers by the epoch, as after a cut; the triangles stay.
        assert_eq!(body.epoch() > epoch, adapted.has_changed(), "{k} {adapted:?}");
        (epoch, most) = (body.epoch(), most.max(cells(&sim)));
        let surface = sim.bodies()[0].body.surface().triangles.len();
        // A probe follows its material over new numbers.
        let after = sim.probe_position(&sim.probes()[0]);
        assert!((after - before).norm() < 0.002, "{k}: {before} {after}");
        results.record(&sim).unwrap();
        if k == 40 {
            assert!(cells(&sim) > coarse + 100, "{} of {coarse}", cells(&sim));
            // Only cells within reach of the finger were divided.
            let tip = sim.tools().iter().next().unwrap().pose.translation.vector;
            let (body, known) = (&sim.bodies()[0].body, rest.len());
            assert!(body.positions().len() > known);
            let reach = body.positions()[known..].iter().map(|x| (x - tip).norm()).fold(0.0, f64::max);
            // The largest cells are 0.02 m wide; balance divides their neighbours, too.
            assert!(reach < 0.03 + 0.02 * 3_f64.sqrt() + 0.02, "{reach}");
            // New nodes between held ones are held, and belong to their group.
            let groups = &sim.bodies()[0].fix_groups;
            let fixed = body.fixed_nodes().len();
            assert!(groups[0].len() >= fixed && fixed >= held[0].len(), "{fixed}");
            // Someone who joins now sees what the body is.
            sim.snapshot_into(&Wants { surface: vec![true], ..Wants::default() }, &mut snapshot);
            let seen = &snapshot.bodies[0];
            assert_eq!((seen.epoch, seen.topology.epoch), (epoch, epoch));
            assert_eq!(seen.positions.len(), seen.topology.vertex_count as usize);
            assert_eq!(seen.topology.triangles.len(), surface);
            let count = seen.topology.vertex_count;
            assert!(seen.topology.triangles.iter().flatten().all(|&v| v < count));
            assert!(seen.adapted.divided > 0 && seen.elements as usize == cells(&sim));
        }
    }
    assert_eq!((sim.failures(), sim.troubles()), (Vec::<String>::new(), Vec::new()));
    assert_eq!(cells(&sim), coarse);
    assert_eq!(sim.bodies()[0].body.rest_positions(), rest);
    assert_eq!(sim.bodies()[0].fix_groups, held);
    assert!(sim.bodies()[0].body.renumberings() > 0);
    let counts = sim.bodies()[0].adapt_counts().unwrap();
    assert!(counts.changes > 4 && counts.divided > 10 && counts.joined > 10, "{counts:?}");
    assert_eq!(counts.most_cells, most);
    assert!(sim.total_seconds().of(Stage::Adapt) > 0.0 && sim.plan().is_on("adaptation"));
    let summary = results.finish(&sim, "done").unwrap();
    let told = summary.bodies[0].adaptation.unwrap();
    assert_eq!((told.divided, told.joined, told.most_cells), (counts.divided, counts.joined, most));
    assert!(std::fs::metadata(directory.path().join("final.vtu")).unwrap().len() > 10_000);
}

#[test]
fn reset_while_cells_are_fine_leads_back_to_the_start() {
    let mut sim = start_with(PRESSED, 1);
    let (coarse, groups) = (cells(&sim), sim.bodies()[0].fix_groups.clone());
    run(&mut sim, 30);
    let first = sim.bodies()[0].body.positions().to_vec();
    assert!(cells(&sim) > coarse);
    sim.reset().unwrap();
    assert_eq!((cells(&sim), &sim.bodies()[0].fix_groups), (coarse, &groups));
    assert_eq!(sim.bodies()[0].adapt_counts().unwrap(), Default::default());
    assert_eq!(sim.bodies()[0].body.positions(), sim.bodies()[0].body.rest_positions());
    run(&mut sim, 30);
    assert_eq!(sim.bodies()[0].body.positions(), first);
}

#[test]
fn cells_and_motion_are_the_same_for_every_number_of_threads() {
    let run = |threads| {
        let mut sim = start_with(PRESSED, threads);
        run(&mut sim, 45);
        let body = &sim.bodies()[0].body;
        (body.positions().to_vec(), body.velocities().to_vec(), sim.bodies()[0].adapt_counts())
    };
    let one = run(1);
    assert!(one.2.unwrap().divided > 0);
    assert!(one == run(2) && one == run(3));
}

#[test]
fn a_cut_through_fine_cells_is_taken_back_behind_the_finger() {
    let mut sim = start_with(PRESSED, 1);
    run(&mut sim, 30);
    let fine = cells(&sim);
    let mass = sim.bodies()[0].body.total_mass();
    let at = |y: f64| [Vector3::new(0.072, y, 0.12), Vector3::new(0.072, y, 0.055)];
    let request =
        CutRequest { request: 1, tool: Arc::from("knife"), body: None, segments: vec![at(-0.01), at(0.09)] };
    sim.step(&Inputs { cuts: vec![request], ..Inputs::default() });
    assert!(cells(&sim) > fine);
    run(&mut sim, 69);
    let flaws = sim.bodies()[0].body.flaws();
    assert!(flaws.surface == 0 && flaws.volume < 1e-12, "{flaws:?}");
    sim.undo().unwrap();
    let undone = cells(&sim);
    assert_eq!(undone, fine);
    run(&mut sim, 30);
    // Nothing but the finger made these cells fine.
    assert!(cells(&sim) < undone, "{} of {undone}", cells(&sim));
    assert!((sim.bodies()[0].body.total_mass() / mass - 1.0).abs() < 1e-12);
    assert_eq!(sim.failures(), Vec::<String>::new());
}

#[test]
fn a_body_held_by_forceps_stays_in_their_grip_over_adaptations() {
    let text = PRESSED
        .replace("tip_m = [0.06, 0.04, 0.085] }", "tip_m = [0.06, 0.04, 0.081] }")
        .replace("tip_m = [0.08, 0.04, 0.083] }", "tip_m = [0.06, 0.04, 0.095], mode = \"grab\" }")
        .replace(
            "at_s = 0.2, tip_m = [0.06, 0.04, 0.081]",
            "at_s = 0.2, mode = \"grab\", tip_m = [0.06, 0.04, 0.081]",
        );
    let mut sim = start_with(&text, 1);
    let mut changes_while_held = 0;
    for _ in 0..48 {
        sim.step(&Inputs::default());
        let force = sim.tools().iter().next().unwrap().force_n;
        changes_while_held += u32::from(force.norm() > 0.01 && sim.report().bodies[0].adapted.has_changed());
    }
    let force = sim.tools().iter().next().unwrap().force_n;
    assert!(changes_while_held > 0 && force.z < -0.05, "{changes_while_held} {force}");
}

#[test]
fn free_fall_keeps_its_momentum_while_cells_come_and_go() {
    let text = PRESSED
        .replace("[[body.fix]]\n    where = { slab = { axis = \"z\", from = 0, to = 0.3 } }", "")
        .replace("tip_m = [0.06, 0.04, 0.085] }", "tip_m = [0.06, 0.04, 0.085], mode = \"hover\" }")
        .replace("at_s = 0.0, tip_m", "at_s = 0.0, mode = \"hover\", tip_m")
        .replace("distance_m = [0.02, 0.03]", "speed_m_s = [1.0, 0.5], distance_m = [0.02, 0.03]");
    let mut sim = start_with(&text, 1);
    let coarse = cells(&sim);
    run(&mut sim, 20);
    let body = &sim.bodies()[0].body;
    let expected = Vector3::new(0.0, 0.0, -9.81 * 0.2) * body.total_mass();
    assert!((body.momentum() - expected).norm() < 1e-6 * expected.norm(), "{}", body.momentum());
    // It falls faster than 1 m/s, so all of it is fine.
    assert!(cells(&sim) == 32 * 16 * 16 && coarse < 32 * 16 * 16, "{} of {coarse}", cells(&sim));
}

#[test]
fn composite_elements_follow_cells_that_come_and_go() {
    let run = |level: u8| {
        let text = PRESSED.replace("levels = 2,", &format!("levels = 2, simulate_level = {level},"));
        let mut sim = start_with(&text, 1);
        let (coarse, mut most) = (cells(&sim), 0);
        for _ in 0..100 {
            let report = sim.step(&Inputs::default());
            assert!(!report.bodies[0].solve.is_unconverged(), "level {level}");
            most = most.max(cells(&sim));
        }
        assert_eq!((sim.failures(), sim.troubles()), (Vec::<String>::new(), Vec::new()));
        assert!(cells(&sim) == coarse && most > coarse + 100);
        sim.probe_position(&sim.probes()[0])
    };
    let finest = run(0);
    for level in [1, 2] {
        let off = (run(level) - finest).norm();
        assert!(off > 0.0 && off < 5e-4, "level {level}: {off:e} m off");
    }
}

#[test]
fn the_estimated_error_divides_cells_at_the_clamped_end() {
    let text = PRESSED
        .split("[[tool]]")
        .next()
        .unwrap()
        .replace("axis = \"z\", from = 0, to = 0.3", "axis = \"x\", from = 0, to = 0")
        .replace(
            "distance_m = [0.02, 0.03], every_steps = 2",
            "error_sqrt_j = [2e-3, 1e-5], every_steps = 1, error_every_steps = 10",
        );
    let mut sim = start_with(&text, 1);
    let coarse = cells(&sim);
    let mut changed = Vec::new();
    for step in 1..=31 {
        sim.step(&Inputs::default());
        if sim.report().bodies[0].adapted != AdaptReport::default() {
            changed.push(step);
        }
    }
    assert!(!changed.is_empty() && changed.iter().all(|step| step % 10 == 1), "{changed:?}");
    assert!(cells(&sim) > coarse);
    let known = sim.bodies()[0].body.node_of_copy().len();
    let rest = sim.bodies()[0].body.rest_positions();
    let uncut = start_with(&text, 1).bodies()[0].body.rest_positions().len();
    let mean = rest[uncut..known].iter().map(|rest| rest.x).sum::<f64>() / (known - uncut) as f64;
    assert!(mean < 0.08, "{mean}");
}

#[test]
fn what_is_off_or_quiet_costs_nothing() {
    let still = PRESSED.replace("tip_m = [0.06, 0.04, 0.14]", "tip_m = [9, 9, 9]").replace(
        "{ at_s = 0.2, tip_m = [0.06, 0.04, 0.085] },
      { at_s = 0.5, tip_m = [0.08, 0.04, 0.083] },
      { at_s = 0.6, tip_m = [0.08, 0.04, 0.20] },
      { at_s = 0.9, tip_m = [0.50, 0.04, 0.20] },",
        "",
    );
    let off = still.replace(", adapt = { distance_m = [0.02, 0.03], every_steps = 2 }", "");
    assert!(off != still && still.len() < PRESSED.len());
    let (mut quiet, mut off) = (start_with(&still, 1), start_with(&off, 1));
    run(&mut quiet, 40);
    run(&mut off, 40);
    for sim in [&mut quiet, &mut off] {
        let before = allocations();
        run(sim, 20);
        assert_eq!(allocations() - before, 0);
    }
    assert_eq!(quiet.bodies()[0].body.positions(), off.bodies()[0].body.positions());
    assert_eq!(quiet.bodies()[0].epoch(), off.bodies()[0].epoch());
    assert_eq!((off.bodies()[0].adapt_counts(), off.plan().is_on("adaptation")), (None, false));
}

#[test]
fn what_is_wrong_with_adaptation_is_refused() {
    let refused = |replace: &str, parts: &[&str]| {
        let find = "adapt = { distance_m = [0.02, 0.03], every_steps = 2 }";
        let message = Scene::from_toml(&PRESSED.replace(find, replace)).map(drop).unwrap_err().to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?} in: {message}");
    };
    refused("adapt = {}", &["body.block.octree.adapt", "at least one of distance_m"]);
    refused("adapt = { distance_m = [0.03, 0.02] }", &["adapt.distance_m", "[0.03, 0.02]", "first < second"]);
    refused("adapt = { distance_m = [0.03] }", &["adapt.distance_m", "exactly 2 items"]);
    refused("adapt = { speed_m_s = [0.1, 0.2] }", &["adapt.speed_m_s", "first > second"]);
    refused("adapt = { error_sqrt_j = [0.1, -0.2] }", &["adapt.error_sqrt_j", "[0.1, -0.2]"]);
    refused("adapt = { distance_m = [0.02, 0.03], level = 2 }", &["adapt.level", "below levels = 2"]);
    refused("adapt = { distance_m = [0.02, 0.03], every_steps = 0 }", &["every_steps", "at least 1"]);
    let alone = "adapt = { distance_m = [0.02, 0.03], error_every_steps = 9 }";
    refused(alone, &["error_every_steps", "only goes with `error_sqrt_j`"]);
}
