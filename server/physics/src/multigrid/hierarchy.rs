//! The levels of an octree, from the finest to the coarsest.

use std::collections::BTreeMap;

use super::level::{Level, NONE};
use super::transfer::Transfer;
use crate::material::Region;
use crate::octree::{Lattice, Octree};

/// Coarsening ends at this number of unknowns.
pub const COARSE_ENOUGH: usize = 3_000;
/// Coarsening ends where a level keeps more than this share of the vertices and no larger cells wait to be merged.
const STALLED: f64 = 0.9;

/// Cells, vertices and transfers of all levels; no numbers of materials or shapes.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    /// Side of a finest cell [m].
    pub(super) h: f64,
    /// Regions with other constants than the body; region number n is entry n − 1.
    regions: Vec<Region>,
    /// Level 0 is the finest.
    pub(super) levels: Vec<Level>,
    /// Between levels ℓ and ℓ + 1.
    pub(super) steps: Vec<Step>,
    /// Kinds of cells whose matrix is shared.
    pub(super) kinds: Vec<Kind>,
    /// Per level and cell its kind, or [`NONE`].
    pub(super) kind_of: Vec<Vec<u32>>,
    /// Per level and cell, whether the matrix of its kind is exact with mass, too.
    pub(super) exact: Vec<Vec<bool>>,
}

/// What leads from a level to the next coarser one.
#[derive(Clone, Debug)]
pub struct Step {
    /// Coarse cell of every fine cell.
    pub parent: Vec<u32>,
    /// Entries of `children` of every coarse cell.
    pub first_child: Vec<u32>,
    /// Fine cells by coarse cell, ascending.
    pub children: Vec<u32>,
    /// P.
    pub transfer: Transfer,
}

/// Cubes with the same matrix up to their rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Kind {
    /// Number of the material.
    pub material: u16,
    /// Its side is 2^side finest cells.
    pub side: u8,
    /// How often its leaves were merged; 0 for a leaf.
    pub merged: u8,
}

impl Step {
    /// Fine cells of coarse cell `id`.
    #[inline]
    pub fn children_of(&self, id: usize) -> &[u32] {
        &self.children[self.first_child[id] as usize..self.first_child[id + 1] as usize]
    }
}

impl Hierarchy {
    /// The levels of `octree` as it is cut now.
    pub fn new(octree: &Octree) -> Self {
        Self::with(octree, COARSE_ENOUGH, true)
    }

    /// The same with a level `least`, if the body is wide enough for it.
    pub fn with_level(octree: &Octree, least: usize) -> Self {
        Self::down_to(octree, (COARSE_ENOUGH, least), true)
    }

    /// The same with coarse levels that do not see cuts inside their cells; only for comparison.
    pub fn without_duplicates(octree: &Octree) -> Self {
        Self::with(octree, COARSE_ENOUGH, false)
    }

    /// The same down to some number of unknowns; without `duplicates` the coarse levels do not see cuts inside
    /// their cells.
    pub(super) fn with(octree: &Octree, coarse_enough: usize, duplicates: bool) -> Self {
        Self::down_to(octree, (coarse_enough, 0), duplicates)
    }

    fn down_to(octree: &Octree, (coarse_enough, least): (usize, usize), duplicates: bool) -> Self {
        let (finest, mut links) = Level::finest(octree);
        let mut levels = vec![finest];
        let mut steps = Vec::new();
        let across = largest_extent(octree.lattice());
        let mut size = 0;
        let enough = |levels: &[Level]| {
            levels.len() > least && 3 * levels[levels.len() - 1].n_vertices <= coarse_enough
        };
        while !enough(&levels) && 1 << size < across {
            let fine = &levels[levels.len() - 1];
            let coarsened = fine.coarsened(&links, size, duplicates);
            let (before, after) = (fine.n_vertices as f64, coarsened.level.n_vertices as f64);
            let larger_wait = fine.cells.iter().any(|cell| cell.level > size);
            if after > STALLED * before && !larger_wait && levels.len() > least {
                break;
            }
            steps.push(Step::new(fine, &coarsened.level, coarsened.parent));
            levels.push(coarsened.level);
            links = coarsened.links;
            size += 1;
        }
        let mut hierarchy = Self {
            h: octree.lattice().h,
            regions: octree.regions().to_vec(),
            levels,
            steps,
            kinds: Vec::new(),
            kind_of: Vec::new(),
            exact: Vec::new(),
        };
        hierarchy.find_kinds();
        hierarchy
    }

