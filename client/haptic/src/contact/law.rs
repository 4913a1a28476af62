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
//! If the message names the stiffness that is left when the tissue has followed, the force answers the whole
//! way of the tip since the pose used ([`relaxation`](super::relaxation)). Held tissue pulls back along three axes,
//! each on both sides. Where the plane names a coefficient of friction the tissue sticks and slips across the normal
//! ([`friction`](super::friction)).
//!
//! Several planes meet in two ways. Those that push by themselves add up: together they hold a tool in a groove from
//! both sides. An edge ends the tissue under another plane, and takes its load away as the tool passes beyond.
//!
//! # Turning
//! A shaft or a blade touches at an arm a = point − tip. A small turn θ of the tool since the pose used moves the place
//! of contact by θ × a, which loads the plane as if the tip had gone that way; a ball, whose arm lies along the normal,
//! is not loaded by it. The force has the torque a × f about the tip.
//!
//! # Source
//! The message `scindo.v1.Contact` (`proto/scindo/v1/tool.proto`).

use super::friction::{Start, friction};
use super::history::TipHistory;
use super::load::PlaneLoad;
use super::model::{ContactModel, ContactPlane};
use super::relaxation::{Response, Used};
use crate::constants::{EXTRAPOLATION_STEPS, MAX_EXTRAPOLATION_S, PATCH_FADE};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use scindo_proto::limits::MAX_CONTACTS;

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

    /// Sum of the friction [N] under the loads with the tip at `p`.
    pub fn friction_at(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let share = |load: &PlaneLoad| load.friction_n.cap_magnitude(load.friction * load.at(p).max(0.0));
        self.iter().filter(|load| load.friction > 0.0).map(share).sum()
    }

    /// Torque about a tip at `p` [N·m].
    pub fn torque_at(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let of = |load: &PlaneLoad| {
            let along = load.at(p);
            let across = load.friction_n.cap_magnitude(load.friction * along.max(0.0));
            load.arm_m.cross(&(along * load.normal + across))
        };
        self.iter().map(of).sum()
    }

    /// Stiffness along the unit vector `along` with the tip at `p` [N/m].
    pub fn stiffness_along(&self, p: &Vector3<f64>, along: &Vector3<f64>) -> f64 {
        let share = |load: &PlaneLoad| load.stiffness_n_m * load.normal.dot(along).powi(2);
        self.iter().filter(|load| load.acts(p)).map(share).sum()
    }

    /// Power with which the surfaces that load the tip at `p` push it by their own motion [W].
    pub fn tissue_power(&self, p: &Vector3<f64>) -> f64 {
        let pushes = |load: &PlaneLoad| load.at(p) * load.normal.dot(&load.surface_velocity_m_s);
        self.iter().filter(|load| load.acts(p)).map(pushes).sum()
    }

    /// Upper bound of the stiffness in any direction: the trace of Σ k n nᵀ [N/m].
    pub fn stiffness_bound(&self) -> f64 {
        self.iter().map(|load| load.stiffness_n_m).sum()
    }
}

/// Evaluates models. It remembers the length of a simulation step, which sets the horizon, and the way of the
/// tip.
#[derive(Debug, Clone)]
pub struct ContactLaw {
    horizon_s: f64,
    last_step: (u64, f64),
    history: TipHistory,
    /// Stiffness across a plane that the device can render [N/m].
    stiffest_n_m: f64,
    /// Tool axes to world axes.
    turn: UnitQuaternion<f64>,
}

impl Default for ContactLaw {
    fn default() -> Self {
        Self::new(f64::INFINITY)
    }
}

impl ContactLaw {
    /// A law for a device that renders this stiffness at most [N/m].
    pub fn new(stiffest_n_m: f64) -> Self {
        Self {
            horizon_s: MAX_EXTRAPOLATION_S,
            last_step: (0, 0.0),
            history: TipHistory::default(),
            stiffest_n_m,
            turn: UnitQuaternion::identity(),
        }
    }

    /// Turns the tool to the orientation x, y, z, w of the device, a unit quaternion from tool axes to world axes. Another
    /// one is ignored.
    pub fn turn_to(&mut self, [x, y, z, w]: [f64; 4]) {
        let q = Quaternion::new(w, x, y, z);
        if (q.norm() - 1.0).abs() < 0.1 {
            self.turn = UnitQuaternion::new_normalize(q);
        }
    }

