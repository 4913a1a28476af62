//! Dry friction at the client.
//!
//! A model states the friction f_t for the pose at t₀. With the stiffness across the normal k_t the tissue sticks to an
//! anchor that is s = f_t / k_t ahead of the tip. The client knows the way of its tip since t₀, tick by tick:
//!
//! s ← s − (I − n nᵀ) Δp, then |s| ≤ μ f_n / k_t,
//!
//! so that the anchor stays while the tissue sticks, and is dragged along where it slips. The force is k_t s. An old
//! model slips as a new one does: friction depends on the way and not on the time.
//!
//! # Source
//! Hayward and Armstrong 2000, *A new computational model of friction applied to haptic rendering*, eq. 4.

use super::history::TipHistory;
use super::load::PlaneLoad;
use super::model::ContactPlane;
use nalgebra::Vector3;

/// The pose of a model.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Tip [m].
    pub tip_m: Vector3<f64>,
    /// Loop clock when the tip was there [ns]; `None` if it is not known.
    pub at_ns: Option<u64>,
}

/// Friction [N] with the tip at `tip_m` after the ticks of `history`. `load` is the load of the plane along its
/// normal, and `stiffest_n_m` what the device can render.
pub fn friction(
    plane: &ContactPlane,
    load: &PlaneLoad,
    stiffest_n_m: f64,
    start: &Start,
    history: &TipHistory,
    tip_m: &Vector3<f64>,
) -> Vector3<f64> {
    let k = plane.tangential_stiffness_n_m.min(stiffest_n_m);
    if plane.friction <= 0.0 || k <= 0.0 {
        return Vector3::zeros();
    }
    let n = plane.normal;
    let (mut stretch, mut last) = (plane.tangential_n / k, start.tip_m);
    let mut follow = |tip: &Vector3<f64>| {
        let s = stretch - (tip - last);
        stretch = (s - n * n.dot(&s)).cap_magnitude(plane.friction * load.at(tip).max(0.0) / k);
        last = *tip;
    };
    if let Some(at_ns) = start.at_ns {
        history.iter().filter(|past| past.at_ns > at_ns).for_each(|past| follow(&past.tip_m));
    }
    follow(tip_m);
    k * stretch
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANE: ContactPlane = ContactPlane {
        force_n: 1.0,
        stiffness_n_m: 200.0,
        tangential_stiffness_n_m: 100.0,
        friction: 0.3,
        ..ContactPlane::NONE
    };

    /// Loads with 1 N at z = 0.
    fn load() -> PlaneLoad {
        PlaneLoad {
            normal: Vector3::z(),
            offset_n: 1.0,
            stiffness_n_m: 200.0,
            damping_ns_m: 0.0,
            surface_velocity_m_s: Vector3::zeros(),
            two_sided: false,
            friction: 0.3,
            friction_n: Vector3::zeros(),
            arm_m: Vector3::zeros(),
        }
    }

    /// Friction at the end of a way along x, with a model for its tick `used`.
    fn at_the_end(way: &[f64], used: usize, before: Vector3<f64>) -> Vector3<f64> {
        let tip = |x: f64| Vector3::new(x, 0.0, 0.0);
        let mut history = TipHistory::default();
        let (last, others) = way.split_last().unwrap();
        (1..).zip(others).for_each(|(t, x)| history.record(t, tip(*x)));
        let start = Start { tip_m: tip(way[used]), at_ns: Some(used as u64 + 1) };
        let plane = ContactPlane { tangential_n: before, ..PLANE };
        friction(&plane, &load(), 1e4, &start, &history, &tip(*last))
    }

    #[test]
    fn it_sticks_slips_and_turns_back() {
        let at_rest = Vector3::zeros();
        let stuck = at_the_end(&[0.0, 0.001, 0.002], 0, at_rest);
        assert!((stuck + Vector3::x() * 0.2).norm() < 1e-12, "{stuck}");
        let slid = at_the_end(&[0.0, 0.002, 0.01], 0, at_rest);
        assert!((slid + Vector3::x() * 0.3).norm() < 1e-12, "{slid}");
        // It turns back from its bound at once, and does not jump.
        let back = at_the_end(&[0.0, 0.01, 0.009], 0, at_rest);
        assert!((back + Vector3::x() * 0.2).norm() < 1e-12, "{back}");
    }

    #[test]
    fn an_old_model_slips_as_a_new_one_does() {
        let way: Vec<f64> = (0..40).map(|t| 0.004 * f64::sin(0.2 * f64::from(t))).collect();
        // What each tick felt, from the first model on.
        let felt: Vec<_> = (1..=way.len()).map(|t| at_the_end(&way[..t], 0, Vector3::zeros())).collect();
        for used in 1..way.len() - 1 {
            let newer = at_the_end(&way, used, felt[used]);
            assert!((newer - felt[way.len() - 1]).norm() < 1e-12, "{used}");
        }
        let most = felt.iter().map(|f| f.norm()).fold(0.0, f64::max);
        assert!((0.299..=0.3 + 1e-12).contains(&most), "it slips on this way: {most}");
    }

    #[test]
    fn a_load_that_goes_takes_its_friction_along() {
        let start = Start { tip_m: Vector3::zeros(), at_ns: Some(0) };
        let plane = ContactPlane { tangential_n: Vector3::x() * 0.3, ..PLANE };
        let at = |z: f64| {
            friction(&plane, &load(), 1e4, &start, &TipHistory::default(), &Vector3::new(0.0, 0.0, z))
        };
        assert!((at(0.0).x - 0.3).abs() < 1e-12);
        assert!((at(0.0025).x - 0.15).abs() < 1e-12);
        assert_eq!(at(0.006), Vector3::zeros());
    }
}
