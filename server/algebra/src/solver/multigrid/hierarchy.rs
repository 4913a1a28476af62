//! The levels of an octree, from the finest to the coarsest.

use std::collections::BTreeMap;

use scindo_matter::material::Region;
use scindo_matter::octree::{Lattice, Octree};
use scindo_matter::team::Team;

use super::follow::{LevelChange, Links, follow_level};
use super::level::{Level, NONE};
use super::step::Step;
use super::transfer::{MOST_VERTICES, Transfer};

/// Coarsening ends at this number of unknowns.
pub(super) const COARSE_ENOUGH: usize = 3_000;
/// Coarsening ends where a level keeps more than this share of the vertices and no larger cells wait to be merged.
const STALLED: f64 = 0.9;

/// Cells, vertices and transfers of all levels; no numbers of materials or shapes.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
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
    numbers: BTreeMap<Kind, u32>,
    /// Per level and cell its kind, or [`NONE`].
    pub(super) kind_of: Vec<Vec<u32>>,
    /// Per level and cell, whether the matrix of its kind is exact with mass, too.
    pub(super) exact: Vec<Vec<bool>>,
    limits: Limits,
    /// Whether coarsening ended because a further level would have kept most vertices.
    stalled: bool,
}

/// How far cells are merged.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Limits {
    /// Number of unknowns that is small enough.
    coarse_enough: usize,
    /// Least number of the last level.
    least: usize,
    /// Finest cells along the longest side of the lattice.
    across: u32,
    /// Whether coarse levels see cuts inside their cells.
    duplicates: bool,
}

