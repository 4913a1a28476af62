//! The cells as hexahedra with common points, for files and slices.

use std::collections::BTreeMap;

use super::cells::Octree;
use super::vertices::corner_weights;
use crate::cut::{Solid, SolidCells, SolidOrigin};
use crate::element::MaterialPoint;

impl Octree {
    /// The leaves as hexahedra, built anew at each call. The first points are the vertices of the octree under
    /// their numbers, then come the hanging corners.
    pub fn solid(&self) -> Solid {
        let mut points: Vec<MaterialPoint> =
            (0..self.n_vertices() as u32).map(|v| MaterialPoint::new([(v, 1.0)])).collect();
        // Hanging corners at one lattice point are one point if the same vertices carry them.
        let mut known: BTreeMap<Vec<u32>, u32> = BTreeMap::new();
        let mut cells = Vec::with_capacity(self.cells.len());
        for (id, cell) in self.cells.iter().enumerate() {
            let mut corners = self.vertices[id];
            if self.hanging[id] != 0 {
                let W = corner_weights(cell, self.hanging[id]);
                for c in (0..8).filter(|c| self.hanging[id] >> c & 1 == 1) {
                    let weights = self.vertices[id].into_iter().zip(W[c]).filter(|(_, w)| *w != 0.0);
                    let mut carriers: Vec<(u32, f64)> = weights.collect();
                    carriers.sort_unstable_by_key(|(vertex, _)| *vertex);
                    let key = carriers.iter().map(|(vertex, _)| *vertex).collect();
                    corners[c] = *known.entry(key).or_insert_with(|| {
                        points.push(MaterialPoint::new(carriers));
                        points.len() as u32 - 1
                    });
                }
            }
            cells.push(corners);
        }
        let origin = |id: u32| SolidOrigin { element: id, piece: id, stress: id, fraction: 1.0 };
        let origins = (0..cells.len() as u32).map(origin).collect();
        Solid { vertices: points, cells: SolidCells::Hexes(cells), origins }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Vector3;

    use super::super::*;
    use crate::cut::SolidCells;

    #[test]
    fn hexahedra_share_points_where_the_material_does() {
        let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
        let mut octree = Octree::fill(&shape, OctreeSettings { cells: 16, levels: 2 }, &|_| 0).unwrap();
        for cut in [false, true] {
            if cut {
                let link = CutLink { at: [0.5; 2], normal: [Vector3::x(); 2], incision: 1 };
                let links: Vec<(LinkKey, CutLink)> =
                    (0..12).flat_map(|y| (0..16).map(move |z| (([7, y, z], 0), link))).collect();
                octree.cut(&links);
            }
            let solid = octree.solid();
            let rest = octree.rest_positions();
            let at: Vec<Vector3<f64>> = solid.vertices.iter().map(|p| p.position(&rest)).collect();
            let mut volume: f64 = 0.0;
            let SolidCells::Hexes(hexes) = &solid.cells else { panic!("cells are hexahedra") };
            for (corners, cell) in hexes.iter().zip(octree.cells()) {
                for c in 0..8 {
                    let corner = octree.lattice().point(cell.corner(c));
                    assert!((at[corners[c] as usize] - corner).norm() < 1e-12);
                }
                let edge = |k: usize| at[corners[k] as usize] - at[corners[0] as usize];
                volume += edge(1).cross(&edge(2)).dot(&edge(4));
            }
            assert!((volume - 1.0).abs() < 1e-12);
            // Without a cut every corner of a leaf is one point.
            let places: std::collections::BTreeSet<At> =
                octree.cells().iter().flat_map(|cell| (0..8).map(|c| cell.corner(c))).collect();
            let separate = solid.vertices.len() - places.len();
            // The points at the end of the cut are not doubled.
            assert_eq!(separate, if cut { 12 * 17 } else { 0 });
        }
    }
}
