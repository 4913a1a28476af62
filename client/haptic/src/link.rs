//! Contact messages in, poses out. Everything that may wait happens here, on separate threads. zenoh's
//! receiving thread fills the contact slot, and the thread `haptic-pose` sends.

pub mod deadband;

use crate::clock::LoopClock;
use crate::constants::{PERIOD_S, POSE_QUEUE};
use crate::contact::model::{ContactInbox, ContactSlot, contact_slot};
use crate::device::{Capability, DeviceState, ToolMode};
use crate::link::deadband::{Deadband, Withholding};
use crate::log::row::LogRow;
use crate::safety::flag;
use crate::statistics::LinkReport;
use crossbeam_channel::{Receiver, Sender, TryRecvError};
use nalgebra::Vector3;
use scindo_client::messages::{self, DeviceCapability, Pose, ToolSample, ToolShape, Vec3, tool_sample};
use scindo_client::{ContactStream, Cutter, Link, LinkConfig, LinkError, PoseSender};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{JoinHandle, Thread};
use std::time::Duration;

/// Owner id of a tool that the scene moves.
const SCRIPT: &str = "script";

/// Longest sleep of the sender if nobody wakes it.
const SENDER_PARK: Duration = Duration::from_millis(5);

/// One pose on its way to the server.
#[derive(Debug, Clone, Copy)]
struct PoseSample {
    state: DeviceState,
    force_n: Vector3<f64>,
    contact_seq: u64,
    contact_age_ms: f64,
    round_trip_ms: f64,
    energy_j: f64,
    flags: u32,
}

/// The loop's end of the pose queue.
pub struct PoseQueue {
    sender: Sender<PoseSample>,
    thread: Thread,
    period_ns: u64,
    next_ns: u64,
    withholding: Option<Withholding>,
}

/// What became of a pose that was offered to the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offered {
    /// None was due.
    NotDue,
    /// It is on its way.
    Queued,
    /// One was due, but it was within the deadband of the last one.
    Withheld,
    /// The queue was full.
    Dropped,
}

impl PoseQueue {
    fn new(sender: Sender<PoseSample>, thread: Thread, pose_hz: f64, deadband: Option<Deadband>) -> Self {
        let withholding = deadband.map(Withholding::new);
        Self { sender, thread, period_ns: (1e9 / pose_hz) as u64, next_ns: 0, withholding }
    }

    /// Queues a pose if one is due and worth sending. Never waits: the receiver polls, so the channel takes no
    /// lock. Waking its thread is one system call.
    pub fn offer(&mut self, state: &DeviceState, row: &LogRow, now_ns: u64) -> Offered {
        let urgent = self.withholding.as_ref().is_some_and(|held| held.is_urgent(state.mode));
        if now_ns < self.next_ns && !urgent {
            return Offered::NotDue;
        }
        self.next_ns = now_ns + self.period_ns - (PERIOD_S * 0.5e9) as u64;
        if self.withholding.as_ref().is_some_and(|held| !held.lets_pass(state, now_ns)) {
            return Offered::Withheld;
        }
        let sample = PoseSample {
            state: *state,
            force_n: row.force_n,
            contact_seq: row.contact_seq,
            contact_age_ms: row.contact_age_ms,
            round_trip_ms: row.round_trip_ms,
            energy_j: row.energy_j,
            flags: row.flags,
        };
        let taken = self.sender.try_send(sample).is_ok();
        self.thread.unpark();
        if !taken {
            return Offered::Dropped;
        }
        if let Some(held) = &mut self.withholding {
            held.sent(state, now_ns);
        }
        Offered::Queued
    }
}

/// The tool that the client wants to hold.
#[derive(Debug, Clone)]
pub struct ToolRequest {
    /// Id of the tool.
    pub id: String,
    /// Shape of the tool, used if the scene does not declare it.
    pub shape: ToolShape,
    /// Poses per second [Hz].
    pub pose_hz: f64,
    /// Poses within it of the last one sent are withheld; `None` sends all.
    pub deadband: Option<Deadband>,
    /// Capability of the device that moves the tool.
    pub capability: Capability,
}

/// Connections of the loop to the network.
pub struct LoopPorts {
    /// Newest contact model.
    pub contacts: ContactSlot,
    /// Whether the server's liveliness token is present.
    pub server_alive: Arc<AtomicBool>,
    /// Queue of poses to the server.
    pub poses: PoseQueue,
}

/// A tool that this client holds over the network.
pub struct HeldTool {
    inbox: Arc<Mutex<ContactInbox>>,
    sent: Arc<AtomicU64>,
    sender: JoinHandle<()>,
    _contacts: ContactStream,
    _cutter: Cutter,
}

