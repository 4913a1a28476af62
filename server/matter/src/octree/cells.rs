//! Cubical cells on an adaptive octree, the links between them, and their vertices.
//!
//! # Source
//! Dick, Georgii, Westermann 2011, §4. Every finest cell has six links to its neighbours. A cut disconnects
//! links; both ends of a cut link are leaves of the finest level, so leaves of different size are always linked
//! where they touch.

use std::fmt;

use super::lattice::{At, Lattice, LeafMap, OUTSIDE, OctreeSettings, neighbours};
use super::link_map::{CutLink, LinkKey, LinkMap};
use crate::material::{Region, Regions};

/// A leaf of the octree: one finite element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Cell {
    /// Low corner, in sides of finest cells.
    pub at: At,
    /// Its side is 2^level finest cells.
    pub level: u8,
    /// Bit d is set if no link leads on in direction d of [`DIRECTIONS`]. 0 unless the level is 0.
    pub cut: u8,
    /// Number of its material.
    pub material: u16,
}

impl Cell {
    /// A cell with all links.
    pub fn new(at: At, level: u8, material: u16) -> Self {
        Self { at, level, cut: 0, material }
    }

    /// Side in finest cells.
    #[inline]
    pub fn side(&self) -> i32 {
        1 << self.level
    }

    /// Lattice point of corner `c`; bit k of `c` is its end along axis k.
    #[inline]
    pub fn corner(&self, c: usize) -> At {
        [0, 1, 2].map(|k| self.at[k] + if c >> k & 1 == 1 { self.side() } else { 0 })
    }

    /// The corner at the lattice point `p`.
    #[inline]
    pub fn corner_at(&self, p: At) -> Option<usize> {
        (0..3).try_fold(0, |corner, k| match p[k] - self.at[k] {
            0 => Some(corner),
            across if across == self.side() => Some(corner | 1 << k),
            _ => None,
        })
    }

    /// Which child of its parent it is; bit k is the half along axis k.
    #[inline]
    pub fn octant(&self) -> usize {
        (0..3).fold(0, |octant, k| octant | ((self.at[k] >> self.level & 1) as usize) << k)
    }
}

/// Cells, links and vertices of a body.
///
/// Vertices are numbered; they are the copies of `Space` in scindo-physics. Those of the uncut body come
/// first.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Octree {
    pub(super) lattice: Lattice,
    pub(super) map: LeafMap,
    pub(super) cells: Vec<Cell>,
    /// Vertices of every cell: those of its corners, except that a hanging corner is replaced by the vertex of
    /// the parent's corner in that direction.
    pub(super) vertices: Vec<[u32; 8]>,
    /// Bit c is set if corner c hangs.
    pub(super) hanging: Vec<u8>,
    /// Lattice point of every vertex.
    pub(super) points: Vec<At>,
    /// Constants of the materials 1, 2, …; material 0 is the body's own.
    pub(super) regions: Vec<Region>,
    /// Links that are cut by an incision.
    pub(super) links: LinkMap,
    /// Where links that lead out of the body meet its boundary; halfway if nothing is known.
    pub(super) boundary: LinkMap,
    /// Hanging corners do not follow cuts; only a mutation test sets it.
    pub(super) stale: bool,
}

impl Octree {
    /// The octree with these leaves; `map` knows them.
    pub(super) fn of_leaves(lattice: Lattice, map: LeafMap, cells: Vec<Cell>) -> Self {
        let n = cells.len();
        let (vertices, hanging) = (vec![[OUTSIDE; 8]; n], vec![0; n]);
        let (points, regions) = (Vec::new(), Vec::new());
        let (links, boundary) = (LinkMap::default(), LinkMap::default());
        let stale = false;
        let mut octree =
            Self { lattice, map, cells, vertices, hanging, points, regions, links, boundary, stale };
        octree.mark_boundary();
        octree.number_vertices();
        octree
    }

    /// Cuts the links of finest leaves that lead out of the body.
    fn mark_boundary(&mut self) {
        for i in 0..self.cells.len() {
            if self.cells[i].level == 0 {
                let near = neighbours(self.cells[i].at);
                let out = |d: &usize| self.map.leaf(near[*d]) == OUTSIDE;
                self.cells[i].cut = (0..6).filter(out).fold(0, |cut, d| cut | 1 << d);
            }
        }
    }

    /// Hanging corners do not follow cuts from now on; only for checking the tests themselves.
    #[doc(hidden)]
    pub fn keep_stale_vertices(&mut self) {
        self.stale = true;
    }

    /// Hanging corners count as the vertices that stand in for them; only for checking the tests themselves.
    #[doc(hidden)]
    pub fn forget_hanging(&mut self) {
        self.hanging.fill(0);
    }

    /// Gives the cells of material n the constants `regions[n − 1]`.
    pub fn set_regions(&mut self, regions: Vec<Region>) {
        self.regions = regions;
    }

    /// Gives every cell the material of the element of its number, and these their constants.
    pub fn set_materials(&mut self, regions: &Regions) {
        for (e, cell) in self.cells.iter_mut().enumerate() {
            cell.material = regions.of(e);
        }
        self.regions = regions.constants().to_vec();
    }

