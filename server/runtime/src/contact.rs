//! The contact thread computes a local contact model per tool, at its own rate beside the simulation. It uses
//! the newest snapshot and the newest pose. It computes, and asks the simulation for surfaces, only while
//! somebody subscribes to the contact of a held tool.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use scindo_proto::limits::MAX_CONTACTS;
use scindo_proto::messages::{self as wire, HapticContact, haptic_contact};
use scindo_proto::{Chunk, KeySpace, Topic, encode, encoding};
use scindo_world::contact::model::{ContactMode, ContactModels, ContactPlane, LocalContact, ToolQuery};
use scindo_world::inputs::{ToolInput, ToolShape};
use scindo_world::snapshot::Snapshot;
use triple_buffer::Output;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::{Session, Wait as _};

use crate::exchange::Exchange;
use crate::wire::convert::{to_pose, unix_ns};

/// How often an idle thread checks whether somebody holds a tool.
const IDLE: Duration = Duration::from_millis(5);

/// Most ticks that are made up for after a delay. The rest is lost.
const MOST_BEHIND: u32 = 16;

/// Fixed settings of the contact thread.
pub struct ContactConfig {
    /// Key space of the session.
    pub keys: KeySpace,
    /// The session on which contacts are published.
    pub haptic: Session,
    /// Contact models per second and tool [Hz].
    pub rate_hz: f64,
    /// Shapes of the scene's tools, by id.
    pub shapes: BTreeMap<String, ToolShape>,
    /// Ids of the scene's bodies, in scene order.
    pub bodies: Vec<String>,
}

/// Publisher of the contact of one held tool.
struct Line {
    publisher: Publisher<'static>,
    wanted: Arc<AtomicBool>,
    seq: u64,
}

/// When ticks are due. Their mean rate is kept: after a delay they come at twice the rate until they are made up for.
struct Beat {
    period: Duration,
    due: Instant,
}

impl Beat {
    /// When the tick after one that began at `begun` is to begin.
    fn after(&mut self, begun: Instant) -> Instant {
        self.due += self.period;
        if let Some(oldest) = begun.checked_sub(self.period * MOST_BEHIND) {
            self.due = self.due.max(oldest);
        }
        self.due.max(begun + self.period / 2)
    }
}

/// State of the contact thread.
pub struct ContactThread {
    config: ContactConfig,
    exchange: Arc<Exchange>,
    snapshots: Output<Snapshot>,
    models: ContactModels,
    lines: BTreeMap<Arc<str>, Line>,
    held: Vec<ToolInput>,
    epoch: Instant,
}

impl ContactThread {
    /// Creates an idle thread.
    pub fn new(config: ContactConfig, exchange: Arc<Exchange>, snapshots: Output<Snapshot>) -> Self {
        Self {
            config,
            exchange,
            snapshots,
            models: ContactModels::default(),
            lines: BTreeMap::new(),
            held: Vec::new(),
            epoch: Instant::now(),
        }
    }

