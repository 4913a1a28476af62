//! The path of the simulated hand: keyframes of a file, or the built-in `press` and `circle`.
//!
//! # Format
//! TOML with the same entries as a scripted tool of a scene. Times rise from zero:
//! ```toml
//! [[path]]
//! at_s = 0.0
//! tip_m = [0.0, 0.0, 0.1]
//! toward = [0.0, 0.0, 1.0]   # from the tip along the shaft; upwards if left out
//! mode = "touch"             # hover | touch | grab | cut, from this time on
//! ```
//! CSV has the header `at_s,x_m,y_m,z_m` and an optional column `mode`.

use super::ToolMode;
use nalgebra::{UnitQuaternion, Vector3};
use serde::Deserialize;
use std::path::Path as FilePath;

/// Most keyframes of a file: an hour at 20 per second.
const MAX_KEYFRAMES: usize = 72_000;

/// Largest path file [bytes].
const MAX_FILE_BYTES: u64 = 16 << 20;

/// Reason why a path cannot be followed.
#[derive(Debug, thiserror::Error)]
pub enum PathError {
    /// The file cannot be read.
    #[error("cannot read the path {file}: {source}; built-in paths are `press` and `circle`")]
    Read {
        /// Name of the file.
        file: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The content does not match the extension of the file.
    #[error("{file} is not a path: {message}")]
    Parse {
        /// Name of the file.
        file: String,
        /// Message of the parser.
        message: String,
    },
    /// A keyframe cannot be used.
    #[error("keyframe {index} of the path: {what}; {next}")]
    Keyframe {
        /// Index from zero.
        index: usize,
        /// What is wrong, with the value.
        what: String,
        /// What the user can do.
        next: &'static str,
    },
}

/// One pose of the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keyframe {
    /// Time since the start [s].
    pub at_s: f64,
    /// Tip of the tool [m].
    pub tip_m: Vector3<f64>,
    /// Unit direction from the tip along the shaft.
    pub toward: Vector3<f64>,
    /// Action of the hand from this time on.
    pub mode: ToolMode,
}

/// The target pose of the hand at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandTarget {
    /// Tip of the tool [m].
    pub position_m: Vector3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Unit quaternion x, y, z, w.
    pub orientation: [f64; 4],
    /// Action of the hand.
    pub mode: ToolMode,
}

/// Keyframes with linear motion in between. At the end the path repeats or stops.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    keyframes: Vec<Keyframe>,
    repeat: bool,
}

impl Path {
    /// Builds a path after checking order, size and finiteness of the keyframes.
    pub fn new(keyframes: Vec<Keyframe>, repeat: bool) -> Result<Self, PathError> {
        let fail = |index, what: String, next| Err(PathError::Keyframe { index, what, next });
        if keyframes.is_empty() {
            return fail(0, "there is none".into(), "write at least one keyframe");
        }
        if keyframes.len() > MAX_KEYFRAMES {
            return fail(keyframes.len(), format!("more than {MAX_KEYFRAMES}"), "shorten the path");
        }
        let mut last_s = -1.0;
        for (index, k) in keyframes.iter().enumerate() {
            let finite = k.at_s.is_finite() && k.tip_m.iter().chain(k.toward.iter()).all(|v| v.is_finite());
            if !finite || k.tip_m.norm() > 1.0e3 {
                return fail(index, "a value is not finite or beyond 1 km".into(), "coordinates are metres");
            }
            if k.at_s < 0.0 || k.at_s <= last_s {
                return fail(index, format!("at_s = {} does not rise", k.at_s), "times start at 0 and rise");
            }
            if k.toward.norm() < 1e-9 {
                return fail(
                    index,
                    "toward has no length".into(),
                    "give a direction from the tip along the shaft",
                );
            }
            last_s = k.at_s;
        }
        Ok(Self { keyframes, repeat })
    }

    /// A path that rests at one point.
    pub fn still(tip_m: Vector3<f64>) -> Self {
        let keyframe = Keyframe { at_s: 0.0, tip_m, toward: Vector3::z(), mode: ToolMode::Touch };
        Self { keyframes: vec![keyframe], repeat: false }
    }

    /// A path of four seconds that presses on a point of the surface and lifts off again.
    pub fn press(touch: &Touch) -> Self {
        let (above, below) = (touch.above(), touch.point_m + touch.direction * touch.depth_m);
        let times = [0.0, 0.8, 1.6, 2.6, 3.2, 4.0];
        Self::built_in(touch, times.into_iter().zip([above, above, below, below, above, above]))
    }

