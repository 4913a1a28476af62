//! The newest contact message as the loop sees it: parsed, finite, in order.
//!
//! [`ContactInbox`] is the network side. It refuses unusable messages, drops those that arrive out of order
//! and counts lost ones. It puts the newest model into a lock-free slot.

use crate::constants::{DEFAULT_VALIDITY_NS, LOST_NS, MAX_VALIDITY_NS};
use crate::statistics::{LinkReport, RoundTrips};
use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};
use scindo_proto::limits::{MAX_CONTACTS, MAX_FRICTION, MAX_RELAXATION_S};
use scindo_proto::messages::{Contact, HapticContact, Pose, Vec3, Vec3f, haptic_contact};

/// Largest plausible force of one plane [N].
const MAX_PLANE_FORCE_N: f64 = 1.0e3;
/// Largest plausible stiffness of one plane [N/m].
const MAX_PLANE_STIFFNESS_N_M: f64 = 1.0e6;
/// Largest plausible damping of one plane [N·s/m].
const MAX_PLANE_DAMPING_NS_M: f64 = 1.0e4;
/// Largest plausible coordinate [m] and velocity [m/s].
const MAX_COORDINATE: f64 = 1.0e4;

/// One plane with a linearised force; see `scindo.v1.Contact`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPlane {
    /// Point of the surface [m], at the centre of the patch where the plane is trusted.
    pub point_m: Vector3<f64>,
    /// Unit, from the tissue to the tool.
    pub normal: Vector3<f64>,
    /// Force along the normal with the tip at the pose used by the server [N].
    pub force_n: f64,
    /// Decrease of that force per metre along the normal [N/m].
    pub stiffness_n_m: f64,
    /// The same at once, before the tissue moves [N/m]; zero if the server does not know.
    pub instant_stiffness_n_m: f64,
    /// The same after the tissue has followed [N/m]; zero if the server does not know.
    pub relaxed_stiffness_n_m: f64,
    /// Time in which the force falls from the one to the other [s].
    pub relaxation_s: f64,
    /// Decrease of the force per metre across the normal, of tissue that sticks or is held [N/m].
    pub tangential_stiffness_n_m: f64,
    /// Coefficient of dry friction; zero: none, or tissue that is held.
    pub friction: f64,
    /// Force across the normal, of friction or of tissue that is held [N].
    pub tangential_n: Vector3<f64>,
    /// Damping along the normal, against the relative velocity [N·s/m].
    pub damping_ns_m: f64,
    /// Velocity of the surface [m/s].
    pub surface_velocity_m_s: Vector3<f64>,
    /// Radius around `point_m` where the plane is trusted [m]; zero for everywhere. Of an edge: way over which the load
    /// of the contact that it ends falls to zero [m].
    pub patch_radius_m: f64,
    /// Distance of the tool from the plane at the pose used [m]; negative behind it.
    pub gap_m: f64,
    /// Number of the plane whose tissue ends here; `None` for a plane that pushes by itself.
    pub edge_of: Option<usize>,
}

impl ContactPlane {
    /// A plane without force.
    pub const NONE: Self = Self {
        point_m: Vector3::new(0.0, 0.0, 0.0),
        normal: Vector3::new(0.0, 0.0, 1.0),
        force_n: 0.0,
        stiffness_n_m: 0.0,
        instant_stiffness_n_m: 0.0,
        relaxed_stiffness_n_m: 0.0,
        relaxation_s: 0.0,
        tangential_stiffness_n_m: 0.0,
        friction: 0.0,
        tangential_n: Vector3::new(0.0, 0.0, 0.0),
        damping_ns_m: 0.0,
        surface_velocity_m_s: Vector3::new(0.0, 0.0, 0.0),
        patch_radius_m: 0.0,
        gap_m: 0.0,
        edge_of: None,
    };

    /// Share of the load that an edge leaves to the contact that it ends, after the tool has moved by `moved` [m].
    pub fn edge_share(&self, moved: &Vector3<f64>) -> f64 {
        let behind = -(self.gap_m + self.normal.dot(moved));
        if self.patch_radius_m > 0.0 { (behind / self.patch_radius_m).clamp(0.0, 1.0) } else { 1.0 }
    }
}

