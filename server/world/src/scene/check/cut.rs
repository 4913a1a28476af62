//! Scheduled cuts.

use nalgebra::Vector3;

use super::super::checked::{CutPath, CutSpec};
use super::super::problem::Fault;
use super::super::raw::RawCut;
use super::Check;

impl Check<'_> {
    /// One cut; the schema has seen to it that it has exactly one of `sweep_m`, `path_m` and `plane`.
    pub(super) fn cut(&mut self, index: usize, cut: &RawCut) -> CutSpec {
        let at = format!("cut.{index}");
        let body = self.body_named(format!("{at}.body"), &cut.body);
        self.cut_method(&at, cut, body);
        self.cutting_is_on(&at);
        if let (Some(_), None) = (cut.depth_m, &cut.path_m) {
            let next = "remove it: a sweep goes as deep as its blade, or give the path as `path_m`";
            self.conflict(format!("{at}.depth_m"), "`depth_m` only goes with `path_m`", next);
        }
        let blade = if let Some(path) = &cut.path_m {
            let points: Vec<Vector3<f64>> = path.iter().map(|p| Vector3::from(*p)).collect();
            self.incision(&at, points, cut.depth_m)
        } else if let Some(plane) = &cut.plane {
            let normal = self.direction(&format!("{at}.plane.normal"), plane.normal);
            CutPath::Plane { point_m: Vector3::from(plane.point_m), normal }
        } else {
            let segments = cut.sweep_m.iter().flatten();
            self.sweep(&at, segments.map(|ends| ends.map(Vector3::from)).collect())
        };
        CutSpec { body, at_s: cut.at_s, blade }
    }

    fn incision(&mut self, at: &str, points: Vec<Vector3<f64>>, depth_m: Option<f64>) -> CutPath {
        if points.windows(2).any(|pair| pair[0] == pair[1]) {
            let next = "remove one of them";
            self.conflict(format!("{at}.path_m"), "two points in a row are the same", next);
        }
        let Some(depth_m) = depth_m else {
            let meaning = "how deep the tool goes into the skin along `path_m` [m], such as 0.01".into();
            self.report(at.to_owned(), Fault::MissingKey { key: "depth_m".into(), meaning });
            return CutPath::Sweep(Vec::new());
        };
        CutPath::Incision { points, depth_m }
    }

    fn sweep(&mut self, at: &str, segments: Vec<[Vector3<f64>; 2]>) -> CutPath {
        if segments.iter().all(|[tip, heel]| tip == heel) {
            let next = "give each blade segment a tip and a heel that differ";
            self.conflict(format!("{at}.sweep_m"), "all blade segments have zero length", next);
        } else if segments.windows(2).all(|pair| pair[0] == pair[1]) {
            let next = "give successive positions of the blade";
            self.conflict(format!("{at}.sweep_m"), "the blade does not move", next);
        }
        CutPath::Sweep(segments)
    }

    fn cutting_is_on(&mut self, at: &str) {
        if self.raw.effects.cutting == Some(false) {
            let next = "remove the cut or effects.cutting";
            self.conflict(at.to_owned(), "effects.cutting = false, but the scene has a cut", next);
        }
    }
}
