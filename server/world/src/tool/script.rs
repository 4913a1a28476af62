//! A tool moved by the keyframes of a scene instead of a hand.
//!
//! Tip positions are interpolated per axis by cubic Hermite polynomials. Their slopes are the weighted
//! harmonic means of the neighbouring differences, so the path is smooth and never overshoots a keyframe.
//!
//! # Source
//! Fritsch and Butland, A method for constructing local monotone piecewise cubic interpolants
//! (1984).

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::inputs::ToolMode;
use crate::scene::checked::PathPoint;

/// Pose and mode of a scripted tool at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScriptedPose {
    /// Tool axes to world axes.
    pub pose: Isometry3<f64>,
    /// Mode of the keyframe in force.
    pub mode: ToolMode,
    /// Number of completed rounds. The pose jumps when it rises.
    pub round: u64,
}

/// Keyframes by ascending time.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Script {
    path: Vec<PathPoint>,
    repeat_s: Option<f64>,
}

impl Script {
    /// A script; `None` without keyframes. It restarts every `repeat_s` [s], if given.
    pub fn new(path: &[PathPoint], repeat_s: Option<f64>) -> Option<Self> {
        (!path.is_empty()).then(|| Self { path: path.to_vec(), repeat_s })
    }

    /// Pose and mode at simulated time `time_s` [s]. Before the first keyframe the tool hovers at it. After
    /// the last it stays there.
    pub fn at(&self, time_s: f64) -> ScriptedPose {
        let (time_s, round) = match self.repeat_s {
            Some(period) if period > 0.0 => (time_s.rem_euclid(period), (time_s / period) as u64),
            _ => (time_s, 0),
        };
        let next = self.path.partition_point(|key| key.at_s <= time_s);
        if next == 0 {
            let first = &self.path[0];
            return posed(first.tip_m, rotation(first), ToolMode::Hover, round);
        }
        let from = &self.path[next - 1];
        let Some(to) = self.path.get(next) else {
            return posed(from.tip_m, rotation(from), from.mode, round);
        };
        let span = to.at_s - from.at_s;
        let s = ((time_s - from.at_s) / span).clamp(0.0, 1.0);
        let (m0, m1) = (self.slope(next - 1) * span, self.slope(next) * span);
        let tip = hermite(from.tip_m, m0, to.tip_m, m1, s);
        let turned = if from.across.is_some() || to.across.is_some() {
            let (from, to) = (rotation(from), rotation(to));
            from.try_slerp(&to, s, 1e-9).unwrap_or(to)
        } else {
            shaft_along(from.toward.slerp(&to.toward, s).into_inner())
        };
        posed(tip, turned, from.mode, round)
    }

    /// Velocity of the tip at keyframe `i` [m/s]; zero at both ends.
    fn slope(&self, i: usize) -> Vector3<f64> {
        if i == 0 || i + 1 >= self.path.len() {
            return Vector3::zeros();
        }
        let [a, b, c] = [&self.path[i - 1], &self.path[i], &self.path[i + 1]];
        let (h0, h1) = (b.at_s - a.at_s, c.at_s - b.at_s);
        let (d0, d1) = ((b.tip_m - a.tip_m) / h0, (c.tip_m - b.tip_m) / h1);
        d0.zip_map(&d1, |d0, d1| {
            if d0 * d1 <= 0.0 {
                return 0.0;
            }
            let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
            (w0 + w1) / (w0 / d0 + w1 / d1)
        })
    }
}

fn hermite(p0: Vector3<f64>, m0: Vector3<f64>, p1: Vector3<f64>, m1: Vector3<f64>, s: f64) -> Vector3<f64> {
    let (s2, s3) = (s * s, s * s * s);
    p0 * (2.0 * s3 - 3.0 * s2 + 1.0) + m0 * (s3 - 2.0 * s2 + s) + p1 * (3.0 * s2 - 2.0 * s3) + m1 * (s3 - s2)
}

