//! The surface of an octree body by dual contouring: skin, and the two lips of every cut.
//!
//! Every cut link gives one quad on each inner side. The corners of a quad lie in the four dual cells around its
//! link: the cubes of eight finest cells around a lattice point. Quads are [joined](links) across an edge by
//! walking through linked cells around it, so the surface connects exactly what the material connects. The
//! corners that these joints bring together are one patch of a dual cell, and one vertex. The surface is
//! therefore closed and 2-manifold, whatever is cut.
//!
//! A vertex lies where the planes of the cuts around it [meet](place), which keeps rims sharp. It is bound to the
//! nearest cell of its patch.
//!
//! A body that was made from a surface can show [its triangles](own) where no cut has touched them.
//!
//! # Source
//! Ju, Losasso, Schaefer, Warren 2002: Dual contouring of Hermite data. Schaefer, Ju, Warren 2007: Manifold dual
//! contouring. Wu, Dick, Westermann 2011: Interactive high-resolution boundary surfaces for deformable bodies with
//! changing topology. Dick, Georgii, Westermann 2011, §7, for the binding.
//!
//! # Limit
//! Parts of the surface may pass through each other by less than the side of a finest cell, e.g. the lips of two
//! incisions near their crossing.

mod links;
mod mosaic;
mod own;
mod patches;
mod place;
mod triangles;

use nalgebra::Vector3;

use super::cells::Octree;
use super::coarsen::Coarsening;
use super::lattice::{DIRECTIONS, OUTSIDE};
use super::link_map::LinkKey;
use crate::cut::Surface;
use links::partner;
pub use own::OwnSkin;
use patches::{Patches, Vertices};
use place::{Crossing, place};

/// No quad, or an open edge.
const NONE: u32 = u32::MAX;

/// The surface of an octree, kept up to date at a cost that depends on what a cut changed.
///
/// Quads are never removed: a cut link stays cut, and its ends are never divided. The triangles of quad q are 2q
/// and 2q + 1. They keep their numbers, new ones follow; numbers of vertices may change.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct OctreeSurface {
    surface: Surface,
    /// Face of every quad: 6·leaf + direction.
    faces: Vec<u32>,
    /// Quad of every face, or [`NONE`].
    quad_at: Vec<u32>,
    /// Where the link of every quad is cut on the side of its leaf.
    crossings: Vec<Crossing>,
    /// Whether the diagonal of a quad runs from corner 1 to 3 instead of 0 to 2.
    turned: Vec<bool>,
    patches: Patches,
    /// Position of every vertex at rest [m].
    rest: Vec<Vector3<f64>>,
    doubled: triangles::Doubled,
    /// Quads around the vertices that were placed last.
    around: Vec<u32>,
    /// The faces of a patch.
    patch: Vec<u32>,
}

impl OctreeSurface {
    /// The surface of `octree`.
    pub fn build(octree: &Octree) -> Self {
        let mut surface = Self::default();
        let cells: Vec<u32> =
            (0u32..).zip(octree.cells()).filter(|(_, cell)| cell.cut != 0).map(|(id, _)| id).collect();
        surface.follow(octree, &cells, &[]);
        surface
    }

    /// Triangles with their tags, and vertices bound to the vertices of the octree.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Follows a change: `cells` have other links, vertices or hanging corners
    /// ([`OctreeChange::cells`](super::OctreeChange::cells)), and `links` may be cut at other places.
    ///
    /// The triangles are those of a new surface, with other numbers.
    pub fn follow(&mut self, octree: &Octree, cells: &[u32], links: &[LinkKey]) {
        self.begin();
        self.collect_quads(octree, cells, links);
        self.join_quads(octree);
        self.place_vertices(octree);
        self.triangulate(octree);
        self.divide_doubled_edges(octree);
    }

    /// Follows a coarsening. Quads belong to finest leaves, which stay.
    pub fn follow_coarsening(&mut self, octree: &Octree, change: &Coarsening) {
        let face = |face: u32| 6 * change.cell_of[face as usize / 6] + face % 6;
        self.faces.iter_mut().for_each(|known| *known = face(*known));
        self.doubled.renumber(face);
        self.quad_at.clear();
        self.quad_at.resize(6 * octree.cells().len(), NONE);
        for (q, &face) in (0u32..).zip(&self.faces) {
            self.quad_at[face as usize] = q;
        }
        self.surface.vertices.iter_mut().for_each(|point| *point = change.renumbered(point));
        self.follow(octree, &change.cells, &[]);
    }