/// Cubes with the same matrix up to their rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub(super) struct Kind {
    /// Number of the material.
    pub material: u16,
    /// Its side is 2^side finest cells.
    pub side: u8,
    /// How often its leaves were merged; 0 for a leaf.
    pub merged: u8,
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
        let limits = Limits { coarse_enough, least, across: largest_extent(octree.lattice()), duplicates };
        let mut stalled = false;
        while limits.goes_on(&levels) {
            let size = levels.len() as u8 - 1;
            let fine = &levels[levels.len() - 1];
            let coarsened = fine.coarsened(&links, size, duplicates);
            let (before, after) = (fine.n_vertices as f64, coarsened.level.n_vertices as f64);
            let larger_wait = fine.cells.iter().any(|cell| cell.level > size);
            if after > STALLED * before && !larger_wait && levels.len() > least {
                stalled = true;
                break;
            }
            steps.push(Step::new(fine, &coarsened.level, coarsened.parent));
            levels.push(coarsened.level);
            links = coarsened.links;
        }
        let mut hierarchy = Self {
            h: octree.lattice().h,
            regions: octree.regions().to_vec(),
            levels,
            steps,
            kinds: Vec::new(),
            numbers: BTreeMap::new(),
            kind_of: Vec::new(),
            exact: Vec::new(),
            limits,
            stalled,
        };
        for l in 0..hierarchy.levels.len() {
            let n = hierarchy.levels[l].cells.len();
            hierarchy.kind_of.push(vec![NONE; n]);
            hierarchy.exact.push(vec![false; n]);
            (0..n).for_each(|id| hierarchy.find_kind(l, id));
        }
        hierarchy
    }

    /// Follows a cut of the octree that changed the leaves `changed`, ascending, and left the numbers of all others.
    /// The levels are those that [`new`](Self::new) makes, with other numbers of coarse cells and vertices. Returns
    /// what changed on each level.
    ///
    /// `None` if all have to be made anew, because the coarsest level has become too large or the coarse levels do
    /// not see cuts; the hierarchy is then of no more use. Where coarsening stalls, the number of levels stays.
    ///
    /// [`follow_transfers`](Self::follow_transfers) comes next.
    pub fn follow(&mut self, octree: &Octree, changed: &[u32]) -> Option<Vec<LevelChange>> {
        if !self.limits.duplicates {
            return None;
        }
        let mut changes = vec![self.levels[0].follow_leaves(octree, changed)];
        for (l, step) in self.steps.iter_mut().enumerate() {
            let (below, above) = self.levels.split_at_mut(l + 1);
            let (fine, coarse) = (&below[l], &mut above[0]);
            let links = if l == 0 { Links::Leaves(octree) } else { Links::Cells(&fine.links) };
            changes.push(follow_level((fine, links, &changes[l]), step, coarse, l as u8)?);
        }
        if !self.stalled && self.limits.goes_on(&self.levels) {
            return None;
        }
        for (l, change) in changes.iter().enumerate() {
            let n = self.levels[l].cells.len();
            self.kind_of[l].resize(n, NONE);
            self.exact[l].resize(n, false);
            change.cells.iter().for_each(|&id| self.find_kind(l, id as usize));
        }
        Some(changes)
    }

    /// Lets the transfers follow these changes of the levels. Meanwhile `with_levels` is given the levels and the steps
    /// between them, as yet without transfers.
    pub fn follow_transfers(
        &mut self,
        team: &mut Team,
        changes: &[LevelChange],
        with_levels: &mut (dyn FnMut(&Self) + Send),
    ) {
        let mut transfers: Vec<Transfer> =
            self.steps.iter_mut().map(|step| std::mem::take(&mut step.transfer)).collect();
        let levels = &*self;
        let mut follow = || {
            for (l, (step, transfer)) in levels.steps.iter().zip(&mut transfers).enumerate() {
                // A row follows from the fine vertex, its cell, and the vertices of the parent of that.
                let below = changes[l + 1].moved.iter().flat_map(|&id| step.children.get(id as usize));
                let cells = below.chain(&changes[l].moved).copied();
                transfer.follow(&levels.levels[l], &levels.levels[l + 1], &step.parent, cells);
            }
        };
        team.run(&mut [&mut follow, &mut || with_levels(levels)]);
        self.steps.iter_mut().zip(transfers).for_each(|(step, transfer)| step.transfer = transfer);
    }

    /// Lists the slots of the finest level, too.
    pub(super) fn list_finest_slots(&mut self) {
        self.levels[0].list_slots();
    }

    /// Bytes in use.
    pub fn memory(&self) -> usize {
        let levels: usize = self.levels.iter().map(Level::memory).sum();
        let step =
            |step: &Step| size_of_val(&step.parent[..]) + step.children.memory() + step.transfer.memory();
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

    /// Finds whether the matrix of a cell is that of a cube of its size: that of a leaf, or of a cell of eight such
    /// children of one material. Children come first.
    fn find_kind(&mut self, l: usize, id: usize) {
        let level = &self.levels[l];
        let cell = &level.cells[id];
        let own = Kind { material: cell.material, side: cell.level, merged: 0 };
        let found = if level.leaf[id] {
            Some((own, true))
        } else {
            let (children, fine) = (self.steps[l - 1].children_of(id), &self.levels[l - 1]);
            let kind = |child: u32| self.kinds.get(self.kind_of[l - 1][child as usize] as usize).copied();
            let full = children.len() == 8
                && children.iter().all(|&c| kind(c).is_some_and(|k| k.material == cell.material));
            kind(children[0]).filter(|_| full).map(|first| {
                let exact = children.iter().all(|&c| {
                    self.exact[l - 1][c as usize] && kind(c) == Some(first) && fine.hanging[c as usize] == 0
                });
                (Kind { merged: first.merged + 1, ..own }, exact)
            })
        };
        let kinds = &mut self.kinds;
        let mut number = |kind: Kind| {
            *self.numbers.entry(kind).or_insert_with(|| {
                kinds.push(kind);
                kinds.len() as u32 - 1
            })
        };
        self.kind_of[l][id] = found.map_or(NONE, |(kind, _)| number(kind));
        self.exact[l][id] = found.is_some_and(|(_, exact)| exact);
    }
}

impl Limits {
    /// Whether a coarser level than the last of `levels` is wanted.
    fn goes_on(&self, levels: &[Level]) -> bool {
        let coarsest = &levels[levels.len() - 1];
        let enough = levels.len() > self.least && 3 * coarsest.n_vertices <= self.coarse_enough;
        !enough && 1 << (levels.len() - 1) < self.across && coarsest.n_vertices <= MOST_VERTICES
    }
}

/// Finest cells along the longest side of the lattice.
fn largest_extent(lattice: &Lattice) -> u32 {
    lattice.size.into_iter().max().unwrap_or(1)
}
