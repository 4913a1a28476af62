//! Closed surfaces and random vectors for the tests of this crate.

use std::collections::BTreeMap;

use fastrand::Rng;
use nalgebra::Vector3;

/// Positions [m] and outward triangles.
pub(crate) type Surface = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// A cube of half edge `half` [m] whose faces are split into `n` x `n` quads.
pub(crate) fn block(half: [f32; 3], n: usize) -> Surface {
    let mut index = BTreeMap::new();
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let mut vertex = |lattice: [usize; 3]| {
        *index.entry(lattice).or_insert_with(|| {
            let at = |axis: usize| (lattice[axis] as f32 / n as f32 * 2.0 - 1.0) * half[axis];
            positions.push([at(0), at(1), at(2)]);
            positions.len() as u32 - 1
        })
    };
    for axis in 0..3 {
        for side in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let quad = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[a, b]| {
                        let mut lattice = [side; 3];
                        lattice[(axis + 1) % 3] = a;
                        lattice[(axis + 2) % 3] = b;
                        vertex(lattice)
                    });
                    let [a, b, c, d] = quad;
                    if side == n {
                        triangles.extend([[a, b, c], [a, c, d]]);
                    } else {
                        triangles.extend([[a, c, b], [a, d, c]]);
                    }
                }
            }
        }
    }
    (positions, triangles)
}

/// Uniform in the cube of half width `r` around the origin.
pub(crate) fn vector(random: &mut Rng, r: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| (2.0 * random.f64() - 1.0) * r)
}

/// A ball of radius `radius` [m]: a cube's faces blown up.
pub(crate) fn ball(radius: f32, n: usize) -> Surface {
    let (mut positions, triangles) = block([1.0; 3], n);
    for p in &mut positions {
        let norm = p.iter().map(|x| x * x).sum::<f32>().sqrt();
        *p = p.map(|x| x / norm * radius);
    }
    (positions, triangles)
}