    /// Runs until the server ends.
    pub fn run(mut self) {
        // Scenes allow 50 to 2000 Hz.
        let period = Duration::from_secs_f64(1.0 / self.config.rate_hz.max(1.0));
        let mut beat = Beat { period, due: Instant::now() };
        while !self.exchange.stopping() {
            let begun = Instant::now();
            let next = if self.look() {
                self.tick();
                beat.after(begun)
            } else {
                beat.due = begun + IDLE;
                beat.due
            };
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
    }

    /// Updates which tools are held. True if somebody wants the contact of one of them.
    fn look(&mut self) -> bool {
        self.held.clear();
        self.held.extend(self.exchange.inbox().held().cloned());
        let held = &self.held;
        self.lines.retain(|tool, _| held.iter().any(|input| input.id == *tool));
        for input in held {
            if !self.lines.contains_key(&input.id)
                && let Some(line) = open_line(&self.config, &input.id)
            {
                self.lines.insert(input.id.clone(), line);
            }
        }
        let wanted = self.lines.values().any(|line| line.wanted.load(Ordering::Relaxed));
        self.exchange.want_contact(wanted);
        wanted
    }

    /// Computes and publishes one model per tool.
    fn tick(&mut self) {
        let now_s = self.epoch.elapsed().as_secs_f64();
        if self.snapshots.update() {
            self.models.take(self.snapshots.output_buffer(), now_s);
        }
        for input in &self.held {
            let Some(line) = self.lines.get_mut(&input.id) else { continue };
            let shape = input.shape.or_else(|| self.config.shapes.get(&*input.id).copied());
            let Some(shape) = shape.filter(|_| line.wanted.load(Ordering::Relaxed)) else { continue };
            let query = ToolQuery {
                id: input.id.clone(),
                shape,
                pose: input.pose,
                velocity_m_s: input.velocity_m_s,
                mode: input.mode,
            };
            let model = self.models.evaluate(&query, now_s);
            line.seq += 1;
            let mut message = to_message(model, input, line.seq);
            message.body_id = model.body.and_then(|i| self.config.bodies.get(i)).cloned().unwrap_or_default();
            heed_device(&mut message, &self.exchange);
            if let Err(error) = line.publisher.put(encode(&message)).wait() {
                tracing::debug!(%error, "contact not published");
            }
            self.exchange.meter.contact(&input.id);
        }
    }
}

fn open_line(config: &ContactConfig, tool: &str) -> Option<Line> {
    let id = Chunk::new("tool id", tool).ok()?;
    let publisher = config
        .haptic
        .declare_publisher(config.keys.key(&Topic::ToolContact(id)))
        .encoding(encoding::<HapticContact>())
        .priority(Priority::RealTime)
        .express(true)
        .congestion_control(CongestionControl::Drop)
        .reliability(Reliability::BestEffort)
        .wait()
        .inspect_err(|error| tracing::warn!(%error, tool, "no contact for this tool"))
        .ok()?;
    let wanted = Arc::new(AtomicBool::new(false));
    let flag = wanted.clone();
    publisher
        .matching_listener()
        .callback(move |status| flag.store(status.matching(), Ordering::Relaxed))
        .background()
        .wait()
        .ok()?;
    if publisher.matching_status().wait().is_ok_and(|status| status.matching()) {
        wanted.store(true, Ordering::Relaxed);
    }
    Some(Line { publisher, wanted, seq: 0 })
}

/// The message of a model, computed for `input`.
pub fn to_message(model: &LocalContact, input: &ToolInput, seq: u64) -> HapticContact {
    let mode = match model.mode {
        ContactMode::Free => haptic_contact::Mode::Free,
        ContactMode::Contact => haptic_contact::Mode::Contact,
        ContactMode::Cutting => haptic_contact::Mode::Cutting,
        ContactMode::Hold => haptic_contact::Mode::Hold,
    };
    // All planes of a model touch the same tissue.
    let relaxing = model.planes.iter().find(|plane| plane.relaxed_stiffness_n_m > 0.0);
    HapticContact {
        seq,
        sim_step: model.step,
        sim_time_s: model.time_s,
        publish_unix_ns: unix_ns(),
        tool_seq_used: input.seq,
        tool_client_time_ns: input.client_time_ns,
        epoch: model.epoch,
        client_id: input.owner.to_string(),
        tool_id: input.id.to_string(),
        body_id: String::new(),
        tool_pose_used: Some(to_pose(&model.pose_used)),
        mode: mode.into(),
        // Planes are sorted by urgency. One datagram holds this many.
        contacts: model.planes.iter().take(MAX_CONTACTS).map(to_contact).collect(),
        validity_ms: (1e3 * model.validity_s) as f32,
        max_force_n: model.max_force_n as f32,
        max_stiffness_n_m: model.max_stiffness_n_m as f32,
        instant_stiffness_n_m: relaxing.map_or(0.0, |plane| plane.instant_stiffness_n_m as f32),
        relaxed_stiffness_n_m: relaxing.map_or(0.0, |plane| plane.relaxed_stiffness_n_m as f32),
        relaxation_s: relaxing.map_or(0.0, |plane| plane.relaxation_s as f32),
    }
}

fn to_contact(plane: &ContactPlane) -> wire::Contact {
    let pushes = plane.edge_of.is_none();
    wire::Contact {
        point_m: Some(to_vec3f(&plane.point_m)),
        normal: Some(to_vec3f(&plane.normal)),
        gap_m: plane.gap_m as f32,
        force_n: pushes.then(|| to_vec3f(&plane.force_n)),
        stiffness_n_m: plane.stiffness_n_m as f32,
        tangential_stiffness_n_m: plane.tangential_stiffness_n_m as f32,
        friction: plane.friction as f32,
        damping_ns_m: plane.damping_ns_m as f32,
        surface_velocity_m_s: pushes.then(|| to_vec3f(&plane.surface_velocity_m_s)),
        patch_radius_m: plane.patch_radius_m as f32,
        feature_id: plane.feature_id,
        edge_of: plane.edge_of.map_or(0, |of| of as u32 + 1),
    }
}

fn to_vec3f(v: &Vector3<f64>) -> wire::Vec3f {
    wire::Vec3f { x: v.x as f32, y: v.y as f32, z: v.z as f32 }
}

/// Limits the advice to what the device said it can do.
fn heed_device(message: &mut HapticContact, exchange: &Exchange) {
    let inbox = exchange.inbox();
    let Some(device) = inbox.capability_of(&message.tool_id) else { return };
    let least = |advice: f32, device: f64| if device > 0.0 { advice.min(device as f32) } else { advice };
    message.max_force_n = least(message.max_force_n, device.max_force_n);
    message.max_stiffness_n_m = least(message.max_stiffness_n_m, device.max_stiffness_n_m);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_ticks_are_made_up_for_within_bounds() {
        let period = Duration::from_millis(2);
        let start = Instant::now();
        let mut beat = Beat { period, due: start };
        // On time: on the beat, however late within a period a tick begins.
        let mut begun = start;
        for tick in 1..=5 {
            let next = beat.after(begun);
            assert_eq!(next, start + period * tick);
            begun = next + Duration::from_micros(300);
        }
        // Eleven milliseconds late: at twice the rate until the beat has been caught up with.
        begun += Duration::from_millis(11);
        let mut ticks = 5;
        while beat.after(begun) == begun + period / 2 {
            (begun, ticks) = (begun + period / 2, ticks + 1);
        }
        assert_eq!(beat.due, start + period * (ticks + 1));
        assert!((10..=20).contains(&ticks), "{ticks}");
        // A second late: most of it is lost.
        begun += Duration::from_secs(1);
        let mut hurried = 0;
        while beat.after(begun) == begun + period / 2 {
            (begun, hurried) = (begun + period / 2, hurried + 1);
        }
        assert!((MOST_BEHIND..=2 * MOST_BEHIND + 2).contains(&hurried), "{hurried}");
    }
}
