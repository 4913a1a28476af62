//! Virtual coupling: a massless proxy on a spring stands between device and tissue. The spring is just soft
//! enough for the device to render the pair passively.
//!
//! # Derivation
//! A device with damping b renders a sampled wall of stiffness K and damping B passively if
//! b > K (T/2 + τ) + |B| (T: period, τ: latency beyond the sample hold), so K ≤ (b − |B|)/(T/2 + τ);
//! with τ = 0 this is 2 (b − |B|)/T. Tissue of stiffness k in series with a coupling of stiffness
//! K_vc gives 1/(1/k + 1/K_vc) ≤ K for 1/K_vc = 1/K − 1/k. Tissue softer than K needs no coupling:
//! the proxy sits on the device and the force is that of the tissue, undistorted.
//!
//! The proxy balances K_vc (x − p) + Σᵢ fᵢ(p) = 0: the minimum of a convex, piecewise quadratic
//! energy, found by Newton's method on the set of planes that load it (3 × 3, at most 8 rounds).
//!
//! # Source
//! Colgate and Schenkel 1997, eq. 8; Colgate, Stanley and Brown 1995; Adams and Hannaford 1999.

use crate::constants::{PERIOD_S, VIRTUAL_DAMPING_SHARE};
use crate::contact::law::PlaneLoads;
use crate::device::{Capability, DeviceState};
use crate::safety::tank::Charge;
use nalgebra::{Matrix3, Vector3};

/// Most rounds of the search for the loaded planes; there are at most eight planes.
const MAX_ROUNDS: usize = 8;

/// Spring and damper that the device can render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VirtualCoupling {
    /// Largest stiffness at the device [N/m].
    pub stiffness_limit_n_m: f64,
    /// Largest damping at the device [N·s/m].
    pub damping_limit_ns_m: f64,
}

impl VirtualCoupling {
    /// Limits from the passivity bound and the device's own.
    pub fn new(device: &Capability) -> Self {
        let damping = VIRTUAL_DAMPING_SHARE * device.damping_ns_m;
        let passive = (device.damping_ns_m - damping).max(0.0) / (PERIOD_S / 2.0 + device.latency_s.max(0.0));
        Self { stiffness_limit_n_m: passive.min(device.max_stiffness_n_m), damping_limit_ns_m: damping }
    }

    /// Force of the tissue on the device [N]. `advice_n_m` is the stiffness limit that the server advises.
    pub fn force(&self, state: &DeviceState, loads: &PlaneLoads, advice_n_m: f64) -> Vector3<f64> {
        let limit = self.stiffness_limit_n_m.min(advice_n_m);
        let proxy = match coupling_stiffness(loads.stiffness_bound(), limit) {
            None => state.position_m,
            Some(k_vc) => balance(&state.position_m, k_vc, loads),
        };
        let elastic = loads.force_at(&proxy);
        elastic + self.damping(state, loads, &proxy, elastic.norm()) + loads.friction_at(&proxy)
    }

    /// What `force_n` costs an energy tank with the tip at `p`.
    pub fn charge(&self, force_n: &Vector3<f64>, p: &Vector3<f64>, loads: &PlaneLoads) -> Charge {
        let along = force_n.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z);
        let stiffness_n_m = loads.stiffness_along(p, &along).min(self.stiffness_limit_n_m);
        Charge { stiffness_n_m, tissue_w: loads.tissue_power(p) }
    }

    /// −Σ b n n·(v − v_s) over the planes that load the tip, limited to the damping that the device can
    /// render. It never exceeds the elastic force, so it neither pulls nor jumps at touch.
    fn damping(
        &self,
        state: &DeviceState,
        loads: &PlaneLoads,
        p: &Vector3<f64>,
        elastic_n: f64,
    ) -> Vector3<f64> {
        let (mut force, mut total) = (Vector3::zeros(), 0.0);
        for load in loads.iter().filter(|load| load.acts(p)) {
            let approach = load.normal.dot(&(state.velocity_m_s - load.surface_velocity_m_s));
            force -= load.damping_ns_m * approach * load.normal;
            total += load.damping_ns_m;
        }
        if total > self.damping_limit_ns_m {
            force *= self.damping_limit_ns_m / total;
        }
        let norm = force.norm();
        if norm > elastic_n { force * (elastic_n / norm) } else { force }
    }
}

/// K_vc of the derivation; `None` for a rigid coupling.
fn coupling_stiffness(tissue_n_m: f64, limit_n_m: f64) -> Option<f64> {
    (tissue_n_m > limit_n_m).then(|| 1.0 / (1.0 / limit_n_m - 1.0 / tissue_n_m))
}

