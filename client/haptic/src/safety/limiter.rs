//! Clamp and slew limit: the last stage before the device.
//!
//! The output moves towards the clamped target by at most `slew · T` per tick, in a straight line.
//! Both ends of that line lie within the clamp, so the output does.

use super::flag;
use crate::constants::{FIRST_CONTACT_S, FIRST_CONTACT_SLEW, FREE_FORCE_N, PERIOD_S};
use nalgebra::Vector3;

/// Largest force and its largest change.
#[derive(Debug, Clone, Copy)]
pub struct Limiter {
    max_force_n: f64,
    slew_n_s: f64,
    output_n: Vector3<f64>,
    touch_s: f64,
}

impl Limiter {
    /// Starts at zero force.
    pub fn new(max_force_n: f64, slew_n_s: f64) -> Self {
        Self { max_force_n, slew_n_s, output_n: Vector3::zeros(), touch_s: 0.0 }
    }

    /// The force that may be sent [N], and the flags of the limits that held it back. `advice_n` is the
    /// server's limit, approached within the slew limit. The limiter's own clamp is hard.
    pub fn limit(&mut self, wanted_n: Vector3<f64>, advice_n: f64) -> (Vector3<f64>, u32) {
        let (target, mut flags) = self.clamp(wanted_n, advice_n);
        let step = target - self.output_n;
        let allowed = self.slew(target.norm()) * PERIOD_S;
        let size = step.norm();
        if size > allowed {
            self.output_n += step * (allowed / size);
            flags |= flag::SLEWED;
        } else {
            self.output_n = target;
        }
        self.touch_s = if self.output_n.norm() > FREE_FORCE_N { self.touch_s + PERIOD_S } else { 0.0 };
        (self.output_n, flags)
    }

    /// Clamps `wanted_n`. The gain of a ramp is applied after the clamp. In the opposite order, a force far
    /// above the clamp would fill it until the ramp is nearly over. The slew limit would then hold force long
    /// after.
    pub fn clamp(&self, wanted_n: Vector3<f64>, advice_n: f64) -> (Vector3<f64>, u32) {
        clamp(wanted_n, self.max_force_n.min(advice_n))
    }

    /// Sets the force to zero at once: for device faults, where the force itself is the danger.
    pub fn cut(&mut self) -> Vector3<f64> {
        self.output_n = Vector3::zeros();
        self.touch_s = 0.0;
        self.output_n
    }

    /// The slew limit for this tick. It is lower while force rises at the start of a touch.
    fn slew(&self, target_n: f64) -> f64 {
        let rises = target_n > self.output_n.norm();
        if rises && self.touch_s < FIRST_CONTACT_S {
            FIRST_CONTACT_SLEW * self.slew_n_s
        } else {
            self.slew_n_s
        }
    }
}

fn clamp(wanted_n: Vector3<f64>, limit_n: f64) -> (Vector3<f64>, u32) {
    let size = wanted_n.norm();
    if !size.is_finite() {
        (Vector3::zeros(), flag::CLAMPED)
    } else if size > limit_n {
        (wanted_n * (limit_n / size), flag::CLAMPED)
    } else {
        (wanted_n, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clamp_is_hard_and_reached_within_the_slew_limit() {
        let mut limiter = Limiter::new(2.5, 50.0);
        let mut last = 0.0;
        for tick in 0..200 {
            let (force, flags) = limiter.limit(Vector3::new(0.0, 0.0, 100.0), f64::INFINITY);
            let allowed = if tick < 99 { 0.020 } else { 0.050 };
            assert!(force.z - last <= allowed + 1e-12 && force.z <= 2.5, "{tick}: {last} → {force}");
            assert!(flags & flag::CLAMPED != 0);
            last = force.z;
        }
        assert_eq!(last, 2.5);
        assert!((limiter.limit(Vector3::zeros(), f64::INFINITY).0.z - 2.45).abs() < 1e-12);
    }

    #[test]
    fn advice_is_approached_within_the_slew_limit() {
        let mut limiter = Limiter::new(2.5, 50.0);
        for _ in 0..200 {
            limiter.limit(Vector3::x() * 2.0, f64::INFINITY);
        }
        assert!((limiter.limit(Vector3::x() * 2.0, 0.5).0.x - 1.95).abs() < 1e-12);
        for _ in 0..200 {
            limiter.limit(Vector3::x() * 2.0, 0.5);
        }
        assert!((limiter.limit(Vector3::x() * 2.0, 0.5).0.x - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_finite_counts_as_no_force_and_a_cut_is_immediate() {
        let mut limiter = Limiter::new(2.5, 50.0);
        for _ in 0..100 {
            limiter.limit(Vector3::x(), f64::INFINITY);
        }
        let (force, _) = limiter.limit(Vector3::new(f64::NAN, 0.0, 0.0), f64::INFINITY);
        assert!((force.x - 0.95).abs() < 1e-12);
        assert_eq!(limiter.cut(), Vector3::zeros());
    }
}
