//! Regions of rest space and the nodes they select.

use nalgebra::Vector3;

use crate::scene::checked::Region;

/// Whether the point `x` [m] lies in `region`; `low` and `high` are the corners of the body's bounding box [m].
pub fn holds(region: &Region, [low, high]: [Vector3<f64>; 2], x: &Vector3<f64>) -> bool {
    match region {
        Region::Box { min_m, max_m } => (0..3).all(|i| x[i] >= min_m[i] && x[i] <= max_m[i]),
        Region::Ball { centre_m, radius_m } => (x - centre_m).norm_squared() <= radius_m * radius_m,
        Region::HalfSpace { point_m, normal } => normal.dot(&(x - point_m)) >= 0.0,
        Region::Slab { axis, from, to } => {
            let extent = high[*axis] - low[*axis];
            let slack = 1e-12 * extent;
            let height = x[*axis] - low[*axis];
            height >= from * extent - slack && height <= to * extent + slack
        }
    }
}

/// Nodes whose rest position [m] lies in `region`, ascending; `low` and `high` are the corners of the
/// body's bounding box [m].
pub fn select(rest: &[Vector3<f64>], bounds: [Vector3<f64>; 2], region: &Region) -> Vec<u32> {
    (0..rest.len() as u32).filter(|n| holds(region, bounds, &rest[*n as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Unit;
    use scindo_physics::mesh::{BoxPattern, box_mesh};

    #[test]
    fn every_kind_of_region_selects_its_nodes() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [4, 4, 4], BoxPattern::Tet6);
        let count = |region: Region| select(&mesh.nodes, mesh.bounds(), &region).len();
        let base = Region::Box { min_m: Vector3::repeat(-1.0), max_m: Vector3::new(2.0, 2.0, 0.0) };
        assert_eq!(count(base), 25);
        assert_eq!(count(Region::Slab { axis: 2, from: 0.0, to: 0.25 }), 50);
        assert_eq!(count(Region::Slab { axis: 0, from: 0.9, to: 1.0 }), 25);
        let half =
            Region::HalfSpace { point_m: Vector3::repeat(0.5), normal: Unit::new_normalize(Vector3::x()) };
        assert_eq!(count(half), 75);
        assert_eq!(count(Region::Ball { centre_m: Vector3::zeros(), radius_m: 0.26 }), 4);
        assert_eq!(count(Region::Ball { centre_m: Vector3::repeat(9.0), radius_m: 0.26 }), 0);
    }
}