impl HeldTool {
    /// Takes hold of the tool. It must run inside a multi-threaded tokio runtime.
    pub async fn hold(
        link: &Link,
        tool: &ToolRequest,
        clock: LoopClock,
    ) -> Result<(Self, LoopPorts), LinkError> {
        let (slot, contacts) = contact_slot();
        let inbox = Arc::new(Mutex::new(ContactInbox::new(slot, link.id())));
        let shared = inbox.clone();
        // zenoh's receiving thread, the live figures and the final report lock it. The loop reads the slot.
        let stream = link
            .each_contact(&tool.id, move |message| {
                let mut inbox = shared.lock().unwrap_or_else(PoisonError::into_inner);
                inbox.accept(&message, clock.now_ns(), scindo_client::tool::unix_ns());
            })
            .await?;
        let held = link.tool(&tool.id).await?;
        held.cutter.announce(capability(&tool.capability)).await?;
        let (sender, receiver) = crossbeam_channel::bounded(POSE_QUEUE);
        let sent = Arc::new(AtomicU64::new(0));
        let thread = spawn_sender(held.poses, receiver, tool.shape, sent.clone())?;
        let poses = PoseQueue::new(sender, thread.thread().clone(), tool.pose_hz, tool.deadband);
        let ports = LoopPorts { contacts, server_alive: follow_presence(link), poses };
        Ok((Self { inbox, sent, sender: thread, _contacts: stream, _cutter: held.cutter }, ports))
    }

    /// A function for another thread that returns the number of contacts taken so far.
    pub fn contact_count(&self) -> impl Fn() -> u64 + Send + use<> {
        let inbox = self.inbox.clone();
        move || inbox.lock().unwrap_or_else(PoisonError::into_inner).contacts()
    }

    /// Waits for the sender to end and returns the figures of the link. The loop must have dropped its queue.
    pub fn finish(self) -> LinkReport {
        if self.sender.join().is_err() {
            tracing::error!("the pose sender panicked");
        }
        let report = self.inbox.lock().unwrap_or_else(PoisonError::into_inner).report();
        LinkReport { poses_sent: self.sent.load(Ordering::Relaxed), ..report }
    }
}

/// A flag that follows the server's liveliness token.
fn follow_presence(link: &Link) -> Arc<AtomicBool> {
    let mut presence = link.presence();
    let alive = Arc::new(AtomicBool::new(presence.borrow_and_update().servers > 0));
    let shared = alive.clone();
    tokio::spawn(async move {
        while presence.changed().await.is_ok() {
            let servers = presence.borrow_and_update().servers;
            shared.store(servers > 0, Ordering::Relaxed);
            tracing::info!(servers, "servers in the session");
        }
        shared.store(false, Ordering::Relaxed);
    });
    alive
}

fn spawn_sender(
    mut poses: PoseSender,
    queue: Receiver<PoseSample>,
    shape: ToolShape,
    sent: Arc<AtomicU64>,
) -> Result<JoinHandle<()>, LinkError> {
    let run = move || {
        loop {
            match queue.try_recv() {
                Ok(sample) => match poses.send(wire_sample(&sample, shape)) {
                    Ok(_) => drop(sent.fetch_add(1, Ordering::Relaxed)),
                    Err(error) => tracing::debug!(%error, "pose not sent"),
                },
                Err(TryRecvError::Empty) => std::thread::park_timeout(SENDER_PARK),
                Err(TryRecvError::Disconnected) => return,
            }
        }
    };
    std::thread::Builder::new()
        .name("haptic-pose".into())
        .spawn(run)
        .map_err(|e| LinkError::Config { what: "thread haptic-pose".into(), reason: e.to_string() })
}

fn wire_sample(sample: &PoseSample, shape: ToolShape) -> ToolSample {
    let PoseSample { state, .. } = sample;
    let [qx, qy, qz, qw] = state.orientation;
    let mode = match state.mode {
        ToolMode::Hover => tool_sample::Mode::Hover,
        ToolMode::Touch => tool_sample::Mode::Touch,
        ToolMode::Grab => tool_sample::Mode::Grab,
        ToolMode::Cut => tool_sample::Mode::Cut,
        ToolMode::Scalpel => tool_sample::Mode::Scalpel,
    };
    ToolSample {
        pose: Some(Pose { position_m: Some(vec3(&state.position_m)), qx, qy, qz, qw }),
        velocity_m_s: Some(vec3(&state.velocity_m_s)),
        mode: mode.into(),
        shape: Some(shape),
        applied_force_n: Some(vec3(&sample.force_n)),
        last_contact_seq_used: sample.contact_seq,
        contact_age_ms: sample.contact_age_ms as f32,
        round_trip_ms: sample.round_trip_ms as f32,
        passivity_energy_j: sample.energy_j,
        fault_flags: sample.flags & flag::FAULTS,
        ..ToolSample::default()
    }
}

fn capability(device: &Capability) -> DeviceCapability {
    DeviceCapability {
        model: device.model.to_owned(),
        max_force_n: device.max_force_n,
        max_continuous_force_n: device.max_continuous_force_n,
        max_stiffness_n_m: device.max_stiffness_n_m,
        workspace_radius_m: device.workspace_radius_m,
        loop_rate_hz: 1.0 / PERIOD_S,
        ..DeviceCapability::default()
    }
}

