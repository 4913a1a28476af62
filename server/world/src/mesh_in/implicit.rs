//! An implicit surface {x : f(x) = 0}, f < 0 inside, turned into triangles by marching tetrahedra.
//!
//! # Source
//! Doi, Koide 1991, "An efficient method of triangulating equi-valued surfaces by using tetrahedral
//! cells"; Kuhn's six tetrahedra per cube, so that triangles match across cubes.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::format::SurfaceMesh;

/// Corner c of a cube is at (c & 1, c >> 1 & 1, c >> 2). The tets surround the diagonal 0–7.
const KUHN: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// Bisections of a grid edge that place a vertex, to 2⁻³⁰ of the edge.
const BISECTIONS: usize = 30;

/// Triangulates the zero set of `f` within a box, on a grid of cubes of side `spacing` [m].
///
/// The surface is closed if `f` is positive on the border of the box. Vertices lie on the zero set.
pub(super) fn triangulate(
    name: &str,
    f: &dyn Fn(&Vector3<f64>) -> f64,
    low: Vector3<f64>,
    high: Vector3<f64>,
    spacing: f64,
) -> SurfaceMesh {
    let cubes = [0, 1, 2].map(|axis| ((high - low)[axis] / spacing).ceil().max(1.0) as usize);
    let grid = Grid { low, spacing, cubes };
    let values: Vec<f64> = (0..grid.n_nodes()).map(|n| f(&grid.position(n))).collect();
    let mut march = March {
        f,
        grid,
        values,
        vertex_on: BTreeMap::new(),
        surface: SurfaceMesh { file: name.into(), vertices: vec![], triangles: vec![], notes: vec![] },
    };
    for k in 0..cubes[2] {
        for j in 0..cubes[1] {
            for i in 0..cubes[0] {
                let corners: [usize; 8] =
                    std::array::from_fn(|c| march.grid.node([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]));
                // Most cubes lie entirely on one side.
                let inside = corners.iter().filter(|&&n| march.values[n] < 0.0).count();
                if inside % 8 != 0 {
                    KUHN.iter().for_each(|tet| march.tet(tet.map(|c| corners[c])));
                }
            }
        }
    }
    march.surface
}

struct Grid {
    low: Vector3<f64>,
    spacing: f64,
    cubes: [usize; 3],
}

impl Grid {
    fn n_nodes(&self) -> usize {
        self.cubes.iter().map(|n| n + 1).product()
    }

    fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        i + (self.cubes[0] + 1) * (j + (self.cubes[1] + 1) * k)
    }

    fn position(&self, node: usize) -> Vector3<f64> {
        let (nx, ny) = (self.cubes[0] + 1, self.cubes[1] + 1);
        let ijk = [node % nx, node / nx % ny, node / (nx * ny)];
        self.low + self.spacing * Vector3::from(ijk.map(|c| c as f64))
    }
}

struct March<'a> {
    f: &'a dyn Fn(&Vector3<f64>) -> f64,
    grid: Grid,
    values: Vec<f64>,
    vertex_on: BTreeMap<[usize; 2], u32>,
    surface: SurfaceMesh,
}

impl March<'_> {
    fn tet(&mut self, tet: [usize; 4]) {
        let (inside, outside): (Vec<usize>, Vec<usize>) = tet.iter().partition(|&&n| self.values[n] < 0.0);
        let mean = |nodes: &[usize]| {
            nodes.iter().map(|&n| self.grid.position(n)).sum::<Vector3<f64>>() / nodes.len().max(1) as f64
        };
        let outward = mean(&outside) - mean(&inside);
        match (&inside[..], &outside[..]) {
            (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => {
                let corners = [[a, b], [a, c], [a, d]].map(|e| self.vertex(e));
                self.triangle(corners, &outward);
            }
            (&[a, b], &[c, d]) => {
                let [ac, ad, bd, bc] = [[a, c], [a, d], [b, d], [b, c]].map(|e| self.vertex(e));
                self.triangle([ac, ad, bd], &outward);
                self.triangle([ac, bd, bc], &outward);
            }
            _ => {}
        }
    }

    /// The vertex on a grid edge whose ends lie on different sides. Tets that share the edge share the
    /// vertex.
    fn vertex(&mut self, [a, b]: [usize; 2]) -> u32 {
        let next = self.surface.vertices.len() as u32;
        let vertex = *self.vertex_on.entry([a.min(b), a.max(b)]).or_insert(next);
        if vertex == next {
            let (p, q) = (self.grid.position(a.min(b)), self.grid.position(a.max(b)));
            let p_inside = self.values[a.min(b)] < 0.0;
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                let inside = (self.f)(&(p + middle * (q - p))) < 0.0;
                if inside == p_inside { low = middle } else { high = middle }
            }
            self.surface.vertices.push(p + 0.5 * (low + high) * (q - p));
        }
        vertex
    }

    fn triangle(&mut self, mut corners: [u32; 3], outward: &Vector3<f64>) {
        let [a, b, c] = corners.map(|v| self.surface.vertices[v as usize]);
        if (b - a).cross(&(c - a)).dot(outward) < 0.0 {
            corners.swap(1, 2);
        }
        self.surface.triangles.push(corners);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_in::lattice_from_surface;

    #[test]
    fn a_ball_is_closed_outward_and_has_its_volume() {
        let f = |x: &Vector3<f64>| x.norm() - 1.0;
        let surface = triangulate("ball", &f, Vector3::repeat(-1.2), Vector3::repeat(1.2), 0.1);
        assert!(surface.vertices.iter().all(|v| (v.norm() - 1.0).abs() < 1e-8));
        let (_, report) = lattice_from_surface(&surface, 8, 1.0).unwrap();
        assert!(report.surface.is_clean() && !report.surface.was_inside_out, "{report:?}");
        assert_eq!(report.surface.flipped_triangles, 0);
        assert!((report.surface.volume_m3 / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
    }
}
