//! A coarse level that follows a cut of the level below it, at a cost that depends on the cut alone.
//!
//! A cut takes links away and divides leaves. Merged cells and the classes of corners that are vertices can
//! therefore come apart, but never grow together. Each cell and each vertex keeps its number for one of its parts;
//! the other parts get the numbers that follow. So all numbers stay in use, and lists only change around the cut.

use scindo_matter::octree::{Cell, Octree, parent_corner};
use scindo_matter::storage::bits::Bits;
use scindo_matter::storage::disjoint::{find, join};
use scindo_matter::storage::jagged::Jagged;

use super::level::{Level, NONE};
use super::step::Step;

/// What a cut did to a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelChange {
    /// Cells that are new or have other children, links, vertices or hanging corners, ascending.
    pub cells: Vec<u32>,
    /// The vertices of these cells, now and before, ascending; none where the level has no slots.
    pub vertices: Vec<u32>,
    /// Number of cells before.
    pub known: usize,
    /// For every new cell, the one before that it was part of.
    pub origin: Vec<u32>,
    /// Those of `cells` that are new, elsewhere, or rest on other vertices or with other corners that hang.
    pub moved: Vec<u32>,
}

/// The links of a level.
#[derive(Clone, Copy, Debug)]
pub(super) enum Links<'a> {
    /// Those of the leaves of an octree.
    Leaves(&'a Octree),
    /// [`Level::links`].
    Cells(&'a Jagged<u32>),
}

impl Links<'_> {
    /// Calls `visit` with every cell that cell `id` is linked to, and the direction that leads there.
    fn of(self, id: u32, mut visit: impl FnMut(u32, usize)) {
        match self {
            Self::Leaves(octree) => octree.for_links_of(id, visit),
            Self::Cells(links) => {
                links.get(id as usize).iter().for_each(|link| visit(link / 8, (link % 8) as usize));
            }
        }
    }
}

/// Cells as they were before.
#[derive(Debug)]
struct History {
    /// Entry of `earlier` by cell, or [`NONE`]; new cells have none.
    number: Vec<u32>,
    earlier: Vec<(u32, Earlier)>,
}

impl History {
    /// No history of `n` cells.
    fn new(n: usize) -> Self {
        Self { number: vec![NONE; n], earlier: Vec::new() }
    }

    fn get(&self, id: u32) -> Option<&Earlier> {
        let number = *self.number.get(id as usize)?;
        self.earlier.get(number as usize).map(|(_, earlier)| earlier)
    }

    /// Keeps the state of a cell, unless there is one.
    fn keep(&mut self, id: u32, now: Earlier) {
        if let Some(number) = self.number.get_mut(id as usize).filter(|number| **number == NONE) {
            *number = self.earlier.len() as u32;
            self.earlier.push((id, now));
        }
    }
}

/// A cell as it was before.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Earlier {
    cell: Cell,
    vertices: [u32; 8],
    hanging: u8,
}

impl LevelChange {
    /// The cell itself, or the one before that a new one was part of.
    pub fn before(&self, id: u32) -> u32 {
        (id as usize).checked_sub(self.known).map_or(id, |new| self.origin[new])
    }

    /// The change of the cells `cells` of `level`, of which there were `known`, with these earlier states. Enters
    /// the change in the slots.
    fn new(
        level: &mut Level,
        (cells, known): (Vec<u32>, usize),
        origin: Vec<u32>,
        history: &History,
    ) -> Self {
        let is_moved = |&id: &u32| {
            id as usize >= known || history.get(id).is_some_and(|earlier| *earlier != level.now(id))
        };
        let moved = cells.iter().copied().filter(is_moved).collect();
        let (mut vertices, mut edits) = (Bits::new(level.n_vertices), Vec::new());
        for &id in cells.iter().filter(|_| level.has_slots()) {
            let now = level.vertices[id as usize];
            let before = history.get(id).map_or(now, |earlier| earlier.vertices);
            vertices.extend(now);
            for c in 0..8 {
                let slot = 8 * id + c as u32;
                if id as usize >= known {
                    edits.push((now[c], slot, true));
                } else if before[c] != now[c] {
                    vertices.insert(before[c]);
                    edits.extend([(before[c], slot, false), (now[c], slot, true)]);
                }
            }
        }
        if level.has_slots() {
            level.slots.grow(level.n_vertices);
            level.slots.edit(&edits, |slot| *slot);
        }
        Self { cells, vertices: vertices.iter().collect(), known, origin, moved }
    }
}

