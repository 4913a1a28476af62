//! Force of the tissue at the present tip, from the newest contact model.
//!
//! Each plane i of the message loads the tip with
//!
//! fᵢ(p) = nᵢ wᵢ max(0, f₀ᵢ·nᵢ − kᵢ (p − p_used − v_sᵢ·a)·nᵢ),
//!
//! p: tip, p_used: tip for which the message was computed, v_s: velocity of the surface, a = min(age,
//! horizon): the surface moves on while the message ages, but not without limit; w: one within the trusted
//! radius of the plane, falling to zero beyond.
//!
//! # Source
//! The message `scindo.v1.Contact` (`proto/scindo/v1/tool.proto`).

use super::model::{ContactModel, ContactPlane};
use crate::constants::{EXTRAPOLATION_STEPS, MAX_EXTRAPOLATION_S, PATCH_FADE};
use nalgebra::Vector3;
use scindo_proto::limits::MAX_CONTACTS;

/// A plane as a load that is linear along its normal: max(0, offset − stiffness n·p) n.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneLoad {
    /// Unit, from the tissue to the tool.
    pub normal: Vector3<f64>,
    /// Load extrapolated to n·p = 0 [N].
    pub offset_n: f64,
    /// Decrease of the load per metre along the normal [N/m].
    pub stiffness_n_m: f64,
    /// Damping along the normal, against the relative velocity [N·s/m].
    pub damping_ns_m: f64,
    /// Velocity of the surface [m/s].
    pub surface_velocity_m_s: Vector3<f64>,
}

impl PlaneLoad {
    /// Load with the tip at `p` [N]; it never pulls.
    pub fn at(&self, p: &Vector3<f64>) -> f64 {
        (self.offset_n - self.stiffness_n_m * self.normal.dot(p)).max(0.0)
    }
}

/// All planes of a message for one tick.
#[derive(Debug, Clone, Copy)]
pub struct PlaneLoads {
    loads: [PlaneLoad; MAX_CONTACTS],
    count: usize,
}

impl PlaneLoads {
    /// The planes that load the tip or may load it.
    pub fn iter(&self) -> impl Iterator<Item = &PlaneLoad> {
        self.loads[..self.count].iter()
    }

    /// Sum of the loads with the tip at `p` [N].
    pub fn force_at(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.iter().map(|load| load.at(p) * load.normal).sum()
    }

    /// Upper bound of the stiffness in any direction: the trace of Σ k n nᵀ [N/m].
    pub fn stiffness_bound(&self) -> f64 {
        self.iter().map(|load| load.stiffness_n_m).sum()
    }
}

/// Evaluates models. It remembers the length of a simulation step, which sets the horizon.
#[derive(Debug, Clone, Copy)]
pub struct ContactLaw {
    horizon_s: f64,
    last_step: (u64, f64),
}

impl Default for ContactLaw {
    fn default() -> Self {
        Self { horizon_s: MAX_EXTRAPOLATION_S, last_step: (0, 0.0) }
    }
}

impl ContactLaw {
    /// Loads on a tip near `tip_m` at loop time `now_ns`.
    pub fn loads(&mut self, model: &ContactModel, tip_m: &Vector3<f64>, now_ns: u64) -> PlaneLoads {
        self.observe_step(model);
        let age_s = (model.age_ns(now_ns) as f64 * 1e-9).min(self.horizon_s);
        let empty = PlaneLoad {
            normal: Vector3::z(),
            offset_n: 0.0,
            stiffness_n_m: 0.0,
            damping_ns_m: 0.0,
            surface_velocity_m_s: Vector3::zeros(),
        };
        let mut out = PlaneLoads { loads: [empty; MAX_CONTACTS], count: model.plane_count };
        for (load, plane) in out.loads.iter_mut().zip(model.planes()) {
            let reference = model.tip_used_m + plane.surface_velocity_m_s * age_s;
            let weight = patch_weight(plane, &(tip_m - plane.surface_velocity_m_s * age_s));
            *load = PlaneLoad {
                normal: plane.normal,
                offset_n: weight * (plane.force_n + plane.stiffness_n_m * plane.normal.dot(&reference)),
                stiffness_n_m: weight * plane.stiffness_n_m,
                damping_ns_m: weight * plane.damping_ns_m,
                surface_velocity_m_s: plane.surface_velocity_m_s,
            };
        }
        out
    }

