//! Dry friction between a tool that presses and the tissue.
//!
//! Every point of the stencil with which a tool bears carries a stretch s [m] across the normal n: how far the place to
//! which the tissue sticks has gone ahead of the tissue. In a step the tool moves by Δ, so the solve starts from
//! s + (I − n nᵀ) Δ. It answers with f_t = k_t s on the tissue, at most μ f_n. Afterwards s = f_t / k_t: it stays where
//! the tissue sticks, and is dragged along where it slips. The tissue under the points is found anew in every step, so
//! the stretch belongs to the point on the tool.

use nalgebra::{Isometry3, Vector3};

use crate::contact::rings::MAX_POINTS;
use crate::inputs::ToolShape;
use crate::tool::geometry::capsule;

/// Friction under one capsule of a tool, kept from step to step.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub struct Rub {
    points: [RubPoint; MAX_POINTS],
    /// Where the hand held the tool in the last step; `None` before a first touch.
    device: Option<Isometry3<f64>>,
}

/// Friction at one point of the stencil.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct RubPoint {
    /// s [m].
    stretch_m: Vector3<f64>,
    /// μ f_n of the last step [N].
    grip_n: f64,
    /// What the springs of the present step gave.
    sums: Sums,
}

/// Sums over the springs at one point.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct Sums {
    /// Force on the tissue across the normal [N].
    across_n: Vector3<f64>,
    /// Force on the tissue along the normal [N].
    push_n: f64,
    /// Stiffness [N/m].
    stiffness_n_m: f64,
}

/// What a spring needs to know about friction.
#[derive(Debug, Clone, Copy)]
pub struct Roughness {
    /// μ.
    pub friction: f64,
    /// s at the start of the step [m].
    pub stretch_m: Vector3<f64>,
    /// Bound of the force with which the solve begins [N].
    pub grip_n: f64,
    /// Number of the point in the stencil.
    pub point: u8,
}

impl Rub {
    /// Follows the hand to `device`. `parameter` is the touched place along the core of the tool.
    pub fn follow(
        &mut self,
        shape: ToolShape,
        device: &Isometry3<f64>,
        parameter: f64,
        normal: &Vector3<f64>,
    ) {
        let place = |pose: &Isometry3<f64>| capsule(shape, pose).core_point(parameter);
        let moved = self.device.map_or_else(Vector3::zeros, |before| place(device) - place(&before));
        for point in &mut self.points {
            let stretch = point.stretch_m + moved;
            point.stretch_m = stretch - normal * normal.dot(&stretch);
            point.sums = Sums::default();
        }
        self.device = Some(*device);
    }

    /// For the springs at point `point` in this step.
    pub fn roughness(&self, friction: f64, point: u8) -> Roughness {
        let RubPoint { stretch_m, grip_n, .. } = self.points[usize::from(point)];
        Roughness { friction, stretch_m, grip_n, point }
    }

    /// Adds a spring at point `point`: its force on the tissue [N] and its stiffness [N/m].
    pub fn add(&mut self, point: u8, force: &Vector3<f64>, normal: &Vector3<f64>, stiffness_n_m: f64) {
        let sums = &mut self.points[usize::from(point)].sums;
        let push = force.dot(normal);
        sums.across_n += force - push * normal;
        sums.push_n += push;
        sums.stiffness_n_m += stiffness_n_m;
    }

    /// Friction on the tissue in this step [N].
    pub fn force_n(&self) -> Vector3<f64> {
        self.points.iter().map(|point| point.sums.across_n).sum()
    }

    /// Drags the places to which tissue sticks along where it slipped. A point that did not bear follows the others.
    pub fn settle(&mut self, friction: f64) {
        let stiffness: f64 = self.points.iter().map(|point| point.sums.stiffness_n_m).sum();
        if stiffness <= 0.0 {
            return;
        }
        let mean = self.force_n() / stiffness;
        for point in &mut self.points {
            let bears = point.sums.stiffness_n_m > 0.0;
            point.stretch_m = if bears { point.sums.across_n / point.sums.stiffness_n_m } else { mean };
            point.grip_n = friction * point.sums.push_n.max(0.0);
        }
    }
}
