//! The triangles of a surface in place of those of dual contouring, where no cut has touched them.
//!
//! The surface is [laid](Laid) on the triangles of the uncut body. A vertex of dual contouring is whole as long as the
//! quads around it are joined as in the uncut body, and their links are cut at the same places. Over a triangle with
//! three whole vertices the surface's own triangles are shown; all others are shown themselves, divided where they meet
//! points of the surface along an edge. So skin and lips stay closed and 2-manifold, and the skin along a cut is that of
//! dual contouring, about two cells wide.
//!
//! Each point of the surface is bound to the nearest of the cells around the vertices that it lies between. As long as
//! these are whole, links join those cells.
//!
//! # Limit
//! Points outside their cells are carried by their extrapolation, which differs from that of the next cell by about
//! h²u″/2. Triangles that are much finer than cells show this as faint steps where the body is strongly bent.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::Vector3;

use super::super::cells::Octree;
use super::super::coarsen::Coarsening;
use super::OctreeSurface;
use super::mosaic::{Mosaic, Source};
use super::place::{Crossing, bind};
use crate::cut::Surface;
use crate::element::MaterialPoint;
use crate::skin::{Ground, Kept, Laid, LaidPoint, OwnSurface, SkinError, SkinShape};

/// The surface of an octree body with the triangles of another surface.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct OwnSkin {
    uncut: Arc<Uncut>,
    /// Cell that carries each point of the surface, and the cells that carry points, ascending, with these.
    leaf: Vec<u32>,
    carried: Vec<(u32, u32)>,
    /// Each point of the surface in the material.
    bound: Vec<MaterialPoint>,
    /// Whether the three vertices of each triangle of dual contouring are whole, and whether the surface's own triangles are
    /// shown over it.
    whole: Vec<bool>,
    shown: Vec<bool>,
    /// Half-edges of doubled edges that are divided.
    halved: BTreeSet<u32>,
    mosaic: Mosaic,
}

/// What the skin was like before all cuts.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Uncut {
    laid: Laid,
    kept: Kept,
    leaf: Vec<u32>,
    twin: Vec<u32>,
    crossings: Vec<Crossing>,
    turned: Vec<bool>,
}

/// A vertex with its place at rest [m].
type PlacedVertex = (u32, Vector3<f64>);

impl OwnSkin {
    /// Lays `own` on the surface of an uncut body. Where the two do not go together, the skin rests where `shape` says.
    ///
    /// # Errors
    /// Too many triangles, or a place that is not finite.
    pub fn new(
        octree: &Octree,
        dual: &OctreeSurface,
        own: &OwnSurface<'_>,
        shape: &mut SkinShape<'_>,
    ) -> Result<Self, SkinError> {
        let triangles = dual.ground();
        let twin: Vec<usize> =
            (0..3 * triangles.len() as u32).map(|h| dual.triangle_twin(h) as usize).collect();
        let ground = Ground { vertices: &dual.rest, triangles: &triangles, twin: &twin };
        let (laid, kept) = Laid::new(&ground, own, shape)?;
        let mut around = vec![Vec::new(); dual.rest.len()];
        for c in 0..4 * dual.faces.len() as u32 {
            around[dual.patches.vertex(c) as usize].push(dual.faces[c as usize / 4] / 6);
        }
        let centre = |leaf: u32| octree.lattice().centre(octree.cells()[leaf as usize].at);
        let nearest = |point: &LaidPoint| {
            let leaves = point.between().flat_map(|v| around[v as usize].iter().copied());
            let far = |leaf: u32| (centre(leaf) - point.rest).norm_squared();
            leaves.min_by(|&a, &b| far(a).total_cmp(&far(b)).then(a.cmp(&b))).unwrap_or(0)
        };
        let leaf: Vec<u32> = laid.points.iter().map(nearest).collect();
        let uncut = Uncut {
            laid,
            kept,
            leaf,
            twin: (0..4 * dual.faces.len() as u32).map(|h| dual.patches.twin(h)).collect(),
            crossings: dual.crossings.clone(),
            turned: dual.turned.clone(),
        };
        let mut skin = Self {
            uncut: Arc::new(uncut),
            leaf: Vec::new(),
            carried: Vec::new(),
            bound: Vec::new(),
            whole: Vec::new(),
            shown: Vec::new(),
            halved: BTreeSet::new(),
            mosaic: Mosaic::default(),
        };
        skin.begin_anew(octree, dual);
        Ok(skin)
    }

