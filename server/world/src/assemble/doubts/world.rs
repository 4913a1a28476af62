//! Doubts about the scene as a whole: nothing in it, steps that are too long, gravity in other units.

use super::longest_side;
use crate::body::SimBody;
use crate::quantity::{digits, duration, length};
use crate::scene::CheckedScene;
use crate::scene::raw::RawIntegrator;

/// Gravity above this [m/s²] is hardly in m/s²: that of Jupiter is 25.
const GRAVITY: f64 = 50.0;
/// Longer steps [s] show a motion as single pictures.
const LONG_STEP_S: f64 = 0.1;
/// Rayleigh damping that delays every deformation by more than this [s].
const SLUGGISH_S: f64 = 1.0;
/// A hand moves no faster than this [m/s].
const FAST_TOOL: f64 = 5.0;

/// Doubts that concern no single body.
pub(super) fn doubts(scene: &CheckedScene, bodies: &[SimBody], doubts: &mut Vec<String>) {
    if scene.bodies.is_empty() {
        doubts.push("the scene has no body: nothing deforms; add a [[body]]".into());
    }
    let g = scene.gravity_m_s2.norm();
    if g > GRAVITY {
        doubts.push(format!(
            "world.gravity_m_s2: {} m/s² is {} times that of the Earth; was it given in mm/s²?",
            digits(g),
            digits(g / 9.81)
        ));
    }
    step(scene, bodies, doubts);
    for body in &scene.bodies {
        if body.damping_stiffness_s > SLUGGISH_S {
            doubts.push(format!(
                "body.{}.rayleigh.stiffness_s: damping delays every deformation by {}; 0.001 to 0.05 s suits tissue",
                body.id,
                duration(body.damping_stiffness_s)
            ));
        }
    }
    for tool in &scene.tools {
        let speed = |pair: &[crate::scene::PathPoint]| {
            (pair[1].tip_m - pair[0].tip_m).norm() / (pair[1].at_s - pair[0].at_s)
        };
        let fastest = tool.path.windows(2).map(speed).fold(0.0, f64::max);
        if fastest > FAST_TOOL {
            doubts.push(format!(
                "tool.{}.path: the tip moves at {} m/s, a hand at 1 m/s at most; are tip_m in metres and at_s in seconds?",
                tool.id,
                digits(fastest)
            ));
        }
    }
}

/// A step in which a body falls through its own length, or that is far from what an eye follows.
fn step(scene: &CheckedScene, bodies: &[SimBody], doubts: &mut Vec<String>) {
    let moving = scene
        .bodies
        .iter()
        .zip(bodies)
        .filter(|(spec, _)| spec.mechanics.integrator != RawIntegrator::Static);
    let smallest_m = moving.map(|(_, body)| longest_side(body)).fold(f64::INFINITY, f64::min);
    if !smallest_m.is_finite() {
        return;
    }
    let (h, g) = (scene.step_s, scene.gravity_m_s2.norm());
    let fallen_m = 0.5 * g * h * h;
    if fallen_m > 0.5 * smallest_m {
        doubts.push(format!(
            "world.step_s: in one step of {} gravity moves a body by {}, which is {} long; write 0.005 to 0.04",
            duration(h),
            length(fallen_m),
            length(smallest_m)
        ));
    } else if h > LONG_STEP_S {
        doubts.push(format!(
            "world.step_s: a step of {} makes the motion jump between pictures and damps it away; write 0.005 to 0.04",
            duration(h)
        ));
    }
}
