//! Distances from solids, and the first point where a path meets them.

use nalgebra::{Unit, Vector3};
use scindo_collision::{SurfaceBvh, closest_point_on_segment};

type V = Vector3<f64>;

/// What is solid of an obstacle.
#[derive(Debug, Clone)]
pub enum Shape {
    /// Everything behind a plane.
    HalfSpace {
        /// A point of the plane [m].
        point: V,
        /// Out of the solid.
        normal: Unit<V>,
    },
    /// A box along the axes.
    Box {
        /// Lower corner [m].
        min: V,
        /// Upper corner [m].
        max: V,
    },
    /// A segment with a radius; a ball if its ends are the same.
    Capsule {
        /// The ends of the segment [m].
        ends: [V; 2],
        /// Radius [m].
        radius: f64,
    },
    /// The inside of a closed surface.
    Surface(Box<SurfaceBvh>),
}

/// The place of a solid's surface that is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePlace {
    /// Distance of the point [m], negative inside the solid.
    pub distance: f64,
    /// Unit normal of the surface there, out of the solid.
    pub normal: V,
}

/// Most steps along a path.
const MOST_STEPS: usize = 64;

impl Shape {
    /// The place of the surface nearest to `p` [m]; `None` if it is farther away than `reach` [m].
    pub fn nearest(&self, p: V, reach: f64) -> Option<SurfacePlace> {
        let place = match self {
            Shape::HalfSpace { point, normal } => {
                SurfacePlace { distance: normal.dot(&(p - point)), normal: normal.into_inner() }
            }
            Shape::Box { min, max } => of_box(p, min, max),
            Shape::Capsule { ends, radius } => {
                let core = closest_point_on_segment(p, ends[0], ends[1]);
                let away = p - (ends[0] + (ends[1] - ends[0]) * core);
                let distance = away.norm();
                let normal = if distance > 1e-12 { away / distance } else { V::z() };
                SurfacePlace { distance: distance - radius, normal }
            }
            Shape::Surface(surface) => {
                let near = surface.closest_point(p, reach)?;
                let (distance, away) = (near.signed_distance, p - near.point);
                // Away from the surface its direction is better known than that of a facet.
                let normal = if distance.abs() > 1e-7 { away / distance } else { near.normal };
                SurfacePlace { distance, normal }
            }
        };
        (place.distance <= reach).then_some(place)
    }

    /// The nearest place of the surface as seen from where the path from `from` to `to` [m] first meets it, or from
    /// `to` if it comes no closer than `margin` [m] without meeting it, together with the point from which it is
    /// seen; `None` if it stays farther away.
    ///
    /// # Source
    /// Hart 1996: a step as long as the distance cannot pass a surface.
    pub fn meet(&self, from: V, to: V, margin: f64) -> Option<(V, SurfacePlace)> {
        let way = (to - from).norm();
        let first = self.nearest(from, way + margin)?;
        if first.distance <= 0.0 || way == 0.0 {
            return Some((from, first));
        }
        let tolerance = 1e-3 * margin.max(1e-6);
        let (mut gone, mut at, mut place) = (0.0, from, first);
        for _ in 0..MOST_STEPS {
            gone += place.distance.max(tolerance);
            if gone >= way {
                return self.nearest(to, margin).map(|place| (to, place));
            }
            at = from + (to - from) * (gone / way);
            place = self.nearest(at, way + margin)?;
            if place.distance <= tolerance {
                return Some((at, place));
            }
        }
        // A path at a flat angle is near the surface after so many steps, or its end tells.
        if place.distance <= margin {
            Some((at, place))
        } else {
            self.nearest(to, margin).map(|place| (to, place))
        }
    }
}

/// Distance from a box along the axes.
fn of_box(p: V, min: &V, max: &V) -> SurfacePlace {
    let beside = (min - p).sup(&(p - max));
    let out = beside.sup(&V::zeros());
    let distance = out.norm();
    if distance > 0.0 {
        let closest = p.sup(min).inf(max);
        return SurfacePlace { distance, normal: (p - closest) / distance };
    }
    let axis = beside.imax();
    let mut normal = V::zeros();
    normal[axis] = if p[axis] - min[axis] < max[axis] - p[axis] { -1.0 } else { 1.0 };
    SurfacePlace { distance: beside[axis], normal }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn shapes() -> Vec<Shape> {
        // A tetrahedron with its corners at distance 1 from the origin.
        let corners = [[1.0f32, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        let surface = SurfaceBvh::new(&corners, &[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]).unwrap();
        vec![
            Shape::HalfSpace {
                point: V::new(0.0, 0.0, 0.5),
                normal: Unit::new_normalize(V::new(1.0, 0.0, 2.0)),
            },
            Shape::Box { min: V::new(-1.0, -0.5, -0.2), max: V::new(0.5, 0.5, 0.3) },
            Shape::Capsule { ends: [V::new(-0.5, 0.0, 0.0), V::new(0.5, 0.2, 0.0)], radius: 0.3 },
            Shape::Capsule { ends: [V::zeros(); 2], radius: 0.7 },
            Shape::Surface(Box::new(surface)),
        ]
    }

    /// Points all over the neighbourhood.
    fn points() -> impl Iterator<Item = V> {
        (0..400).map(|i| {
            let t = f64::from(i);
            V::new((t * 0.71).sin() * 1.6, (t * 1.13).cos() * 1.4, (t * 0.37).sin() * 1.2)
        })
    }

    #[test]
    fn moving_by_the_distance_along_the_normal_leads_to_the_surface() {
        for shape in shapes() {
            for p in points() {
                let place = shape.nearest(p, 10.0).unwrap();
                let there = shape.nearest(p - place.distance * place.normal, 10.0).unwrap();
                assert!(there.distance.abs() < 1e-6, "{shape:?} {p} {place:?} {there:?}");
                assert!((place.normal.norm() - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_path_is_stopped_where_it_first_meets_the_solid() {
        for shape in shapes() {
            let mut met = 0;
            for (from, to) in points().zip(points().skip(7)) {
                if shape.nearest(from, 10.0).unwrap().distance <= 0.0 {
                    continue;
                }
                // Brute force: the first of many samples that is inside.
                let inside = |i: &i32| {
                    let p = from + (to - from) * (f64::from(*i) / 2000.0);
                    shape.nearest(p, 10.0).unwrap().distance < -1e-3
                };
                let first = (0..=2000).find(inside).map(|i| f64::from(i) / 2000.0);
                let found = shape.meet(from, to, 0.01);
                if let Some(first) = first {
                    let (at, place) = found.unwrap();
                    let share = (at - from).norm() / (to - from).norm();
                    assert!(share <= first + 1e-3 && place.distance <= 0.011, "{share} {first} {place:?}");
                    met += 1;
                }
            }
            assert!(met > 10, "{shape:?}: {met}");
        }
    }
}