    /// Skin and lips.
    pub fn surface(&self) -> &Surface {
        self.mosaic.surface()
    }

    /// How much of the surface became the skin of the uncut body.
    pub fn kept(&self) -> Kept {
        self.uncut.kept
    }

    /// Returns to the uncut body; `dual` is its surface.
    pub fn begin_anew(&mut self, octree: &Octree, dual: &OctreeSurface) {
        self.leaf.clone_from(&self.uncut.leaf);
        self.carry();
        let points = self.leaf.iter().zip(&self.uncut.laid.points);
        self.bound = points.map(|(&leaf, point)| bind(octree, leaf, point.rest).point).collect();
        self.mosaic = Mosaic::default();
        self.shown.clear();
        self.whole = vec![true; 2 * dual.faces.len()];
        self.show(octree, dual, 0..dual.faces.len() as u32);
    }

    /// Follows a change that `dual` has followed: `cells` have other vertices. The cost depends on what changed.
    pub fn follow(&mut self, octree: &Octree, dual: &OctreeSurface, cells: &[u32]) {
        for &cell in cells {
            let first = self.carried.partition_point(|(leaf, _)| *leaf < cell);
            let points = self.carried[first..].iter().take_while(|(leaf, _)| *leaf == cell);
            for &(_, p) in points {
                let point = bind(octree, cell, self.uncut.laid.points[p as usize].rest).point;
                self.mosaic.rebind(Source::Own(p), &point);
                self.bound[p as usize] = point;
            }
        }
        self.look_again(dual, &dual.around);
        self.show(octree, dual, dual.around.iter().copied());
    }

    /// Follows a coarsening that `dual` has followed.
    pub fn follow_coarsening(&mut self, octree: &Octree, dual: &OctreeSurface, change: &Coarsening) {
        self.leaf.iter_mut().for_each(|leaf| *leaf = change.cell_of[*leaf as usize]);
        self.carry();
        self.bound.iter_mut().for_each(|point| *point = change.renumbered(point));
        self.mosaic.rebind_all(|point| change.renumbered(point));
        self.follow(octree, dual, &change.cells);
    }

    /// Sorts the points by their cells.
    fn carry(&mut self) {
        self.carried.clear();
        self.carried.extend(self.leaf.iter().copied().zip(0..));
        self.carried.sort_unstable();
    }

    /// Determines which triangles of these quads are whole.
    fn look_again(&mut self, dual: &OctreeSurface, quads: &[u32]) {
        self.whole.resize(2 * dual.faces.len(), false);
        for &q in quads.iter().filter(|q| (**q as usize) < self.uncut.turned.len()) {
            let whole = [0, 1, 2, 3].map(|k| self.is_whole(dual, 4 * q + k));
            let same = dual.turned[q as usize] == self.uncut.turned[q as usize];
            for t in 2 * q..2 * q + 2 {
                let corners = [0, 1, 2].map(|k| whole[dual.corner(3 * t + k) as usize % 4]);
                self.whole[t as usize] = same && corners == [true; 3];
            }
        }
    }

    /// Whether the vertex at a corner of a quad is whole.
    fn is_whole(&self, dual: &OctreeSurface, corner: u32) -> bool {
        let mut whole = true;
        dual.patches.for_patch(corner, |c| {
            let (q, h) = (c as usize / 4, c / 4 * 4 + (c + 3) % 4);
            whole &= self.uncut.twin.get(h as usize).is_some_and(|twin| *twin == dual.patches.twin(h))
                && self.uncut.crossings[q] == dual.crossings[q];
        });
        whole
    }

