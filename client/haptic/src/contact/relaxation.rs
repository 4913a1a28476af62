//! Response of relaxing tissue to the way that the tip has gone since the pose of a model.
//!
//! # Derivation
//! A standard linear solid answers the depth d(t) with f = k∞ d + (k₀ − k∞) q, q̇ = ḋ − q/τ. k₀ is the stiffness at once, k∞
//! that which is left when the tissue has followed. A model states f₀ for the pose at t₀, so the force now is
//!
//! f(t) = f₀ + k∞ (d(t) − d(t₀)) + (k₀ − k∞) (q(t) − q(t₀)).
//!
//! An old model is thus answered with k∞ for what lies far back: rendering k₀ over a delay makes the force too large
//! (Schuwerk et al. 2015). d and q follow from the client's own record of its tip, so the measured age enters exactly.
//! Where no newer pose reached the server, it has kept the tip in place for a time h until it sent the message, and its
//! tissue has relaxed meanwhile: q(t₀) is then q at the pose used times exp(−h/τ).
//! Between two ticks d is straight, so that q₂ = q₁ e + (1 − e) (τ/T) Δd, e = exp(−T/τ). Depth starts at the surface,
//! where the force is zero: d(t₀) = f₀ / k∞.

use super::history::TipHistory;
use super::model::ContactPlane;
use crate::constants::PERIOD_S;
use nalgebra::Vector3;

/// The pose for which the server computed a force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Used {
    /// Tip [m].
    pub tip_m: Vector3<f64>,
    /// Loop clock when the tip was there [ns].
    pub at_ns: u64,
    /// How long the server has kept it there [ns].
    pub held_ns: u64,
}

/// Force along one axis as a function of the tip p now: offset − stiffness n·p.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Force at n·p = 0 [N].
    pub offset_n: f64,
    /// Decrease of the force per metre along the normal [N/m].
    pub stiffness_n_m: f64,
}

impl Response {
    /// The response of `plane` after the ticks of `history`. A plane without two sides is not touched above the
    /// surface.
    pub fn along(plane: &ContactPlane, used: &Used, two_sided: bool, history: &TipHistory) -> Self {
        let used_m = &used.tip_m;
        let relaxed = plane.relaxed_stiffness_n_m;
        let transient = (plane.instant_stiffness_n_m - relaxed).max(0.0);
        let ticks = plane.relaxation_s / PERIOD_S;
        let decay = if ticks > 0.0 { (-1.0 / ticks).exp() } else { 0.0 };
        let ramp = ticks * (1.0 - decay);
        let start = match (two_sided, plane.force_n > 0.0) {
            (true, _) => 0.0,
            (false, true) => plane.force_n / relaxed,
            (false, false) => plane.force_n / plane.stiffness_n_m.max(f64::MIN_POSITIVE),
        };
        let depth = |tip: &Vector3<f64>| start + plane.normal.dot(&(used_m - tip));
        let touched = |tip: &Vector3<f64>| if two_sided { depth(tip) } else { depth(tip).max(0.0) };
        let (mut d, mut q) = (None, 0.0);
        let (mut d_used, mut q_used) = (touched(used_m), 0.0);
        for past in history.iter() {
            let now = touched(&past.tip_m);
            q = q * decay + ramp * (now - d.unwrap_or(now));
            d = Some(now);
            if past.at_ns <= used.at_ns {
                (d_used, q_used) = (now, q);
            }
        }
        let d = d.unwrap_or(d_used);
        if plane.relaxation_s > 0.0 {
            q_used *= (-(used.held_ns as f64) * 1e-9 / plane.relaxation_s).exp();
        }
        let force = if two_sided { plane.force_n } else { plane.force_n.max(0.0) };
        let at_origin = depth(&Vector3::zeros());
        let offset_n = force
            + relaxed * (at_origin - d_used)
            + transient * (q * decay + ramp * (at_origin - d) - q_used);
        Self { offset_n, stiffness_n_m: relaxed + transient * ramp }
    }