/// Position of the proxy [m].
fn balance(device_m: &Vector3<f64>, k_vc: f64, loads: &PlaneLoads) -> Vector3<f64> {
    let mut p = *device_m;
    for _ in 0..MAX_ROUNDS {
        let mut gradient = k_vc * (device_m - p);
        let mut hessian = Matrix3::identity() * k_vc;
        for load in loads.iter().filter(|load| load.acts(&p)) {
            gradient += load.at(&p) * load.normal;
            hessian += load.stiffness_n_m * load.normal * load.normal.transpose();
        }
        let Some(step) = hessian.cholesky().map(|factor| factor.solve(&gradient)) else { return p };
        p += step;
        if step.norm_squared() < 1e-20 {
            break;
        }
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law::ContactLaw;
    use crate::contact::model::{ContactModel, ContactPlane};
    use crate::device::ToolMode;
    use crate::device::simulated::CAPABILITY;

    fn loads(planes: &[ContactPlane]) -> PlaneLoads {
        let mut model = ContactModel { seq: 1, plane_count: planes.len(), ..ContactModel::NONE };
        model.planes[..planes.len()].copy_from_slice(planes);
        ContactLaw::default().loads(&model, &Vector3::zeros(), 0)
    }

    fn wall(normal: Vector3<f64>, stiffness_n_m: f64) -> ContactPlane {
        ContactPlane { normal, stiffness_n_m, ..ContactPlane::NONE }
    }

    fn at(position_m: Vector3<f64>, velocity_m_s: Vector3<f64>) -> DeviceState {
        DeviceState { position_m, velocity_m_s, orientation: [0.0, 0.0, 0.0, 1.0], mode: ToolMode::Touch }
    }

    #[test]
    fn the_limit_is_the_passivity_bound() {
        let device = Capability { damping_ns_m: 4.0, latency_s: 0.0, max_stiffness_n_m: 1e9, ..CAPABILITY };
        assert!((VirtualCoupling::new(&device).stiffness_limit_n_m - 2.0 * (4.0 - 1.0) / 1e-3).abs() < 1e-9);
        let late = Capability { latency_s: 0.5e-3, ..device };
        assert!((VirtualCoupling::new(&late).stiffness_limit_n_m - 3000.0).abs() < 1e-9);
        let soft = Capability { max_stiffness_n_m: 400.0, ..device };
        assert_eq!(VirtualCoupling::new(&soft).stiffness_limit_n_m, 400.0);
    }

    #[test]
    fn soft_tissue_passes_undistorted_and_stiff_tissue_is_limited() {
        let coupling = VirtualCoupling { stiffness_limit_n_m: 1000.0, damping_limit_ns_m: 1.0 };
        let state = at(Vector3::new(0.0, 0.0, -0.001), Vector3::zeros());
        let force = |k, advice| coupling.force(&state, &loads(&[wall(Vector3::z(), k)]), advice).z;
        assert!((force(300.0, f64::INFINITY) - 0.3).abs() < 1e-12);
        assert!((force(1e5, f64::INFINITY) - 1.0).abs() < 1e-9);
        assert!((force(1e5, 250.0) - 0.25).abs() < 1e-9);
    }

    #[test]
    fn in_a_corner_every_direction_is_limited() {
        let coupling = VirtualCoupling { stiffness_limit_n_m: 500.0, damping_limit_ns_m: 1.0 };
        let tilted = Vector3::new(0.6, 0.0, 0.8);
        let corner = loads(&[wall(Vector3::z(), 4e3), wall(tilted, 4e3), wall(Vector3::x(), 4e3)]);
        let depth = 0.002;
        for direction in [Vector3::z(), Vector3::x(), tilted, Vector3::new(0.7, 0.0, 0.7).normalize()] {
            let force = coupling.force(&at(-depth * direction, Vector3::zeros()), &corner, f64::INFINITY);
            assert!(force.norm() <= 500.0 * depth * (1.0 + 1e-9), "{direction} {force}");
            assert!(force.dot(&direction) > 0.0);
        }
    }

    #[test]
    fn damping_is_limited_and_never_pulls() {
        let coupling = VirtualCoupling { stiffness_limit_n_m: 1000.0, damping_limit_ns_m: 1.0 };
        let damped = ContactPlane { damping_ns_m: 50.0, force_n: 0.5, ..wall(Vector3::z(), 100.0) };
        let force = |v: f64| {
            coupling
                .force(&at(Vector3::zeros(), Vector3::new(0.0, 0.0, v)), &loads(&[damped]), f64::INFINITY)
                .z
        };
        assert!((force(-0.1) - 0.6).abs() < 1e-12);
        assert_eq!(force(10.0), 0.0);
        assert!((force(-10.0) - 1.0).abs() < 1e-12);
        assert_eq!(
            coupling.force(&at(Vector3::z(), -Vector3::z()), &loads(&[damped]), f64::INFINITY),
            Vector3::zeros()
        );
    }
}