/// A contact message, ready for the loop. Fixed size: it is copied, never allocated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactModel {
    /// Number of the message; zero before the first one.
    pub seq: u64,
    /// Epoch of the topology that it was computed on.
    pub epoch: u32,
    /// Step of the simulation that it was computed after.
    pub sim_step: u64,
    /// Simulated time of that step [s].
    pub sim_time_s: f64,
    /// Loop clock at arrival [ns].
    pub received_ns: u64,
    /// Tip for which the model was computed [m].
    pub tip_used_m: Vector3<f64>,
    /// Orientation for which it was computed.
    pub turn_used: UnitQuaternion<f64>,
    /// Loop clock when the tip was there [ns]; `None` if the message names none of this client's poses.
    pub used_ns: Option<u64>,
    /// How long the server has kept the tip there before it sent the message, since no newer pose came [ns].
    pub held_ns: u64,
    /// Newest time from a pose to its contact [ns]; zero if none is known.
    pub round_trip_ns: u64,
    /// Whether the tool holds the tissue, so that it pulls back in all directions.
    pub holds: bool,
    /// The planes; only the first `plane_count` are valid.
    pub planes: [ContactPlane; MAX_CONTACTS],
    /// Number of valid planes.
    pub plane_count: usize,
    /// Age at which the force must start to ramp down [ns].
    pub validity_ns: u64,
    /// Largest force that the server advises [N]; infinite if it gave none.
    pub max_force_n: f64,
    /// Largest stiffness that the server advises [N/m]; infinite if it gave none.
    pub max_stiffness_n_m: f64,
}

impl ContactModel {
    /// Held by the loop before the first message.
    pub const NONE: Self = Self {
        seq: 0,
        epoch: 0,
        sim_step: 0,
        sim_time_s: 0.0,
        received_ns: 0,
        tip_used_m: Vector3::new(0.0, 0.0, 0.0),
        turn_used: Unit::new_unchecked(Quaternion::new(1.0, 0.0, 0.0, 0.0)),
        used_ns: None,
        held_ns: 0,
        round_trip_ns: 0,
        holds: false,
        planes: [ContactPlane::NONE; MAX_CONTACTS],
        plane_count: 0,
        validity_ns: 0,
        max_force_n: f64::INFINITY,
        max_stiffness_n_m: f64::INFINITY,
    };

    /// The valid planes.
    pub fn planes(&self) -> &[ContactPlane] {
        &self.planes[..self.plane_count]
    }

    /// Time since arrival [ns]; infinite (`u64::MAX`) before the first message.
    pub fn age_ns(&self, now_ns: u64) -> u64 {
        if self.seq == 0 { u64::MAX } else { now_ns.saturating_sub(self.received_ns) }
    }

    /// Whether the model may still be rendered at full gain.
    pub fn is_fresh(&self, now_ns: u64) -> bool {
        self.age_ns(now_ns) <= self.validity_ns
    }

    /// Parses a message. `None` if a value is missing, not finite or implausible.
    pub fn parse(message: &HapticContact, received_ns: u64) -> Option<Self> {
        if message.seq == 0 || message.contacts.len() > MAX_CONTACTS || !message.sim_time_s.is_finite() {
            return None;
        }
        let pose =
            message.tool_pose_used.as_ref().and_then(|p| vector(p.position_m.as_ref(), MAX_COORDINATE));
        let relaxation = [
            within(message.instant_stiffness_n_m, MAX_PLANE_STIFFNESS_N_M)?,
            within(message.relaxed_stiffness_n_m, MAX_PLANE_STIFFNESS_N_M)?,
            within(message.relaxation_s, MAX_RELAXATION_S)?,
        ];
        let free = message.mode() == haptic_contact::Mode::Free || message.contacts.is_empty();
        let mut model = Self {
            seq: message.seq,
            epoch: message.epoch,
            sim_step: message.sim_step,
            sim_time_s: message.sim_time_s,
            received_ns,
            tip_used_m: if free { pose.unwrap_or_default() } else { pose? },
            turn_used: orientation(message.tool_pose_used.as_ref()),
            holds: message.mode() == haptic_contact::Mode::Hold,
            validity_ns: validity_ns(message.validity_ms)?,
            max_force_n: advice(message.max_force_n)?,
            max_stiffness_n_m: advice(message.max_stiffness_n_m)?,
            ..Self::NONE
        };
        for (slot, contact) in model.planes.iter_mut().zip(&message.contacts) {
            *slot = parse_plane(contact, relaxation)?;
            let ended = slot.edge_of.is_none_or(|of| of < message.contacts.len());
            ended.then_some(())?;
        }
        model.plane_count = message.contacts.len();
        Some(model)
    }
}

