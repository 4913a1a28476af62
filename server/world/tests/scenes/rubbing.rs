//! Dry friction under a ball that is pressed into a block and drawn aside.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_world::contact::model::{ContactModels, ToolQuery};
use scindo_world::inputs::{Inputs, ToolInput, ToolMode, Wants};
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::{Snapshot, ToolSnapshot};

use crate::start_with;

type V = Vector3<f64>;

const STEP_S: f64 = 0.005;
const RADIUS_M: f64 = 0.008;
/// Height of the tip's centre when the ball is pressed 3 mm into the block.
const PRESSED_M: f64 = 0.03 + RADIUS_M - 0.003;
const FRICTION: f64 = 0.3;

fn scene(friction: &str, shape: &str) -> String {
    format!(
        r#"
        schema = 1
        [world]
        gravity_m_s2 = [0, 0, 0]
        step_s = {STEP_S}
        [[body]]
        id = "block"
        mesh = {{ box = {{ min_m = [-0.05, -0.03, 0], max_m = [0.05, 0.03, 0.03], cells = [16, 10, 5] }} }}
        young_pa = 2e4
        poisson = 0.4
        density_kg_m3 = 1000
        rayleigh = {{ mass_1_s = 2.0, stiffness_s = 0.005 }}
        solver = {{ iterations = 200, tolerance = 1e-7 }}
        [[body.fix]]
        where = {{ slab = {{ axis = "z", from = 0, to = 0.01 }} }}
        [[tool]]
        id = "probe"
        shape = {{ {shape} }}
        stiffness_n_m = 800
        max_force_n = 8
        {friction}
        "#
    )
}

fn ball() -> String {
    format!("sphere = {{ radius_m = {RADIUS_M} }}")
}

struct Table {
    sim: Simulation,
    inputs: Inputs,
    shot: Snapshot,
    tip: V,
}

impl Table {
    fn new(text: &str, threads: usize) -> Self {
        let sim = start_with(text, threads);
        let tip = V::new(0.0, 0.0, 0.03 + 2.0 * RADIUS_M);
        Self { sim, inputs: Inputs::default(), shot: Snapshot::default(), tip }
    }

    /// Carries the tip to `to` in a straight line, and returns the tool after every step.
    fn carry(&mut self, to: V, seconds: f64) -> Vec<ToolSnapshot> {
        let (from, steps) = (self.tip, (seconds / STEP_S).round() as usize);
        let mut seen = Vec::new();
        for i in 1..=steps {
            self.tip = from.lerp(&to, i as f64 / steps as f64);
            self.inputs.tools = vec![ToolInput {
                velocity_m_s: (to - from) / seconds,
                ..ToolInput::new("probe", "hand", Isometry3::translation(self.tip.x, self.tip.y, self.tip.z))
            }];
            self.sim.step(&self.inputs);
            let wants = Wants { contact: true, ..Wants::default() };
            self.sim.snapshot_into(&wants, &mut self.shot);
            seen.push(self.shot.tools[0].clone());
        }
        seen
    }

    fn pressed(text: &str) -> Self {
        let mut table = Self::new(text, 1);
        table.carry(V::new(0.0, 0.0, PRESSED_M), 0.5);
        table.carry(V::new(0.0, 0.0, PRESSED_M), 1.0);
        table
    }
}

/// Friction over the force along the normal.
fn ratio(tool: &ToolSnapshot) -> f64 {
    tool.friction_n.norm() / (tool.force_n - tool.friction_n).norm()
}

#[test]
fn a_ball_that_slides_is_held_back_by_friction_times_force() {
    for (friction, mu) in [(format!("friction = {FRICTION}"), FRICTION), ("friction = 0.1".into(), 0.1)] {
        let mut table = Table::pressed(&scene(&friction, &ball()));
        let slid = table.carry(V::new(0.03, 0.0, PRESSED_M), 1.0);
        for tool in &slid[120..] {
            assert!((ratio(tool) / mu - 1.0).abs() < 0.03, "{} of {mu}", ratio(tool));
            assert!(tool.friction_n.x < -0.95 * tool.friction_n.norm(), "{}", tool.friction_n);
        }
        assert!(slid.iter().all(|tool| ratio(tool) < 1.03 * mu));
        // On the way back it turns around.
        let back = table.carry(V::new(0.0, 0.0, PRESSED_M), 1.0);
        assert!(back[120..].iter().all(|tool| tool.friction_n.x > 0.9 * tool.friction_n.norm()));
    }
}