impl Level {
    /// Follows a cut of the octree that changed the leaves `changed`, ascending.
    pub(super) fn follow_leaves(&mut self, octree: &Octree, changed: &[u32]) -> LevelChange {
        let known = self.cells.len();
        let new = changed.iter().filter(|&&id| id as usize >= known);
        let origin = new.map(|&id| octree.whole_of(&self.cells, id)).collect();
        let mut history = History::new(known);
        self.grow(octree.cells().len());
        self.n_vertices = octree.n_vertices();
        for &id in changed {
            let at = id as usize;
            history.keep(id, self.now(id));
            self.cells[at] = Cell { cut: 0, ..octree.cells()[at] };
            self.leaf[at] = true;
            (self.vertices[at], self.hanging[at]) = (octree.vertices()[at], octree.hanging()[at]);
        }
        LevelChange::new(self, (changed.to_vec(), known), origin, &history)
    }

    /// Adds places for cells until there are `n`.
    fn grow(&mut self, n: usize) {
        self.cells.resize(n, Cell::new([0; 3], 0, 0));
        self.leaf.resize(n, true);
        self.vertices.resize(n, [NONE; 8]);
        self.hanging.resize(n, 0);
    }

    fn now(&self, id: u32) -> Earlier {
        let id = id as usize;
        Earlier { cell: self.cells[id], vertices: self.vertices[id], hanging: self.hanging[id] }
    }

    /// Finds the corners that are one point of the material with corner `slot`, as 8 · cell + corner. Returns the
    /// larger cell on which they hang, or [`NONE`].
    fn class_of(&self, slot: u32, members: &mut Vec<u32>) -> u32 {
        members.clear();
        members.push(slot);
        let (mut hangs_on, mut next) = (NONE, 0);
        while let Some(&slot) = members.get(next) {
            next += 1;
            let (id, c) = (slot / 8, (slot % 8) as usize);
            let p = self.cells[id as usize].corner(c);
            for &link in self.links.get(id as usize) {
                let (near, d) = (link / 8, (link % 8) as usize);
                if c >> (d / 2) & 1 != d % 2 {
                    continue;
                }
                match self.corner_at(near, p) {
                    Some(k) if !members.contains(&(8 * near + k as u32)) => members.push(8 * near + k as u32),
                    Some(_) => {}
                    None if self.cells[near as usize].level > self.cells[id as usize].level => {
                        hangs_on = hangs_on.min(near);
                    }
                    None => {}
                }
            }
        }
        hangs_on
    }
}

/// Lets `coarse` follow the `change` of `fine`, whose cells of side 2^size it merges. `None` if parts have grown
/// together, which no cut does; the level is then to be made anew.
pub(super) fn follow_level(
    (fine, links, change): (&Level, Links<'_>, &LevelChange),
    step: &mut Step,
    coarse: &mut Level,
    size: u8,
) -> Option<LevelChange> {
    let known = coarse.cells.len();
    let mut follow = Follow { coarse, known, origin: Vec::new(), history: History::new(known) };
    let renewed = follow.regroup((fine, links, change), step, size)?;
    let relinked = follow.relink(&renewed, links, step);
    follow.renumber(&relinked)?;
    let Follow { coarse, origin, history, .. } = follow;
    let mut cells = relinked;
    cells.extend(history.earlier.iter().map(|(id, _)| id));
    cells.sort_unstable();
    cells.dedup();
    Some(LevelChange::new(coarse, (cells, known), origin, &history))
}

/// A coarse level on its way.
struct Follow<'a> {
    coarse: &'a mut Level,
    /// Number of its cells before.
    known: usize,
    /// Of every new cell the one it was part of.
    origin: Vec<u32>,
    /// States of cells before.
    history: History,
}