    /// Shows what lies over these quads anew, with everything beside it that this changes.
    fn show(&mut self, octree: &Octree, dual: &OctreeSurface, quads: impl Iterator<Item = u32>) {
        let halved: BTreeSet<u32> =
            dual.doubled_half_edges().flat_map(|h| [h, dual.triangle_twin(h)]).collect();
        let mut stale: Vec<u32> = quads.flat_map(|q| [2 * q, 2 * q + 1]).collect();
        stale.extend(self.halved.iter().chain(&halved).map(|h| h / 3));
        stale.sort_unstable();
        stale.dedup();
        self.halved = halved;
        self.shown.resize(2 * dual.faces.len(), false);
        for i in 0..stale.len() {
            let t = stale[i];
            let shown = self.whole[t as usize] && self.halved.range(3 * t..3 * t + 3).next().is_none();
            if std::mem::replace(&mut self.shown[t as usize], shown) != shown {
                stale.extend((3 * t..3 * t + 3).map(|h| dual.triangle_twin(h) / 3));
            }
        }
        stale.sort_unstable();
        stale.dedup();
        self.mosaic.set_groups(2 * dual.faces.len());
        stale.iter().for_each(|&t| self.mosaic.clear(t));
        let uncut = Arc::clone(&self.uncut);
        for &t in &stale {
            let tag = dual.surface.tags[t as usize];
            if self.shown[t as usize] {
                for corners in uncut.laid.over(t) {
                    let corners = corners.map(|p| self.own_vertex(p).0);
                    self.mosaic.add(t, corners, tag);
                }
            } else {
                self.divide(octree, dual, t, tag);
            }
        }
        self.mosaic.drop_loose();
    }

    /// Shows a triangle of dual contouring, as a fan if points lie on its edges.
    fn divide(&mut self, octree: &Octree, dual: &OctreeSurface, t: u32, tag: u32) {
        let mut ring: Vec<PlacedVertex> = Vec::with_capacity(8);
        for h in 3 * t..3 * t + 3 {
            let corner = self.corner(dual, h);
            ring.push(corner);
            let twin = dual.triangle_twin(h);
            if self.shown[twin as usize / 3] {
                let uncut = Arc::clone(&self.uncut);
                ring.extend(uncut.laid.side(twin).iter().rev().map(|&p| self.own_vertex(p)));
            } else if self.halved.contains(&h) {
                // The same for both triangles at the edge.
                let edge = h.min(twin);
                let ends = [edge, edge / 3 * 3 + (edge + 1) % 3].map(|h| self.corner(dual, h).1);
                let at = (ends[0] + ends[1]) / 2.0;
                let point = bind(octree, dual.faces[edge as usize / 6] / 6, at).point;
                ring.push((self.mosaic.vertex(Source::Middle(edge), point), at));
            }
        }
        if let [a, b, c] = ring[..] {
            return self.mosaic.add(t, [a, b, c].map(|p| p.0), tag);
        }
        let mean = ring.iter().map(|p| p.1).sum::<Vector3<f64>>() / ring.len() as f64;
        let point = bind(octree, dual.faces[t as usize / 2] / 6, mean).point;
        let centre = self.mosaic.vertex(Source::Centre(t), point);
        for k in 0..ring.len() {
            self.mosaic.add(t, [ring[k].0, ring[(k + 1) % ring.len()].0, centre], tag);
        }
    }

    /// The vertex of a point of the surface.
    fn own_vertex(&mut self, p: u32) -> PlacedVertex {
        let v = self.mosaic.vertex(Source::Own(p), self.bound[p as usize]);
        (v, self.uncut.laid.points[p as usize].rest)
    }

    /// The vertex at the first end of half-edge 3·triangle + k.
    fn corner(&mut self, dual: &OctreeSurface, h: u32) -> PlacedVertex {
        let corner = dual.corner(h);
        if self.is_whole(dual, corner) {
            return self.own_vertex(self.uncut.own_point(corner));
        }
        let v = dual.patches.vertex(corner);
        let point = dual.surface.vertices[v as usize];
        (self.mosaic.vertex(Source::Dual(v), point), dual.rest[v as usize])
    }
}

impl Uncut {
    /// Point at a corner 4·quad + k.
    fn own_point(&self, corner: u32) -> u32 {
        let (q, k) = (corner / 4, corner % 4);
        let s = u32::from(self.turned[q as usize]);
        // Corners s, s + 1, s + 2 of the quad are those of its first triangle, s + 3 is the second one of the other.
        let at = match (k + 4 - s) % 4 {
            3 => 3 * (2 * q + 1) + 1,
            first => 6 * q + first,
        };
        self.laid.corners[at as usize]
    }
}

impl OctreeSurface {
    /// The triangles before doubled edges are divided.
    pub fn ground(&self) -> Vec<[u32; 3]> {
        let of = |t: u32| [0, 1, 2].map(|k| self.patches.vertex(self.corner(3 * t + k)));
        (0..2 * self.faces.len() as u32).map(of).collect()
    }

    /// Where its vertices rest before doubled edges are divided [m].
    pub fn rest(&self) -> &[Vector3<f64>] {
        &self.rest
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
