//! Hexahedra that are equal cubes of one lattice, as the leaves of an octree without levels.

use nalgebra::Vector3;

use super::cells::{Cell, Octree};
use super::lattice::{At, Lattice, LeafMap, OUTSIDE};
use crate::mesh::HexMesh;

/// Largest distance of a node from its lattice point, in sides of a cube.
const SLACK: f64 = 1e-6;
/// Largest number of cubes of the lattice for every hexahedron.
const MOST_EMPTY: usize = 64;

impl Octree {
    /// The cubes of `mesh` as leaves, numbered as its elements, on its nodes as vertices. `None` if the elements are
    /// no equal cubes along the axes, do not lie on one lattice, or do not share the nodes where they touch.
    pub fn of_cubes(mesh: &HexMesh) -> Option<Self> {
        let first = mesh.hexes.first().map(|hex| hex.map(|n| mesh.nodes[n as usize]))?;
        let h = (first[1] - first[0]).norm();
        let low = mesh.nodes.iter().fold(Vector3::repeat(f64::INFINITY), |low, x| low.inf(x));
        let mut lattice = Lattice { origin: low, h, size: [0; 3], levels: 0 };
        let point_of = |x: &Vector3<f64>| -> Option<At> {
            let at = lattice.coordinates(x);
            let near = at.map(f64::round);
            let fits = (at - near).amax() <= SLACK && near.amax() < f64::from(1 << 20);
            fits.then(|| [0, 1, 2].map(|k| near[k] as i32))
        };
        let points: Vec<At> = mesh.nodes.iter().map(point_of).collect::<Option<_>>()?;
        let mut cells = Vec::with_capacity(mesh.hexes.len());
        for hex in &mesh.hexes {
            let cell = Cell::new(points[hex[0] as usize], 0, 0);
            if !(0..8).all(|c| points[hex[c] as usize] == cell.corner(c)) {
                return None;
            }
            cells.push(cell);
        }
        let size = [0, 1, 2].map(|k| cells.iter().map(|cell| cell.at[k] + 1).max().unwrap_or(0) as usize);
        let room = size.iter().try_fold(1usize, |room, n| room.checked_mul(*n))?;
        if room > MOST_EMPTY.saturating_mul(cells.len()) {
            return None;
        }
        lattice.size = size.map(|n| n as u32);
        let mut map = LeafMap::new(lattice.size);
        for (id, cell) in (0u32..).zip(&cells) {
            if map.leaf(cell.at) != OUTSIDE {
                return None;
            }
            map.set(cell.at, 0, id);
        }
        let mut octree = Self::of_leaves(lattice, map, cells);
        octree.take_numbers(mesh, points).then_some(octree)
    }

    /// Gives the vertices the numbers of the nodes of `mesh`. Returns whether they are the same points of the
    /// material.
    fn take_numbers(&mut self, mesh: &HexMesh, points: Vec<At>) -> bool {
        let mut node_of = vec![OUTSIDE; self.n_vertices()];
        for (vertices, hex) in self.vertices.iter_mut().zip(&mesh.hexes) {
            for (vertex, &node) in vertices.iter_mut().zip(hex) {
                let known = &mut node_of[*vertex as usize];
                if *known != OUTSIDE && *known != node {
                    return false;
                }
                (*known, *vertex) = (node, node);
            }
        }
        // A node of two vertices would tie cubes together that touch in an edge or a point only.
        let same = self.points.len() == points.len();
        self.points = points;
        same
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::mesh::box_hexes;

    #[test]
    fn a_box_of_cubes_keeps_its_numbers() {
        let mesh = box_hexes(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.5, 0.0, 0.9), [4, 2, 6]);
        let octree = Octree::of_cubes(&mesh).unwrap();
        assert_eq!(octree.vertices(), &mesh.hexes[..]);
        assert!(octree.hanging().iter().all(|hanging| *hanging == 0));
        let rest = octree.rest_positions();
        let apart = rest.iter().zip(&mesh.nodes).map(|(a, b)| (a - b).norm());
        assert!(apart.fold(0.0, f64::max) < 1e-12);
        // In any order, and not only boxes.
        let mut other = mesh.clone();
        other.hexes.reverse();
        other.hexes.truncate(40);
        let used: std::collections::BTreeSet<u32> = other.hexes.iter().flatten().copied().collect();
        let number: Vec<Option<usize>> =
            (0..mesh.nodes.len() as u32).map(|n| used.iter().position(|&u| u == n)).collect();
        other.hexes.iter_mut().flatten().for_each(|n| *n = number[*n as usize].unwrap() as u32);
        other.nodes = used.iter().map(|&n| mesh.nodes[n as usize]).collect();
        assert_eq!(Octree::of_cubes(&other).unwrap().vertices(), &other.hexes[..]);
    }

    #[test]
    fn what_is_no_lattice_of_cubes_is_none() {
        let cuboids = box_hexes(Vector3::zeros(), Vector3::new(1.0, 1.0, 1.1), [2, 2, 2]);
        assert!(Octree::of_cubes(&cuboids).is_none());
        let mut bent = box_hexes(Vector3::zeros(), Vector3::repeat(1.0), [2, 2, 2]);
        bent.nodes[13].x += 1e-3;
        assert!(Octree::of_cubes(&bent).is_none());
        // Two halves that touch without sharing nodes would be joined.
        let mut apart = box_hexes(Vector3::zeros(), Vector3::new(2.0, 1.0, 1.0), [2, 1, 1]);
        let doubled: Vec<u32> = apart.hexes[1].to_vec();
        let n = apart.nodes.len() as u32;
        for (k, node) in doubled.iter().enumerate() {
            apart.nodes.push(apart.nodes[*node as usize]);
            apart.hexes[1][k] = n + k as u32;
        }
        assert!(Octree::of_cubes(&apart).is_none());
        assert!(Octree::of_cubes(&HexMesh::default()).is_none());
    }
}
