//! Decides when force is allowed: the device must be plausible, the contact fresh, the start free.
//!
//! ```text
//!            200 ms of fresh contact without force
//!  Waiting ────────────────────────────────────────▶ Engaged (gain rises over 200 ms)
//!     ▲                                                 │ contact older than its validity,
//!     │ gain is zero                                    ▼ or the server's token is gone
//!     └──────────────────────────────────────────── Ramping (damping held, spring to zero)
//! ```
//! A device fault leads from any state to Waiting, with zero force at once. So does a silence that is too long for a
//! ramp, which happens when the client itself has stood still.

use super::flag;
use crate::constants::{
    ENGAGE_RAMP_NS, FREE_FORCE_N, FREE_SPACE_NS, HOLD_DAMPING_NS_M, LOST_NS, MAX_JUMP_M, MAX_SPEED_M_S,
    PERIOD_S, RAMP_DOWN_NS, SILENT_ZERO_NS,
};
use crate::contact::model::ContactModel;
use crate::device::{DeviceGone, DeviceState, ToolMode};
use nalgebra::Vector3;

/// Checks the device: its values must be finite, continuous and not too fast.
#[derive(Debug, Clone, Copy, Default)]
pub struct DeviceGuard {
    last: Option<DeviceState>,
    /// Whether the device did not answer last time; where it comes back is no jump.
    gone: bool,
}

impl DeviceGuard {
    /// The state to continue with (always finite), and the fault flags found. `elapsed_s` is the time since
    /// the last call: after a stall the hand may have moved further.
    pub fn check(&mut self, read: Result<DeviceState, DeviceGone>, elapsed_s: f64) -> (DeviceState, u32) {
        let was_gone = std::mem::replace(&mut self.gone, read.is_err());
        let Ok(state) = read else { return (self.at_rest(ToolMode::Hover), flag::GONE) };
        let finite = state.position_m.iter().chain(state.velocity_m_s.iter()).all(|v| v.is_finite())
            && state.orientation.iter().all(|v| v.is_finite());
        if !finite {
            return (self.at_rest(state.mode), flag::NOT_FINITE);
        }
        let mut flags = 0;
        let ticks = (elapsed_s / PERIOD_S).max(1.0);
        if !was_gone
            && self.last.is_some_and(|last| (state.position_m - last.position_m).norm() > MAX_JUMP_M * ticks)
        {
            flags |= flag::JUMP;
        }
        if state.velocity_m_s.norm() > MAX_SPEED_M_S {
            flags |= flag::OVER_SPEED;
        }
        self.last = Some(state);
        (state, flags)
    }

    /// Where the hand was last, at rest; `mode` if it was nowhere yet.
    fn at_rest(&self, mode: ToolMode) -> DeviceState {
        let nowhere = DeviceState {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
            orientation: [0.0, 0.0, 0.0, 1.0],
            mode,
        };
        DeviceState { velocity_m_s: Vector3::zeros(), ..self.last.unwrap_or(nowhere) }
    }
}

/// How much of the force is allowed in one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Permit {
    /// Factor on the contact force, from zero to one.
    pub gain: f64,
    /// Damping that holds the hand [N·s/m].
    pub hold_damping_ns_m: f64,
    /// Largest magnitude of the holding force [N].
    pub hold_limit_n: f64,
    /// Set the force to zero at once, regardless of the slew limit.
    pub cut: bool,
    /// Flags of the tick, see [`flag`].
    pub flags: u32,
}

impl Permit {
    /// The allowed part of `force_n` plus the holding damping.
    pub fn apply(&self, force_n: Vector3<f64>, velocity_m_s: &Vector3<f64>) -> Vector3<f64> {
        let hold = -self.hold_damping_ns_m * velocity_m_s;
        let norm = hold.norm();
        let hold = if norm > self.hold_limit_n { hold * (self.hold_limit_n / norm) } else { hold };
        self.gain * force_n + hold
    }
}

#[derive(Debug, Clone, Copy)]
enum Engagement {
    Waiting { free_since_ns: Option<u64> },
    Engaged { since_ns: u64 },
    Ramping { from_ns: u64, duration_ns: u64, from_gain: f64, from_force_n: f64 },
}

/// State machine of engagement.
#[derive(Debug, Clone, Copy)]
pub struct Watchdog {
    engagement: Engagement,
    started_ns: Option<u64>,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self { engagement: Engagement::Waiting { free_since_ns: None }, started_ns: None }
    }
}

impl Watchdog {
    /// Evaluates one tick. `force_n`: force that the contact would give; `server_alive`: whether the server's
    /// liveliness token is present; `device_faults`: from [`DeviceGuard`].
    pub fn judge(
        &mut self,
        model: &ContactModel,
        force_n: &Vector3<f64>,
        server_alive: bool,
        device_faults: u32,
        now_ns: u64,
    ) -> Permit {
        let fresh = server_alive && model.is_fresh(now_ns);
        let silent_ns = model.age_ns(now_ns).min(now_ns - *self.started_ns.get_or_insert(now_ns));
        let mut flags = device_faults;
        if !fresh {
            flags |= flag::STALE;
        }
        if silent_ns > LOST_NS {
            flags |= flag::LOST;
        }
        let cut = device_faults != 0 || silent_ns > SILENT_ZERO_NS;
        self.advance(model, force_n, fresh, cut, now_ns);
        let mut permit = self.permit(now_ns);
        permit.flags |= flags;
        permit.cut = cut;
        permit
    }

