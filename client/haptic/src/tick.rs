//! One millisecond of the haptic client.

use crate::blend::Blend;
use crate::constants::PERIOD_S;
use crate::contact::law::ContactLaw;
use crate::contact::model::ContactSlot;
use crate::device::{DeviceState, HapticDevice};
use crate::link::{Offered, PoseQueue};
use crate::live::Meter;
use crate::log::recorder::LogQueue;
use crate::log::row::LogRow;
use crate::safety::flag;
use crate::safety::limiter::Limiter;
use crate::safety::passivity::Passivity;
use crate::safety::tank::EnergyTank;
use crate::safety::watchdog::{DeviceGuard, Permit, Watchdog};
use crate::statistics::{Histogram, LoopReport};
use crate::virtual_coupling::VirtualCoupling;
use nalgebra::Vector3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest damping that the passivity controller injects, in multiples of the device's own damping.
const MAX_INJECTED_DAMPING: f64 = 2.0;

/// The time of a tick.
#[derive(Debug, Clone, Copy)]
pub struct TickTime {
    /// Loop clock [ns].
    pub now_ns: u64,
    /// Time since the last tick [s]: one period, more after a stall.
    pub elapsed_s: f64,
}

/// Output of one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TickOutput {
    /// Force on the hand [N].
    pub force_n: Vector3<f64>,
    /// Torque on the hand about the tip [N·m].
    pub torque_nm: Vector3<f64>,
    /// Flags of the tick, see [`flag`].
    pub flags: u32,
}

/// Hard limits of the session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Clamp [N]; the device's own limit also applies.
    pub max_force_n: f64,
    /// Slew limit [N/s].
    pub slew_n_s: f64,
}

/// Inputs and outputs of a tick, other than the device.
pub struct Ports {
    /// Newest contact model.
    pub contacts: ContactSlot,
    /// Whether the server's liveliness token is present.
    pub server_alive: Arc<AtomicBool>,
    /// Queue of poses to the server.
    pub poses: Option<PoseQueue>,
    /// Queue of log rows.
    pub log: Option<LogQueue>,
    /// Figures shown while the loop runs.
    pub meter: Option<Arc<Meter>>,
}

/// All state of the loop, owned by its thread.
pub struct HapticTick {
    device: Box<dyn HapticDevice>,
    guard: DeviceGuard,
    ports: Ports,
    law: ContactLaw,
    coupling: VirtualCoupling,
    blend: Blend,
    tank: EnergyTank,
    watchdog: Watchdog,
    passivity: Passivity,
    limiter: Limiter,
    last_force_n: Vector3<f64>,
    ages: Histogram,
    report: LoopReport,
}

impl HapticTick {
    /// Creates the state at rest, without force.
    pub fn new(device: Box<dyn HapticDevice>, limits: Limits, ports: Ports) -> Self {
        let capability = device.capability();
        let coupling = VirtualCoupling::new(&capability);
        Self {
            device,
            guard: DeviceGuard::default(),
            ports,
            law: ContactLaw::new(coupling.stiffness_limit_n_m),
            coupling,
            blend: Blend::default(),
            tank: EnergyTank::default(),
            watchdog: Watchdog::default(),
            passivity: Passivity::new(MAX_INJECTED_DAMPING * capability.damping_ns_m),
            limiter: Limiter::new(limits.max_force_n.min(capability.max_force_n), limits.slew_n_s),
            last_force_n: Vector3::zeros(),
            ages: Histogram::default(),
            report: LoopReport::default(),
        }
    }

    /// Lets models inject any energy; only for a mutation test.
    #[doc(hidden)]
    pub fn open_tank(&mut self) {
        self.tank.open();
    }