fn posed(tip: Vector3<f64>, rotation: UnitQuaternion<f64>, mode: ToolMode, round: u64) -> ScriptedPose {
    ScriptedPose { pose: Isometry3::from_parts(Translation3::from(tip), rotation), mode, round }
}

/// Orientation at a keyframe.
fn rotation(key: &PathPoint) -> UnitQuaternion<f64> {
    let Some(across) = key.across else { return shaft_along(key.toward.into_inner()) };
    // z is exact, and x as near to `across` as it can be.
    let y = key.toward.cross(&across);
    UnitQuaternion::face_towards(&key.toward, &y)
}

/// An orientation with the shaft along `toward`. For a direction opposite to +z any half turn across the shaft is
/// right: most tools are rotationally symmetric about their shaft.
fn shaft_along(toward: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), &toward)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Unit};

    fn key(at_s: f64, tip: [f64; 3], toward: [f64; 3], mode: ToolMode) -> PathPoint {
        let toward = Unit::new_normalize(Vector3::from(toward));
        PathPoint { at_s, tip_m: Vector3::from(tip), toward, across: None, mode }
    }

    #[test]
    fn passes_its_keyframes_smoothly_and_never_beyond_them() {
        let path = [
            key(1.0, [0.0, 0.0, 0.1], [0.0, 0.0, 1.0], ToolMode::Touch),
            key(2.0, [0.0, 0.0, 0.02], [0.0, 1.0, 1.0], ToolMode::Cut),
            key(3.0, [0.05, 0.0, 0.02], [0.0, 0.0, -1.0], ToolMode::Hover),
        ];
        let script = Script::new(&path, None).unwrap();
        for p in &path {
            let there = script.at(p.at_s);
            assert!((there.pose.translation.vector - p.tip_m).norm() < 1e-12);
            let toward = there.pose.rotation * Vector3::z();
            assert!((toward - p.toward.into_inner()).norm() < 1e-9);
            assert_eq!(there.mode, p.mode);
        }
        assert_eq!(script.at(0.5).mode, ToolMode::Hover);
        assert_eq!(script.at(9.0).pose.translation.vector, path[2].tip_m);
        let mut before = script.at(1.0).pose * Point3::origin();
        for i in 1..=2000 {
            let now = script.at(1.0 + f64::from(i) * 1e-3).pose * Point3::origin();
            assert!((now - before).norm() < 0.25e-3, "no jumps");
            assert!(now.z >= 0.02 - 1e-12 && now.x <= 0.05 + 1e-12, "no overshoot");
            before = now;
        }
    }

    #[test]
    fn starts_again_after_its_period() {
        let path = [
            key(0.0, [0.0; 3], [0.0, 0.0, 1.0], ToolMode::Touch),
            key(1.0, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], ToolMode::Touch),
        ];
        let script = Script::new(&path, Some(2.0)).unwrap();
        assert_eq!(script.at(0.5).pose, script.at(2.5).pose);
        assert_eq!((script.at(0.5).round, script.at(2.5).round), (0, 1));
    }

    #[test]
    fn the_jaws_open_across_the_shaft_as_the_keyframes_say() {
        let across = |at_s, toward, across: [f64; 3]| {
            let across = Some(Unit::new_normalize(Vector3::from(across)));
            PathPoint { across, ..key(at_s, [0.0; 3], toward, ToolMode::Touch) }
        };
        let path =
            [across(0.0, [0.0, 0.0, 2.0], [0.0, 1.0, 0.4]), across(1.0, [1.0, 0.0, 0.0], [0.0, 3.0, 0.0])];
        let script = Script::new(&path, None).unwrap();
        for (at_s, shaft) in [(0.0, Vector3::z()), (1.0, Vector3::x())] {
            let rotation = script.at(at_s).pose.rotation;
            assert!((rotation * Vector3::z() - shaft).norm() < 1e-9);
            assert!((rotation * Vector3::x() - Vector3::y()).norm() < 1e-9);
        }
        let midway = script.at(0.5).pose.rotation * Vector3::x();
        assert!((midway - Vector3::y()).norm() < 1e-9, "{midway}");
    }
}
