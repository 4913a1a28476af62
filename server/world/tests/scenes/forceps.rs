//! Forceps on an upright sheet of tissue: grip, slip, release; and tools of several capsules that push.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_world::contact::model::{ContactModels, ToolQuery};
use scindo_world::inputs::{Inputs, ToolInput, ToolMode, ToolShape, Wants};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::{Snapshot, ToolSnapshot};

use crate::{start, start_with};

type V = Vector3<f64>;

const STEP_S: f64 = 0.01;
const GRIP_N: f64 = 1.0;
const OPENING_M: f64 = 0.012;
/// The sheet is 6 mm thick along x and 30 mm high.
const THICK_M: f64 = 0.006;
const TOP_M: f64 = 0.03;

fn scene(friction: f64) -> String {
    format!(
        r#"
        schema = 1
        [world]
        gravity_m_s2 = [0, 0, 0]
        step_s = {STEP_S}
        [[body]]
        id = "sheet"
        mesh = {{ box = {{ min_m = [-0.003, -0.02, 0], max_m = [0.003, 0.02, {TOP_M}], cells = [2, 12, 9] }} }}
        young_pa = 6e4
        poisson = 0.4
        density_kg_m3 = 1000
        rayleigh = {{ mass_1_s = 2.0, stiffness_s = 0.01 }}
        solver = {{ iterations = 200, tolerance = 1e-6 }}
        [[body.fix]]
        where = {{ slab = {{ axis = "z", from = 0, to = 0.01 }} }}
        [[tool]]
        id = "forceps"
        shape = {{ forceps = {{ radius_m = 0.002, length_m = 0.06, opening_m = {OPENING_M}, grip_force_n = {GRIP_N:?}, friction = {friction:?} }} }}
        stiffness_n_m = 2000
        max_force_n = 8
        "#
    )
}

struct Table {
    sim: Simulation,
    inputs: Inputs,
    shot: Snapshot,
}

impl Table {
    fn new(text: &str) -> Self {
        let sim = start(text);
        Self { sim, inputs: Inputs::default(), shot: Snapshot::default() }
    }

    fn step(&mut self, tip: V, mode: ToolMode, closed: Option<f64>) -> &ToolSnapshot {
        self.inputs.tools = vec![ToolInput {
            mode,
            closed,
            ..ToolInput::new("forceps", "left", Isometry3::translation(tip.x, tip.y, tip.z))
        }];
        self.sim.step(&self.inputs);
        self.sim.snapshot_into(&Wants::default(), &mut self.shot);
        &self.shot.tools[0]
    }

    fn hold(&mut self, tip: V, seconds: f64) -> ToolSnapshot {
        for _ in 0..(seconds / STEP_S) as usize {
            self.step(tip, ToolMode::Grab, None);
        }
        self.shot.tools[0].clone()
    }

    /// Moves the closed forceps from one place to another.
    fn carry(&mut self, from: V, to: V, seconds: f64) -> ToolSnapshot {
        let steps = (seconds / STEP_S) as usize;
        for i in 1..=steps {
            self.step(from.lerp(&to, i as f64 / steps as f64), ToolMode::Grab, None);
        }
        self.shot.tools[0].clone()
    }

    fn positions(&self) -> Vec<V> {
        self.sim.bodies()[0].body.positions().to_vec()
    }
}

/// The tip with the top of the sheet 14 mm between the jaws.
fn around() -> V {
    V::new(0.0, 0.0, TOP_M - 0.014)
}

/// The same grip on one thread and on three: all bits of the tissue and of the force.
fn grip_on(threads: usize) -> (Vec<V>, V) {
    let mut table = Table::new(&scene(0.3));
    table.sim = start_with(&scene(0.3), threads);
    table.hold(around(), 0.4);
    let tool = table.carry(around(), around() + V::new(0.004, 0.003, 0.001), 0.4);
    (table.positions(), tool.force_n)
}

#[test]
fn a_grip_is_the_same_on_any_number_of_threads() {
    let (one, three) = (grip_on(1), grip_on(3));
    assert!(one.0 == three.0 && one.1 == three.1 && one.1.norm() > 0.05, "{} {}", one.1, three.1);
}

