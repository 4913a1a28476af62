//! What tests of cut bodies share: random vectors, a square blade, and a look at a surface from its
//! triangle list alone.

use std::collections::{BTreeMap, BTreeSet};

use fastrand::Rng;
use nalgebra::Vector3;

use crate::cut::Surface;

/// The vector (x, y, z).
pub(crate) fn v(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

/// Random vectors.
pub(crate) trait Vectors {
    /// Uniform in the cube of half width `r` around the origin.
    fn vector(&mut self, r: f64) -> Vector3<f64>;

    /// Uniform on the unit sphere.
    fn direction(&mut self) -> Vector3<f64>;
}

impl Vectors for Rng {
    fn vector(&mut self, r: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| (2.0 * self.f64() - 1.0) * r)
    }

    fn direction(&mut self) -> Vector3<f64> {
        loop {
            let v = self.vector(1.0);
            if (0.2..1.0).contains(&v.norm()) {
                return v.normalize();
            }
        }
    }
}

/// A sweep over the square of half width `reach` [m] in the plane through `point` with the normal.
pub(crate) fn square(point: Vector3<f64>, normal: Vector3<f64>, reach: f64) -> [[Vector3<f64>; 2]; 2] {
    let n = normal.normalize();
    let helper = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let u = n.cross(&helper).normalize() * reach;
    let w = n.cross(&u);
    [[point - u - w, point - u + w], [point + u - w, point + u + w]]
}

/// Each directed edge once, its opposite once, every vertex link a single cycle, every vertex used.
pub(crate) fn surface_is_closed_and_manifold(surface: &Surface) {
    assert_eq!(surface.triangles.len(), surface.tags.len());
    let mut edges = BTreeSet::new();
    let mut link: BTreeMap<u32, BTreeMap<u32, u32>> = BTreeMap::new();
    for t in &surface.triangles {
        for k in 0..3 {
            let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            assert!(a != b, "triangle {t:?} names a vertex twice");
            assert!(edges.insert((a, b)), "edge {a}->{b} twice");
            link.entry(a).or_default().insert(b, c);
        }
    }
    for &(a, b) in &edges {
        assert!(edges.contains(&(b, a)), "edge {a}->{b} has no opposite");
    }
    assert_eq!(link.len(), surface.vertices.len(), "unused surface vertices");
    for (vertex, next) in link {
        let first = *next.keys().next().expect("a corner");
        let (mut at, mut length) = (first, 0);
        loop {
            at = next[&at];
            length += 1;
            if at == first {
                break;
            }
        }
        assert_eq!(length, next.len(), "the link of surface vertex {vertex} is not one cycle");
    }
}