impl Follow<'_> {
    /// Merges the fine cells anew in the coarse cells that the change is in. Returns these and the new ones,
    /// ascending.
    fn regroup(
        &mut self,
        (fine, links, change): (&Level, Links<'_>, &LevelChange),
        step: &mut Step,
        size: u8,
    ) -> Option<Vec<u32>> {
        let Self { coarse, known, origin, history } = self;
        // A new fine cell has no parent yet and counts where the cell lay that it was part of.
        let mut renewed: Vec<u32> =
            change.cells.iter().map(|&id| step.parent[change.before(id) as usize]).collect();
        renewed.sort_unstable();
        renewed.dedup();
        let new = change.known as u32..fine.cells.len() as u32;
        let mut members: Vec<u32> =
            renewed.iter().flat_map(|&id| step.children_of(id as usize)).copied().chain(new).collect();
        members.sort_unstable();
        let parent_before: Vec<u32> =
            members.iter().map(|&id| step.parent[change.before(id) as usize]).collect();
        // Vertices are numbered by what these cells were, so that is kept before anything is overwritten.
        for &id in &renewed {
            history.keep(id, coarse.now(id));
        }

        // Links inside a block of cells that merge connect them.
        let cell = |id: u32| &fine.cells[id as usize];
        let block = |id: u32| cell(id).at.map(|x| x >> (size + 1));
        let mut root: Vec<u32> = (0..members.len() as u32).collect();
        let mut whole = true;
        for (&id, i) in members.iter().zip(0..).filter(|(id, _)| cell(**id).level == size) {
            links.of(id, |near, _| {
                if cell(near).level == size && block(near) == block(id) {
                    match members.binary_search(&near) {
                        Ok(j) => {
                            join(&mut root, i, j as u32);
                        }
                        // A link that leaves the list joins what was apart before.
                        Err(_) => whole = false,
                    }
                }
            });
        }
        let mut by_root: Vec<(u32, usize)> =
            (0..members.len()).map(|i| (find(&mut root, i as u32), i)).collect();
        by_root.sort_unstable();

        step.parent.resize(fine.cells.len(), NONE);
        // The first group with a parent keeps the number of that; others, which the cut split off, get new ones.
        let (mut taken, mut children) = (vec![false; renewed.len()], Vec::new());
        for group in by_root.chunk_by(|a, b| a.0 == b.0) {
            let mut held = group.iter().map(|g| g.1).filter(|&i| (members[i] as usize) < change.known);
            let first = held.next().map(|i| parent_before[i]);
            whole &= held.all(|i| Some(parent_before[i]) == first);
            let is_free = |id: &u32| {
                let taken = renewed.binary_search(id).ok().and_then(|at| taken.get_mut(at));
                taken.is_some_and(|taken| !std::mem::replace(taken, true))
            };
            let id = match first.filter(is_free) {
                Some(id) => id,
                None => {
                    let id = (*known + origin.len()) as u32;
                    origin.push(parent_before[group[0].1]);
                    coarse.grow(id as usize + 1);
                    step.children.grow(id as usize + 1);
                    id
                }
            };
            let (own, at) = (members[group[0].1], id as usize);
            let merges = cell(own).level == size;
            let low = cell(own).at.map(|x| x >> (size + 1) << (size + 1));
            coarse.cells[at] =
                if merges { Cell { at: low, level: size + 1, ..*cell(own) } } else { *cell(own) };
            coarse.leaf[at] = !merges;
            children.clear();
            children.extend(group.iter().map(|g| members[g.1]));
            children.iter().for_each(|&child| step.parent[child as usize] = id);
            step.children.set(at, &children);
        }
        // A parent that no group took over would leave its number unused.
        whole &= taken.iter().all(|taken| *taken);
        renewed.extend(*known as u32..coarse.cells.len() as u32);
        whole.then_some(renewed)
    }

    /// Finds the links of cells that were merged anew, and of those around them. Returns the cells of both whose
    /// links changed, ascending.
    fn relink(&mut self, renewed: &[u32], links: Links<'_>, step: &Step) -> Vec<u32> {
        let coarse = &mut *self.coarse;
        coarse.links.grow(coarse.cells.len());
        let mut around: Vec<u32> =
            renewed.iter().flat_map(|&id| coarse.links.get(id as usize)).map(|link| link / 8).collect();
        around.sort_unstable();
        around.dedup();
        let mut relinked = renewed.to_vec();
        let (mut list, mut known) = (Vec::new(), Vec::new());
        let beside = around.into_iter().filter(|id| renewed.binary_search(id).is_err());
        for id in renewed.iter().copied().chain(beside) {
            list.clear();
            for &child in step.children_of(id as usize) {
                links.of(child, |near, d| {
                    let near = step.parent[near as usize];
                    if near != id {
                        list.push(8 * near + d as u32);
                    }
                });
            }
            list.sort_unstable();
            list.dedup();
            known.clear();
            known.extend_from_slice(coarse.links.get(id as usize));
            known.sort_unstable();
            if list != known {
                coarse.links.set(id as usize, &list);
                relinked.push(id);
            }
        }
        relinked.sort_unstable();
        relinked.dedup();
        relinked
    }

    /// Numbers the vertices of the cells `relinked` anew. A class of corners keeps the number of a class that it
    /// was part of, if no other class did before it.
    fn renumber(&mut self, relinked: &[u32]) -> Option<()> {
        // Numbers that must stay in use.
        let mut owed = Bits::new(self.coarse.n_vertices);
        for &id in relinked.iter().filter(|id| (**id as usize) < self.known) {
            let Earlier { vertices, hanging, .. } = self.coarse.now(id);
            (0..8).filter(|c| hanging >> c & 1 == 0).for_each(|c| {
                owed.insert(vertices[c]);
            });
        }
        let mut done = Bits::new(8 * self.coarse.cells.len());
        let mut taken = Bits::new(self.coarse.n_vertices);
        let (mut members, mut hanging) = (Vec::new(), Vec::<(u32, u32)>::new());
        for slot in relinked.iter().flat_map(|id| 8 * id..8 * id + 8) {
            if done.has(slot) {
                continue;
            }
            let hangs_on = self.coarse.class_of(slot, &mut members);
            members.iter().for_each(|&slot| {
                done.insert(slot);
            });
            // What carries a hanging class may have no number yet, so such classes wait for all others.
            if hangs_on != NONE {
                hanging.extend(members.iter().map(|&slot| (slot, hangs_on)));
                continue;
            }
            // The lowest number that one of the corners had. Parts that come later find it taken and get new ones.
            let known = members.iter().filter_map(|&slot| self.vertex_before(slot));
            let vertex = known.filter(|&v| !taken.has(v)).min().unwrap_or_else(|| {
                self.coarse.n_vertices += 1;
                self.coarse.n_vertices as u32 - 1
            });
            taken.insert(vertex);
            members.iter().for_each(|&slot| self.enter(slot, vertex, false));
        }

        // Corners hang on vertices of larger cells, which may have other numbers now.
        let changed = self.history.earlier.iter().map(|(id, _)| *id);
        let mut changed: Vec<u32> = changed.chain(relinked.iter().copied()).collect();
        changed.sort_unstable();
        changed.dedup();
        for id in changed {
            let level = self.coarse.cells[id as usize].level;
            for &link in self.coarse.links.get(id as usize) {
                let (near, d) = (link / 8, link as usize % 8);
                if self.coarse.cells[near as usize].level >= level || self.coarse.hanging[near as usize] == 0
                {
                    continue;
                }
                let beside = (0..8).filter(|c| c >> (d / 2) & 1 != d % 2);
                for c in beside.filter(|c| self.coarse.hanging[near as usize] >> c & 1 == 1) {
                    let slot = 8 * near + c as u32;
                    if !done.has(slot) {
                        let hangs_on = self.coarse.class_of(slot, &mut members);
                        for &slot in &members {
                            done.insert(slot);
                            hanging.push((slot, hangs_on));
                        }
                    }
                }
            }
        }
        for (slot, big) in hanging {
            let q = parent_corner(&self.coarse.cells[slot as usize / 8], slot as usize % 8);
            let big = self.coarse.cells.get(big as usize).map(|_| big)?;
            let k = self.coarse.corner_at(big, q)?;
            self.enter(slot, self.coarse.vertices[big as usize][k], true);
        }
        // A number without a taker is a vertex without corners: classes have grown together.
        owed.is_within(&taken).then_some(())
    }

    /// The vertex that carried corner `slot` before, if it did not hang.
    fn vertex_before(&self, slot: u32) -> Option<u32> {
        let (id, c) = (slot / 8, (slot % 8) as usize);
        let whole = (id as usize).checked_sub(self.known).map_or(id, |new| self.origin[new]);
        let Some(earlier) = self.history.get(whole) else {
            let Earlier { vertices, hanging, .. } = self.coarse.now(id);
            return (hanging >> c & 1 == 0).then_some(vertices[c]);
        };
        let p = self.coarse.cells[id as usize].corner(c);
        let k = earlier.cell.corner_at(p).filter(|k| earlier.hanging >> k & 1 == 0)?;
        Some(earlier.vertices[k])
    }

    /// Lets `vertex` carry corner `slot`, or stand in for it where it hangs.
    fn enter(&mut self, slot: u32, vertex: u32, hangs: bool) {
        let (id, c) = (slot / 8, (slot % 8) as usize);
        let now = self.coarse.now(id);
        let bit = 1 << c;
        if now.vertices[c] == vertex && (now.hanging & bit != 0) == hangs {
            return;
        }
        self.history.keep(id, now);
        self.coarse.vertices[id as usize][c] = vertex;
        self.coarse.hanging[id as usize] = if hangs { now.hanging | bit } else { now.hanging & !bit };
    }
}
