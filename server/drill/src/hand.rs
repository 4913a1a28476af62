//! A haptic client: the real tick on a simulated device, poses and cuts up, contacts and answers down.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Vector3;
use scindo_haptic::constants::PERIOD_S;
use scindo_haptic::contact::model::{ContactInbox, contact_slot};
use scindo_haptic::device::ToolMode;
use scindo_haptic::tick::{HapticTick, Limits, Ports, TickOutput, TickTime};
use scindo_proto::messages::{
    BladeSegment, CutAck, CutCommand, HapticContact, Pose, ToolSample, ToolShape, Vec3, tool_sample,
    tool_shape,
};
use scindo_proto::{Chunk, KeySpace, Topic, decode_as, encode, encoding};

use crate::device::{BenchDevice, HANDS, Probe};
use crate::network::{MS, Packet};

/// Limits of the force, as by default.
pub const LIMITS: Limits = Limits { max_force_n: 2.5, slew_n_s: 50.0 };
/// A cut without an answer is sent again after this time, and given up after the other [ns].
const RESEND_NS: u64 = 100 * MS;
const GIVE_UP_NS: u64 = 5_000 * MS;
/// Unix time at which episodes begin [ns].
const BEGINNING_NS: u64 = 1_700_000_000_000 * MS;

/// What became of a cut, as its sender knows.
#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// No answer yet; when it was sent first and last [ns].
    Waiting {
        /// First time [ns].
        since_ns: u64,
        /// Last time [ns].
        sent_ns: u64,
    },
    /// The server has made it.
    Applied,
    /// The server refused it, for this reason.
    Refused(String),
    /// The server had done something with it before, and has forgotten what.
    Known,
    /// There was no answer.
    GivenUp,
}

/// A client with a device.
pub struct HandClient {
    /// The client id under which it speaks.
    pub id: Chunk,
    /// The tool that it wants to hold.
    pub tool: Chunk,
    /// What became of its cuts, by number.
    pub cuts: BTreeMap<u64, (CutCommand, Fate)>,
    /// Until when it stands still [ns].
    pub frozen_until_ns: u64,
    /// Difference of its clock [ns].
    pub clock_ns: i64,
    /// Loop clock when the newest contact was accepted [ns].
    pub heard_ns: u64,
    /// Whether it hears the newest contact again and again, as one without the check of validity would.
    pub believes_for_ever: bool,
    keys: KeySpace,
    tick: HapticTick,
    inbox: ContactInbox,
    alive: Arc<AtomicBool>,
    probe: Probe,
    seq: u64,
    contacts: u64,
    newest: Option<HapticContact>,
    next_cut: u64,
}

/// Where the hand of a client wants to be at `t` [s]: it touches and leaves the block.
fn path(t: f64) -> Vector3<f64> {
    Vector3::new(0.01 * (2.1 * t).sin(), 0.006 * (1.3 * t).cos(), 0.026 + 0.010 * (3.0 * t).cos())
}

fn vec3(v: &Vector3<f64>) -> Vec3 {
    Vec3 { x: v.x, y: v.y, z: v.z }
}

impl HandClient {
    /// A client that is not there yet. `number` chooses how firmly its hand holds the device.
    pub fn new(keys: &KeySpace, id: Chunk, tool: Chunk, number: usize) -> Self {
        let (device, probe) = BenchDevice::new(HANDS[number % HANDS.len()], path, |_| ToolMode::Touch);
        let (slot, contacts) = contact_slot();
        let alive = Arc::new(AtomicBool::new(true));
        let ports = Ports { contacts, server_alive: Arc::clone(&alive), poses: None, log: None, meter: None };
        let inbox = ContactInbox::new(slot, id.as_str());
        Self {
            id,
            tool,
            cuts: BTreeMap::new(),
            frozen_until_ns: 0,
            clock_ns: 0,
            heard_ns: 0,
            believes_for_ever: false,
            keys: keys.clone(),
            tick: HapticTick::new(Box::new(device), LIMITS, ports),
            inbox,
            alive,
            probe,
            seq: 0,
            contacts: 0,
            newest: None,
            next_cut: 0,
        }
    }

    /// Starts as a new process with the same id: it counts its poses from 1 and knows nothing.
    pub fn restart(&mut self, now_ns: u64, number: usize) {
        let next = Self::new(&self.keys, self.id.clone(), self.tool.clone(), number);
        let cuts = std::mem::take(&mut self.cuts);
        let next_cut = self.next_cut.max(self.unix_ns(now_ns) / MS);
        *self = Self { cuts, next_cut, clock_ns: self.clock_ns, ..next };
        // A process that ended waits for nothing.
        for (_, fate) in self.cuts.values_mut() {
            if matches!(fate, Fate::Waiting { .. }) {
                *fate = Fate::GivenUp;
            }
        }
    }

    /// Time of its clock [ns].
    pub fn unix_ns(&self, now_ns: u64) -> u64 {
        (BEGINNING_NS + now_ns).saturating_add_signed(self.clock_ns)
    }