    /// Force with the tip at `p` [N].
    pub fn at(&self, normal: &Vector3<f64>, p: &Vector3<f64>) -> f64 {
        self.offset_n - self.stiffness_n_m * normal.dot(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANE: ContactPlane = ContactPlane {
        stiffness_n_m: 200.0,
        instant_stiffness_n_m: 300.0,
        relaxed_stiffness_n_m: 100.0,
        relaxation_s: 0.01,
        ..ContactPlane::NONE
    };

    fn plane(force_n: f64) -> ContactPlane {
        ContactPlane { force_n, ..PLANE }
    }

    fn used(tip_m: Vector3<f64>, at_ns: u64) -> Used {
        Used { tip_m, at_ns, held_ns: 0 }
    }

    /// Force after the tip was at the origin for 200 ms, then 1 mm deeper for `ms`.
    fn after(ms: u64, force_n: f64, step_m: f64) -> f64 {
        let mut history = TipHistory::default();
        let tip = |t: u64| Vector3::new(0.0, 0.0, if t < 200 { 0.0 } else { step_m });
        (0..200 + ms).for_each(|t| history.record(t * 1_000_000, tip(t)));
        let used = used(Vector3::zeros(), 199_000_000);
        Response::along(&plane(force_n), &used, false, &history).at(&Vector3::z(), &tip(200))
    }

    #[test]
    fn a_step_is_answered_stiffly_and_then_relaxes() {
        // The step takes a tick.
        let ramp = 10.0 * (1.0 - f64::exp(-0.1));
        let expected = |ms: f64| 0.5 + 0.1 + 0.2 * ramp * (-ms / 10.0).exp();
        for ms in [0, 1, 5, 20, 200] {
            assert!((after(ms, 0.5, -1e-3) - expected(ms as f64)).abs() < 1e-9, "{ms}");
        }
    }

    #[test]
    fn tissue_without_viscosity_answers_as_it_is() {
        let elastic = ContactPlane { instant_stiffness_n_m: 100.0, relaxation_s: 0.0, ..plane(0.5) };
        let used = used(Vector3::zeros(), 0);
        let response = Response::along(&elastic, &used, false, &TipHistory::default());
        assert_eq!(response.stiffness_n_m, 100.0);
        assert!((response.at(&Vector3::z(), &Vector3::new(0.0, 0.0, -0.001)) - 0.6).abs() < 1e-12);
    }

    #[test]
    fn a_tip_that_was_above_the_surface_is_only_pressed_below_it() {
        // 0.3 mm above at the pose used, so 0.7 mm deep now.
        let deep = after(200, -0.06, -1e-3);
        assert!((deep - 0.07).abs() < 1e-6, "{deep}");
        assert!(after(200, -0.06, -2e-4) < 1e-9);
    }

    #[test]
    fn an_old_model_of_a_moving_tip_is_as_good_as_a_new_one() {
        // The truth: the solid under a tip that sinks at 20 mm/s for 100 ms and then rests.
        let (k, relaxed, ticks) = (300.0, 100.0, 10.0);
        let (decay, tip) =
            (f64::exp(-1.0 / ticks), |t: u64| Vector3::new(0.0, 0.0, -2e-5 * t.min(100) as f64));
        let (mut history, mut q, mut force) = (TipHistory::default(), 0.0, Vec::new());
        for t in 0..200u64 {
            let d = -tip(t).z;
            let before = if t == 0 { 0.0 } else { -tip(t - 1).z };
            q = q * decay + ticks * (1.0 - decay) * (d - before);
            force.push(relaxed * d + (k - relaxed) * q);
            if t >= 150 {
                for age in [0, 20, 100u64] {
                    let used = t - age;
                    let used_tip = tip(used);
                    let model = plane(force[used as usize]);
                    let pose = self::used(used_tip, used * 1_000_000);
                    let response = Response::along(&model, &pose, true, &history);
                    let felt = response.at(&Vector3::z(), &tip(t));
                    assert!((felt - force[t as usize]).abs() < 1e-3, "{t} {age}: {felt}");
                }
            }
            history.record(t * 1_000_000, tip(t));
        }
    }

    #[test]
    fn a_pose_that_no_other_follows_relaxes_on_the_server_too() {
        // A step of 1 mm, and then a hand so still that the client sends no other pose for 30 ms. Messages
        // with less and less force go on coming.
        let tip = |t: u64| Vector3::new(0.0, 0.0, if t < 200 { 0.0 } else { -1e-3 });
        let mut history = TipHistory::default();
        (0..230u64).for_each(|t| history.record(t * 1_000_000, tip(t)));
        let truth = |ms: f64| 0.1 + 0.2 * 10.0 * (1.0 - f64::exp(-0.1)) * (-ms / 10.0).exp();
        let felt = |held_ns| {
            let used = Used { tip_m: tip(200), at_ns: 200_000_000, held_ns };
            Response::along(&plane(truth(30.0)), &used, true, &history).at(&Vector3::z(), &tip(230))
        };
        assert!((felt(30_000_000) - truth(30.0)).abs() < 1e-9, "{} {}", felt(30_000_000), truth(30.0));
        assert!(felt(0) < 0.7 * truth(30.0), "relaxed twice: {}", felt(0));
    }
}
