//! One cell of the table: a hand presses, holds, slides and leaves, over one link.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use scindo::contact::to_message;
use scindo_drill::device::{BenchDevice, Hand, Probe};
use scindo_haptic::contact::model::{ContactInbox, contact_slot};
use scindo_haptic::device::ToolMode as DeviceMode;
use scindo_haptic::statistics::LoopReport;
use scindo_haptic::tick::{HapticTick, Limits, Ports, TickTime};
use scindo_proto::messages::HapticContact;
use scindo_world::contact::model::{ContactModels, ToolQuery};
use scindo_world::inputs::{ToolInput, ToolMode};
use scindo_world::scene::SceneError;
use scindo_world::snapshot::Snapshot;

use super::link::Line;
use super::measures::{Figures, Sample};
use super::tissue::{SHAPE, TOP_M, Tissue, tool_input};

/// One millisecond [ns].
const MS: u64 = 1_000_000;
/// The server's step [ms], and the period of its contact thread [ms].
const STEP_MS: u64 = 10;
const CONTACT_MS: u64 = 5;
/// Length of a trial [ms].
const LENGTH_MS: u64 = 3000;
/// Interval in which the hand keeps still on the tissue [s].
const STILL_S: [f64; 2] = [1.3, 1.5];
/// Depth of the press below the surface [m], clearance before it [m], way of the slide [m].
const DEPTH_M: f64 = 0.004;
const CLEARANCE_M: f64 = 0.010;
const SLIDE_M: f64 = 0.010;
/// From press to press of a hand that presses again and again [ms].
pub(super) const PERIOD_OF_PRESSES_MS: usize = 1200;
/// Limits of the client, its defaults.
pub(super) const LIMITS: Limits = Limits { max_force_n: 2.5, slew_n_s: 50.0 };

/// What a cell of the table varies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Stiffness, damping and mass of the hand that holds the device.
    pub hand: Hand,
    /// Round trip of the link, half of it each way [ms].
    pub delay_ms: u64,
    /// Share of messages lost, each way.
    pub loss: f64,
}

impl Cell {
    /// Share of the true force that an error may have at this delay; none where nothing is promised.
    pub fn allowed(&self) -> Option<f64> {
        match self.delay_ms {
            0..=20 => Some(0.07),
            21..=100 => Some(0.15),
            _ => None,
        }
    }
}

/// A finished cell.
#[derive(Debug, Clone)]
pub struct Trial {
    /// What was varied.
    pub cell: Cell,
    /// What is compared with the promise.
    pub figures: Figures,
    /// Every tick.
    pub samples: Vec<Sample>,
}

impl Trial {
    /// What is out of its bound.
    pub fn failures(&self) -> Vec<&'static str> {
        self.figures.failures(self.cell.allowed())
    }
}

/// Where the hand wants to be at time `t` [s]: down, still, along, still, up.
fn path(t: f64) -> Vector3<f64> {
    let moved = |from: f64, to: f64| {
        let s = ((t - from) / (to - from)).clamp(0.0, 1.0);
        s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    };
    let down = moved(0.6, 1.0) - moved(2.3, 2.7);
    let along = moved(1.5, 2.0);
    let height = TOP_M + 0.005 + CLEARANCE_M - (CLEARANCE_M + DEPTH_M) * down;
    Vector3::new(SLIDE_M * (along - 0.5), 0.001, height)
}

/// The parts of a session on one clock.
struct Session {
    tick: HapticTick,
    probe: Probe,
    inbox: ContactInbox,
    up: Line<ToolInput>,
    down: Line<HapticContact>,
    server: Server,
    /// The same tissue solved every millisecond, where the truth is wanted.
    truth: Option<Tissue>,
    poses: u64,
    age_ms: f64,
}

/// The server's side.
struct Server {
    tissue: Tissue,
    models: ContactModels,
    snapshot: Snapshot,
    newest: Option<ToolInput>,
    messages: u64,
}

impl Server {
    /// Only the newest pose counts.
    fn receive(&mut self, pose: ToolInput) {
        if self.newest.as_ref().is_none_or(|newest| pose.seq > newest.seq) {
            self.newest = Some(pose);
        }
    }

    /// One millisecond: steps and evaluates where they are due. A message if there is one.
    fn run(&mut self, ms: u64) -> Option<HapticContact> {
        let now_s = ms as f64 * 1e-3;
        if ms.is_multiple_of(STEP_MS) {
            self.tissue.step(self.newest.as_ref());
            self.tissue.show(&mut self.snapshot);
            self.models.take(&self.snapshot, now_s);
        }
        let input = self.newest.as_ref().filter(|_| ms.is_multiple_of(CONTACT_MS))?;
        let query = ToolQuery {
            id: Arc::clone(&input.id),
            shape: SHAPE,
            pose: input.pose,
            velocity_m_s: input.velocity_m_s,
            mode: input.mode,
        };
        let model = self.models.evaluate(&query, now_s);
        self.messages += 1;
        let message = to_message(model, input, self.messages);
        Some(HapticContact { publish_unix_ns: ms * MS, ..message })
    }
}