    fn advance(&mut self, model: &ContactModel, force_n: &Vector3<f64>, fresh: bool, cut: bool, now_ns: u64) {
        let gain = self.permit(now_ns).gain;
        self.engagement = match self.engagement {
            _ if cut => Engagement::Waiting { free_since_ns: None },
            Engagement::Waiting { .. } if !fresh || force_n.norm() > FREE_FORCE_N => {
                Engagement::Waiting { free_since_ns: None }
            }
            Engagement::Waiting { free_since_ns } => {
                let since_ns = free_since_ns.unwrap_or(now_ns);
                if now_ns - since_ns >= FREE_SPACE_NS {
                    Engagement::Engaged { since_ns: now_ns }
                } else {
                    Engagement::Waiting { free_since_ns: Some(since_ns) }
                }
            }
            Engagement::Engaged { .. } if !fresh => {
                let left_ns = SILENT_ZERO_NS.saturating_sub(model.age_ns(now_ns));
                let duration_ns = left_ns.clamp(RAMP_DOWN_NS[0], RAMP_DOWN_NS[1]);
                Engagement::Ramping {
                    from_ns: now_ns,
                    duration_ns,
                    from_gain: gain,
                    from_force_n: gain * force_n.norm(),
                }
            }
            Engagement::Ramping { from_ns, duration_ns, .. } if now_ns - from_ns >= duration_ns => {
                Engagement::Waiting { free_since_ns: None }
            }
            same => same,
        };
    }

