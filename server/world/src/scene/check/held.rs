//! The directions in which a fix holds its nodes.

use nalgebra::Vector3;
use scindo_physics::element::Held;

use super::super::raw::{RawAxes, RawBody, RawFix};
use super::Check;

impl Check<'_> {
    /// World axes, all but a plane, or all but a line.
    pub(super) fn held(&mut self, at: &str, fix: &RawFix) -> Held {
        let found =
            [("axes", fix.axes.is_some()), ("normal", fix.normal.is_some()), ("rail", fix.rail.is_some())];
        let found: Vec<&str> = found.iter().filter(|(_, given)| *given).map(|(key, _)| *key).collect();
        if found.len() > 1 {
            let what = format!("found {}, allowed: at most one of axes, normal, rail", found.join(" and "));
            self.conflict(
                at.to_owned(),
                what,
                "keep one; a second [[body.fix]] on the same nodes holds them further",
            );
        }
        let held = match (fix.normal, fix.rail) {
            (Some(normal), _) => Held::along(*self.direction(&format!("{at}.normal"), normal)),
            (_, Some(rail)) => Held::across(*self.direction(&format!("{at}.rail"), rail)),
            _ => fix.axes.map(|axes| Held::Axes(held_axes(axes))),
        };
        held.unwrap_or(Held::FULLY)
    }

    /// A level that is simulated has vertices of its own, which know world axes only.
    pub(super) fn inclined(&mut self, at: &str, body: &RawBody) {
        if body.octree.as_ref().is_none_or(|octree| octree.simulate_level == 0) {
            return;
        }
        for (i, fix) in body.fix.iter().enumerate() {
            for (key, given) in [("normal", fix.normal), ("rail", fix.rail)] {
                let direction = given.map(Vector3::from).and_then(Held::along);
                if direction.is_some_and(|held| held.is_inclined()) {
                    self.conflict(
                        format!("{at}.fix.{i}.{key}"),
                        "found a direction that is no world axis on a body with octree.simulate_level above 0, \
                         allowed there: axes",
                        "write octree.simulate_level = 0, or hold it along axes",
                    );
                }
            }
        }
    }
}

fn held_axes(axes: RawAxes) -> [bool; 3] {
    match axes {
        RawAxes::X => [true, false, false],
        RawAxes::Y => [false, true, false],
        RawAxes::Z => [false, false, true],
        RawAxes::Xy => [true, true, false],
        RawAxes::Xz => [true, false, true],
        RawAxes::Yz => [false, true, true],
        RawAxes::Xyz => [true; 3],
    }
}