    /// Constants of the materials 1, 2, …; cells of material 0 have those of the body.
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// Place and size of the finest cells.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The leaves, each a finite element.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Number of vertices, each with three degrees of freedom.
    pub fn n_vertices(&self) -> usize {
        self.points.len()
    }

    /// Lattice point of every vertex.
    pub fn points(&self) -> &[At] {
        &self.points
    }

    /// The eight vertices that carry each cell: those of its corners, or, for a corner that hangs, of the
    /// parent's corner in that direction.
    pub fn vertices(&self) -> &[[u32; 8]] {
        &self.vertices
    }

    /// Which corners of each cell hang, one bit per corner.
    pub fn hanging(&self) -> &[u8] {
        &self.hanging
    }

    /// The leaf that covers the finest cell `at`, or [`OUTSIDE`].
    #[inline]
    pub fn leaf(&self, at: At) -> u32 {
        self.map.leaf(at)
    }

    /// Whether the link from the finest cell `at`, which is inside, in direction `d` is whole.
    #[inline]
    pub fn is_linked(&self, at: At, d: usize) -> bool {
        let cell = &self.cells[self.map.leaf(at) as usize];
        cell.level > 0 || cell.cut >> d & 1 == 0
    }

    /// The links that incisions cut.
    pub fn cut_links(&self) -> &LinkMap {
        &self.links
    }

    /// Calls `visit` with two linked leaves and the axis from the lower to the upper one, once for each pair,
    /// in the order of the cells.
    pub fn for_links(&self, mut visit: impl FnMut(u32, u32, usize)) {
        for (id, cell) in (0u32..).zip(&self.cells) {
            for d in 0..6 {
                let (axis, up) = (d / 2, d % 2 == 1);
                // The first finest cell beyond the face; if that leaf is smaller, it tells of this link itself.
                let mut beyond = cell.at;
                beyond[axis] += if up { cell.side() } else { -1 };
                if cell.cut >> d & 1 == 1 {
                    continue;
                }
                let near = self.map.leaf(beyond);
                if near == OUTSIDE {
                    continue;
                }
                let level = self.cells[near as usize].level;
                if level > cell.level || (level == cell.level && up) {
                    let (low, high) = if up { (id, near) } else { (near, id) };
                    visit(low, high, axis);
                }
            }
        }
    }

    /// Calls `visit` with every leaf that leaf `id` is linked to, and the direction that leads there.
    pub fn for_links_of(&self, id: u32, mut visit: impl FnMut(u32, usize)) {
        let cell = &self.cells[id as usize];
        for d in (0..6).filter(|d| cell.cut >> d & 1 == 0) {
            let (axis, up) = (d / 2, d % 2 == 1);
            let mut beyond = cell.at;
            beyond[axis] += if up { cell.side() } else { -1 };
            let near = self.map.leaf(beyond);
            if near != OUTSIDE && self.cells[near as usize].level >= cell.level {
                visit(near, d);
                continue;
            }
            // By 2:1 balance at most four smaller ones, of half the side.
            let half = cell.side() / 2;
            for quarter in (0..4).filter(|_| half > 0) {
                let mut at = beyond;
                at[(axis + 1) % 3] += half * (quarter & 1);
                at[(axis + 2) % 3] += half * (quarter >> 1);
                let near = self.map.leaf(at);
                if near != OUTSIDE {
                    visit(near, d);
                }
            }
        }
    }

    /// Which of the leaves `known` before a cut the new leaf `id` was part of. The first part of a divided leaf has
    /// its number.
    pub fn whole_of(&self, known: &[Cell], id: u32) -> u32 {
        let cell = &self.cells[id as usize];
        let whole = (cell.level + 1..=self.lattice.levels).find_map(|level| {
            let at = cell.at.map(|c| c >> level << level);
            let first = self.leaf(at);
            let whole = known.get(first as usize)?;
            (whole.level == level && whole.at == at).then_some(first)
        });
        whole.unwrap_or(0)
    }

    /// Bytes in use.
    pub fn bytes(&self) -> usize {
        self.map.bytes()
            + self.cells.len() * (size_of::<Cell>() + 33)
            + self.points.len() * size_of::<At>()
            + (self.links.len() + self.boundary.len()) * (size_of::<LinkKey>() + size_of::<CutLink>())
    }
}

/// Why a solid cannot be filled with cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OctreeError {
    /// The solid has no finite extent.
    Empty,
    /// The number of cells or levels is out of range.
    Settings(OctreeSettings),
    /// The lattice would have too many finest cells.
    TooMany {
        /// Finest cells of the lattice.
        finest: u64,
        /// Largest number.
        limit: u64,
    },
    /// No centre of a finest cell is inside the solid.
    NoCell {
        /// Side of a finest cell [m].
        h: f64,
    },
}

impl fmt::Display for OctreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "the solid has no finite extent; check the surface and its unit"),
            Self::Settings(OctreeSettings { cells, levels }) => write!(
                f,
                "octree with {cells} cells across and {levels} levels: allowed are 1 … 4096 cells and 0 … 8 levels"
            ),
            Self::TooMany { finest, limit } => {
                write!(f, "octree of {finest} finest cells: at most {limit} are allowed; take fewer cells")
            }
            Self::NoCell { h } => write!(
                f,
                "no cell has its centre inside the solid, which is thinner than a cell of {h} m; take more cells"
            ),
        }
    }
}

impl std::error::Error for OctreeError {}