    /// Loads on a tip near `tip_m` at loop time `now_ns`. Must be called once per tick.
    pub fn loads(&mut self, model: &ContactModel, tip_m: &Vector3<f64>, now_ns: u64) -> PlaneLoads {
        self.observe_step(model);
        let age_s = (model.age_ns(now_ns) as f64 * 1e-9).min(self.horizon_s);
        let mut out = PlaneLoads { loads: [NO_LOAD; MAX_CONTACTS], count: 0 };
        for (number, plane) in model.planes().iter().enumerate().filter(|(_, plane)| plane.edge_of.is_none())
        {
            let share = share_of_edges(model, number, tip_m);
            for plane in axes(plane, model.holds).into_iter().flatten() {
                if let Some(slot) = out.loads.get_mut(out.count) {
                    *slot = self.load(&plane, (model, share), tip_m, age_s);
                    out.count += 1;
                }
            }
        }
        self.history.record(now_ns, *tip_m);
        out
    }

    fn load(
        &self,
        plane: &ContactPlane,
        (model, share): (&ContactModel, f64),
        tip_m: &Vector3<f64>,
        age_s: f64,
    ) -> PlaneLoad {
        let n = plane.normal;
        let moved = plane.surface_velocity_m_s * age_s;
        let weight = share * patch_weight(plane, &(tip_m - moved));
        let turn = self.turn_since(model);
        let arm_m = plane.point_m - model.tip_used_m;
        let two_sided = model.holds && plane.stiffness_n_m > 0.0;
        let answer = match model.used_ns {
            Some(at_ns) if plane.relaxed_stiffness_n_m > 0.0 => {
                let used = Used { tip_m: model.tip_used_m + moved, at_ns, held_ns: model.held_ns };
                Response::along(plane, &used, two_sided, &self.history)
            }
            _ => Response {
                offset_n: plane.force_n + plane.stiffness_n_m * n.dot(&(model.tip_used_m + moved)),
                stiffness_n_m: plane.stiffness_n_m,
            },
        };
        let turned = answer.stiffness_n_m * n.dot(&turn.cross(&arm_m));
        let mut load = PlaneLoad {
            normal: n,
            offset_n: weight * (answer.offset_n - turned),
            stiffness_n_m: weight * answer.stiffness_n_m,
            damping_ns_m: weight * plane.damping_ns_m,
            surface_velocity_m_s: plane.surface_velocity_m_s,
            two_sided,
            friction: if two_sided { 0.0 } else { plane.friction },
            friction_n: Vector3::zeros(),
            arm_m: plane.point_m + moved - tip_m,
        };
        if load.friction > 0.0 {
            let start = Start { tip_m: model.tip_used_m, at_ns: model.used_ns };
            let stiffest = self.stiffest_n_m.min(model.max_stiffness_n_m);
            load.friction_n = friction(plane, &load, stiffest, &start, &self.history, tip_m);
        }
        load
    }

