//! Rigid tools: held by a client, moved by a script, or idle; and [obstacles](obstacle), which stand still.
//!
//! # Order in a step
//! 1. [`Tools::advance`]: poses and modes of this step, from scripts and clients.
//! 2. [`Tools::take_sweep`] per tool: what its blade swept since its last cut, for `Body::cut`.
//! 3. Contact: surfaces, proxies, springs. After the solve it writes the reactions to [`Tool::force_n`].

pub mod blade;
pub mod compound;
pub mod geometry;
pub mod obstacle;
pub mod script;

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_physics::cut::BladeSweep;

use crate::inputs::{MAX_PASSED, MAX_TOOLS, ToolInput, ToolMode, ToolShape};
use crate::scene::checked::ToolSpec;
use blade::{BladeEdge, IncisionNumbers, PressedEdge};
use script::Script;

/// Owner name of a tool that a script moves.
pub const SCRIPT: &str = "script";
/// Spring of a tool that a client declared [N/m], and its largest force [N].
const GUEST_SPRING: (f64, f64) = (800.0, 8.0);

/// Jaws go from open to closed in this time [s].
const CLOSING_S: f64 = 0.25;

/// One rigid tool and its state in this step.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Tool {
    /// Name, unique in the simulation.
    pub id: Arc<str>,
    /// Shape and dimensions.
    pub shape: ToolShape,
    /// Name of the client that holds it, `script`, or empty if nobody does.
    pub owner: Arc<str>,
    /// Pose of the hand, tool axes to world axes. The translation is the tip [m].
    pub pose: Isometry3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Touch, grab, cut or hover, as the hand or the script requests.
    pub mode: ToolMode,
    /// How far the jaws of forceps are closed, 0 to 1, if nothing is between them.
    pub closed: f64,
    closing: f64,
    /// Stiffness of the spring between hand and tissue [N/m].
    pub stiffness_n_m: f64,
    /// Largest force of that spring [N].
    pub max_force_n: f64,
    /// Coefficient of dry friction μ between it and the tissue on which it presses.
    pub friction: f64,
    /// Force of the tissue on the tool from the last solve [N].
    pub force_n: Vector3<f64>,
    /// The part of it that is friction under a tool that presses [N].
    pub friction_n: Vector3<f64>,
    /// Sequence number of the newest sample used; set by the client.
    pub seq: u64,
    /// The client's clock at that sample [ns].
    pub client_time_ns: u64,
    edge: BladeEdge,
    /// Poses of a cutting blade since the last step.
    passed: Vec<Isometry3<f64>>,
    /// Its edge where it cuts with force.
    pub(crate) pressed: PressedEdge,
    script: Option<Script>,
    round: u64,
    declared: bool,
    number: u64,
    hand_overs: u64,
    jumps: u64,
}

impl Tool {
    fn new(number: u64, id: &str, shape: ToolShape, (stiffness_n_m, max_force_n): (f64, f64)) -> Self {
        Self {
            id: id.into(),
            shape,
            owner: Arc::from(""),
            pose: Isometry3::identity(),
            velocity_m_s: Vector3::zeros(),
            mode: ToolMode::Hover,
            closed: 0.0,
            closing: 0.0,
            stiffness_n_m,
            max_force_n,
            friction: 0.0,
            force_n: Vector3::zeros(),
            friction_n: Vector3::zeros(),
            seq: 0,
            client_time_ns: 0,
            edge: BladeEdge::default(),
            passed: Vec::new(),
            pressed: PressedEdge::default(),
            script: None,
            round: 0,
            declared: false,
            number,
            hand_overs: 0,
            jumps: 0,
        }
    }

    /// A number that no other tool of the simulation has ever had.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Number of changes of owner. At each one the tool releases what it touches and holds.
    pub fn hand_overs(&self) -> u64 {
        self.hand_overs
    }

    /// Number of restarts of its script. At each one the tool is elsewhere without having moved there.
    pub fn jumps(&self) -> u64 {
        self.jumps
    }

    /// Whether the tool is a blade that cuts now. A cutting blade passes through tissue: it parts what it
    /// meets instead of pushing it.
    pub fn cuts(&self) -> bool {
        self.mode == ToolMode::Cut && matches!(self.shape, ToolShape::Blade { .. })
    }