    /// Finds the quads of changed cells and links, and where their links are cut.
    fn collect_quads(&mut self, octree: &Octree, cells: &[u32], links: &[LinkKey]) {
        self.quad_at.resize(6 * octree.cells().len(), NONE);
        for &id in cells {
            let cell = octree.cells()[id as usize];
            (0..6).filter(|d| cell.cut >> d & 1 == 1).for_each(|d| self.touch(octree, 6 * id + d));
        }
        for &(at, axis) in links {
            let mut upper = at;
            upper[usize::from(axis)] += 1;
            for (end, d) in [(at, 2 * axis + 1), (upper, 2 * axis)] {
                let leaf = octree.leaf(end);
                if leaf != OUTSIDE && !octree.is_linked(end, usize::from(d)) {
                    self.touch(octree, 6 * leaf + u32::from(d));
                }
            }
        }
    }

    fn touch(&mut self, octree: &Octree, face: u32) {
        let (crossing, tag) = Crossing::of(octree, face);
        let mut q = self.quad_at[face as usize];
        if q == NONE {
            q = self.faces.len() as u32;
            self.quad_at[face as usize] = q;
            self.faces.push(face);
            self.crossings.push(crossing);
            self.turned.push(false);
            self.patches.add_quad();
            self.surface.triangles.extend([[NONE; 3]; 2]);
            self.surface.tags.extend([tag; 2]);
        }
        self.crossings[q as usize] = crossing;
        self.patches.touch(q);
    }

    /// Pairs the edges of all touched quads.
    fn join_quads(&mut self, octree: &Octree) {
        for i in 0..self.patches.touched().len() {
            let q = self.patches.touched()[i];
            for h in 4 * q..4 * q + 4 {
                self.open(h);
            }
        }
        let mut i = 0;
        while i < self.patches.touched().len() {
            let q = self.patches.touched()[i];
            for h in 4 * q..4 * q + 4 {
                if self.patches.twin(h) != NONE {
                    continue;
                }
                let (face, edge) = partner(octree, self.faces[q as usize], h as usize % 4);
                if self.quad_at[face as usize] == NONE {
                    self.touch(octree, face);
                }
                let other = 4 * self.quad_at[face as usize] + edge;
                // A quad that loses its partner here finds another one later in this loop.
                let left = self.patches.twin(other);
                if left != NONE {
                    self.patches.touch(left / 4);
                    self.open(other);
                }
                self.patches.join(h, other);
            }
            i += 1;
        }
    }

    fn open(&mut self, h: u32) {
        if self.patches.twin(h) != NONE {
            self.doubled.forget(self.edge_name(h));
            self.patches.open(h);
        }
    }

    /// Numbers the patches around all touched quads and places their vertices.
    fn place_vertices(&mut self, octree: &Octree) {
        let (faces, crossings, patch) = (&self.faces, &self.crossings, &mut self.patch);
        let quad_at = &self.quad_at;
        let mut vertices = Vertices { rest: &mut self.rest, points: &mut self.surface.vertices };
        self.patches.number(&mut vertices, |corners| {
            patch.clear();
            patch.extend(corners.iter().map(|&c| faces[c as usize / 4]));
            // Sums do not depend on where the walk around the patch began.
            patch.sort_unstable();
            let (face, corner) = (faces[corners[0] as usize / 4], corners[0] as usize % 4);
            let at = octree.cells()[face as usize / 6].corner(links::CORNERS[face as usize % 6][corner]);
            place(octree, at, patch, |face| crossings[quad_at[face as usize] as usize])
        });
    }

    /// Position at rest of the corners of a quad [m].
    fn corners(&self, q: u32) -> [Vector3<f64>; 4] {
        [0, 1, 2, 3].map(|k| self.rest[self.patches.vertex(4 * q + k) as usize])
    }

    /// Outward direction of a quad along its link.
    fn direction(&self, q: u32) -> Vector3<f64> {
        Vector3::from(DIRECTIONS[self.faces[q as usize] as usize % 6].map(f64::from))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