fn vec3(v: &Vector3<f64>) -> Vec3 {
    Vec3 { x: v.x, y: v.y, z: v.z }
}

/// Finds a body to touch: its id, and the point of its surface that lies furthest against `direction`.
pub async fn nearest_surface(
    link: &Link,
    body: Option<&str>,
    direction: &Vector3<f64>,
) -> Result<Option<(messages::BodyInfo, Vector3<f64>)>, LinkError> {
    let info = link.info().await?;
    let wanted = |b: &&messages::BodyInfo| body.is_none_or(|id| b.id == id);
    let Some(info) = info.bodies.iter().find(wanted).cloned() else { return Ok(None) };
    let mut mirror = link.mirror(&info.id).await?;
    let surface = tokio::time::timeout(Duration::from_secs(5), mirror.next()).await.map_err(|_| {
        LinkError::Timeout { key: format!("surface of {}", info.id), waited: Duration::from_secs(5) }
    })??;
    let height = |p: &Vector3<f64>| -direction.dot(p);
    let point =
        surface.frame.positions.chunks_exact(12).map(position).max_by(|a, b| height(a).total_cmp(&height(b)));
    Ok(point.map(|point| (info, point)))
}

/// Decodes three little-endian `f32`.
fn position(bytes: &[u8]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|b| bytes[4 * i + b]))))
}

/// Warns if a script of the scene moves the requested tool.
pub async fn tell_of_script(link: &Link, tool: &str) -> Result<(), LinkError> {
    if is_scripted(&link.info().await?, tool) {
        tracing::warn!(
            "tool '{tool}' has a path in the scene. It now follows this device, and its path again when the \
             device releases it. To keep the path, name a tool without `path`, or a new id"
        );
    }
    Ok(())
}

fn is_scripted(info: &messages::SessionInfo, tool: &str) -> bool {
    info.tools.iter().any(|known| known.id == tool && known.owner == SCRIPT)
}

/// Connects with the role `haptic`.
pub async fn connect(config: LinkConfig) -> Result<Link, LinkError> {
    Link::connect(config).await
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_client::messages::{SessionInfo, ToolInfo};

    const MS: u64 = 1_000_000;

    /// What became of the poses of `states`, one per millisecond, and the times [ms] of those that were queued.
    fn offered(states: &[DeviceState], deadband: Option<Deadband>) -> (Vec<Offered>, Vec<usize>) {
        let (sender, receiver) = crossbeam_channel::bounded(states.len());
        let mut queue = PoseQueue::new(sender, std::thread::current(), 500.0, deadband);
        let offer = |(ms, state)| queue.offer(state, &LogRow::default(), MS * ms);
        let all: Vec<Offered> = (0..).zip(states).map(offer).collect();
        let times: Vec<usize> = (0..all.len()).filter(|&ms| all[ms] == Offered::Queued).collect();
        assert_eq!(receiver.len(), times.len());
        (all, times)
    }

    fn still(mode: ToolMode) -> DeviceState {
        let (position_m, velocity_m_s) = (Vector3::zeros(), Vector3::zeros());
        DeviceState { position_m, velocity_m_s, orientation: [0.0, 0.0, 0.0, 1.0], mode }
    }

    #[test]
    fn a_still_hand_sends_signs_of_life_and_a_button_passes_at_once() {
        let band = Some(Deadband { position_m: 1e-4, angle_rad: 0.01 });
        let mut states = vec![still(ToolMode::Touch); 1000];
        let (all, times) = offered(&states, band);
        assert_eq!(times, (0..20).map(|i| 50 * i).collect::<Vec<_>>());
        assert_eq!(all.iter().filter(|o| **o == Offered::Withheld).count(), 480);
        states[333..].fill(still(ToolMode::Grab));
        let (_, times) = offered(&states, band);
        assert!(times.contains(&333), "between two poses that are due: {times:?}");
        // Without a deadband every pose that is due goes.
        let (all, times) = offered(&states, None);
        assert_eq!(times, (0..500).map(|i| 2 * i).collect::<Vec<_>>());
        assert!(!all.contains(&Offered::Withheld));
    }

    #[test]
    fn only_tools_that_a_script_moves_are_told_of() {
        let tool =
            |id: &str, owner: &str| ToolInfo { id: id.into(), owner: owner.into(), ..ToolInfo::default() };
        let tools = vec![tool("finger", "script"), tool("probe", ""), tool("hook", "someone")];
        let info = SessionInfo { tools, ..SessionInfo::default() };
        assert!(is_scripted(&info, "finger"));
        assert!(!is_scripted(&info, "probe") && !is_scripted(&info, "hook") && !is_scripted(&info, "new"));
    }
}