fn farthest(a: &[V], b: &[V]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn jaws_close_to_the_force_of_the_grip_and_hold_without_drift() {
    // A micrometre higher than elsewhere: at that height exactly, rounding decides what sticks to the jaws.
    let place = around() + V::new(0.0, 0.0, 1e-6);
    let mut table = Table::new(&scene(0.5));
    table.step(place, ToolMode::Hover, None);
    let at_rest = table.positions();
    table.hold(place, 1.0);
    let lift = place + V::new(0.0, 0.0, 0.001);
    let gripped = table.hold(lift, 1.0);
    let held = gripped.held_m.unwrap();
    assert!(gripped.force_n.z < -0.05, "the tissue pulls back: {}", gripped.force_n);
    assert!(gripped.closed > 0.3 && gripped.closed < 1.0, "the sheet keeps them apart: {}", gripped.closed);
    let (then, before) = (table.positions(), gripped.force_n);
    assert!(farthest(&then, &at_rest) > 3e-4);
    table.hold(lift, 2.0);
    let settled = table.positions();
    let later = table.hold(lift, 8.0);
    assert!((later.held_m.unwrap() - held).norm() < 2e-6, "{} {held}", later.held_m.unwrap());
    assert!(farthest(&then, &table.positions()) < 5e-6, "{}", farthest(&then, &table.positions()));
    assert!((later.force_n - before).norm() < 0.01 * before.norm());
    // What moves in the first seconds still settles after the jump by a millimetre; then nothing does.
    assert!(farthest(&settled, &table.positions()) < 1e-7, "{}", farthest(&settled, &table.positions()));
}

#[test]
fn held_tissue_slips_at_the_bound_of_friction_of_both_jaws() {
    for friction in [0.15, 0.3] {
        let mut table = Table::new(&scene(friction));
        table.hold(around(), 1.0);
        // Along the faces, and across the jaws: they open towards their ends.
        let mut most = 0.0_f64;
        for i in 0..300 {
            let tool = table.step(around() + V::y() * 2e-5 * f64::from(i), ToolMode::Grab, None);
            most = most.max(-tool.force_n.y);
        }
        let bound = 2.0 * friction * GRIP_N;
        println!("friction {friction}: pulls with {most:.4} N, bound {bound:.4} N");
        assert!((most / bound - 1.0).abs() < 0.05, "{most} {bound}");
        // Well below the bound nothing slips.
        let mut table = Table::new(&scene(friction));
        table.hold(around(), 1.0);
        let tool = table.hold(around(), 0.5);
        let from = tool.held_m.unwrap();
        let back = (0..100).map(|i| 1.0 - (f64::from(i) / 50.0 - 1.0).abs());
        for part in back {
            let tool = table.step(around() + V::y() * 2e-4 * part, ToolMode::Grab, None);
            assert!(-tool.force_n.y < 0.9 * bound);
        }
        let to = table.hold(around(), 0.5).held_m.unwrap();
        assert!((to - from).norm() < 1e-5, "it comes back to where it was: {from} {to}");
    }
}

#[test]
fn release_frees_and_reset_returns_to_the_start() {
    let mut table = Table::new(&scene(0.8));
    table.step(around(), ToolMode::Hover, None);
    let at_rest = table.positions();
    table.hold(around(), 0.5);
    let aside = table.carry(around(), around() + V::new(0.004, 0.0, 0.0), 0.6);
    assert!(aside.force_n.x < -0.05 && farthest(&table.positions(), &at_rest) > 2e-3, "{}", aside.force_n);
    for _ in 0..300 {
        table.step(around() + V::new(0.004, 0.0, 0.05), ToolMode::Hover, None);
    }
    let free = &table.shot.tools[0];
    assert_eq!((free.force_n, free.held_m), (V::zeros(), None));
    assert_eq!(free.closed, 0.0, "the jaws are open again");
    assert!(farthest(&table.positions(), &at_rest) < 1e-4, "{}", farthest(&table.positions(), &at_rest));
    table.hold(around(), 0.5);
    assert!(table.shot.tools[0].held_m.is_some());
    table.sim.reset().unwrap();
    let first = table.step(around(), ToolMode::Hover, None);
    assert_eq!((first.held_m, first.closed), (None, 0.0));
    assert_eq!(farthest(&table.positions(), &at_rest), 0.0);
}

#[test]
fn a_grip_on_nothing_does_nothing() {
    let mut table = Table::new(&scene(0.8));
    let mut alone = Table::new(&scene(0.8));
    let away = V::new(0.05, 0.0, 0.05);
    let tool = table.hold(away, 0.5);
    for _ in 0..50 {
        alone.step(away, ToolMode::Hover, None);
    }
    assert_eq!((tool.force_n, tool.held_m, tool.closed), (V::zeros(), None, 1.0));
    assert!(table.positions() == alone.positions(), "not one bit changes");
    // Half closed by the hand, and beside the sheet.
    for _ in 0..50 {
        table.step(away, ToolMode::Touch, Some(0.5));
    }
    assert!((table.shot.tools[0].closed - 0.5).abs() < 1e-12);
    for _ in 0..50 {
        table.step(away, ToolMode::Grab, Some(0.0));
    }
    let open = table.step(around(), ToolMode::Grab, Some(0.0));
    assert_eq!(open.held_m, None, "the sheet, {THICK_M} m, is thinner than the opening, {OPENING_M} m");
}

#[test]
fn a_grip_that_is_torn_away_lets_go_and_stays_bounded() {
    let mut table = Table::new(&scene(0.8));
    table.hold(around(), 0.5);
    let mut most = 0.0_f64;
    for i in 0..200 {
        let jerk = V::new(0.004, 0.002, 0.003) * f64::from(i % 3);
        let tool = table.step(around() + jerk, ToolMode::Grab, None);
        most = most.max(tool.force_n.norm());
        assert!(table.positions().iter().all(|x| x.amax() < 0.2), "step {i}");
    }
    println!("torn with up to {most:.2} N");
    // Along its normal a jaw pushes with at most four times the grip; friction of both beside it.
    assert!(most < GRIP_N * 4.0 * (1.0 + 2.0 * 0.8), "{most}");
    let away = table.hold(V::new(0.3, 0.0, 0.3), 0.5);
    assert_eq!((away.force_n, away.held_m), (V::zeros(), None));
}

#[test]
fn the_capsules_of_retractors_and_hooks_push_what_they_meet() {
    let retractor = "retractor = { radius_m = 0.002, length_m = 0.08, width_m = 0.02, height_m = 0.006 }";
    let hook = "hook = { radius_m = 0.0015, length_m = 0.08, reach_m = 0.008, point_m = 0.006 }";
    for shape in [retractor, hook] {
        let text = scene(0.5);
        let (before, rest) = text.split_once("shape = { forceps").unwrap();
        let (_, after) = rest.split_once("} }").unwrap();
        let mut table = Table::new(&format!("{before}shape = {{ {shape} }}{after}"));
        let start = V::new(-0.02, 0.0, 0.018);
        table.step(start, ToolMode::Touch, None);
        let at_rest = table.positions();
        for i in 0..150 {
            table.step(start + V::x() * 1.5e-4 * f64::from(i), ToolMode::Touch, None);
        }
        let tool = table.shot.tools[0].clone();
        assert!(tool.force_n.x < -0.05 && tool.force_n.norm() < 8.0, "{shape}: {}", tool.force_n);
        assert!(farthest(&table.positions(), &at_rest) > 1e-3, "{shape}");
        assert!(tool.proxy.translation.x < tool.pose.translation.x - 1e-5, "the tissue stops it: {shape}");
        for _ in 0..300 {
            table.step(start - V::x() * 0.05, ToolMode::Touch, None);
        }
        assert!(farthest(&table.positions(), &at_rest) < 1e-4, "{shape} frees it");
        assert_eq!(table.shot.tools[0].force_n, V::zeros());
    }
}

#[test]
fn a_shape_of_forceps_needs_all_its_lengths() {
    let text = scene(0.5).replace("opening_m = 0.012", "opening_m = 0");
    let error = Scene::from_toml(&text).unwrap_err().to_string();
    assert!(error.contains("opening_m"), "{error}");
    let shape = ToolShape::Hook { radius_m: 0.001, length_m: 0.1, reach_m: 0.01, point_m: 0.01 };
    assert_eq!(scindo_world::tool::compound::count(shape), 3);
}

#[test]
fn two_hands_raise_a_flap() {
    let text = include_str!("../../scenes/two-hands.toml");
    let mut sim = start(text);
    let wants = Wants { measures: true, ..Wants::default() };
    let (mut shot, mut pull, mut load) = (Snapshot::default(), 0.0_f64, 0.0_f64);
    let mut after = |sim: &mut Simulation, until_s: f64| {
        while shot.time_s < until_s {
            sim.step(&Inputs::default());
            sim.snapshot_into(&wants, &mut shot);
            let [forceps, scalpel] = &shot.tools[..] else { panic!("two tools") };
            pull = pull.max(-forceps.force_n.z);
            load = load.max(-scalpel.force_n.x);
            assert_eq!(shot.bodies[0].inverted, 0, "inverted elements at {} s", shot.time_s);
        }
        (shot.probes[0], sim.bodies()[0].body.n_copies(), shot.tools[0].clone(), pull, load)
    };
    let (low, copies, open, ..) = after(&mut sim, 0.5);
    assert_eq!((open.held_m, open.closed), (None, 0.0));
    let (high, same, forceps, pull, _) = after(&mut sim, 4.0);
    assert!(high.z - low.z > 0.008, "the flap is lifted: {low} {high}");
    assert!(forceps.held_m.is_some() && pull > 0.5, "{pull}");
    assert!((0.5..0.9).contains(&forceps.closed), "the flap keeps the jaws apart: {}", forceps.closed);
    assert_eq!(same, copies, "the scalpel only begins");
    let (still, more, forceps, _, load) = after(&mut sim, 9.0);
    assert!(load > 1.5 && more > copies + 80, "the scalpel goes on by force: {load} N, {more} copies");
    assert!((still - high).norm() < 2e-3 && forceps.held_m.is_some(), "the forceps hold on: {high} {still}");
    assert!(-forceps.force_n.z < 0.5 * pull, "a longer flap pulls less: {} of {pull}", forceps.force_n);
    // What was cut closes again between the jaws, which hold on.
    sim.undo().unwrap();
    assert_eq!(sim.bodies()[0].body.n_copies(), copies);
    let (_, _, forceps, ..) = after(&mut sim, 10.0);
    assert!(forceps.held_m.is_some());
}

/// Every jaw that touches is a plane of the local model, and together they are the force of the step.
#[test]
fn a_client_feels_each_jaw_that_touches() {
    let mut table = Table::new(&scene(0.3));
    let wants = Wants { contact: true, ..Wants::default() };
    table.inputs.wants = wants.clone();
    let mut models = ContactModels::default();
    let mut most = 0;
    for i in 0..80 {
        // Open, astride the sheet; then aside, so that one jaw presses its inner face on it.
        let tip = around() - V::x() * 1.5e-4 * f64::from(i.min(40));
        let force = table.step(tip, ToolMode::Touch, Some(0.0)).force_n;
        table.sim.snapshot_into(&wants, &mut table.shot);
        let (tool, now_s) = (&table.shot.tools[0], f64::from(i) * STEP_S);
        models.take(&table.shot, now_s);
        let query = ToolQuery {
            id: Arc::clone(&tool.id),
            shape: tool.shape,
            pose: tool.pose,
            velocity_m_s: V::zeros(),
            mode: ToolMode::Touch,
        };
        let model = models.evaluate(&query, now_s);
        let pushing = model.planes.iter().filter(|plane| plane.force_n.norm() > 1e-3).count();
        most = most.max(pushing);
        if i == 79 {
            let felt = model.force_at(tip);
            assert!(force.x > 0.05, "the jaw at +x presses: {force}");
            assert!((felt - force).norm() < 0.05 * force.norm(), "{felt} against {force}");
            assert_eq!(pushing, 1, "the other jaw is in the air");
        }
    }
    assert!(most >= 1);
}