fn parse_plane(contact: &Contact, [instant, relaxed, relaxation_s]: [f64; 3]) -> Option<ContactPlane> {
    let normal = vector_f32(contact.normal.as_ref(), 2.0)?;
    let length = normal.norm();
    let normal = ((length - 1.0).abs() < 1e-2).then(|| normal / length)?;
    let force = match &contact.force_n {
        None if contact.edge_of > 0 => Vector3::zeros(),
        force => vector_f32(force.as_ref(), MAX_PLANE_FORCE_N)?,
    };
    Some(ContactPlane {
        point_m: vector_f32(contact.point_m.as_ref(), MAX_COORDINATE)?,
        normal,
        force_n: force.dot(&normal),
        stiffness_n_m: within(contact.stiffness_n_m, MAX_PLANE_STIFFNESS_N_M)?,
        instant_stiffness_n_m: instant,
        relaxed_stiffness_n_m: relaxed,
        relaxation_s,
        tangential_stiffness_n_m: within(contact.tangential_stiffness_n_m, MAX_PLANE_STIFFNESS_N_M)?,
        friction: within(contact.friction, MAX_FRICTION)?,
        tangential_n: force - normal * force.dot(&normal),
        damping_ns_m: within(contact.damping_ns_m, MAX_PLANE_DAMPING_NS_M)?,
        surface_velocity_m_s: match &contact.surface_velocity_m_s {
            None => Vector3::zeros(),
            velocity => vector_f32(velocity.as_ref(), MAX_COORDINATE)?,
        },
        patch_radius_m: within(contact.patch_radius_m, MAX_COORDINATE)?,
        gap_m: within(contact.gap_m.abs(), MAX_COORDINATE)?.copysign(contact.gap_m.into()),
        edge_of: (contact.edge_of as usize).checked_sub(1),
    })
}

/// The orientation of a pose; none if it is not a unit quaternion.
fn orientation(pose: Option<&Pose>) -> UnitQuaternion<f64> {
    let q = pose.map(|p| Quaternion::new(p.qw, p.qx, p.qy, p.qz));
    let usable = q.filter(|q| (q.norm() - 1.0).abs() < 1e-2);
    usable.map_or_else(UnitQuaternion::identity, UnitQuaternion::new_normalize)
}

fn vector_f32(v: Option<&Vec3f>, limit: f64) -> Option<Vector3<f64>> {
    let wide = v.map(|v| Vec3 { x: v.x.into(), y: v.y.into(), z: v.z.into() });
    vector(wide.as_ref(), limit)
}

fn vector(v: Option<&Vec3>, limit: f64) -> Option<Vector3<f64>> {
    let v = v.map(|v| Vector3::new(v.x, v.y, v.z))?;
    v.iter().all(|c| c.abs() <= limit).then_some(v)
}

fn within(value: f32, limit: f64) -> Option<f64> {
    let value = f64::from(value);
    (0.0..=limit).contains(&value).then_some(value)
}

fn advice(value: f32) -> Option<f64> {
    match f64::from(value) {
        v if v > 0.0 && v.is_finite() => Some(v),
        0.0 => Some(f64::INFINITY),
        _ => None,
    }
}

fn validity_ns(milliseconds: f32) -> Option<u64> {
    match f64::from(milliseconds) {
        v if v > 0.0 && v.is_finite() => Some(((v * 1e6) as u64).min(MAX_VALIDITY_NS)),
        0.0 => Some(DEFAULT_VALIDITY_NS),
        _ => None,
    }
}

/// Reading end of the slot, owned by the loop.
pub type ContactSlot = triple_buffer::Output<ContactModel>;

/// Creates a lock-free slot for the newest model: the writing end for the inbox, the reading end for the
/// loop.
pub fn contact_slot() -> (triple_buffer::Input<ContactModel>, ContactSlot) {
    triple_buffer::triple_buffer(&ContactModel::NONE)
}

/// Network side of the slot; its only writer.
pub struct ContactInbox {
    slot: triple_buffer::Input<ContactModel>,
    /// Id of this client.
    client_id: String,
    last_seq: u64,
    last_publish_unix_ns: u64,
    last_received_ns: u64,
    last_tool_seq: u64,
    /// When the first message for the pose `last_tool_seq` arrived [ns].
    tool_seq_since_ns: u64,
    round_trip_ns: u64,
    first_received_ns: u64,
    counts: LinkReport,
    round_trips: RoundTrips,
}

