//! A contact stream and a device made for tests.

use super::{HapticTick, Limits, Ports, TickOutput, TickTime};
use crate::contact::model::{ContactInbox, contact_slot};
use crate::device::simulated::CAPABILITY;
use crate::device::{Capability, DeviceGone, DeviceState, HapticDevice, ToolMode};
use nalgebra::Vector3;
use scindo_proto::messages::{Contact, HapticContact, Pose, Vec3, Vec3f, haptic_contact};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

pub(crate) const MS: u64 = 1_000_000;
pub(crate) const LIMITS: Limits = Limits { max_force_n: 2.5, slew_n_s: 50.0 };

/// A message of a tool in free space.
pub(crate) fn free(seq: u64) -> HapticContact {
    HapticContact {
        seq,
        sim_step: seq,
        sim_time_s: seq as f64 * 0.005,
        publish_unix_ns: seq.wrapping_mul(5 * MS),
        tool_id: "t".into(),
        epoch: 1,
        tool_pose_used: Some(Pose { position_m: Some(Vec3::default()), qw: 1.0, ..Pose::default() }),
        mode: haptic_contact::Mode::Free.into(),
        validity_ms: 50.0,
        ..HapticContact::default()
    }
}

/// A message with one plane through the origin, normal +z, and `force_n` at the origin.
pub(crate) fn contact(seq: u64, force_n: f64, stiffness_n_m: f32) -> HapticContact {
    let z = |z| Some(Vec3f { x: 0.0, y: 0.0, z });
    let plane = Contact {
        point_m: z(0.0),
        normal: z(1.0),
        force_n: z(force_n as f32),
        stiffness_n_m,
        ..Contact::default()
    };
    HapticContact { mode: haptic_contact::Mode::Contact.into(), contacts: vec![plane], ..free(seq) }
}

/// A device that reports what the test sets and keeps the force that it received.
#[derive(Clone)]
pub(crate) struct FakeDevice(Arc<Mutex<(DeviceState, Vector3<f64>)>>, Arc<AtomicBool>);

impl FakeDevice {
    pub(crate) fn new() -> Self {
        let state = DeviceState {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
            orientation: [0.0, 0.0, 0.0, 1.0],
            mode: ToolMode::Touch,
        };
        Self(Arc::new(Mutex::new((state, Vector3::zeros()))), Arc::default())
    }

    pub(crate) fn place(&self, position_m: Vector3<f64>, velocity_m_s: Vector3<f64>) {
        let mut inner = self.0.lock().unwrap();
        (inner.0.position_m, inner.0.velocity_m_s) = (position_m, velocity_m_s);
    }

    pub(crate) fn unplug(&self, gone: bool) {
        self.1.store(gone, Ordering::Relaxed);
    }

    pub(crate) fn given(&self) -> Vector3<f64> {
        self.0.lock().unwrap().1
    }
}

impl HapticDevice for FakeDevice {
    fn capability(&self) -> Capability {
        CAPABILITY
    }

    fn read(&mut self, _elapsed_s: f64) -> Result<DeviceState, DeviceGone> {
        if self.1.load(Ordering::Relaxed) { Err(DeviceGone) } else { Ok(self.0.lock().unwrap().0) }
    }

    fn write(&mut self, force_n: Vector3<f64>) {
        self.0.lock().unwrap().1 = force_n;
    }
}

/// A loop on a fake device, fed message by message.
pub(crate) struct Rig {
    pub device: FakeDevice,
    pub inbox: ContactInbox,
    pub alive: Arc<AtomicBool>,
    pub tick: HapticTick,
    pub now_ns: u64,
    pub seq: u64,
}

impl Rig {
    pub(crate) fn new(limits: Limits) -> Self {
        let (device, alive) = (FakeDevice::new(), Arc::new(AtomicBool::new(true)));
        let (input, contacts) = contact_slot();
        let ports = Ports { contacts, server_alive: alive.clone(), poses: None, log: None, meter: None };
        let tick = HapticTick::new(Box::new(device.clone()), limits, ports);
        Self { device, inbox: ContactInbox::new(input, ""), alive, tick, now_ns: MS, seq: 0 }
    }

    pub(crate) fn step(&mut self) -> TickOutput {
        self.now_ns += MS;
        self.tick.tick(TickTime { now_ns: self.now_ns, elapsed_s: 1e-3 })
    }

    /// Runs `ms` ticks with a new message every fifth tick; without messages if `None`.
    pub(crate) fn run(
        &mut self,
        ms: usize,
        message: Option<&dyn Fn(u64) -> HapticContact>,
    ) -> Vec<TickOutput> {
        let one = |i: usize| {
            if let (Some(message), 0) = (message, i % 5) {
                self.seq += 1;
                self.inbox.accept(&message(self.seq), self.now_ns, 0);
            }
            self.step()
        };
        (0..ms).map(one).collect()
    }

    /// Presses down to `depth_m` [m] at 20 mm/s, as a hand would, and waits. The hand pays for the force.
    pub(crate) fn press(&mut self, depth_m: f64, message: &dyn Fn(u64) -> HapticContact) -> Vec<TickOutput> {
        let mut outputs = Vec::new();
        let ticks = (depth_m / 2e-5).ceil().max(1.0);
        for i in 1..=ticks as usize {
            let z = -depth_m * i as f64 / ticks;
            self.device.place(Vector3::new(0.0, 0.0, z), Vector3::zeros());
            if i % 5 == 1 {
                self.seq += 1;
                self.inbox.accept(&message(self.seq), self.now_ns, 0);
            }
            outputs.push(self.step());
        }
        outputs.extend(self.run(100, Some(message)));
        outputs
    }

    /// A rig that is engaged at full gain, without force.
    pub(crate) fn engaged(limits: Limits) -> Self {
        let mut rig = Self::new(limits);
        rig.run(600, Some(&free));
        rig
    }
}