#[test]
fn a_ball_that_moves_little_takes_the_tissue_along_and_does_not_creep() {
    let mut table = Table::pressed(&scene("friction = 0.8", &ball()));
    let little = V::new(5e-4, 0.0, PRESSED_M);
    table.carry(little, 0.2);
    let first = table.carry(little, 1.0).pop().unwrap();
    assert!((0.02..0.7).contains(&ratio(&first)), "it sticks: {}", ratio(&first));
    let later = table.carry(little, 5.0).pop().unwrap();
    let change = (later.friction_n - first.friction_n).norm() / first.friction_n.norm();
    assert!(change < 0.01, "after 5 s: {change}");
    // Released, it springs back to the middle and the tissue with it.
    let back = table.carry(V::new(0.0, 0.0, PRESSED_M), 0.2).pop().unwrap();
    assert!(back.friction_n.norm() < 0.1 * first.friction_n.norm(), "{}", back.friction_n);
    let free = table.carry(V::new(0.0, 0.0, 0.06), 0.5).pop().unwrap();
    assert_eq!((free.force_n, free.friction_n), (V::zeros(), V::zeros()));
}

#[test]
fn without_friction_nothing_changes_and_the_threads_agree_with_it() {
    let way = |text: &str, threads: usize| -> Vec<V> {
        let mut table = Table::new(text, threads);
        let mut forces = Vec::new();
        for to in [V::new(0.0, 0.0, PRESSED_M), V::new(0.01, 0.0, PRESSED_M)] {
            forces.extend(table.carry(to, 0.2).iter().map(|tool| tool.force_n));
        }
        forces
    };
    assert_eq!(way(&scene("", &ball()), 1), way(&scene("friction = 0", &ball()), 1));
    let rough = scene("friction = 0.3", &ball());
    let one = way(&rough, 1);
    assert_ne!(one, way(&scene("", &ball()), 1));
    for threads in [2, 3] {
        assert_eq!(one, way(&rough, threads));
    }
}

#[test]
fn the_local_model_foretells_friction() {
    let mut table = Table::pressed(&scene(&format!("friction = {FRICTION}"), &ball()));
    let mut models = ContactModels::default();
    let (mut worst, mut most): (f64, f64) = (0.0, 0.0);
    for i in 0..80 {
        let time_s = i as f64 * STEP_S;
        models.take(&table.shot, time_s);
        let next = table.tip + V::x() * 1e-4;
        let query = ToolQuery {
            id: Arc::from("probe"),
            shape: table.shot.tools[0].shape,
            pose: Isometry3::translation(next.x, next.y, next.z),
            velocity_m_s: V::x() * 1e-4 / STEP_S,
            mode: ToolMode::Touch,
        };
        let told = models.evaluate(&query, time_s + STEP_S).force_at(next);
        let felt = table.carry(next, STEP_S).pop().unwrap();
        most = most.max(felt.friction_n.norm());
        if i > 2 {
            worst = worst.max((told - felt.force_n).x.abs());
        }
    }
    assert!(most > 0.1, "{most}");
    assert!(worst < 0.1 * most, "worst {worst} of {most} N");
}

#[test]
fn the_capsules_of_a_retractor_rub_each_by_itself() {
    let shape = "retractor = { radius_m = 0.002, length_m = 0.1, width_m = 0.02, height_m = 0.008 }";
    let mut table = Table::new(&scene(&format!("friction = {FRICTION}"), shape), 1);
    table.carry(V::new(0.0, 0.0, 0.03), 0.5);
    let slid = table.carry(V::new(0.0, 0.02, 0.03), 1.0);
    let tool = slid.last().unwrap();
    assert!(tool.force_n.norm() > 0.05, "{}", tool.force_n);
    assert!(ratio(tool) < 1.1 * FRICTION, "{}", ratio(tool));
    assert!(tool.friction_n.y < -0.5 * tool.friction_n.norm(), "{}", tool.friction_n);
    let limbs: V = tool.limbs.iter().map(|limb| limb.friction_n).sum();
    assert!((limbs - tool.friction_n).norm() < 1e-12);
}
