//! Tools made of several capsules.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::inputs::ToolShape;

type V = Vector3<f64>;

/// Most capsules of one tool.
pub const MAX_PARTS: usize = 3;

/// One capsule of a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Axes of the capsule to those of the tool.
    pub pose: Isometry3<f64>,
    /// The capsule, with its tip in the origin of its own axes.
    pub shape: ToolShape,
}

/// Number of capsules of a compound shape; 0 for the others.
pub fn count(shape: ToolShape) -> usize {
    match shape {
        ToolShape::Sphere { .. } | ToolShape::Capsule { .. } | ToolShape::Blade { .. } => 0,
        ToolShape::Forceps { .. } => 2,
        ToolShape::Retractor { .. } | ToolShape::Hook { .. } => 3,
    }
}

/// The capsules of a compound shape; none for the others. The inner faces of forceps have the distance `gap_m` [m] at
/// the ends of the jaws.
pub fn parts(shape: ToolShape, gap_m: f64) -> impl Iterator<Item = Part> {
    let (radius_m, segments) = match shape {
        ToolShape::Sphere { .. } | ToolShape::Capsule { .. } | ToolShape::Blade { .. } => {
            (0.0, [None; MAX_PARTS])
        }
        ToolShape::Forceps { radius_m: r, length_m, .. } => {
            let jaw = |side: f64| {
                Some([V::new(side * (0.5 * gap_m + r), 0.0, 0.0), V::new(side * r, 0.0, length_m)])
            };
            (r, [jaw(1.0), jaw(-1.0), None])
        }
        ToolShape::Retractor { radius_m, length_m, width_m, height_m } => {
            let bar = |z: f64| Some([V::new(-0.5 * width_m, 0.0, z), V::new(0.5 * width_m, 0.0, z)]);
            (radius_m, [bar(0.0), bar(height_m), Some([V::zeros(), V::z() * length_m])])
        }
        ToolShape::Hook { radius_m, length_m, reach_m, point_m } => {
            let bend = V::x() * reach_m;
            let rods = [[V::zeros(), V::z() * length_m], [V::zeros(), bend], [bend, bend + V::z() * point_m]];
            (radius_m, rods.map(Some))
        }
    };
    segments.into_iter().flatten().map(move |[from, to]| part(from, to, radius_m))
}

/// A capsule from one point to another.
fn part(from: V, to: V, radius_m: f64) -> Part {
    let along = to - from;
    let rotation = UnitQuaternion::rotation_between(&V::z(), &along).unwrap_or_default();
    Part {
        pose: Isometry3::from_parts(Translation3::from(from), rotation),
        shape: ToolShape::Capsule { radius_m, length_m: along.norm() },
    }
}

/// The inner face of the jaw on the side of +x, or with `side` -1 on that of -x, in tool axes: its end [m], the way to
/// the hinge [m], and the unit normal towards the other jaw.
pub fn inner_face(length_m: f64, gap_m: f64, side: f64) -> (V, V, V) {
    let end = V::new(side * 0.5 * gap_m, 0.0, 0.0);
    let way = V::z() * length_m - end;
    let normal = V::new(-side * length_m, 0.0, -0.5 * gap_m).normalize();
    (end, way, normal)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::tool::geometry::core;

    #[test]
    fn jaws_have_their_inner_faces_at_the_opening_and_meet_at_the_hinge() {
        let (radius_m, length_m) = (0.002, 0.05);
        let shape =
            ToolShape::Forceps { radius_m, length_m, opening_m: 0.01, grip_force_n: 1.0, friction: 0.5 };
        for gap_m in [0.0, 0.004, 0.01] {
            let jaws: Vec<_> = parts(shape, gap_m).map(|part| core(part.shape, &part.pose)).collect();
            assert_eq!((jaws.len(), count(shape)), (2, 2));
            for (jaw, side) in jaws.iter().zip([1.0, -1.0]) {
                assert!((jaw[0].x - side * (0.5 * gap_m + radius_m)).abs() < 1e-12);
                assert!((jaw[1] - V::new(side * radius_m, 0.0, length_m)).norm() < 1e-12);
                let (end, way, normal) = inner_face(length_m, gap_m, side);
                assert!(normal.dot(&way).abs() < 1e-12 && normal.x * side < -0.9);
                assert!((end + way - V::z() * length_m).norm() < 1e-12);
                // A radius behind its face lies the core.
                assert!((jaw[0] - end + normal * radius_m).norm() < 0.2 * radius_m);
            }
        }
    }

    #[test]
    fn bars_and_bends_lie_where_the_shape_says() {
        let (radius_m, length_m) = (0.002, 0.1);
        let retractor = ToolShape::Retractor { radius_m, length_m, width_m: 0.03, height_m: 0.01 };
        let cores: Vec<_> = parts(retractor, 0.0).map(|part| core(part.shape, &part.pose)).collect();
        assert!((cores[1][0] - V::new(-0.015, 0.0, 0.01)).norm() < 1e-12);
        assert!((cores[1][1] - V::new(0.015, 0.0, 0.01)).norm() < 1e-12);
        assert!((cores[2][1] - V::z() * length_m).norm() < 1e-12);
        let hook = ToolShape::Hook { radius_m, length_m, reach_m: 0.01, point_m: 0.006 };
        let cores: Vec<_> = parts(hook, 0.0).map(|part| core(part.shape, &part.pose)).collect();
        assert!((cores[2][1] - V::new(0.01, 0.0, 0.006)).norm() < 1e-12);
        assert_eq!(count(hook), cores.len());
    }
}
