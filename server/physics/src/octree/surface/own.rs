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

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::Vector3;

use super::super::cells::Octree;
use super::super::coarsen::Coarsening;
use super::place::{Crossing, bind};
use super::{NONE, OctreeSurface};
use crate::cut::Surface;
use crate::element::MaterialPoint;
use crate::space::skin::{Ground, Kept, Laid, LaidPoint, OwnSurface, SkinError, SkinShape};

/// The surface of an octree body with the triangles of another surface.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct OwnSkin {
    uncut: Arc<Uncut>,
    /// Cell that carries each point of the surface, and the cells that carry points, ascending, with these.
    leaf: Vec<u32>,
    carried: Vec<(u32, u32)>,
    /// Each point of the surface in the material.
    bound: Vec<MaterialPoint>,
    /// Whether the three vertices of each triangle of dual contouring are whole.
    whole: Vec<bool>,
    surface: Surface,
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

/// A vertex of the surface that is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Source {
    /// Point of the surface that was laid.
    Own(u32),
    /// Vertex of dual contouring.
    Dual(u32),
}

/// A vertex with its place at rest [m].
type Placed = (u32, Vector3<f64>);

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
            surface: Surface::default(),
        };
        skin.begin_anew(octree, dual);
        Ok(skin)
    }

    /// Skin and lips.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// How much of the surface became the skin of the uncut body.
    pub fn kept(&self) -> Kept {
        self.uncut.kept
    }

    /// Returns to the uncut body; `dual` is its surface.
    pub fn begin_anew(&mut self, octree: &Octree, dual: &OctreeSurface) {
        self.leaf.clone_from(&self.uncut.leaf);
        self.whole = vec![true; 2 * dual.faces.len()];
        self.bind_all(octree);
        self.show(octree, dual);
    }

    /// Follows a change that `dual` has followed: `cells` have other vertices.
    pub fn follow(&mut self, octree: &Octree, dual: &OctreeSurface, cells: &[u32]) {
        for &cell in cells {
            let first = self.carried.partition_point(|(leaf, _)| *leaf < cell);
            let points = self.carried[first..].iter().take_while(|(leaf, _)| *leaf == cell);
            for &(_, p) in points {
                self.bound[p as usize] = bind(octree, cell, self.uncut.laid.points[p as usize].rest).point;
            }
        }
        self.look_again(dual);
        self.show(octree, dual);
    }

    /// Follows a coarsening that `dual` has followed.
    pub fn follow_coarsening(&mut self, octree: &Octree, dual: &OctreeSurface, change: &Coarsening) {
        self.leaf.iter_mut().for_each(|leaf| *leaf = change.cell_of[*leaf as usize]);
        self.bind_all(octree);
        self.look_again(dual);
        self.show(octree, dual);
    }

    fn bind_all(&mut self, octree: &Octree) {
        self.carried.clear();
        self.carried.extend(self.leaf.iter().copied().zip(0..));
        self.carried.sort_unstable();
        self.bound.clear();
        let points = self.leaf.iter().zip(&self.uncut.laid.points);
        self.bound.extend(points.map(|(&leaf, point)| bind(octree, leaf, point.rest).point));
    }

    /// Determines which triangles around the vertices that changed last are whole.
    fn look_again(&mut self, dual: &OctreeSurface) {
        self.whole.resize(2 * dual.faces.len(), false);
        for &q in dual.around.iter().filter(|q| (**q as usize) < self.uncut.turned.len()) {
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

    /// Puts the surface together.
    fn show(&mut self, octree: &Octree, dual: &OctreeSurface) {
        let halved = dual.halved();
        let divided: BTreeSet<u32> = halved.iter().map(|h| h / 3).collect();
        let mut made = Made {
            skin: self,
            octree,
            dual,
            own: vec![NONE; self.uncut.laid.points.len()],
            of_dual: vec![NONE; dual.rest.len()],
            middles: BTreeMap::new(),
            surface: Surface::default(),
        };
        for t in 0..2 * dual.faces.len() as u32 {
            let tag = dual.surface.tags[t as usize];
            if made.skin.is_shown(t, &divided) {
                for corners in self.uncut.laid.over(t) {
                    let corners = corners.map(|p| made.vertex(Source::Own(p)).0);
                    made.add(corners, tag);
                }
            } else {
                made.divide(t, tag, &halved, &divided);
            }
        }
        self.surface = made.surface;
    }

    fn is_shown(&self, t: u32, divided: &BTreeSet<u32>) -> bool {
        self.whole[t as usize] && !divided.contains(&t)
    }
}

/// A surface that is being put together.
struct Made<'a> {
    skin: &'a OwnSkin,
    octree: &'a Octree,
    dual: &'a OctreeSurface,
    /// Vertex of each point of the surface that was laid, if it has one already.
    own: Vec<u32>,
    /// The same for each vertex of dual contouring.
    of_dual: Vec<u32>,
    /// Vertices in the middle of edges, by the smaller of their half-edges.
    middles: BTreeMap<u32, Placed>,
    surface: Surface,
}

