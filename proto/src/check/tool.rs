//! Tools: poses, cuts and their answers, states, contacts, devices.

use prost::Name as _;

use super::field::{Checked, In};
use crate::codec::{CountLimit, DecodeError, WireMessage};
use crate::limits::{
    MAX_BODIES, MAX_CONTACT_BYTES, MAX_CONTACTS, MAX_COORDINATE_M, MAX_CUT_BYTES, MAX_FORCE_N, MAX_FRICTION,
    MAX_POSE_BYTES, MAX_RELAXATION_S, MAX_SMALL_BYTES, MAX_SWEEP_SEGMENTS, MAX_VELOCITY_M_S,
    MIN_SWEEP_SEGMENTS, NORMAL_TOLERANCE,
};
use crate::messages::{
    BladeSegment, Contact, CutAck, CutCommand, DeviceCapability, HapticContact, ToolSample, ToolState,
    cut_ack, haptic_contact, tool_sample,
};

impl WireMessage for ToolSample {
    const MAX_BYTES: usize = MAX_POSE_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("client_id", &self.client_id)?;
        at.id("tool_id", &self.tool_id)?;
        at.pose(at.present("pose", &self.pose)?)?;
        at.optional_vec3("velocity_m_s", &self.velocity_m_s, MAX_VELOCITY_M_S)?;
        at.optional_vec3("applied_force_n", &self.applied_force_n, MAX_FORCE_N)?;
        at.known::<tool_sample::Mode>("mode", self.mode)?;
        at.finite("contact_age_ms", f64::from(self.contact_age_ms))?;
        at.positive("round_trip_ms", f64::from(self.round_trip_ms), f64::MAX)?;
        at.finite("passivity_energy_j", self.passivity_energy_j)?;
        self.closed.map_or(Ok(()), |closed| at.positive("closed", f64::from(closed), 1.0))?;
        at.name("name", &self.name)?;
        self.shape.as_ref().map_or(Ok(()), |shape| at.shape(shape))
    }
}

impl WireMessage for CutCommand {
    const MAX_BYTES: usize = MAX_CUT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] =
        &[CountLimit { tag: 6, field: "sweep", allowed: MAX_SWEEP_SEGMENTS }];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("client_id", &self.client_id)?;
        at.id("tool_id", &self.tool_id)?;
        at.optional_id("body_id", &self.body_id)?;
        if self.seq == 0 {
            return Err(at.range("seq", 0, "1 or more"));
        }
        let segments = self.sweep.len();
        if !(MIN_SWEEP_SEGMENTS..=MAX_SWEEP_SEGMENTS).contains(&segments) {
            let allowed = format!("{MIN_SWEEP_SEGMENTS} to {MAX_SWEEP_SEGMENTS} segments");
            return Err(at.range("sweep", segments, allowed));
        }
        self.sweep.iter().try_for_each(|s| segment(at, s))
    }
}

fn segment(at: In, segment: &BladeSegment) -> Checked {
    let tip = at.present("sweep.tip_m", &segment.tip_m)?;
    let heel = at.present("sweep.heel_m", &segment.heel_m)?;
    at.vec3("sweep.tip_m", tip, MAX_COORDINATE_M)?;
    at.vec3("sweep.heel_m", heel, MAX_COORDINATE_M)
}

impl WireMessage for CutAck {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[CountLimit { tag: 6, field: "epochs", allowed: MAX_BODIES }];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("client_id", &self.client_id)?;
        at.id("tool_id", &self.tool_id)?;
        at.known::<cut_ack::Outcome>("outcome", self.outcome)?;
        for epoch in &self.epochs {
            at.id("epochs.body_id", &epoch.body_id)?;
        }
        at.error(&self.error)
    }
}

impl WireMessage for ToolState {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("tool_id", &self.tool_id)?;
        at.optional_id("owner", &self.owner)?;
        at.finite("sim_time_s", self.sim_time_s)?;
        at.pose(at.present("pose", &self.pose)?)?;
        self.proxy_pose.as_ref().map_or(Ok(()), |p| at.pose(p))?;
        at.known::<tool_sample::Mode>("mode", self.mode)?;
        at.optional_vec3("force_n", &self.force_n, MAX_FORCE_N)?;
        at.positive("max_force_n", f64::from(self.max_force_n), MAX_FORCE_N)?;
        at.optional_vec3("held_point_m", &self.held_point_m, MAX_COORDINATE_M)?;
        at.positive("closed", f64::from(self.closed), 1.0)?;
        self.shape.as_ref().map_or(Ok(()), |shape| at.shape(shape))
    }
}