    /// Small rotation vector of the tool since the pose of the model [rad].
    fn turn_since(&self, model: &ContactModel) -> Vector3<f64> {
        let turn = (self.turn * model.turn_used.inverse()).scaled_axis();
        turn.cap_magnitude(MAX_TURN_RAD)
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

/// Turn since the pose of a model up to which the places of contact are followed [rad].
const MAX_TURN_RAD: f64 = 0.5;

/// Part of the load of plane `number` that the edges of its tissue leave with the tip at `tip_m`.
fn share_of_edges(model: &ContactModel, number: usize, tip_m: &Vector3<f64>) -> f64 {
    let moved = tip_m - model.tip_used_m;
    let edges = model.planes().iter().filter(|plane| plane.edge_of == Some(number));
    edges.map(|edge| edge.edge_share(&moved)).product()
}

/// A load that does nothing.
const NO_LOAD: PlaneLoad = PlaneLoad {
    normal: Vector3::new(0.0, 0.0, 1.0),
    offset_n: 0.0,
    stiffness_n_m: 0.0,
    damping_ns_m: 0.0,
    surface_velocity_m_s: Vector3::new(0.0, 0.0, 0.0),
    two_sided: false,
    friction: 0.0,
    friction_n: Vector3::new(0.0, 0.0, 0.0),
    arm_m: Vector3::new(0.0, 0.0, 0.0),
};

/// The plane itself, and the two axes across it if it holds.
fn axes(plane: &ContactPlane, holds: bool) -> [Option<ContactPlane>; 3] {
    if !holds || plane.tangential_stiffness_n_m <= 0.0 {
        return [Some(*plane), None, None];
    }
    let n = plane.normal;
    let side = Vector3::ith(n.iamin(), 1.0);
    let first = (side - n * n.dot(&side)).normalize();
    let share = plane.tangential_stiffness_n_m / plane.stiffness_n_m.max(f64::MIN_POSITIVE);
    let across = |normal: Vector3<f64>| ContactPlane {
        normal,
        force_n: plane.tangential_n.dot(&normal),
        stiffness_n_m: plane.tangential_stiffness_n_m,
        instant_stiffness_n_m: share * plane.instant_stiffness_n_m,
        relaxed_stiffness_n_m: share * plane.relaxed_stiffness_n_m,
        ..*plane
    };
    [Some(*plane), Some(across(first)), Some(across(n.cross(&first)))]
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
    fn held_tissue_pulls_back_in_every_direction() {
        let held = ContactPlane {
            force_n: 0.5,
            tangential_n: Vector3::x() * 0.1,
            tangential_stiffness_n_m: 100.0,
            ..plane()
        };
        let model = ContactModel { holds: true, ..model(&[held]) };
        let force = |tip: Vector3<f64>| ContactLaw::default().loads(&model, &tip, 0).force_at(&tip);
        let rest = force(Vector3::zeros());
        assert!((rest - Vector3::new(0.1, 0.0, 0.5)).norm() < 1e-12, "{rest}");
        for tip in [Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::x(), -Vector3::y(), -Vector3::z()] {
            let back = force(tip * 0.01) - rest;
            let k = if tip.z == 0.0 { 100.0 } else { 200.0 };
            assert!((back + k * 0.01 * tip).norm() < 1e-12, "{tip} {back}");
        }
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
    fn a_groove_holds_from_both_sides() {
        let side = |x: f64| ContactPlane { normal: Vector3::x() * x, force_n: 0.0, ..plane() };
        let loads =
            ContactLaw::default().loads(&model(&[plane(), side(1.0), side(-1.0)]), &Vector3::zeros(), 0);
        assert_eq!(loads.force_at(&Vector3::zeros()), Vector3::z());
        for x in [-0.002, 0.003] {
            let force = loads.force_at(&Vector3::new(x, 0.0, 0.0));
            assert!((force - Vector3::new(-200.0 * x, 0.0, 1.0)).norm() < 1e-12, "{x} {force}");
        }
    }

    #[test]
    fn tissue_ends_at_its_edge() {
        // The tool lies 1 mm before the edge, and the load falls to zero 2 mm beyond where it begins to fall.
        let edge = ContactPlane {
            normal: Vector3::x(),
            gap_m: -0.003,
            patch_radius_m: 0.002,
            edge_of: Some(0),
            ..ContactPlane::NONE
        };
        let model = model(&[plane(), edge]);
        let force = |x: f64| {
            let tip = Vector3::new(x, 0.0, 0.0);
            ContactLaw::default().loads(&model, &tip, 0).force_at(&tip)
        };
        for (x, share) in [(-0.01, 1.0), (0.0, 1.0), (0.001, 1.0), (0.002, 0.5), (0.003, 0.0), (0.01, 0.0)] {
            assert!((force(x) - Vector3::z() * share).norm() < 1e-9, "{x} {}", force(x));
        }
    }

    #[test]
    fn a_shaft_that_turns_presses_with_its_arm_and_a_ball_does_not() {
        let arm = Vector3::new(0.05, 0.0, -0.004);
        let touch = |point_m| model(&[ContactPlane { point_m, ..plane() }]);
        let turned = |angle: f64, point_m: Vector3<f64>| {
            let mut law = ContactLaw::default();
            let turn = UnitQuaternion::new(Vector3::y() * angle);
            law.turn_to([turn.i, turn.j, turn.k, turn.w]);
            let loads = law.loads(&touch(point_m), &Vector3::zeros(), 0);
            (loads.force_at(&Vector3::zeros()), loads.torque_at(&Vector3::zeros()))
        };
        // The place of contact goes down by 0.02 · 5 cm, into the tissue.
        let (force, torque) = turned(0.02, arm);
        assert!((force.z - (1.0 + 200.0 * 0.02 * 0.05)).abs() < 1e-12, "{force}");
        assert!((torque - arm.cross(&force)).norm() < 1e-12 && torque.y < -0.05, "{torque}");
        let (force, torque) = turned(0.3, Vector3::z() * -0.004);
        assert!((force - Vector3::z()).norm() < 1e-12 && torque.norm() < 1e-12, "{force} {torque}");
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
