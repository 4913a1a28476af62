//! The simulated device: a mass in a hand that follows a path and feels the force.
//!
//! m a = k_h (p*(t) − x) + b_h (v*(t) − v) − b_d v + f
//!
//! p*, v*: path of the hand; k_h, b_h: the grip; b_d: damping of the device; f: force that the client
//! commands. It is integrated by symplectic Euler in steps of at most one millisecond.

use super::path::Path;
use super::{Capability, DeviceGone, DeviceState, HapticDevice};
use crate::constants::PERIOD_S;
use nalgebra::Vector3;

/// Grip and inertia of the simulated hand. Defaults: a relaxed pen grip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    /// Moving mass of hand and device [kg].
    pub mass_kg: f64,
    /// Stiffness of the grip [N/m].
    pub stiffness_n_m: f64,
    /// Damping of the grip [N·s/m].
    pub damping_ns_m: f64,
}

impl Default for Hand {
    fn default() -> Self {
        Self { mass_kg: 0.1, stiffness_n_m: 250.0, damping_ns_m: 6.0 }
    }
}

/// Figures of a middle-class desktop device (CHAI3D: Touch X, Inverse3).
pub const CAPABILITY: Capability = Capability {
    model: "simulated",
    max_force_n: 7.9,
    max_continuous_force_n: 1.75,
    max_stiffness_n_m: 1000.0,
    damping_ns_m: 5.0,
    latency_s: 1.0e-3,
    workspace_radius_m: 0.1,
};

/// After a stall, one read catches up by at most this many milliseconds.
const MAX_CATCH_UP: usize = 100;

/// A hand on a path, with inertia.
#[derive(Debug, Clone)]
pub struct SimulatedDevice {
    path: Path,
    hand: Hand,
    time_s: f64,
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    force_n: Vector3<f64>,
}

impl SimulatedDevice {
    /// Creates a device at rest at the origin, without a path.
    pub fn at_rest(hand: Hand) -> Self {
        Self::new(Path::still(Vector3::zeros()), hand)
    }

    /// Creates a device at rest on the first point of `path`.
    pub fn new(path: Path, hand: Hand) -> Self {
        let position_m = path.at(0.0).position_m;
        Self {
            path,
            hand,
            time_s: 0.0,
            position_m,
            velocity_m_s: Vector3::zeros(),
            force_n: Vector3::zeros(),
        }
    }

    fn advance(&mut self, dt_s: f64) {
        let Hand { mass_kg, stiffness_n_m, damping_ns_m } = self.hand;
        let target = self.path.at(self.time_s + dt_s);
        let grip = stiffness_n_m * (target.position_m - self.position_m)
            + damping_ns_m * (target.velocity_m_s - self.velocity_m_s);
        let force = grip - CAPABILITY.damping_ns_m * self.velocity_m_s + self.force_n;
        self.velocity_m_s += force * (dt_s / mass_kg);
        self.position_m += self.velocity_m_s * dt_s;
        self.time_s += dt_s;
    }
}

impl HapticDevice for SimulatedDevice {
    fn capability(&self) -> Capability {
        CAPABILITY
    }

    fn read(&mut self, elapsed_s: f64) -> Result<DeviceState, DeviceGone> {
        let steps = ((elapsed_s / PERIOD_S).round() as usize).clamp(1, MAX_CATCH_UP);
        for _ in 0..steps {
            self.advance(PERIOD_S);
        }
        let target = self.path.at(self.time_s);
        Ok(DeviceState {
            position_m: self.position_m,
            velocity_m_s: self.velocity_m_s,
            orientation: target.orientation,
            mode: target.mode,
        })
    }

    fn write(&mut self, force_n: Vector3<f64>) {
        self.force_n = force_n;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_hand_follows_its_path_and_a_force_displaces_it_by_its_grip() {
        let path = Path::still(Vector3::new(0.1, 0.0, 0.0));
        let mut device = SimulatedDevice::new(path, Hand::default());
        assert_eq!(device.read(PERIOD_S).unwrap().position_m, Vector3::new(0.1, 0.0, 0.0));
        device.write(Vector3::new(0.0, 0.0, 1.0));
        let mut state = device.read(PERIOD_S).unwrap();
        for _ in 0..2000 {
            state = device.read(PERIOD_S).unwrap();
        }
        assert!((state.position_m.z - 1.0 / 250.0).abs() < 1e-9, "{}", state.position_m.z);
        assert!(state.velocity_m_s.norm() < 1e-9);
    }

    #[test]
    fn a_stall_advances_the_hand_by_the_time_that_passed() {
        let path = Path::still(Vector3::zeros());
        let mut one = SimulatedDevice::new(path.clone(), Hand::default());
        let mut many = SimulatedDevice::new(path, Hand::default());
        one.write(Vector3::x());
        many.write(Vector3::x());
        for _ in 0..20 {
            many.read(PERIOD_S).unwrap();
        }
        one.read(20.0 * PERIOD_S).unwrap();
        assert_eq!(one.read(PERIOD_S), many.read(PERIOD_S));
    }
}