    /// Whether the tool pushes tissue now.
    pub fn touches(&self) -> bool {
        !self.cuts() && matches!(self.mode, ToolMode::Touch | ToolMode::Cut | ToolMode::Scalpel)
    }

    /// Distance [m] of the inner faces of forceps at the ends of the jaws if nothing is between them; 0 for others.
    pub fn gap_m(&self) -> f64 {
        match self.shape {
            ToolShape::Forceps { opening_m, .. } => opening_m * (1.0 - self.closed),
            _ => 0.0,
        }
    }

    /// Moves the jaws for `elapsed` seconds to where the hand or the script wants them.
    fn close(&mut self, elapsed: f64) {
        let most = (elapsed / CLOSING_S).clamp(0.0, 1.0);
        self.closed += (self.closing - self.closed).clamp(-most, most);
    }

    fn hand_over(&mut self, owner: &Arc<str>) {
        if self.owner != *owner {
            self.owner = Arc::clone(owner);
            self.hand_overs += 1;
        }
    }
}

/// All tools: first those of the scene, then those of clients.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Tools {
    tools: Vec<Tool>,
    /// Number of tools created so far.
    made: u64,
    numbers: IncisionNumbers,
    by_force: bool,
    script: Arc<str>,
    nobody: Arc<str>,
    refused: u64,
    time_s: Option<f64>,
}

impl Tools {
    /// The tools of a scene, with nobody holding them. Blades that cut `by_force` sweep what their edges passed, and not
    /// what the hand did.
    pub fn new(specs: &[ToolSpec], by_force: bool) -> Self {
        let declared = (0..).zip(specs).map(|(number, spec)| {
            let mut tool = Tool::new(number, &spec.id, spec.shape, (spec.stiffness_n_m, spec.max_force_n));
            tool.friction = spec.friction;
            tool.script = Script::new(&spec.path, spec.repeat_s);
            tool.declared = true;
            tool
        });
        Self {
            tools: declared.collect(),
            made: specs.len() as u64,
            numbers: IncisionNumbers::default(),
            by_force,
            script: Arc::from(SCRIPT),
            nobody: Arc::from(""),
            refused: 0,
            time_s: None,
        }
    }

