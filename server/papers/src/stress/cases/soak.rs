//! Random tools and cuts for a long time.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_physics::body::Outcome;
use scindo_study::trial::random::Random;
use scindo_world::inputs::{CutRequest, Inputs, ToolInput, ToolMode, ToolShape};
use scindo_world::simulation::Simulation;

use super::super::case::{Case, Setting};
use super::super::evidence::Evidence;
use super::touch::{WORLD, block};
use crate::lab::Trouble;

/// Case 30.
pub(super) const CASE: Case = Case {
    number: Some(30),
    name: "soak",
    title: "Random tools and cuts, with sleep and replay",
    set_up: "Two blocks on a table. In turns of 5 s a tool presses, holds and drags what it meets, a random sweep cuts, and then \
             nothing happens until the blocks sleep. Every sixth turn the scene is reset. 40 s of simulated time; \
             in the long form an hour, with an eye on the memory of the process.",
    rule: "Every step advances and stays finite; bodies fall asleep and wake; memory does not grow after the first ten minutes; a \
           second run has the same bits.",
    source: "own",
    quick: false,
    run: soak,
};

/// Length of a turn [steps].
const TURN: u64 = 500;
/// Turns between two resets.
const RESET: u64 = 6;

fn soak(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let turns = if setting.long { 720 } else { 8 };
    let first = run(setting, turns)?;
    let again = run(setting, turns)?;
    evidence.exactly("steps held or refused", first.held, 0);
    evidence.exactly("states that are not finite", first.not_finite, 0);
    evidence.at_least("cuts", first.cuts as f64, turns as f64 / 4.0, "");
    evidence.at_least("times that a body fell asleep", first.slept as f64, turns as f64 / 4.0, "");
    evidence.at_least("times that a body woke", first.woke as f64, turns as f64 / 4.0, "");
    evidence.exactly("turns that end with other bits in the second run", first.differ(&again), 0);
    evidence.tell("most pieces of a body", first.pieces as f64, "");
    if let (true, Some(early), Some(late)) = (setting.long, first.early_bytes, resident_bytes()) {
        evidence.at_most("growth of the memory after ten minutes", (late - early) / 1e6, 64.0, "MB");
    }
    Ok(evidence)
}

#[derive(Default)]
struct Record {
    held: usize,
    not_finite: usize,
    cuts: u64,
    slept: usize,
    woke: usize,
    pieces: usize,
    /// A digest of all bits at the end of every turn.
    digests: Vec<u64>,
    early_bytes: Option<f64>,
}

impl Record {
    fn differ(&self, other: &Self) -> usize {
        self.digests.iter().zip(&other.digests).filter(|(one, two)| one != two).count()
    }

    fn step(&mut self, sim: &mut Simulation, inputs: &Inputs) {
        let n = sim.bodies().len();
        let before: Vec<bool> = (0..n).map(|body| sim.is_asleep(body)).collect();
        let report = sim.step(inputs);
        let advanced = |outcome: Outcome| outcome == Outcome::Advanced;
        self.held += report.bodies.iter().filter(|body| !advanced(body.solve.outcome)).count();
        for (body, was) in before.into_iter().enumerate() {
            self.slept += usize::from(!was && sim.is_asleep(body));
            self.woke += usize::from(was && !sim.is_asleep(body));
            self.pieces = self.pieces.max(sim.bodies()[body].body.n_pieces());
        }
    }
}

fn run(setting: &Setting, turns: u64) -> Result<Record, Trouble> {
    let text = [
        WORLD,
        "effects = { sleep = true, body_collision = true }\n",
        &block("left", [0.0, 0.0, 0.001], [0.06, 0.06, 0.061], [4, 4, 4], ""),
        &block("right", [0.08, 0.0, 0.001], [0.14, 0.06, 0.061], [4, 4, 4], ""),
        "[[obstacle]]\nid = \"table\"\nhalf_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }\n",
    ]
    .concat();
    let mut sim = setting.scene(&text, 1)?;
    let (mut random, mut record) = (Random(11), Record::default());
    for turn in 0..turns {
        if turn % RESET == 0 {
            sim.reset()?;
        }
        let cuts = sim.cuts_applied();
        let from = Vector3::new(0.14 * random.uniform(), 0.06 * random.uniform(), 0.1);
        let by = random.vector(0.03);
        let mode = if random.uniform() < 0.5 { ToolMode::Touch } else { ToolMode::Grab };
        let sweep = blade(&mut random);
        for step in 0..TURN {
            let share = step as f64 / (0.3 * TURN as f64);
            // Down into the tissue, aside, and away.
            let down = Vector3::new(0.0, 0.0, -0.06 * share.min(1.0));
            let tip = from + down + by * (2.0 * share - 1.0).clamp(0.0, 1.0);
            let mut inputs = Inputs::default();
            inputs.tools.extend((share < 1.0).then(|| tool(tip, mode)));
            inputs.cuts.extend((step == TURN / 3).then(|| sweep.clone()));
            record.step(&mut sim, &inputs);
        }
        record.cuts += sim.cuts_applied() - cuts;
        let mut digest = 0u64;
        for x in sim.bodies().iter().flat_map(|body| body.body.positions()).flatten() {
            record.not_finite += usize::from(!x.is_finite());
            digest = digest.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ x.to_bits();
        }
        record.digests.push(digest);
        if turn == 120 {
            record.early_bytes = resident_bytes();
        }
    }
    Ok(record)
}

fn tool(tip: Vector3<f64>, mode: ToolMode) -> ToolInput {
    ToolInput {
        id: Arc::from("finger"),
        owner: Arc::from("hand"),
        pose: Isometry3::translation(tip.x, tip.y, tip.z),
        passed: Vec::new(),
        velocity_m_s: Vector3::zeros(),
        mode,
        closed: None,
        shape: Some(ToolShape::Sphere { radius_m: 0.006 }),
        seq: 1,
        client_time_ns: 0,
    }
}

/// An upright sweep across one of the blocks, as deep as chance will have it.
fn blade(random: &mut Random) -> CutRequest {
    let x = 0.01 + 0.12 * random.uniform();
    let depth = 0.07 * random.uniform();
    let edge = |y: f64| [Vector3::new(x, y, 0.08), Vector3::new(x, y, 0.061 - depth)];
    let (start, end) = (-0.01, 0.07 * random.uniform());
    CutRequest { request: 1, tool: Arc::from("knife"), body: None, segments: vec![edge(start), edge(end)] }
}

/// Memory of this process [bytes]; `None` where the system does not tell.
fn resident_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok().map(|kilobytes| 1024.0 * kilobytes)
}
