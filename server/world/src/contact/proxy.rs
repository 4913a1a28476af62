//! The proxy (god-object) is the pose to which the tissue restricts a tool. The device is at the pose of the
//! hand.
//!
//! A proxy only moves along swept paths, so it cannot pass through a surface, however far the hand jumps.
//! First a surface that moves onto it carries it along. Then it goes towards the device, stops at the first
//! impact and slides along the planes it touches.
//!
//! # Source
//! Zilles and Salisbury, A constraint-based god-object method for haptic display (1995); for
//! shapes with volume Ruspini, Kolarov and Khatib, The haptic display of complex graphical
//! environments (1997).

use nalgebra::{Isometry3, Translation3, Vector3};
use scindo_collision::{Capsule, CapsuleMotion, Impact, SWEEP_TOLERANCE_M, SurfaceBvh};

use crate::contact::surface::ContactSurface;
use crate::inputs::ToolShape;
use crate::tool::geometry::{capsule, core, core_radius};

/// Most sweeps per tick on the way to the device, each ending in a stop or a slide.
const MAX_SLIDES: usize = 10;
/// Most sweeps per tick while surfaces move over the resting proxy.
const MAX_CARRIES: usize = 4;
/// Most corrections per tick of remaining overlap.
const MAX_PUSHES: usize = 8;
/// Largest rotation of one sweep [rad]. The ends of the core move on chords, not arcs.
const MAX_TURN_RAD: f64 = 0.1;
/// Most sweeps spent on one tick's rotation.
const MAX_TURNS: usize = 32;
/// Points of the core that are tested for lying inside a body.
const INSIDE_SAMPLES: usize = 5;

/// A plane the proxy touches while it slides.
#[derive(Debug, Clone, Copy)]
struct Touched {
    normal: Vector3<f64>,
    parameter: f64,
}

/// Pose of a tool that never enters a body.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Proxy {
    pose: Isometry3<f64>,
    engaged: bool,
}

impl Default for Proxy {
    fn default() -> Self {
        Self { pose: Isometry3::identity(), engaged: false }
    }
}

impl Proxy {
    /// Tool axes to world axes.
    pub fn pose(&self) -> &Isometry3<f64> {
        &self.pose
    }

    /// Puts the proxy at the pose of the device, even inside tissue. The next [`follow`](Self::follow) starts
    /// from there, and pushes the proxy out of any tissue it is in.
    pub fn release(&mut self, device: &Isometry3<f64>) {
        self.pose = *device;
        self.engaged = false;
    }

    /// Takes over the pose of another proxy that has met the same surfaces.
    pub fn seat(&mut self, pose: &Isometry3<f64>) {
        self.pose = *pose;
        self.engaged = true;
    }

    /// Moves with surfaces that passed over the resting proxy in their last motion. Must be called once per
    /// motion, before [`follow`](Self::follow).
    pub fn ride(&mut self, shape: ToolShape, surfaces: &[ContactSurface]) {
        if self.engaged {
            self.carry(shape, surfaces);
        }
    }

    /// Moves the proxy towards `device` as far as the surfaces let it.
    pub fn follow(&mut self, shape: ToolShape, device: &Isometry3<f64>, surfaces: &[ContactSurface]) {
        if !self.engaged {
            self.pose = *device;
            self.engaged = true;
            self.push_out(shape, surfaces);
            return;
        }
        self.push_out(shape, surfaces);
        let turn = self.pose.rotation.angle_to(&device.rotation);
        let turns = ((turn / MAX_TURN_RAD).ceil() as usize).clamp(1, MAX_TURNS);
        let start = self.pose;
        for i in 1..=turns {
            let goal = between(&start, device, i as f64 / turns as f64);
            self.slide(shape, &goal, surfaces);
        }
    }

    fn carry(&mut self, shape: ToolShape, surfaces: &[ContactSurface]) {
        let start = core(shape, &self.pose);
        let mut push = Vector3::zeros();
        for _ in 0..MAX_CARRIES {
            let motion = CapsuleMotion { start, end: start.map(|p| p + push), radius: core_radius(shape) };
            let Some((tree, impact)) = first_impact(surfaces, |tree| tree.sweep_moving(&motion)) else {
                break;
            };
            let before = weighted(&tree.previous_triangle(impact.triangle), &impact);
            let after = weighted(&tree.triangle(impact.triangle), &impact);
            // Compensate how far the surface still advances relative to the proxy after the impact.
            let gain = impact.normal.dot(&(after - before - push)) * (1.0 - impact.time);
            push += impact.normal * (gain.max(0.0) + SWEEP_TOLERANCE_M);
        }
        self.pose.translation.vector += push;
    }

