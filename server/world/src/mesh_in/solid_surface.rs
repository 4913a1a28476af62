//! A surface as a solid that octree cells fill.
//!
//! Inside and outside come from the generalised winding number, crossings from the triangles, as for the
//! lattice of tetrahedra.

use nalgebra::Vector3;
use scindo_physics::octree::Shape;

use super::health::surface::{CleanSurface, SurfaceHealth, clean_surface};
use crate::format::{MeshInError, SurfaceMesh};

/// Bisections for a crossing without a triangle, to 2⁻²⁰ of the way.
const BISECTIONS: usize = 20;
/// Hits closer together than this fraction of the way are one, as in an edge that two triangles share.
const SAME: f64 = 1e-9;
/// Step of the differences that give the normal in a hole, as a fraction of the way.
const DIFFERENCE: f64 = 1e-2;

/// The solid that a surface encloses.
pub struct SolidSurface {
    surface: CleanSurface,
    bounds: [Vector3<f64>; 2],
    /// Unit normal of every triangle.
    normals: Vec<Vector3<f64>>,
    /// Whether inside and outside change only at triangles: no edge is open.
    closed: bool,
}

impl SolidSurface {
    /// The solid inside `surface`, and the faults that were found in this. `scale` converts the file's unit
    /// to metres.
    ///
    /// # Errors
    /// A surface with too many triangles without area.
    pub fn new(surface: &SurfaceMesh, scale: f64) -> Result<(Self, SurfaceHealth), MeshInError> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(MeshInError::Scale { file: surface.file.clone(), scale });
        }
        let (clean, health) = clean_surface(surface, scale)?;
        let bounds = [health.min_m, health.max_m].map(Vector3::from);
        let closed = health.boundary_edges + health.non_manifold_edges + health.one_sided_edges == 0;
        let normals = clean.tree.normals();
        Ok((Self { surface: clean, bounds, normals, closed }, health))
    }

    /// Outward unit normal of triangle `t` where the way in direction `d` leaves the solid, or enters it.
    fn normal(&self, t: u32, d: &Vector3<f64>, leaves: bool) -> Vector3<f64> {
        let normal = self.normals[t as usize];
        // Triangles of a dirty surface may face the wrong way.
        if (normal.dot(d) >= 0.0) == leaves { normal } else { -normal }
    }

    /// The crossing between `a` and `b`, of which exactly one is inside, where no triangle is.
    fn in_hole(&self, a: &Vector3<f64>, b: &Vector3<f64>, leaves: bool) -> (f64, Vector3<f64>) {
        let at = |t: f64| a + t * (b - a);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if self.contains(&at(middle)) == leaves { low = middle } else { high = middle }
        }
        let t = 0.5 * (low + high);
        let step = DIFFERENCE * (b - a).norm();
        let w =
            |k: usize, sign: f64| self.surface.tree.winding_number(&(at(t) + Vector3::ith(k, sign * step)));
        let outward = Vector3::from_fn(|k, _| w(k, -1.0) - w(k, 1.0));
        let ahead = if leaves { b - a } else { a - b };
        (t, outward.try_normalize(1e-12).unwrap_or_else(|| ahead.normalize()))
    }
}