impl Session {
    fn new(
        (hand, path): (Hand, fn(f64) -> Vector3<f64>),
        (up, down): (Line<ToolInput>, Line<HapticContact>),
    ) -> Result<Self, SceneError> {
        let (device, probe) = BenchDevice::new(hand, path, |_| DeviceMode::Touch);
        let (slot, contacts) = contact_slot();
        let server_alive = Arc::new(AtomicBool::new(true));
        let ports = Ports { contacts, server_alive, poses: None, log: None, meter: None };
        Ok(Self {
            tick: HapticTick::new(Box::new(device), LIMITS, ports),
            probe,
            inbox: ContactInbox::new(slot, super::tissue::OWNER),
            up,
            down,
            server: Server {
                tissue: Tissue::new(STEP_MS as f64 * 1e-3)?,
                models: ContactModels::default(),
                snapshot: Snapshot::default(),
                newest: None,
                messages: 0,
            },
            truth: None,
            poses: 0,
            age_ms: f64::NAN,
        })
    }

    fn millisecond(&mut self, ms: u64) -> Sample {
        let now_ns = ms * MS;
        while let Some(message) = self.down.receive(now_ns) {
            self.age_ms = (now_ns - message.tool_client_time_ns) as f64 * 1e-6;
            self.inbox.accept(&message, now_ns, now_ns);
        }
        let output = self.tick.tick(TickTime { now_ns, elapsed_s: 1e-3 });
        let body = self.probe.body();
        self.poses += 1;
        let measured = (body.measured_m, body.measured_m_s);
        let pose = tool_input(measured, ToolMode::Touch, self.poses, now_ns);
        if let Some(truth) = &mut self.truth {
            truth.step(Some(&pose));
        }
        self.up.send(pose, now_ns);
        while let Some(pose) = self.up.receive(now_ns) {
            self.server.receive(pose);
        }
        if let Some(message) = self.server.run(ms) {
            self.down.send(message, now_ns);
        }
        Sample {
            time_s: now_ns as f64 * 1e-9,
            tip_m: body.position_m,
            felt_n: output.force_n,
            truth_n: self.truth.as_ref().map_or_else(Vector3::zeros, Tissue::force_n),
            work_j: body.work_j,
            age_ms: self.age_ms,
        }
    }
}

/// Runs a cell.
///
/// # Errors
/// If the tissue cannot be built.
pub fn run(cell: Cell) -> Result<Trial, SceneError> {
    let half_ns = cell.delay_ms * MS / 2;
    let lines = (Line::new(half_ns, cell.loss, 1), Line::new(half_ns, cell.loss, 2));
    let mut session = Session::new((cell.hand, path), lines)?;
    session.truth = Some(Tissue::new(1e-3)?);
    let samples: Vec<Sample> = (1..=LENGTH_MS).map(|ms| session.millisecond(ms)).collect();
    let figures = Figures::of(&samples, cell.allowed().unwrap_or(0.15), STILL_S);
    Ok(Trial { cell, figures, samples })
}

/// Where a hand wants to be that presses for half a second, again and again.
fn presses(t: f64) -> Vector3<f64> {
    let in_period = t % (PERIOD_OF_PRESSES_MS as f64 * 1e-3);
    let s = ((0.3 - (in_period - 0.8).abs()) / 0.1).clamp(0.0, 1.0);
    let down = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    Vector3::new(0.0, 0.001, TOP_M + 0.005 + CLEARANCE_M - (CLEARANCE_M + DEPTH_M) * down)
}

/// Lets `hand` press several times over two directions of a link, with or without the client's energy tank. Every tick,
/// without the truth, and the client's own figures.
///
/// # Errors
/// If the tissue cannot be built.
pub fn press_over(
    hand: Hand,
    lines: (Line<ToolInput>, Line<HapticContact>),
    open_tank: bool,
) -> Result<(Vec<Sample>, LoopReport), SceneError> {
    let mut session = Session::new((hand, presses), lines)?;
    if open_tank {
        session.tick.open_tank();
    }
    let samples = (1..=2 * LENGTH_MS).map(|ms| session.millisecond(ms)).collect();
    Ok((samples, session.tick.report()))
}
