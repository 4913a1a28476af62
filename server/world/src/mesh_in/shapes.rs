//! Small surfaces for tests.

use nalgebra::Vector3;

/// The unit cube, twelve outward triangles, two per face, the last two at z = 1.
pub(super) fn cube() -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
    let vertices = (0..8u32).map(|i| Vector3::from([i & 1, (i >> 1) & 1, i >> 2].map(f64::from))).collect();
    let quads = [[0, 2, 3, 1], [0, 1, 5, 4], [0, 4, 6, 2], [1, 3, 7, 5], [2, 6, 7, 3], [4, 5, 7, 6]];
    (vertices, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// A sphere around the origin from a cube of `n` × `n` quads per face.
pub(super) fn sphere(n: usize, radius: f64) -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for face in 0..6 {
        let first = vertices.len() as u32;
        for i in 0..=n {
            for j in 0..=n {
                let side = if face % 2 == 0 { 1.0 } else { -1.0 };
                let angle =
                    |k: usize| (std::f64::consts::FRAC_PI_4 * (2.0 * k as f64 / n as f64 - 1.0)).tan();
                let (u, v) = (angle(i), side * angle(j));
                let mut p = Vector3::zeros();
                (p[face / 2], p[(face / 2 + 1) % 3], p[(face / 2 + 2) % 3]) = (side, u, v);
                vertices.push(radius * p.normalize());
                if i < n && j < n {
                    let at = |a: usize, b: usize| first + ((i + a) * (n + 1) + j + b) as u32;
                    triangles.push([at(0, 0), at(1, 0), at(1, 1)]);
                    triangles.push([at(0, 0), at(1, 1), at(0, 1)]);
                }
            }
        }
    }
    (vertices, triangles)
}