    /// Bytes in use.
    pub fn memory(&self) -> usize {
        let levels: usize = self.levels.iter().map(Level::memory).sum();
        let step = |step: &Step| {
            size_of_val(&step.parent[..])
                + size_of_val(&step.first_child[..])
                + size_of_val(&step.children[..])
                + step.transfer.memory()
        };
        let kinds: usize = self.kind_of.iter().map(|kinds| size_of_val(&kinds[..])).sum();
        let exact: usize = self.exact.iter().map(|exact| size_of_val(&exact[..])).sum();
        levels + self.steps.iter().map(step).sum::<usize>() + kinds + exact
    }

    /// Number of levels.
    pub fn n_levels(&self) -> usize {
        self.levels.len()
    }

    /// Regions with other constants than the body; those of material number n are entry n − 1.
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// Number of vertices of the finest level.
    pub fn n_vertices(&self) -> usize {
        self.levels[0].n_vertices
    }

    /// Finds the cells whose matrix is that of a cube of their size: leaves, and cells of eight such children of
    /// one material.
    fn find_kinds(&mut self) {
        let mut numbers: BTreeMap<Kind, u32> = BTreeMap::new();
        let mut number = |kind: Kind, kinds: &mut Vec<Kind>| {
            *numbers.entry(kind).or_insert_with(|| {
                kinds.push(kind);
                kinds.len() as u32 - 1
            })
        };
        for (l, level) in self.levels.iter().enumerate() {
            let (mut kind_of, mut exact) = (Vec::new(), Vec::new());
            for (id, cell) in level.cells.iter().enumerate() {
                let own = Kind { material: cell.material, side: cell.level, merged: 0 };
                if level.leaf[id] != NONE {
                    kind_of.push(number(own, &mut self.kinds));
                    exact.push(true);
                    continue;
                }
                let children = self.steps[l - 1].children_of(id);
                let (below, fine) = (&self.kind_of[l - 1], &self.levels[l - 1]);
                let kind = |child: u32| self.kinds.get(below[child as usize] as usize).copied();
                let full = children.len() == 8
                    && children.iter().all(|&c| kind(c).is_some_and(|k| k.material == cell.material));
                let Some(first) = kind(children[0]).filter(|_| full) else {
                    kind_of.push(NONE);
                    exact.push(false);
                    continue;
                };
                exact.push(children.iter().all(|&c| {
                    self.exact[l - 1][c as usize] && kind(c) == Some(first) && fine.hanging[c as usize] == 0
                }));
                kind_of.push(number(Kind { merged: first.merged + 1, ..own }, &mut self.kinds));
            }
            self.kind_of.push(kind_of);
            self.exact.push(exact);
        }
    }
}

impl Step {
    fn new(fine: &Level, coarse: &Level, parent: Vec<u32>) -> Self {
        let n = coarse.cells.len();
        let mut first_child = vec![0_u32; n + 1];
        parent.iter().for_each(|&p| first_child[p as usize + 1] += 1);
        for i in 0..n {
            first_child[i + 1] += first_child[i];
        }
        let mut next = first_child.clone();
        let mut children = vec![0; parent.len()];
        for (child, &p) in (0u32..).zip(&parent) {
            children[next[p as usize] as usize] = child;
            next[p as usize] += 1;
        }
        let transfer = Transfer::new(fine, coarse, &parent);
        Self { parent, first_child, children, transfer }
    }
}

/// Finest cells along the longest side of the lattice.
fn largest_extent(lattice: &Lattice) -> u32 {
    lattice.size.into_iter().max().unwrap_or(1)
}