    /// A path of six seconds: press, draw a circle on the surface whose radius is the depth, lift off.
    pub fn circle(touch: &Touch) -> Self {
        let helper = if touch.direction.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        let across = touch.direction.cross(&helper).normalize();
        let along = touch.direction.cross(&across);
        let on_circle = |part: f64| {
            let (sin, cos) = (part * std::f64::consts::TAU).sin_cos();
            touch.point_m + touch.depth_m * (touch.direction + (cos - 1.0) * across + sin * along)
        };
        let mut points = vec![(0.0, touch.above()), (0.8, touch.above()), (1.6, on_circle(0.0))];
        points.extend((1..=48).map(|i| (1.6 + 3.0 * f64::from(i) / 48.0, on_circle(f64::from(i) / 48.0))));
        points.extend([(5.2, touch.above()), (6.0, touch.above())]);
        Self::built_in(touch, points.into_iter())
    }

    fn built_in(touch: &Touch, points: impl Iterator<Item = (f64, Vector3<f64>)>) -> Self {
        let toward = -touch.direction;
        let keyframe = |(at_s, tip_m)| Keyframe { at_s, tip_m, toward, mode: ToolMode::Touch };
        Self { keyframes: points.map(keyframe).collect(), repeat: true }
    }

    /// Reads a `.toml` or `.csv` file.
    pub fn from_file(file: &FilePath, repeat: bool) -> Result<Self, PathError> {
        let name = file.display().to_string();
        let read = |source| PathError::Read { file: name.clone(), source };
        if std::fs::metadata(file).map_err(read)?.len() > MAX_FILE_BYTES {
            let message = format!("larger than {MAX_FILE_BYTES} bytes");
            return Err(PathError::Parse { file: name, message });
        }
        let text = std::fs::read_to_string(file).map_err(read)?;
        let keyframes = match file.extension().and_then(|e| e.to_str()) {
            Some("csv") => parse_csv(&text),
            _ => parse_toml(&text),
        };
        Self::new(keyframes.map_err(|message| PathError::Parse { file: name, message })?, repeat)
    }

    /// The target at `time_s`.
    pub fn at(&self, time_s: f64) -> HandTarget {
        let last = self.keyframes.len() - 1;
        let end_s = self.keyframes[last].at_s;
        let time_s = if self.repeat && end_s > 0.0 { time_s.rem_euclid(end_s) } else { time_s };
        let next = self.keyframes.partition_point(|k| k.at_s <= time_s);
        let (a, b) = (&self.keyframes[next.saturating_sub(1)], &self.keyframes[next.min(last)]);
        let span_s = b.at_s - a.at_s;
        let (part, velocity_m_s) = if span_s > 0.0 {
            (((time_s - a.at_s) / span_s).clamp(0.0, 1.0), (b.tip_m - a.tip_m) / span_s)
        } else {
            (0.0, Vector3::zeros())
        };
        HandTarget {
            position_m: a.tip_m.lerp(&b.tip_m, part),
            velocity_m_s,
            orientation: shaft_orientation(&a.toward.normalize().lerp(&b.toward.normalize(), part)),
            mode: a.mode,
        }
    }
}

/// A point of a surface, and the way to touch it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Point of the undeformed surface [m].
    pub point_m: Vector3<f64>,
    /// Unit direction into the tissue.
    pub direction: Vector3<f64>,
    /// How deep the hand presses [m].
    pub depth_m: f64,
    /// Height above the surface at which the hand starts and rests [m].
    pub clearance_m: f64,
}

impl Touch {
    fn above(&self) -> Vector3<f64> {
        self.point_m - self.direction * self.clearance_m
    }
}