impl ContactInbox {
    /// Creates an inbox that writes the contacts of client `client_id` into `slot`.
    pub fn new(slot: triple_buffer::Input<ContactModel>, client_id: &str) -> Self {
        Self {
            slot,
            client_id: client_id.to_owned(),
            last_seq: 0,
            last_publish_unix_ns: 0,
            last_received_ns: 0,
            last_tool_seq: 0,
            tool_seq_since_ns: 0,
            round_trip_ns: 0,
            first_received_ns: 0,
            counts: LinkReport::default(),
            round_trips: RoundTrips::default(),
        }
    }

    /// Takes one message. It arrived at `now_ns` of the loop clock and at `client_ns` of the clock that
    /// stamps poses (`tool_client_time_ns`).
    pub fn accept(&mut self, message: &HapticContact, now_ns: u64, client_ns: u64) {
        // Whoever waits for a tool hears what its holder feels.
        if message.client_id != self.client_id {
            self.counts.contacts_of_others += 1;
            return;
        }
        let Some(mut model) = ContactModel::parse(message, now_ns) else {
            self.counts.contacts_refused += 1;
            return;
        };
        // Both clocks are the client's own, so the age needs no synchronisation.
        let age_ns = client_ns.checked_sub(message.tool_client_time_ns);
        model.used_ns = age_ns.filter(|_| message.tool_seq_used > 0).and_then(|age| now_ns.checked_sub(age));
        if !self.in_order(message, now_ns) {
            self.counts.contacts_late += 1;
            return;
        }
        self.count(message, now_ns, client_ns);
        if message.tool_seq_used == self.last_tool_seq {
            model.held_ns = now_ns.saturating_sub(self.tool_seq_since_ns);
        }
        model.round_trip_ns = self.round_trip_ns;
        self.slot.write(model);
    }

    /// Whether the message is newer than the last one. A lower number with a later send time means that the
    /// server restarted. After a silence of half a second any message starts a new stream.
    fn in_order(&mut self, message: &HapticContact, now_ns: u64) -> bool {
        let silent = now_ns.saturating_sub(self.last_received_ns) > LOST_NS;
        let restarted = message.seq <= self.last_seq && message.publish_unix_ns > self.last_publish_unix_ns;
        if message.seq <= self.last_seq && !restarted && !silent {
            return false;
        }
        let fresh_start = self.last_seq == 0 || restarted || silent;
        if fresh_start {
            self.counts.contact_streams += 1;
            self.last_tool_seq = 0;
        } else {
            self.counts.contacts_lost += (message.seq - self.last_seq - 1).min(1_000_000);
        }
        true
    }

    fn count(&mut self, message: &HapticContact, now_ns: u64, client_ns: u64) {
        if self.counts.contacts == 0 {
            self.first_received_ns = now_ns;
        } else {
            let gap_ms = now_ns.saturating_sub(self.last_received_ns) as f64 * 1e-6;
            self.counts.longest_contact_gap_ms = self.counts.longest_contact_gap_ms.max(gap_ms);
        }
        self.counts.contacts += 1;
        self.last_seq = message.seq;
        self.last_publish_unix_ns = message.publish_unix_ns;
        self.last_received_ns = now_ns;
        if message.tool_seq_used > self.last_tool_seq {
            self.last_tool_seq = message.tool_seq_used;
            self.tool_seq_since_ns = now_ns;
            self.round_trip_ns = client_ns.saturating_sub(message.tool_client_time_ns);
            self.round_trips.record(self.round_trip_ns);
        }
    }

    /// Number of messages taken so far.
    pub fn contacts(&self) -> u64 {
        self.counts.contacts
    }