impl WireMessage for DeviceCapability {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("client_id", &self.client_id)?;
        at.id("tool_id", &self.tool_id)?;
        at.text("model", &self.model)?;
        at.positive("max_force_n", self.max_force_n, MAX_FORCE_N)?;
        at.positive("max_continuous_force_n", self.max_continuous_force_n, MAX_FORCE_N)?;
        at.positive("max_stiffness_n_m", self.max_stiffness_n_m, f64::MAX)?;
        at.positive("workspace_radius_m", self.workspace_radius_m, MAX_COORDINATE_M)?;
        at.positive("loop_rate_hz", self.loop_rate_hz, f64::MAX)
    }
}

impl WireMessage for HapticContact {
    const MAX_BYTES: usize = MAX_CONTACT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] =
        &[CountLimit { tag: 12, field: "contacts", allowed: MAX_CONTACTS }];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("tool_id", &self.tool_id)?;
        at.optional_id("body_id", &self.body_id)?;
        at.optional_id("client_id", &self.client_id)?;
        at.finite("sim_time_s", self.sim_time_s)?;
        at.pose(at.present("tool_pose_used", &self.tool_pose_used)?)?;
        at.known::<haptic_contact::Mode>("mode", self.mode)?;
        at.at_most("contacts", self.contacts.len(), MAX_CONTACTS)?;
        at.positive("validity_ms", f64::from(self.validity_ms), f64::MAX)?;
        at.positive("max_force_n", f64::from(self.max_force_n), MAX_FORCE_N)?;
        at.positive("max_stiffness_n_m", f64::from(self.max_stiffness_n_m), f64::MAX)?;
        at.positive("instant_stiffness_n_m", f64::from(self.instant_stiffness_n_m), f64::MAX)?;
        at.positive("relaxed_stiffness_n_m", f64::from(self.relaxed_stiffness_n_m), f64::MAX)?;
        at.positive("relaxation_s", f64::from(self.relaxation_s), MAX_RELAXATION_S)?;
        self.contacts.iter().try_for_each(|c| contact(at, c))
    }
}

fn contact(at: In, c: &Contact) -> Checked {
    let point = at.present("contacts.point_m", &c.point_m)?;
    let normal = at.present("contacts.normal", &c.normal)?;
    at.vec3f("contacts.point_m", point, MAX_COORDINATE_M)?;
    at.vec3f("contacts.normal", normal, f64::MAX)?;
    let norm = [normal.x, normal.y, normal.z].map(|v| f64::from(v) * f64::from(v)).iter().sum::<f64>().sqrt();
    if (norm - 1.0).abs() > NORMAL_TOLERANCE {
        let allowed = format!("norm 1 within {NORMAL_TOLERANCE}");
        return Err(at.range("contacts.normal", format!("norm {norm}"), allowed));
    }
    if let Some(force) = &c.force_n {
        at.vec3f("contacts.force_n", force, MAX_FORCE_N)?;
    }
    if let Some(velocity) = &c.surface_velocity_m_s {
        at.vec3f("contacts.surface_velocity_m_s", velocity, MAX_VELOCITY_M_S)?;
    }
    at.within("contacts.gap_m", f64::from(c.gap_m), MAX_COORDINATE_M)?;
    for (field, value) in [
        ("contacts.stiffness_n_m", c.stiffness_n_m),
        ("contacts.tangential_stiffness_n_m", c.tangential_stiffness_n_m),
        ("contacts.damping_ns_m", c.damping_ns_m),
        ("contacts.patch_radius_m", c.patch_radius_m),
    ] {
        at.positive(field, f64::from(value), f64::MAX)?;
    }
    at.at_most("contacts.edge_of", c.edge_of as usize, MAX_CONTACTS)?;
    if c.edge_of > 0 && (c.force_n.is_some() || c.surface_velocity_m_s.is_some() || c.stiffness_n_m > 0.0) {
        let value = format!("edge of contact {} with a force", c.edge_of - 1);
        return Err(at.range("contacts.edge_of", value, "an edge without force, stiffness and velocity"));
    }
    at.positive("contacts.friction", f64::from(c.friction), MAX_FRICTION)
}