impl Shape for SolidSurface {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        self.bounds
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        self.surface.tree.winding_number(p) > 0.5
    }

    /// Between two crossings of a closed surface all points are on the same side, so its ends tell.
    fn contains_row(&self, point: &dyn Fn(usize) -> Vector3<f64>, inside: &mut [bool]) {
        let n = inside.len();
        let mut fill = |from: usize, to: usize| {
            if from >= to {
                return;
            }
            let ends = [from, to - 1].map(|i| self.contains(&point(i)));
            inside[from..to].fill(ends[0]);
            if ends[0] != ends[1] || !self.closed {
                (from..to).for_each(|i| inside[i] = self.contains(&point(i)));
            }
        };
        if n < 2 || !self.closed {
            return fill(0, n);
        }
        let mut from = 0;
        for (t, _) in self.surface.tree.crossings(&point(0), &point(n - 1)) {
            let to = ((t * (n - 1) as f64).floor() as usize + 1).min(n);
            fill(from, to);
            from = from.max(to);
        }
        fill(from, n);
    }

    fn crossing(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let (from, to) = (self.contains(a), self.contains(b));
        let hits = self.surface.tree.crossings(a, b);
        let at = |t: f64| a + t * (b - a);
        for (i, &(t, triangle)) in hits.iter().enumerate() {
            let next = hits.get(i + 1).map_or(1.0, |hit| hit.0);
            if next - t <= SAME && i + 1 < hits.len() {
                continue;
            }
            let behind =
                if i + 1 == hits.len() && self.closed { to } else { self.contains(&at(0.5 * (t + next))) };
            if behind != from {
                return Some((t, self.normal(triangle, &(b - a), from)));
            }
        }
        (from != to).then(|| self.in_hole(a, b, from))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::mesh_in::shapes::{cube, sphere};

    fn solid((vertices, triangles): (Vec<Vector3<f64>>, Vec<[u32; 3]>)) -> SolidSurface {
        let surface = SurfaceMesh { file: "test".into(), vertices, triangles, notes: Vec::new() };
        SolidSurface::new(&surface, 1.0).unwrap().0
    }

    #[test]
    fn rows_agree_with_single_points() {
        let mut open = sphere(12, 1.0);
        open.1.truncate(open.1.len() - 40);
        for (shape, closed) in [(solid(sphere(12, 1.0)), true), (solid(open), false)] {
            assert_eq!(shape.closed, closed);
            let mut found = 0;
            for row in 0..900 {
                let (y, z) = (row % 30, row / 30);
                let at = |c: usize| (c as f64 - 14.5) / 13.0;
                let point = |i: usize| Vector3::new(at(i), at(y), at(z));
                let mut inside = [false; 30];
                shape.contains_row(&point, &mut inside);
                let single: Vec<bool> = (0..30).map(|i| shape.contains(&point(i))).collect();
                assert_eq!(inside[..], single[..], "row {y} {z}");
                found += inside.iter().filter(|inside| **inside).count();
            }
            let exact = 4.0 / 3.0 * std::f64::consts::PI * 13.0_f64.powi(3);
            assert!((found as f64 / exact - 1.0).abs() < 0.05, "{found} {exact}");
        }
    }

    #[test]
    fn crossings_are_where_the_side_changes_and_normals_point_outwards() {
        let shape = solid(sphere(24, 1.0));
        for i in 0..200 {
            let angle = f64::from(i);
            let out = Vector3::new(angle.sin(), (1.7 * angle).cos(), (0.3 * angle).sin()).normalize();
            let (inner, outer) = (0.9 * out, 1.1 * out);
            for (a, b) in [(inner, outer), (outer, inner)] {
                let (t, normal) = shape.crossing(&a, &b).unwrap();
                assert!(
                    ((a + t * (b - a)).norm() - 1.0).abs() < 0.01 && normal.dot(&out) > 0.99,
                    "{out} {t}"
                );
            }
            assert_eq!(shape.crossing(&(0.5 * out), &inner), None);
        }
    }

    #[test]
    fn a_hole_is_crossed_where_its_membrane_is() {
        let (vertices, mut triangles) = cube();
        triangles.truncate(10); // the face at z = 1 is missing
        let shape = solid((vertices, triangles));
        let (a, b) = (Vector3::new(0.4, 0.5, 0.3), Vector3::new(0.4, 0.5, 1.8));
        let (t, normal) = shape.crossing(&a, &b).unwrap();
        let height = 0.3 + 1.5 * t;
        assert!((0.8..1.3).contains(&height) && normal.z > 0.9, "{height} {normal}");
        assert!(!shape.contains(&Vector3::new(0.4, 0.5, height + 0.01)));
    }

    #[test]
    fn inward_triangles_do_not_turn_the_normals() {
        let (vertices, triangles) = cube();
        let inwards = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let shape = solid((vertices, inwards));
        let (t, normal) = shape.crossing(&Vector3::new(0.5, 0.4, 0.5), &Vector3::new(2.5, 0.4, 0.5)).unwrap();
        assert!((t - 0.25).abs() < 1e-12 && (normal - Vector3::x()).norm() < 1e-12);
    }
}