    /// Counts, rate and round trips so far.
    pub fn report(&self) -> LinkReport {
        let span_s = self.last_received_ns.saturating_sub(self.first_received_ns) as f64 * 1e-9;
        let rate = if span_s > 0.0 { (self.counts.contacts - 1) as f64 / span_s } else { 0.0 };
        LinkReport {
            contact_rate_hz: rate,
            round_trip_ms: self.round_trips.quantiles_ms(),
            ..self.counts.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tick::fixture::{contact, free};

    fn inbox() -> (ContactInbox, ContactSlot) {
        let (input, output) = contact_slot();
        (ContactInbox::new(input, ""), output)
    }

    fn accept(inbox: &mut ContactInbox, message: &HapticContact, now_ns: u64) {
        inbox.accept(message, now_ns, now_ns);
    }

    #[test]
    fn the_newest_message_wins_and_gaps_are_counted() {
        let (mut inbox, mut slot) = inbox();
        assert_eq!(slot.read().age_ns(5), u64::MAX);
        for (seq, now_ms) in [(1, 1), (2, 6), (5, 21), (4, 22)] {
            accept(&mut inbox, &contact(seq, 1.0, 300.0), now_ms * 1_000_000);
        }
        assert_eq!(slot.read().seq, 5);
        let report = inbox.report();
        assert_eq!((report.contacts, report.contacts_lost, report.contacts_late), (3, 2, 1));
        assert!((report.contact_rate_hz - 100.0).abs() < 1e-9);
    }

    #[test]
    fn garbage_is_refused_and_leaves_the_last_model() {
        let (mut inbox, mut slot) = inbox();
        accept(&mut inbox, &contact(1, 1.0, 300.0), 0);
        let spoil: [fn(&mut HapticContact); 14] = [
            |m| m.contacts[0].friction = f32::NAN,
            |m| m.contacts[0].friction = 11.0,
            |m| m.relaxed_stiffness_n_m = f32::NAN,
            |m| m.instant_stiffness_n_m = -1.0,
            |m| m.relaxation_s = f32::INFINITY,
            |m| m.seq = 0,
            |m| m.validity_ms = f32::NAN,
            |m| m.max_force_n = -1.0,
            |m| m.tool_pose_used = None,
            |m| m.contacts[0].force_n = Some(Vec3f { x: f32::INFINITY, y: 0.0, z: 0.0 }),
            |m| m.contacts[0].normal = Some(Vec3f { x: 0.0, y: 0.0, z: 0.5 }),
            |m| m.contacts[0].stiffness_n_m = -5.0,
            |m| m.contacts[0].point_m = Some(Vec3f { x: 1e9, y: 0.0, z: 0.0 }),
            |m| m.contacts = vec![m.contacts[0]; 9],
        ];
        for spoil in spoil {
            let mut message = contact(2, 1.0, 300.0);
            spoil(&mut message);
            accept(&mut inbox, &message, 1);
        }
        assert_eq!(inbox.report().contacts_refused, 14);
        assert_eq!(slot.read().seq, 1);
    }

    #[test]
    fn what_the_holder_of_the_tool_feels_is_not_rendered_by_others() {
        let (mut inbox, mut slot) = inbox();
        accept(&mut inbox, &contact(1, 1.0, 300.0), 0);
        accept(&mut inbox, &HapticContact { client_id: "other".into(), ..contact(2, 2.0, 300.0) }, 1);
        assert_eq!((slot.read().seq, inbox.report().contacts_of_others), (1, 1));
    }

    #[test]
    fn a_server_that_starts_anew_is_heard() {
        let (mut inbox, mut slot) = inbox();
        accept(&mut inbox, &free(1000), 0);
        let mut again = free(1);
        again.publish_unix_ns += 10_000_000_000;
        accept(&mut inbox, &again, 1_000_000);
        assert_eq!(slot.read().seq, 1);
        accept(&mut inbox, &free(u64::MAX), 2_000_000);
        accept(&mut inbox, &free(3), 3_000_000);
        assert_eq!(slot.read().seq, u64::MAX);
        accept(&mut inbox, &free(4), 2_000_000 + LOST_NS + 1);
        assert_eq!(slot.read().seq, 4);
        assert_eq!(inbox.report().contact_streams, 3);
    }

    #[test]
    fn round_trip_is_counted_once_per_pose_and_the_server_holds_a_pose_that_none_follows() {
        let (mut inbox, mut slot) = inbox();
        for (seq, tool_seq, sent_ms, now_ms, held_ms) in
            [(1, 7, 0, 2, 0), (2, 7, 0, 6, 4), (3, 8, 8, 10, 0), (4, 7, 0, 11, 0)]
        {
            let mut message = free(seq);
            message.tool_seq_used = tool_seq;
            message.tool_client_time_ns = sent_ms * 1_000_000;
            accept(&mut inbox, &message, now_ms * 1_000_000);
            let model = slot.read();
            assert_eq!((model.used_ns, model.held_ns), (Some(sent_ms * 1_000_000), held_ms * 1_000_000));
        }
        let quantiles = inbox.report().round_trip_ms;
        assert_eq!(quantiles.count, 2);
        assert!((quantiles.p50 - 2.0).abs() < 0.1, "{quantiles:?}");
    }
}