impl Made<'_> {
    fn add(&mut self, corners: [u32; 3], tag: u32) {
        self.surface.triangles.push(corners);
        self.surface.tags.push(tag);
    }

    fn push(&mut self, point: MaterialPoint) -> u32 {
        self.surface.vertices.push(point);
        self.surface.vertices.len() as u32 - 1
    }

    fn vertex(&mut self, source: Source) -> Placed {
        let (number, rest, point) = match source {
            Source::Own(p) => {
                let p = p as usize;
                (self.own[p], self.skin.uncut.laid.points[p].rest, self.skin.bound[p])
            }
            Source::Dual(v) => {
                let v = v as usize;
                (self.of_dual[v], self.dual.rest[v], self.dual.surface.vertices[v])
            }
        };
        if number != NONE {
            return (number, rest);
        }
        let number = self.push(point);
        match source {
            Source::Own(p) => self.own[p as usize] = number,
            Source::Dual(v) => self.of_dual[v as usize] = number,
        }
        (number, rest)
    }

    /// Shows a triangle of dual contouring, as a fan if points lie on its edges.
    fn divide(&mut self, t: u32, tag: u32, halved: &BTreeSet<u32>, divided: &BTreeSet<u32>) {
        let mut ring: Vec<Placed> = Vec::with_capacity(8);
        for h in 3 * t..3 * t + 3 {
            let corner = self.corner(h);
            ring.push(corner);
            let twin = self.dual.triangle_twin(h);
            if self.skin.is_shown(twin / 3, divided) {
                for &p in self.skin.uncut.laid.side(twin).iter().rev() {
                    ring.push(self.vertex(Source::Own(p)));
                }
            } else if halved.contains(&h) {
                let next = self.corner(h / 3 * 3 + (h + 1) % 3);
                ring.push(self.middle(h.min(twin), t, (corner.1 + next.1) / 2.0));
            }
        }
        if let [a, b, c] = ring[..] {
            return self.add([a, b, c].map(|p| p.0), tag);
        }
        let mean = ring.iter().map(|p| p.1).sum::<Vector3<f64>>() / ring.len() as f64;
        let centre = self.push(bind(self.octree, self.dual.faces[t as usize / 2] / 6, mean).point);
        for k in 0..ring.len() {
            self.add([ring[k].0, ring[(k + 1) % ring.len()].0, centre], tag);
        }
    }

    /// The vertex at the first end of half-edge 3·triangle + k.
    fn corner(&mut self, h: u32) -> Placed {
        let corner = self.dual.corner(h);
        // Triangles in which one diagonal has taken the place of the other have the same corners.
        let own = self.skin.is_whole(self.dual, corner).then(|| self.skin.uncut.own_point(corner));
        self.vertex(own.map_or_else(|| Source::Dual(self.dual.patches.vertex(corner)), Source::Own))
    }

    /// The vertex in the middle of an edge.
    fn middle(&mut self, edge: u32, t: u32, at: Vector3<f64>) -> Placed {
        if let Some(known) = self.middles.get(&edge) {
            return *known;
        }
        let point = bind(self.octree, self.dual.faces[t as usize / 2] / 6, at).point;
        let made = (self.push(point), at);
        self.middles.insert(edge, made);
        made
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

    /// The half-edges of all doubled edges that are divided.
    fn halved(&self) -> BTreeSet<u32> {
        self.doubled_half_edges().flat_map(|h| [h, self.triangle_twin(h)]).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