    /// All tools, those of the scene first.
    pub fn iter(&self) -> std::slice::Iter<'_, Tool> {
        self.tools.iter()
    }

    /// Number of tools.
    pub fn len(&self) -> usize {
        self.tools.len()
    }

    /// Whether there is no tool.
    pub fn is_empty(&self) -> bool {
        self.tools.is_empty()
    }

    pub(crate) fn iter_mut(&mut self) -> std::slice::IterMut<'_, Tool> {
        self.tools.iter_mut()
    }

    /// Whether any tool may touch, grab or cut in this step.
    pub fn any_active(&self) -> bool {
        self.tools.iter().any(|tool| tool.mode != ToolMode::Hover)
    }

    /// Samples refused so far: not finite, or from a guest without a shape or beyond the limit of tools.
    pub fn refused_samples(&self) -> u64 {
        self.refused
    }

    /// A number for an incision that no blade of a tool makes.
    pub fn fresh_incision(&mut self) -> u32 {
        self.numbers.fresh()
    }

    /// Sets poses and modes for the step that ends at `time_s` [s]. A tool with a sample is held by its
    /// client. A tool without one returns to its script, hovers where it is, or is removed if the scene does
    /// not declare it. A non-finite sample leaves the tool unchanged and is counted.
    pub fn advance(&mut self, time_s: f64, samples: &[ToolInput]) {
        let elapsed = self.time_s.map_or(0.0, |before| time_s - before);
        self.time_s = Some(time_s);
        self.tools.retain(|tool| tool.declared || samples.iter().any(|s| s.id == tool.id));
        for sample in samples {
            self.take_sample(sample);
        }
        for tool in &mut self.tools {
            if samples.iter().any(|sample| sample.id == tool.id) {
                continue;
            }
            match &tool.script {
                Some(script) => {
                    let scripted = script.at(time_s);
                    let moved = scripted.pose.translation.vector - tool.pose.translation.vector;
                    // A velocity needs two poses of the same round under the same owner; else the move is a
                    // jump.
                    let held_on = tool.owner == self.script && tool.round == scripted.round;
                    let steady = held_on && elapsed > 0.0;
                    tool.velocity_m_s = if steady { moved / elapsed } else { Vector3::zeros() };
                    tool.pose = scripted.pose;
                    tool.hand_over(&self.script);
                    if tool.round != scripted.round {
                        tool.round = scripted.round;
                        tool.jumps += 1;
                        tool.edge = BladeEdge::default();
                        tool.pressed = PressedEdge::default();
                    }
                    tool.mode = scripted.mode;
                    tool.closing = closing(scripted.mode);
                }
                None => {
                    tool.hand_over(&self.nobody);
                    tool.mode = ToolMode::Hover;
                    tool.velocity_m_s = Vector3::zeros();
                    tool.closing = 0.0;
                }
            }
        }
        self.tools.iter_mut().for_each(|tool| tool.close(elapsed));
    }

    fn take_sample(&mut self, sample: &ToolInput) {
        let speed = sample.velocity_m_s;
        let closed = sample.closed.unwrap_or(closing(sample.mode));
        let sane =
            geometry::is_sane(&sample.pose) && speed.iter().all(|v| v.is_finite()) && closed.is_finite();
        let known = self.tools.iter().position(|tool| tool.id == sample.id);
        let index = match (sane, known, sample.shape) {
            (true, Some(index), _) => index,
            (true, None, Some(shape)) if self.tools.len() < MAX_TOOLS => {
                self.tools.push(Tool::new(self.made, &sample.id, shape, GUEST_SPRING));
                self.made += 1;
                self.tools.len() - 1
            }
            _ => {
                self.refused += 1;
                return;
            }
        };
        let tool = &mut self.tools[index];
        if let (false, Some(shape)) = (tool.declared, sample.shape) {
            tool.shape = shape;
        }
        tool.passed.clear();
        if tool.owner == sample.owner {
            let passed = sample.passed.iter().take(MAX_PASSED).filter(|pose| geometry::is_sane(pose));
            tool.passed.extend(passed);
        }
        tool.pose = sample.pose;
        tool.hand_over(&sample.owner);
        tool.velocity_m_s = sample.velocity_m_s;
        tool.mode = sample.mode;
        tool.closing = closed.clamp(0.0, 1.0);
        tool.seq = sample.seq;
        tool.client_time_ns = sample.client_time_ns;
    }

    /// The sweep of tool `index` since its last cut, and the number of its incision. `None` while the blade
    /// has moved less than `least_m` [m]. Must be called once per step for every tool.
    pub fn take_sweep(&mut self, index: usize, least_m: f64) -> Option<(BladeSweep, u32)> {
        let tool = &mut self.tools[index];
        let draws = tool.mode == ToolMode::Scalpel;
        if self.by_force || draws || tool.pressed.at().is_some() {
            return tool.pressed.take(tool.cuts() || draws, least_m, &mut self.numbers);
        }
        let edge = tool.cuts().then(|| geometry::core(tool.shape, &tool.pose));
        let shape = tool.shape;
        let passed = tool.passed.drain(..).map(|pose| geometry::core(shape, &pose));
        tool.edge.advance(edge, passed, least_m, &mut self.numbers)
    }

    /// Returns to the start of the scene: guests leave, and nobody holds a tool. Incision numbers keep
    /// rising.
    pub fn reset(&mut self) {
        self.tools.retain(|tool| tool.declared);
        for tool in &mut self.tools {
            tool.edge = BladeEdge::default();
            tool.pressed = PressedEdge::default();
            tool.owner = Arc::clone(&self.nobody);
            tool.mode = ToolMode::Hover;
            (tool.closed, tool.closing) = (0.0, 0.0);
            (tool.force_n, tool.friction_n) = (Vector3::zeros(), Vector3::zeros());
            tool.round = 0;
        }
        self.time_s = None;
    }
}

/// How far a hand closes jaws that says nothing about them.
fn closing(mode: ToolMode) -> f64 {
    f64::from(u8::from(mode == ToolMode::Grab))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