    /// Moves towards `goal`, stops at impacts and slides along touched planes.
    fn slide(&mut self, shape: ToolShape, goal: &Isometry3<f64>, surfaces: &[ContactSurface]) {
        let mut touched = [None; 4];
        let mut count = 0;
        for _ in 0..MAX_SLIDES {
            let target = along_planes(shape, &self.pose, goal, &touched);
            let motion = CapsuleMotion {
                start: core(shape, &self.pose),
                end: core(shape, &target),
                radius: core_radius(shape),
            };
            match first_impact(surfaces, |tree| tree.sweep(&motion)) {
                None => {
                    let moved = distance(shape, &self.pose, &target);
                    self.pose = target;
                    if count == 0 || moved < SWEEP_TOLERANCE_M {
                        return;
                    }
                    // Past the corner, go straight to the goal again.
                    touched = [None; 4];
                    count = 0;
                }
                Some((_, impact)) => {
                    self.pose = between(&self.pose, &target, impact.time);
                    let plane = Touched { normal: impact.normal, parameter: impact.parameter };
                    touched[count % touched.len()] = Some(plane);
                    count += 1;
                }
            }
        }
    }

    /// Moves the proxy out of remaining overlap: at its start, after a cut, or where surfaces close in from
    /// several sides.
    fn push_out(&mut self, shape: ToolShape, surfaces: &[ContactSurface]) {
        for _ in 0..MAX_PUSHES {
            let body = capsule(shape, &self.pose);
            let Some(push) =
                surfaces.iter().filter_map(ContactSurface::tree).find_map(|tree| overlap(tree, &body))
            else {
                return;
            };
            self.pose.translation.vector += push;
        }
    }
}

/// The displacement that takes a capsule out of a surface; `None` if they do not overlap.
fn overlap(tree: &SurfaceBvh, capsule: &Capsule) -> Option<Vector3<f64>> {
    let [lower, upper] = tree.bounds()?;
    let in_box = |p: &Vector3<f64>| (0..3).all(|i| p[i] >= lower[i] && p[i] <= upper[i]);
    let samples = if capsule.core[0] == capsule.core[1] { 1 } else { INSIDE_SAMPLES };
    let deepest = (0..samples)
        .map(|i| capsule.core_point(i as f64 / (samples.max(2) - 1) as f64))
        .filter(|p| in_box(p) && tree.contains(*p))
        .filter_map(|p| Some((p, tree.closest_point(p, (upper - lower).norm())?)))
        .map(|(p, closest)| (closest.point - p, closest.normal))
        .max_by(|a, b| a.0.norm_squared().total_cmp(&b.0.norm_squared()));
    if let Some((out, normal)) = deepest {
        let direction = out.try_normalize(SWEEP_TOLERANCE_M).unwrap_or(normal);
        return Some(out + direction * (capsule.radius + 0.5 * SWEEP_TOLERANCE_M));
    }
    let near = tree.closest_triangle(capsule, 0.0)?;
    let shallow = capsule.radius - near.distance;
    let away = near.closest.on_segment - near.closest.on_triangle;
    let direction =
        away.try_normalize(1e-12).unwrap_or_else(|| tree.normal_at(near.triangle, near.closest.barycentric));
    (shallow > SWEEP_TOLERANCE_M).then(|| direction * (shallow + 0.5 * SWEEP_TOLERANCE_M))
}

/// The goal, moved so that no touched point of the tool enters its plane.
fn along_planes(
    shape: ToolShape,
    pose: &Isometry3<f64>,
    goal: &Isometry3<f64>,
    touched: &[Option<Touched>],
) -> Isometry3<f64> {
    let mut target = *goal;
    let from = core(shape, pose);
    // Several rounds, since leaving one plane may enter another.
    for _ in 0..8 {
        let mut inside = false;
        for plane in touched.iter().flatten() {
            let to = core(shape, &target);
            let step = |i: usize| plane.normal.dot(&(to[i] - from[i]));
            let into = step(0) * (1.0 - plane.parameter) + step(1) * plane.parameter;
            if into < 0.0 {
                target.translation.vector -= plane.normal * into;
                inside |= into < -1e-12;
            }
        }
        if !inside {
            break;
        }
    }
    target
}

/// The earliest impact over all surfaces.
fn first_impact(
    surfaces: &[ContactSurface],
    sweep: impl Fn(&SurfaceBvh) -> Option<Impact>,
) -> Option<(&SurfaceBvh, Impact)> {
    surfaces
        .iter()
        .filter_map(ContactSurface::tree)
        .filter_map(|tree| Some((tree, sweep(tree)?)))
        .min_by(|a, b| a.1.time.total_cmp(&b.1.time))
}

fn weighted(triangle: &[Vector3<f64>; 3], impact: &Impact) -> Vector3<f64> {
    scindo_collision::barycentric_point(triangle, impact.barycentric)
}

/// Largest movement of an end of the core [m].
fn distance(shape: ToolShape, from: &Isometry3<f64>, to: &Isometry3<f64>) -> f64 {
    let (from, to) = (core(shape, from), core(shape, to));
    (to[0] - from[0]).norm().max((to[1] - from[1]).norm())
}

/// Interpolates a pose: the tip moves straight, the orientation along the shortest rotation.
fn between(from: &Isometry3<f64>, to: &Isometry3<f64>, s: f64) -> Isometry3<f64> {
    let tip = from.translation.vector.lerp(&to.translation.vector, s);
    let rotation = from.rotation.try_slerp(&to.rotation, s, 1e-12).unwrap_or(to.rotation);
    Isometry3::from_parts(Translation3::from(tip), rotation)
}