    /// Updates the horizon to 1.5 simulation steps, once messages show the length of a step.
    fn observe_step(&mut self, model: &ContactModel) {
        let (step, time_s) = self.last_step;
        if model.sim_step == step {
            return;
        }
        if model.sim_step > step && step > 0 {
            let step_s = (model.sim_time_s - time_s) / (model.sim_step - step) as f64;
            if step_s > 0.0 {
                self.horizon_s = (EXTRAPOLATION_STEPS * step_s).min(MAX_EXTRAPOLATION_S);
            }
        }
        self.last_step = (model.sim_step, model.sim_time_s);
    }
}

/// One within the trusted radius, falling linearly to zero over another half radius.
fn patch_weight(plane: &ContactPlane, tip_m: &Vector3<f64>) -> f64 {
    let r = plane.patch_radius_m;
    if r <= 0.0 {
        return 1.0;
    }
    let d = tip_m - plane.point_m;
    let aside = (d - plane.normal * plane.normal.dot(&d)).norm();
    (1.0 - (aside - r) / (PATCH_FADE * r)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(planes: &[ContactPlane]) -> ContactModel {
        let mut model = ContactModel { seq: 1, sim_step: 1, plane_count: planes.len(), ..ContactModel::NONE };
        model.planes[..planes.len()].copy_from_slice(planes);
        model
    }

    fn plane() -> ContactPlane {
        ContactPlane { force_n: 1.0, stiffness_n_m: 200.0, ..ContactPlane::NONE }
    }

    #[test]
    fn force_is_linear_along_the_normal_and_never_pulls() {
        let loads = ContactLaw::default().loads(&model(&[plane()]), &Vector3::zeros(), 0);
        assert!((loads.force_at(&Vector3::zeros()).z - 1.0).abs() < 1e-12);
        assert!((loads.force_at(&Vector3::new(0.3, 0.0, -0.001)).z - 1.2).abs() < 1e-12);
        assert_eq!(loads.force_at(&Vector3::new(0.0, 0.0, 0.006)), Vector3::zeros());
    }

    #[test]
    fn the_surface_moves_on_up_to_the_horizon() {
        let rising = ContactPlane { surface_velocity_m_s: Vector3::new(0.0, 0.0, 0.1), ..plane() };
        let mut law = ContactLaw::default();
        let at = |law: &mut ContactLaw, ms: u64| {
            law.loads(&model(&[rising]), &Vector3::zeros(), ms * 1_000_000).force_at(&Vector3::zeros()).z
        };
        assert!((at(&mut law, 10) - 1.2).abs() < 1e-12);
        assert!((at(&mut law, 500) - (1.0 + 200.0 * 0.1 * MAX_EXTRAPOLATION_S)).abs() < 1e-12);
    }

    #[test]
    fn the_horizon_is_one_and_a_half_steps() {
        let mut law = ContactLaw::default();
        for (sim_step, sim_time_s) in [(1, 0.0), (3, 0.02)] {
            law.loads(&ContactModel { sim_step, sim_time_s, ..model(&[]) }, &Vector3::zeros(), 0);
        }
        assert!((law.horizon_s - 0.015).abs() < 1e-12);
    }

    #[test]
    fn a_plane_fades_beyond_its_patch() {
        let patch = ContactPlane { patch_radius_m: 0.01, ..plane() };
        let force = |x: f64| {
            let tip = Vector3::new(x, 0.0, 0.0);
            ContactLaw::default().loads(&model(&[patch]), &tip, 0).force_at(&tip).z
        };
        assert_eq!(force(0.009), 1.0);
        assert!((force(0.0125) - 0.5).abs() < 1e-9);
        assert_eq!(force(0.02), 0.0);
    }
}