    fn permit(&self, now_ns: u64) -> Permit {
        let none = Permit { gain: 0.0, hold_damping_ns_m: 0.0, hold_limit_n: 0.0, cut: false, flags: 0 };
        match self.engagement {
            Engagement::Waiting { .. } => Permit { flags: flag::WAITING, ..none },
            Engagement::Engaged { since_ns } => {
                Permit { gain: ((now_ns - since_ns) as f64 / ENGAGE_RAMP_NS as f64).min(1.0), ..none }
            }
            Engagement::Ramping { from_ns, duration_ns, from_gain, from_force_n } => {
                let left = (1.0 - (now_ns - from_ns) as f64 / duration_ns as f64).max(0.0);
                Permit {
                    gain: from_gain * left,
                    hold_damping_ns_m: HOLD_DAMPING_NS_M * (4.0 * left).min(1.0),
                    hold_limit_n: from_force_n,
                    ..none
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::ToolMode;

    const MS: u64 = 1_000_000;

    fn state(x: f64, v: f64) -> DeviceState {
        DeviceState {
            position_m: Vector3::new(x, 0.0, 0.0),
            velocity_m_s: Vector3::new(v, 0.0, 0.0),
            orientation: [0.0, 0.0, 0.0, 1.0],
            mode: ToolMode::Touch,
        }
    }

    /// Feeds a fresh model every tick up to `until_ms`.
    fn run(watchdog: &mut Watchdog, from_ms: u64, until_ms: u64, force: f64) -> Permit {
        let mut permit = None;
        for ms in from_ms..=until_ms {
            let model =
                ContactModel { seq: 1, received_ns: ms * MS, validity_ns: 50 * MS, ..ContactModel::NONE };
            permit = Some(watchdog.judge(&model, &Vector3::new(0.0, 0.0, force), true, 0, ms * MS));
        }
        permit.unwrap()
    }

    fn silence(watchdog: &mut Watchdog, last_ms: u64, now_ms: u64) -> Permit {
        let model =
            ContactModel { seq: 1, received_ns: last_ms * MS, validity_ns: 50 * MS, ..ContactModel::NONE };
        watchdog.judge(&model, &Vector3::new(0.0, 0.0, 1.0), true, 0, now_ms * MS)
    }

    #[test]
    fn a_client_that_stood_still_wakes_up_without_force() {
        let mut watchdog = Watchdog::default();
        run(&mut watchdog, 0, 1000, 0.0);
        assert_eq!(run(&mut watchdog, 1001, 1500, 1.0).gain, 1.0);
        let woken = silence(&mut watchdog, 1500, 1900);
        assert!(woken.cut && woken.gain == 0.0, "{woken:?}");
        // A contact that comes now finds it in the tissue.
        let pressed = run(&mut watchdog, 1901, 2500, 1.0);
        assert!(!pressed.cut && pressed.gain == 0.0, "{pressed:?}");
    }

    #[test]
    fn force_starts_only_from_free_space() {
        let mut watchdog = Watchdog::default();
        let pressed = run(&mut watchdog, 0, 2000, 1.0);
        assert_eq!((pressed.gain, pressed.flags), (0.0, flag::WAITING));
        assert_eq!(run(&mut watchdog, 2001, 2200, 0.0).gain, 0.0);
        assert!(run(&mut watchdog, 2201, 2301, 0.0).gain < 0.51);
        assert_eq!(
            run(&mut watchdog, 2302, 2402, 1.0),
            Permit { gain: 1.0, flags: 0, ..run(&mut watchdog, 2403, 2403, 1.0) }
        );
    }

    #[test]
    fn silence_ramps_to_zero_within_200_ms_and_raises_the_flag_after_500() {
        let mut watchdog = Watchdog::default();
        run(&mut watchdog, 0, 1000, 0.0);
        assert_eq!(silence(&mut watchdog, 1000, 1050).gain, 1.0);
        let mut last = 1.0;
        for ms in 1051..1195 {
            let permit = silence(&mut watchdog, 1000, ms);
            assert!(permit.gain <= last && last - permit.gain < 0.011, "{ms}");
            assert!(permit.hold_damping_ns_m > 0.0);
            last = permit.gain;
        }
        let zero = silence(&mut watchdog, 1000, 1200);
        assert_eq!((zero.gain, zero.hold_damping_ns_m), (0.0, 0.0));
        assert_eq!(zero.flags, flag::STALE | flag::WAITING);
        assert!(silence(&mut watchdog, 1000, 1501).flags & flag::LOST != 0);
        assert_eq!(run(&mut watchdog, 1502, 2500, 1.0).gain, 0.0, "contact is back, but the hand presses");
        assert_eq!(run(&mut watchdog, 2501, 3100, 0.0).gain, 1.0);
    }

    #[test]
    fn a_server_whose_token_is_gone_counts_as_silent() {
        let mut watchdog = Watchdog::default();
        run(&mut watchdog, 0, 1000, 0.0);
        let model =
            ContactModel { seq: 1, received_ns: 1001 * MS, validity_ns: 50 * MS, ..ContactModel::NONE };
        for ms in 1001..=1150 {
            watchdog.judge(&model, &Vector3::z(), false, 0, ms * MS);
        }
        assert_eq!(watchdog.judge(&model, &Vector3::z(), false, 0, 1151 * MS).gain, 0.0);
    }

    #[test]
    fn no_contact_at_all_is_a_lost_link() {
        let mut watchdog = Watchdog::default();
        let early = watchdog.judge(&ContactModel::NONE, &Vector3::zeros(), true, 0, 10 * MS);
        assert_eq!(early.flags, flag::WAITING | flag::STALE);
        assert!(
            watchdog.judge(&ContactModel::NONE, &Vector3::zeros(), true, 0, 600 * MS).flags & flag::LOST != 0
        );
    }

    #[test]
    fn a_device_fault_cuts_at_once_and_asks_for_free_space() {
        let mut watchdog = Watchdog::default();
        assert_eq!(run(&mut watchdog, 0, 1000, 0.0).gain, 1.0);
        let model =
            ContactModel { seq: 1, received_ns: 1001 * MS, validity_ns: 50 * MS, ..ContactModel::NONE };
        let permit = watchdog.judge(&model, &Vector3::z(), true, flag::JUMP, 1001 * MS);
        assert!(permit.cut && permit.gain == 0.0);
        assert_eq!(run(&mut watchdog, 1002, 1500, 1.0).gain, 0.0);
        assert_eq!(run(&mut watchdog, 1501, 2000, 0.0).gain, 1.0);
    }

    #[test]
    fn the_guard_finds_jumps_speed_and_nan_and_stays_finite() {
        let mut guard = DeviceGuard::default();
        assert_eq!(guard.check(Ok(state(0.5, 0.0)), PERIOD_S).1, 0);
        assert_eq!(guard.check(Ok(state(0.515, 0.0)), PERIOD_S).1, 0);
        assert_eq!(guard.check(Ok(state(0.54, 0.0)), PERIOD_S).1, flag::JUMP);
        assert_eq!(guard.check(Ok(state(0.54, 2.1)), PERIOD_S).1, flag::OVER_SPEED);
        let (held, flags) = guard.check(Ok(state(f64::NAN, 0.0)), PERIOD_S);
        assert_eq!((held.position_m.x, flags), (0.54, flag::NOT_FINITE));
        assert_eq!(guard.check(Ok(state(0.6, 0.0)), 5.0 * PERIOD_S).1, 0, "60 mm in a stall of five ticks");
        assert_eq!(
            DeviceGuard::default().check(Ok(state(f64::INFINITY, 0.0)), PERIOD_S).0.position_m,
            Vector3::zeros()
        );
    }

    #[test]
    fn held_damping_brakes_within_its_limit() {
        let permit = Permit { gain: 0.5, hold_damping_ns_m: 2.0, hold_limit_n: 0.1, cut: false, flags: 0 };
        let force = permit.apply(Vector3::z(), &Vector3::new(1.0, 0.0, 0.0));
        assert!((force - Vector3::new(-0.1, 0.0, 0.5)).norm() < 1e-12);
    }
}
