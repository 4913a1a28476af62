//! The body-centred cubic lattice: nodes, edges and tetrahedra by index arithmetic.
//!
//! Nodes are the corners and the centres of cubes of side h. Every pair of neighbouring centres makes a
//! tetrahedron with each side of the square between them. It has two opposite edges of length h (*long*) and
//! four of √3/2 h (*short*). All tets are congruent, with dihedral angles of 60° and 90°.
//!
//! # Source
//! Labelle, Shewchuk 2007, "Isosurface stuffing", §3.

use nalgebra::Vector3;

/// A lattice over a box.
pub(super) struct Bcc {
    /// Position of corner (0, 0, 0) [m].
    pub origin: Vector3<f64>,
    /// Side of a cube [m].
    pub spacing: f64,
    /// Cubes along x, y, z.
    pub cubes: [usize; 3],
}

/// A lattice edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    /// Smaller node number.
    pub a: u32,
    /// Larger node number.
    pub b: u32,
}

impl Edge {
    /// The edge between two nodes.
    pub(super) fn new(a: u32, b: u32) -> Self {
        Edge { a: a.min(b), b: a.max(b) }
    }
}

impl Bcc {
    /// A lattice with `cells` cubes along the longest side of the box, and a margin of cubes entirely outside
    /// it.
    pub(super) fn around(low: Vector3<f64>, high: Vector3<f64>, cells: usize) -> Self {
        let size = high - low;
        let spacing = size.max() / cells as f64;
        let cubes = [0, 1, 2].map(|axis| (size[axis] / spacing).ceil() as usize + 3);
        let extent = Vector3::from(cubes.map(|n| n as f64 * spacing));
        Bcc { origin: 0.5 * (low + high - extent), spacing, cubes }
    }

    fn n_corners(&self) -> usize {
        self.cubes.iter().map(|n| n + 1).product()
    }

    /// Number of nodes.
    pub(super) fn n_nodes(&self) -> usize {
        self.n_corners() + self.cubes.iter().product::<usize>()
    }

    fn corner(&self, [i, j, k]: [usize; 3]) -> u32 {
        (i + (self.cubes[0] + 1) * (j + (self.cubes[1] + 1) * k)) as u32
    }

    fn centre(&self, [i, j, k]: [usize; 3]) -> u32 {
        (self.n_corners() + i + self.cubes[0] * (j + self.cubes[1] * k)) as u32
    }

    /// Position of a node [m].
    pub(super) fn position(&self, node: u32) -> Vector3<f64> {
        let node = node as usize;
        let (index, side, shift) = match node.checked_sub(self.n_corners()) {
            None => (node, self.cubes.map(|n| n + 1), 0.0),
            Some(index) => (index, self.cubes, 0.5),
        };
        let ijk = [index % side[0], index / side[0] % side[1], index / (side[0] * side[1])];
        self.origin + Vector3::from(ijk.map(|c| (c as f64 + shift) * self.spacing))
    }

    /// Whether an edge has length h (corner–corner or centre–centre).
    pub(super) fn is_long(&self, edge: Edge) -> bool {
        ((edge.a as usize) < self.n_corners()) == ((edge.b as usize) < self.n_corners())
    }

    /// Calls `visit` for every tetrahedron, positively oriented, in a fixed order.
    pub(super) fn for_each_tet(&self, mut visit: impl FnMut([u32; 4])) {
        let [nx, ny, nz] = self.cubes;
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    for axis in 0..3 {
                        let cube = [i, j, k];
                        if cube[axis] + 1 < self.cubes[axis] {
                            self.tets_across(cube, axis, &mut visit);
                        }
                    }
                }
            }
        }
    }

    /// The four tets between a cube and its successor along `axis`.
    fn tets_across(&self, cube: [usize; 3], axis: usize, visit: &mut impl FnMut([u32; 4])) {
        let shifted = |steps: [usize; 3]| [0, 1, 2].map(|a| cube[a] + steps[a]);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut forward = [0; 3];
        forward[axis] = 1;
        let (near, far) = (self.centre(cube), self.centre(shifted(forward)));
        // The square's corners, counter-clockwise seen from the far centre.
        let ring = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[s, t]| {
            let mut steps = forward;
            (steps[u], steps[v]) = (s, t);
            self.corner(shifted(steps))
        });
        for side in 0..4 {
            visit([near, far, ring[side], ring[(side + 1) % 4]]);
        }
    }

    /// The edges for which `wanted` is true, each once, in a fixed order. (There are seven edges per node in
    /// all.)
    pub(super) fn edges(&self, wanted: impl Fn(Edge) -> bool) -> Vec<Edge> {
        let mut edges = Vec::new();
        let mut keep = |a: u32, b: u32| {
            let edge = Edge::new(a, b);
            if wanted(edge) {
                edges.push(edge);
            }
        };
        let [nx, ny, nz] = self.cubes;
        for k in 0..=nz {
            for j in 0..=ny {
                for i in 0..=nx {
                    let here = [i, j, k];
                    for axis in 0..3 {
                        let mut next = here;
                        next[axis] += 1;
                        if next[axis] <= self.cubes[axis] {
                            keep(self.corner(here), self.corner(next));
                        }
                        if i < nx && j < ny && k < nz && next[axis] < self.cubes[axis] {
                            keep(self.centre(here), self.centre(next));
                        }
                    }
                    if i < nx && j < ny && k < nz {
                        for c in 0..8 {
                            let corner = self.corner([i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2)]);
                            keep(self.centre(here), corner);
                        }
                    }
                }
            }
        }
        edges
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_physics::mesh::{TetQuality, tet_volume};
    use std::collections::BTreeSet;

    #[test]
    fn tets_are_positive_congruent_and_use_the_listed_edges() {
        let lattice = Bcc::around(Vector3::zeros(), Vector3::new(1.0, 0.6, 0.4), 5);
        let all = lattice.edges(|_| true);
        let edges: BTreeSet<Edge> = all.iter().copied().collect();
        assert_eq!(edges.len(), all.len());
        let mut used = BTreeSet::new();
        lattice.for_each_tet(|tet| {
            let x = tet.map(|n| lattice.position(n));
            assert!((tet_volume(&x) - lattice.spacing.powi(3) / 12.0).abs() < 1e-12);
            assert!((TetQuality::of(&x).min_dihedral_rad.to_degrees() - 60.0).abs() < 1e-6);
            for (i, &a) in tet.iter().enumerate() {
                used.extend(tet[..i].iter().map(|&b| Edge::new(a, b)));
            }
        });
        assert!(used.is_subset(&edges));
    }
}
