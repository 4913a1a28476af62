//! A surface in groups of triangles that are replaced as a whole, at a cost that depends on what is replaced.
//!
//! The last triangle takes the number of one that is gone, the last vertex that of one that no triangle uses any more.

use std::collections::BTreeMap;

use super::NONE;
use crate::cut::Surface;
use crate::element::MaterialPoint;

/// What a vertex stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub(super) enum Source {
    /// Point of a surface that was laid on dual contouring.
    Own(u32),
    /// Vertex of dual contouring.
    Dual(u32),
    /// Middle of the edge with this half-edge.
    Middle(u32),
    /// Middle of a group.
    Centre(u32),
}

/// A surface, with the triangles of every group and around every vertex.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Mosaic {
    surface: Surface,
    /// What each vertex stands for.
    sources: Vec<Source>,
    /// The vertex of each of these, or [`NONE`].
    own: Vec<u32>,
    dual: Vec<u32>,
    middles: BTreeMap<u32, u32>,
    centres: Vec<u32>,
    /// The first corner 3·triangle + k at each vertex, and the next one after each corner.
    at: Vec<u32>,
    next_at: Vec<u32>,
    /// The group of each triangle.
    group: Vec<u32>,
    /// The first triangle of each group, and the next one after each triangle.
    of: Vec<u32>,
    next_of: Vec<u32>,
    /// Vertices that may have lost their last triangle.
    loose: Vec<u32>,
}

impl Mosaic {
    pub(super) fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Sets how many groups there are.
    pub(super) fn set_groups(&mut self, n: usize) {
        self.of.resize(n, NONE);
    }

    /// The vertex that stands for `source`, a new one if there was none, at `point`.
    pub(super) fn vertex(&mut self, source: Source, point: MaterialPoint) -> u32 {
        let new = self.sources.len() as u32;
        let number = self.number_of(source);
        let v = if *number == NONE { new } else { *number };
        *number = v;
        if v == new {
            self.sources.push(source);
            self.at.push(NONE);
            self.surface.vertices.push(point);
        } else {
            self.surface.vertices[v as usize] = point;
        }
        v
    }

    /// Moves the vertex that stands for `source` to another place in the material, if there is one.
    pub(super) fn rebind(&mut self, source: Source, point: &MaterialPoint) {
        let v = *self.number_of(source);
        if v != NONE {
            self.surface.vertices[v as usize] = *point;
        }
    }

    /// The number of the vertex that stands for `source`.
    fn number_of(&mut self, source: Source) -> &mut u32 {
        let (list, i) = match source {
            Source::Own(p) => (&mut self.own, p as usize),
            Source::Dual(v) => (&mut self.dual, v as usize),
            Source::Middle(h) => return self.middles.entry(h).or_insert(NONE),
            Source::Centre(t) => (&mut self.centres, t as usize),
        };
        if list.len() <= i {
            list.resize(i + 1, NONE);
        }
        &mut list[i]
    }

    /// Moves every vertex to another place in the material.
    pub(super) fn rebind_all(&mut self, place: impl Fn(&MaterialPoint) -> MaterialPoint) {
        self.surface.vertices.iter_mut().for_each(|point| *point = place(point));
    }

    /// Adds a triangle to a group.
    pub(super) fn add(&mut self, group: u32, corners: [u32; 3], tag: u32) {
        let t = self.surface.triangles.len() as u32;
        self.surface.triangles.push(corners);
        self.surface.tags.push(tag);
        self.group.push(group);
        self.next_of.push(std::mem::replace(&mut self.of[group as usize], t));
        for (corner, v) in (3 * t..).zip(corners) {
            self.next_at.push(std::mem::replace(&mut self.at[v as usize], corner));
        }
    }

    /// Removes all triangles of a group.
    pub(super) fn clear(&mut self, group: u32) {
        while self.of[group as usize] != NONE {
            self.remove(self.of[group as usize]);
        }
    }

    fn remove(&mut self, t: u32) {
        let corners = self.surface.triangles[t as usize];
        for (corner, v) in (3 * t..).zip(corners) {
            let after = self.next_at[corner as usize];
            *link_to(&mut self.at[v as usize], &mut self.next_at, corner) = after;
            self.loose.push(v);
        }
        let (group, after) = (self.group[t as usize], self.next_of[t as usize]);
        *link_to(&mut self.of[group as usize], &mut self.next_of, t) = after;
        let last = self.group.len() as u32 - 1;
        if t != last {
            for (k, v) in (0..).zip(self.surface.triangles[last as usize]) {
                *link_to(&mut self.at[v as usize], &mut self.next_at, 3 * last + k) = 3 * t + k;
                self.next_at[(3 * t + k) as usize] = self.next_at[(3 * last + k) as usize];
            }
            let group = self.group[last as usize];
            *link_to(&mut self.of[group as usize], &mut self.next_of, last) = t;
        }
        self.surface.triangles.swap_remove(t as usize);
        self.surface.tags.swap_remove(t as usize);
        self.group.swap_remove(t as usize);
        self.next_of.swap_remove(t as usize);
        self.next_at.truncate(3 * last as usize);
    }

    /// Removes all vertices without triangles.
    pub(super) fn drop_loose(&mut self) {
        let mut loose = std::mem::take(&mut self.loose);
        loose.retain(|&v| self.at[v as usize] == NONE);
        // Highest number first: the vertex that takes over a free number is then never loose itself.
        loose.sort_unstable_by(|p, q| q.cmp(p));
        loose.dedup();
        for &v in &loose {
            let last = self.sources.len() as u32 - 1;
            let gone = self.sources[v as usize];
            *self.number_of(gone) = NONE;
            self.sources.swap_remove(v as usize);
            self.at.swap_remove(v as usize);
            self.surface.vertices.swap_remove(v as usize);
            if v == last {
                continue;
            }
            let moved = self.sources[v as usize];
            *self.number_of(moved) = v;
            let mut corner = self.at[v as usize];
            while corner != NONE {
                self.surface.triangles[corner as usize / 3][corner as usize % 3] = v;
                corner = self.next_at[corner as usize];
            }
        }
        self.middles.retain(|_, v| *v != NONE);
        loose.clear();
        self.loose = loose;
    }
}

/// The link that leads to `wanted`, in the chain that begins with `first`.
fn link_to<'a>(first: &'a mut u32, next: &'a mut [u32], wanted: u32) -> &'a mut u32 {
    if *first == wanted {
        return first;
    }
    let mut at = *first;
    while next[at as usize] != wanted {
        at = next[at as usize];
    }
    &mut next[at as usize]
}
