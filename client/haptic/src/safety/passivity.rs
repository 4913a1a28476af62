//! Time-domain passivity: the output may not give the hand more energy than the hand has put in.
//!
//! Observer: E ← E − T f·v, f: force on the hand, v: its velocity. Controller: where E < 0, damping α =
//! min(−E / (T v²), α_max) is added to the force, f ← f − α v. The damping force never exceeds the present or
//! a recent force (it may act for some milliseconds after a bounce). Free space therefore stays free.
//!
//! # Source
//! Hannaford and Ryu, "Time-domain passivity control of haptic interfaces", IEEE T-RA 18 (2002).

use crate::constants::{FREE_FORCE_N, MAX_BANKED_ENERGY_J, PERIOD_S};
use nalgebra::Vector3;

/// After this many ticks without force the energy is reset to zero.
const FREE_TICKS: u32 = 100;

/// Factor by which a recent force decays per tick; after 7 ms half of it is left.
const RECENT_DECAY: f64 = 0.9;

/// Passivity observer and controller.
#[derive(Debug, Clone, Copy)]
pub struct Passivity {
    energy_j: f64,
    max_damping_ns_m: f64,
    free_ticks: u32,
    recent_force_n: f64,
}

impl Passivity {
    /// `max_damping_ns_m`: α_max, the largest damping that the device renders without buzzing.
    pub fn new(max_damping_ns_m: f64) -> Self {
        Self { energy_j: 0.0, max_damping_ns_m, free_ticks: 0, recent_force_n: 0.0 }
    }

    /// Energy that the hand has put in and not received back [J]. Negative: the output is active.
    pub fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// Called while no force is allowed: no damping may be injected then.
    pub fn rest(&mut self) {
        self.recent_force_n = 0.0;
    }

    /// The force with injected damping, and whether any was injected.
    pub fn correct(&mut self, force_n: Vector3<f64>, velocity_m_s: &Vector3<f64>) -> (Vector3<f64>, bool) {
        self.recent_force_n = force_n.norm().max(RECENT_DECAY * self.recent_force_n);
        let predicted_j = self.energy_j - PERIOD_S * force_n.dot(velocity_m_s);
        let v_squared = velocity_m_s.norm_squared();
        if predicted_j >= 0.0 || v_squared < 1e-12 {
            return (force_n, false);
        }
        let alpha = (-predicted_j / (PERIOD_S * v_squared)).min(self.max_damping_ns_m);
        let alpha = alpha.min(self.recent_force_n / v_squared.sqrt());
        (force_n - alpha * velocity_m_s, alpha > 0.0)
    }

    /// Accounts for the force that was really sent.
    pub fn observe(&mut self, force_n: &Vector3<f64>, velocity_m_s: &Vector3<f64>) {
        self.energy_j = (self.energy_j - PERIOD_S * force_n.dot(velocity_m_s)).min(MAX_BANKED_ENERGY_J);
        self.free_ticks = if force_n.norm() > FREE_FORCE_N { 0 } else { self.free_ticks.saturating_add(1) };
        if self.free_ticks > FREE_TICKS {
            self.energy_j = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speed of a mass after it bounces on a wall that is rendered one tick late, which makes the wall
    /// active.
    fn bounce(controlled: bool) -> f64 {
        let (mut passivity, mass, k) = (Passivity::new(20.0), 0.1, 3000.0);
        let (mut x, mut v, mut held) = (0.001, -0.1, 0.0);
        for _ in 0..200 {
            let wanted = Vector3::new(k * f64::max(0.0, -x), 0.0, 0.0);
            let velocity = Vector3::new(v, 0.0, 0.0);
            let force = if controlled { passivity.correct(wanted, &velocity).0 } else { wanted };
            passivity.observe(&Vector3::new(held, 0.0, 0.0), &velocity);
            v += held / mass * PERIOD_S;
            x += v * PERIOD_S;
            held = force.x;
        }
        v
    }

    #[test]
    fn a_late_wall_gives_energy_and_the_controller_takes_it_back() {
        let (free, controlled) = (bounce(false), bounce(true));
        assert!(free > 0.105, "the wall must be active for this test: {free}");
        assert!(controlled < 0.1 + 0.5 * (free - 0.1), "{controlled} against {free}");
    }

    #[test]
    fn the_observer_books_the_work_of_the_hand() {
        let mut passivity = Passivity::new(5.0);
        passivity.observe(&Vector3::new(0.0, 0.0, 1.0), &Vector3::new(0.0, 0.0, -0.1));
        assert!((passivity.energy_j() - 1e-4).abs() < 1e-15);
        let (same, injected) = passivity.correct(Vector3::z(), &Vector3::new(0.0, 0.0, 0.05));
        assert_eq!((same, injected), (Vector3::z(), false));
        let (less, injected) = passivity.correct(Vector3::z(), &Vector3::new(0.0, 0.0, 0.2));
        assert!(injected && less.z < 1.0);
    }

    #[test]
    fn free_space_closes_the_account() {
        let mut passivity = Passivity::new(5.0);
        passivity.observe(&Vector3::z(), &Vector3::new(0.0, 0.0, 1.0));
        assert!(passivity.energy_j() < 0.0);
        for _ in 0..=FREE_TICKS {
            passivity.observe(&Vector3::zeros(), &Vector3::x());
        }
        assert_eq!(passivity.energy_j(), 0.0);
    }
}
