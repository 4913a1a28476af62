//! Converts a point of a surface triangle to springs on the node copies that carry it.

use scindo_physics::element::{MOST_CARRIERS, MaterialPoint};

/// Share of a point's stiffness below which a copy is omitted.
const LEAST_WEIGHT: f64 = 1e-9;
/// Carriers of a point that is not divided among the corners of its triangle: those of one tetrahedron.
const MOST_OF_ONE: usize = 4;
/// Carriers of the three corners together.
const MOST: usize = 3 * MOST_CARRIERS;

/// Calls `emit` with material points that together represent one point of a triangle. If few copies
/// carry the point, it is a single one with share 1. Otherwise there is one per corner with the barycentric
/// coordinate of the corner as its share. Force and moment on the tissue are the same.
pub fn material_points(
    corners: [&MaterialPoint; 3],
    barycentric: [f64; 3],
    mut emit: impl FnMut(MaterialPoint, f64),
) {
    let mut copies = [0; MOST];
    let mut weights = [0.0; MOST];
    let mut count = 0;
    // Corners often share copies, so their weights are merged.
    for (vertex, w) in corners.iter().zip(barycentric) {
        for (copy, weight) in vertex.carriers() {
            let copy = copy as u32;
            if (w * weight).abs() < LEAST_WEIGHT {
                continue;
            }
            let slot = copies[..count].iter().position(|&c| c == copy).unwrap_or(count);
            copies[slot] = copy;
            weights[slot] += w * weight;
            count = count.max(slot + 1);
        }
    }
    if count <= MOST_OF_ONE {
        emit(MaterialPoint::new(copies.into_iter().zip(weights).take(count)), 1.0);
        return;
    }
    for (vertex, w) in corners.into_iter().zip(barycentric) {
        if w > LEAST_WEIGHT {
            emit(*vertex, w);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn vertex(copies: [u32; 4], weights: [f64; 4]) -> MaterialPoint {
        MaterialPoint::in_tet(copies, weights)
    }

    fn position(points: &[(MaterialPoint, f64)], x: &[Vector3<f64>]) -> Vector3<f64> {
        points.iter().map(|(vertex, share)| vertex.position(x) * *share).sum()
    }

    #[test]
    fn the_points_together_are_the_point_of_the_triangle() {
        let x: Vec<_> =
            (0..12).map(|i| Vector3::new(f64::from(i).sin(), f64::from(i * i).cos(), 0.1)).collect();
        let mesh_nodes = [
            vertex([3, 3, 3, 3], [1.0, 0.0, 0.0, 0.0]),
            vertex([5, 3, 5, 5], [0.5, 0.5, 0.0, 0.0]),
            vertex([7, 7, 7, 7], [1.0, 0.0, 0.0, 0.0]),
        ];
        let embedded = [
            vertex([0, 1, 2, 3], [0.1, 0.2, 0.3, 0.4]),
            vertex([4, 5, 6, 7], [0.4, 0.3, 0.2, 0.1]),
            vertex([8, 9, 10, 11], [0.25; 4]),
        ];
        for (corners, expected) in [(mesh_nodes, 1), (embedded, 3)] {
            let w = [0.2, 0.3, 0.5];
            let mut points = Vec::new();
            material_points([&corners[0], &corners[1], &corners[2]], w, |v, s| points.push((v, s)));
            assert_eq!(points.len(), expected);
            let whole: Vector3<f64> = corners.iter().zip(w).map(|(corner, w)| corner.position(&x) * w).sum();
            assert!((position(&points, &x) - whole).norm() < 1e-15);
            for (point, _) in &points {
                assert!((point.weights().iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }
}