/// Rotation that turns tool +z into `toward`, as x, y, z, w.
fn shaft_orientation(toward: &Vector3<f64>) -> [f64; 4] {
    let turned = UnitQuaternion::rotation_between(&Vector3::z(), toward)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    [turned.i, turned.j, turned.k, turned.w]
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPath {
    path: Vec<RawKeyframe>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawKeyframe {
    at_s: f64,
    tip_m: [f64; 3],
    #[serde(default = "upwards")]
    toward: [f64; 3],
    #[serde(default)]
    mode: RawMode,
}

#[derive(Deserialize, Default, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum RawMode {
    Hover,
    #[default]
    Touch,
    Grab,
    Cut,
    Scalpel,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRow {
    at_s: f64,
    x_m: f64,
    y_m: f64,
    z_m: f64,
    #[serde(default)]
    mode: RawMode,
}

fn upwards() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn parse_toml(text: &str) -> Result<Vec<Keyframe>, String> {
    let raw: RawPath = toml::from_str(text).map_err(|e| e.to_string())?;
    let keyframe = |k: RawKeyframe| Keyframe {
        at_s: k.at_s,
        tip_m: k.tip_m.into(),
        toward: k.toward.into(),
        mode: mode(k.mode),
    };
    Ok(raw.path.into_iter().map(keyframe).collect())
}

fn parse_csv(text: &str) -> Result<Vec<Keyframe>, String> {
    let row = |r: Result<RawRow, csv::Error>| {
        let r = r.map_err(|e| e.to_string())?;
        let tip_m = Vector3::new(r.x_m, r.y_m, r.z_m);
        Ok(Keyframe { at_s: r.at_s, tip_m, toward: Vector3::z(), mode: mode(r.mode) })
    };
    csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes())
        .deserialize()
        .map(row)
        .collect()
}

fn mode(raw: RawMode) -> ToolMode {
    match raw {
        RawMode::Hover => ToolMode::Hover,
        RawMode::Touch => ToolMode::Touch,
        RawMode::Grab => ToolMode::Grab,
        RawMode::Cut => ToolMode::Cut,
        RawMode::Scalpel => ToolMode::Scalpel,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch() -> Touch {
        Touch {
            point_m: Vector3::new(0.1, 0.2, 0.3),
            direction: -Vector3::z(),
            depth_m: 0.01,
            clearance_m: 0.02,
        }
    }

    #[test]
    fn press_rests_above_goes_to_its_depth_and_repeats() {
        let path = Path::press(&touch());
        assert_eq!(path.at(0.4).position_m, Vector3::new(0.1, 0.2, 0.32));
        assert!((path.at(2.0).position_m - Vector3::new(0.1, 0.2, 0.29)).norm() < 1e-12);
        assert_eq!(path.at(2.1).velocity_m_s, Vector3::zeros());
        assert_eq!(path.at(0.4), path.at(4.4));
        let down = path.at(1.2).velocity_m_s;
        assert!(down.z < 0.0 && down.norm() < 0.1, "{down}");
    }

    #[test]
    fn circle_stays_at_its_depth_and_closes() {
        let path = Path::circle(&touch());
        for i in 0..=30 {
            let p = path.at(1.6 + 0.1 * f64::from(i)).position_m;
            assert!((p.z - 0.29).abs() < 1e-9, "{p}");
        }
        assert!((path.at(1.6).position_m - path.at(4.6).position_m).norm() < 1e-9);
    }

    #[test]
    fn the_shaft_points_toward() {
        let q = shaft_orientation(&Vector3::x());
        let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[3], q[0], q[1], q[2]));
        assert!((q * Vector3::z() - Vector3::x()).norm() < 1e-12);
        assert!(shaft_orientation(&-Vector3::z())[0].abs() > 0.99);
    }

    #[test]
    fn files_are_parsed_and_bad_ones_refused() {
        let toml =
            parse_toml("[[path]]\nat_s=0.0\ntip_m=[0,0,1]\n[[path]]\nat_s=1.0\ntip_m=[0,0,2]\nmode=\"cut\"")
                .unwrap();
        assert_eq!(toml[1].mode, ToolMode::Cut);
        let csv = parse_csv("at_s,x_m,y_m,z_m\n0,0,0,1\n1, 0, 0, 2\n").unwrap();
        assert_eq!(csv[1].tip_m.z, 2.0);
        assert!(parse_toml("[[path]]\nat_s=0.0\ntip=[0,0,1]").is_err());
        let message = Path::new(vec![csv[1], csv[0]], false).unwrap_err().to_string();
        assert!(message.contains("does not rise"), "{message}");
        let bad = Keyframe { tip_m: Vector3::repeat(f64::NAN), ..csv[0] };
        assert!(Path::new(vec![bad], false).is_err());
        assert!(Path::new(vec![], false).is_err());
        assert!(Path::from_file(FilePath::new("/nowhere.csv"), false).is_err());
    }
}