    /// One millisecond of the loop.
    pub fn tick(&mut self, now_ns: u64, elapsed_s: f64) -> TickOutput {
        if self.believes_for_ever
            && let Some(newest) = &self.newest
        {
            self.contacts += 1;
            let again = HapticContact {
                seq: newest.seq + self.contacts,
                publish_unix_ns: newest.publish_unix_ns + self.contacts,
                ..newest.clone()
            };
            self.inbox.accept(&again, now_ns, self.unix_ns(now_ns));
        }
        self.tick.tick(TickTime { now_ns, elapsed_s: elapsed_s.max(PERIOD_S) })
    }

    /// The pose of this millisecond.
    pub fn pose(&mut self, now_ns: u64) -> (ToolSample, Packet) {
        let body = self.probe.body();
        self.seq += 1;
        let kind = tool_shape::Kind::Sphere(tool_shape::Sphere { radius_m: 0.005 });
        let sample = ToolSample {
            seq: self.seq,
            client_time_ns: self.unix_ns(now_ns),
            client_id: self.id.to_string(),
            tool_id: self.tool.to_string(),
            pose: Some(Pose { position_m: Some(vec3(&body.measured_m)), qw: 1.0, ..Pose::default() }),
            velocity_m_s: Some(vec3(&body.measured_m_s)),
            mode: tool_sample::Mode::Touch.into(),
            shape: Some(ToolShape { kind: Some(kind) }),
            ..ToolSample::default()
        };
        let key = self.keys.key(&Topic::ToolPose(self.id.clone(), self.tool.clone()));
        let packet =
            Packet { key, encoding: encoding::<ToolSample>(), content: encode(&sample), is_sound: false };
        (sample, packet)
    }

    /// Begins a new cut. Its place tells it from all others.
    pub fn cut(&mut self, now_ns: u64, mark: f64) -> Packet {
        self.next_cut = (self.next_cut + 1).max(self.unix_ns(now_ns) / MS);
        let at = |x: f64, z: f64| Some(Vec3 { x, y: mark, z });
        let line = |x: f64| BladeSegment { tip_m: at(x, 0.018), heel_m: at(x, 0.030) };
        let command = CutCommand {
            client_id: self.id.to_string(),
            tool_id: self.tool.to_string(),
            seq: self.next_cut,
            client_time_ns: self.unix_ns(now_ns),
            body_id: String::new(),
            sweep: vec![line(-0.004), line(0.004)],
        };
        let packet = self.packet_of(&command);
        self.cuts.insert(command.seq, (command, Fate::Waiting { since_ns: now_ns, sent_ns: now_ns }));
        packet
    }

    fn packet_of(&self, command: &CutCommand) -> Packet {
        let key = self.keys.key(&Topic::ToolCut(self.id.clone(), self.tool.clone()));
        Packet { key, encoding: encoding::<CutCommand>(), content: encode(command), is_sound: false }
    }

    /// The cuts that are due to be sent again. Those that nobody answered are given up.
    pub fn repeat(&mut self, now_ns: u64) -> Vec<Packet> {
        let mut due = Vec::new();
        for (command, fate) in self.cuts.values_mut() {
            let Fate::Waiting { since_ns, sent_ns } = fate else { continue };
            if now_ns - *since_ns > GIVE_UP_NS {
                *fate = Fate::GivenUp;
            } else if now_ns - *sent_ns >= RESEND_NS {
                *sent_ns = now_ns;
                due.push(command.clone());
            }
        }
        due.iter().map(|command| self.packet_of(command)).collect()
    }

    /// A message from the server. Returns an answer to one of its cuts, if it is one.
    pub fn hear(&mut self, packet: &Packet, now_ns: u64) -> Option<CutAck> {
        if let Ok(contact) = decode_as::<HapticContact>(&packet.encoding, packet.content.clone()) {
            let before = self.inbox.contacts();
            self.inbox.accept(&contact, now_ns, self.unix_ns(now_ns));
            if self.inbox.contacts() > before {
                self.heard_ns = now_ns;
                self.newest = Some(contact);
            }
            return None;
        }
        let ack = decode_as::<CutAck>(&packet.encoding, packet.content.clone()).ok()?;
        // As `scindo_client::tool::Cutter` does: a cut can overtake the token of its client, and is sent again.
        let too_early = ack.error.as_ref().is_some_and(|error| error.code == "no-token");
        if ack.client_id != self.id.as_str() || ack.tool_id != self.tool.as_str() || too_early {
            return None;
        }
        let (_, fate) = self.cuts.get_mut(&ack.seq)?;
        if matches!(fate, Fate::Waiting { .. }) {
            use scindo_proto::messages::cut_ack::Outcome;
            *fate = match ack.outcome() {
                Outcome::Applied => Fate::Applied,
                Outcome::Duplicate if ack.sim_step > 0 => Fate::Applied,
                Outcome::Duplicate => Fate::Known,
                _ => Fate::Refused(ack.error.clone().unwrap_or_default().code),
            };
            return Some(ack);
        }
        None
    }

    /// Whether the server's token is present.
    pub fn sees_server(&self, is_there: bool) {
        self.alive.store(is_there, Ordering::Relaxed);
    }

    /// Contacts accepted so far.
    pub fn contacts(&self) -> u64 {
        self.inbox.contacts()
    }
}