    /// One tick: device → contact → force of the tissue → safety → device, pose, log. It takes no lock,
    /// allocates nothing and waits for nothing.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use std::sync::atomic::AtomicBool;
    ///
    /// use nalgebra::Vector3;
    /// use scindo_haptic::contact::model::contact_slot;
    /// use scindo_haptic::device::simulated::{Hand, SimulatedDevice};
    /// use scindo_haptic::tick::{HapticTick, Limits, Ports, TickTime};
    ///
    /// let (_newest, contacts) = contact_slot();
    /// let server_alive = Arc::new(AtomicBool::new(false));
    /// let ports = Ports { contacts, server_alive, poses: None, log: None, meter: None };
    /// let limits = Limits { max_force_n: 3.0, slew_n_s: 300.0 };
    /// let device = Box::new(SimulatedDevice::at_rest(Hand::default()));
    /// let mut tick = HapticTick::new(device, limits, ports);
    /// for ms in 1..=10 {
    ///     let output = tick.tick(TickTime { now_ns: 1_000_000 * ms, elapsed_s: 1e-3 });
    ///     assert_eq!(output.force_n, Vector3::zeros()); // without a server there is no force
    /// }
    /// assert_eq!(tick.report().ticks, 10);
    /// ```
    pub fn tick(&mut self, time: TickTime) -> TickOutput {
        let (state, faults) = self.guard.check(self.device.read(time.elapsed_s), time.elapsed_s);
        let model = *self.ports.contacts.read();
        let alive = self.ports.server_alive.load(Ordering::Relaxed);

        self.law.turn_to(state.orientation);
        let loads = self.law.loads(&model, &state.position_m, time.now_ns);
        let tissue_n = self.coupling.force(&state, &loads, model.max_stiffness_n_m);
        let blended_n = self.blend.apply(tissue_n, &model, time.now_ns);
        let charge = self.coupling.charge(&blended_n, &state.position_m, &loads);
        let (felt_n, is_paid) = self.tank.pay(blended_n, state.position_m, &charge);

        let permit = self.watchdog.judge(&model, &felt_n, alive, faults, time.now_ns);
        let output = self.release(&permit, felt_n, &state.velocity_m_s, model.max_force_n);
        let output = TickOutput { flags: output.flags | if is_paid { 0 } else { flag::UNPAID }, ..output };
        self.tank.observe(&output.force_n, &charge);
        let torque_nm = released_torque(&loads.torque_at(&state.position_m), &tissue_n, &output.force_n);
        let output = TickOutput { torque_nm, ..output };
        self.device.write(output.force_n);
        self.device.write_torque(output.torque_nm);

        let row = LogRow {
            time_s: time.now_ns as f64 * 1e-9,
            position_m: state.position_m,
            velocity_m_s: state.velocity_m_s,
            tissue_n,
            force_n: output.force_n,
            contact_seq: model.seq,
            round_trip_ms: model.round_trip_ns as f64 * 1e-6,
            contact_age_ms: (model.age_ns(time.now_ns) as f64 * 1e-6).min(1e6),
            epoch: model.epoch,
            energy_j: self.passivity.energy_j(),
            flags: output.flags | if time.elapsed_s > 1.5 * PERIOD_S { flag::MISSED } else { 0 },
        };
        if let Some(used_ns) = model.used_ns {
            self.ages.record(time.now_ns.saturating_sub(used_ns + model.held_ns));
        }
        self.publish(&state, &row, time.now_ns);
        self.account(&row);
        output
    }

    /// The part of the force that the safety stage lets through.
    fn release(
        &mut self,
        permit: &Permit,
        felt_n: Vector3<f64>,
        v: &Vector3<f64>,
        advice_n: f64,
    ) -> TickOutput {
        let (force_n, flags) = if permit.cut {
            (self.limiter.cut(), 0)
        } else if permit.gain == 0.0 {
            self.passivity.rest();
            self.limiter.limit(Vector3::zeros(), advice_n)
        } else {
            let (clamped_n, clamped) = self.limiter.clamp(felt_n, advice_n);
            let (passive_n, injected) = self.passivity.correct(permit.apply(clamped_n, v), v);
            let (force_n, flags) = self.limiter.limit(passive_n, advice_n);
            (force_n, clamped | flags | if injected { flag::PASSIVITY } else { 0 })
        };
        self.passivity.observe(&force_n, v);
        TickOutput { force_n, torque_nm: Vector3::zeros(), flags: flags | permit.flags }
    }

    fn publish(&mut self, state: &DeviceState, row: &LogRow, now_ns: u64) {
        if let Some(poses) = &mut self.ports.poses {
            match poses.offer(state, row, now_ns) {
                Offered::Dropped => self.report.poses_dropped += 1,
                Offered::Withheld => self.report.poses_withheld += 1,
                Offered::NotDue | Offered::Queued => {}
            }
        }
        if let Some(log) = &mut self.ports.log {
            self.report.log_rows_dropped += u64::from(!log.offer(row));
        }
        if let Some(meter) = &self.ports.meter {
            meter.record(row);
        }
    }

    fn account(&mut self, row: &LogRow) {
        let report = &mut self.report;
        report.ticks += 1;
        report.max_force_n = report.max_force_n.max(row.force_n.norm());
        if row.flags & flag::DEVICE_FAULTS == 0 {
            let step_n = (row.force_n - self.last_force_n).norm();
            report.max_force_step_n = report.max_force_step_n.max(step_n);
            report.max_slew_n_s = report.max_force_step_n / PERIOD_S;
        } else {
            report.device_faults += 1;
        }
        report.touch_ticks += u64::from(row.force_n != Vector3::zeros());
        report.stale_ticks += u64::from(row.flags & flag::STALE != 0);
        report.min_energy_j = report.min_energy_j.min(row.energy_j);
        self.last_force_n = row.force_n;
    }

    /// Figures of all ticks so far. The loop adds its own figures.
    pub fn report(&self) -> LoopReport {
        LoopReport { model_age_ms: self.ages.quantiles_ms(), ..self.report.clone() }
    }

    /// Closes the queues, so that their threads can end.
    pub fn close(self) -> LoopReport {
        self.report()
    }
}

/// The torque of the tissue [N·m], with the part that the safety stage let through of its force [N].
fn released_torque(
    torque_nm: &Vector3<f64>,
    tissue_n: &Vector3<f64>,
    released_n: &Vector3<f64>,
) -> Vector3<f64> {
    let whole = tissue_n.norm();
    if whole > 0.0 { torque_nm * (released_n.norm() / whole).min(1.0) } else { Vector3::zeros() }
}

/// A contact stream and devices made for tests.
#[cfg(test)]
pub(crate) mod fixture;

#[cfg(test)]
mod tests;
