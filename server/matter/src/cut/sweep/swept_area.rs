//! The area of a sweep that lies inside a body.

use nalgebra::Vector3;

use super::blade::BladeSweep;
use super::front::sweep_triangles;
use crate::mesh::TET_FACES;

/// Distance, relative to its size, by which a sweep triangle is moved along its normal. A sweep along faces
/// is then counted on one side of them only.
const NUDGE: f64 = 1e-9;

/// Area [m²] of the sweep inside tetrahedra with corners `x` [m].
pub fn swept_area(tets: &[[u32; 4]], x: &[Vector3<f64>], blade: &BladeSweep) -> f64 {
    let triangles = sweep_triangles(None, blade, x);
    let corners = |tet: &[u32; 4]| tet.map(|c| x[c as usize]);
    let mut area = 0.0;
    for triangle in &triangles {
        let [a, b, c] = triangle.drawn;
        let normal = (b - a).cross(&(c - a));
        let nudge = NUDGE * normal.norm().sqrt() * normal.try_normalize(0.0).unwrap_or_default();
        let triangle_at = [a + nudge, b + nudge, c + nudge];
        for tet in tets {
            let tet = corners(tet);
            let beside = (0..3).any(|k| {
                tet.iter().all(|p| p[k] < triangle.low[k]) || tet.iter().all(|p| p[k] > triangle.high[k])
            });
            if !beside {
                area += area_inside(&triangle_at, &tet);
            }
        }
    }
    area
}

/// Area [m²] of the part of a triangle inside a tetrahedron of either orientation.
fn area_inside(triangle: &[Vector3<f64>; 3], tet: &[Vector3<f64>; 4]) -> f64 {
    let mut polygon: Vec<Vector3<f64>> = triangle.to_vec();
    let middle = tet.iter().sum::<Vector3<f64>>() / 4.0;
    for [a, b, c] in TET_FACES.map(|face| face.map(|k| tet[k])) {
        let normal = (b - a).cross(&(c - a));
        let inwards = normal.dot(&(middle - a));
        polygon = clipped(&polygon, |p| normal.dot(&(p - a)) * inwards.signum());
        if polygon.len() < 3 {
            return 0.0;
        }
    }
    let fan = (2..polygon.len()).map(|k| (polygon[k - 1] - polygon[0]).cross(&(polygon[k] - polygon[0])));
    0.5 * fan.sum::<Vector3<f64>>().norm()
}

/// The part of a convex polygon where the linear function `inside` is ≥ 0 (Sutherland, Hodgman 1974).
fn clipped(polygon: &[Vector3<f64>], inside: impl Fn(&Vector3<f64>) -> f64) -> Vec<Vector3<f64>> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (k, p) in polygon.iter().enumerate() {
        let q = &polygon[(k + 1) % polygon.len()];
        let (at_p, at_q) = (inside(p), inside(q));
        if at_p >= 0.0 {
            part.push(*p);
        }
        if at_p * at_q < 0.0 {
            part.push(p + (q - p) * (at_p / (at_p - at_q)));
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxPattern, box_mesh};

    /// The area in a cube of 0.1 m of a sweep of the plane x = `at`, from z = 0.2 m down to `to`.
    fn inside(at: f64, to: f64) -> f64 {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [4; 3], BoxPattern::Tet6);
        let segment = |z: f64| [Vector3::new(at, -0.1, z), Vector3::new(at, 0.3, z)];
        swept_area(&mesh.tets, &mesh.nodes, &BladeSweep { segments: vec![segment(0.2), segment(to)] })
    }

    #[test]
    fn only_what_is_inside_counts_and_once() {
        for at in [0.0333, 0.05, 0.025] {
            assert!((inside(at, -0.1) - 0.01).abs() < 1e-8, "{at}");
            assert!((inside(at, 0.04) - 0.006).abs() < 1e-8, "{at}");
        }
        assert_eq!(inside(0.2, -0.1), 0.0);
    }
}
