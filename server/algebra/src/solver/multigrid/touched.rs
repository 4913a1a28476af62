//! Galerkin operators that follow cuts and other prescribed directions: only matrices of touched cells are computed
//! again, by the next update.

use scindo_matter::element::FixedCopy;
use scindo_matter::octree::corner_shares;
use scindo_matter::storage::bits::Bits;

use super::follow::LevelChange;
use super::galerkin::{Galerkin, held};
use super::hierarchy::Hierarchy;
use super::level::{Level, NONE};
use super::matrices::{CellMatrix, INCLINED, LevelMatrices, Rotation, shared_matrix};
use super::thin::is_thin;

impl Galerkin {
    /// Follows a cut that made these `changes` to the levels of `hierarchy`, whose transfers may still have to follow it.
    /// [`hold_coarse`](Self::hold_coarse) comes next.
    pub(super) fn follow(&mut self, hierarchy: &Hierarchy, changes: &[LevelChange]) {
        self.fixed.resize(hierarchy.n_vertices(), 0);
        if self.first > 0 {
            self.held_bits.resize(hierarchy.levels[self.first].n_vertices, 0);
        }
        if let Some(with) = self.coefficients.take() {
            self.add_kinds(hierarchy, &with);
            self.coefficients = Some(with);
        }
        for (l, change) in changes.iter().enumerate() {
            let (level, n) = (&mut self.levels[l], hierarchy.levels[l].cells.len());
            level.frame.resize(n, Rotation::identity());
            level.matrix.resize(n, CellMatrix::Shared(NONE));
            level.holds.resize(n, [false; 2]);
            level.changed.resize(n, false);
            let weighs = hierarchy.levels[l].has_slots();
            if weighs {
                level.mass.resize(hierarchy.levels[l].n_vertices, 0.0);
            }
            for &id in &change.cells {
                self.touch(hierarchy, l, id);
            }
            // Vertices of a thin cell may have become inner ones without any other change of it.
            let below = l.checked_sub(1).filter(|&below| hierarchy.levels[below].has_slots());
            if let Some(step) = below.and_then(|below| hierarchy.steps.get(below)) {
                let below = changes[l - 1].vertices.iter();
                let children = below.flat_map(|&v| hierarchy.levels[l - 1].slots_of(v as usize));
                let mut around = Bits::new(n);
                around.extend(children.map(|(child, _)| step.parent[child]));
                let thin = around.iter().filter(|&id| is_thin(&hierarchy.levels[l], id as usize));
                thin.for_each(|id| self.touch(hierarchy, l, id));
            }
            // The constants are known from the first update on.
            if self.coefficients.is_some() {
                self.add_carried(hierarchy, l, &change.cells);
                change.vertices.iter().filter(|_| weighs).for_each(|&v| self.weigh(hierarchy, l, v));
            }
        }
    }

    /// Follows other prescribed directions. Returns whether some are free that were prescribed.
    pub(super) fn hold(&mut self, hierarchy: &Hierarchy, fixed: &[FixedCopy]) -> bool {
        let mut vertices: Vec<u32> =
            self.known_fixed.iter().map(|f| f.0).chain(fixed.iter().map(|f| f.copy)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let before: Vec<u8> = vertices.iter().map(|&v| self.bits(v)).collect();
        self.known_fixed.iter().for_each(|f| {
            if let Some(bits) = self.fixed.get_mut(f.0 as usize) {
                *bits = 0;
            }
        });
        self.known_fixed.clear();
        self.known_fixed.extend(fixed.iter().map(|f| (f.copy, f.held)));
        self.enter_fixed(hierarchy);
        let mut released = false;
        let mut changed = Bits::new(self.fixed.len());
        for (&v, &before) in vertices.iter().zip(&before) {
            let now = self.bits(v);
            let inclined = before.max(now) >= INCLINED;
            released |= if inclined { before != now } else { before & !now != 0 };
            if before != now {
                changed.insert(v);
            }
        }
        let carried = (0u32..).zip(&hierarchy.levels[0].vertices);
        let is_changed = |vertices: &[u32; 8]| vertices.iter().any(|&v| changed.has(v));
        let mut cells: Vec<u32> =
            carried.filter(|(_, vertices)| is_changed(vertices)).map(|(id, _)| id).collect();
        for l in 0..self.levels.len() {
            cells.sort_unstable();
            cells.dedup();
            for &id in &cells {
                self.touch(hierarchy, l, id);
            }
            // Leaves on coarse levels have their mass apart from their matrix, unless they are held.
            let level = &hierarchy.levels[l];
            let weighed = cells.iter().filter(|_| level.has_slots());
            let leaves = weighed.filter(|&&id| level.leaf[id as usize]);
            let mut vertices: Vec<u32> = leaves.flat_map(|&id| level.vertices[id as usize]).collect();
            vertices.sort_unstable();
            vertices.dedup();
            vertices.iter().for_each(|&v| self.weigh(hierarchy, l, v));
            if let Some(step) = hierarchy.steps.get(l) {
                cells.iter_mut().for_each(|id| *id = step.parent[*id as usize]);
            }
        }
        released
    }

    fn bits(&self, v: u32) -> u8 {
        self.fixed.get(v as usize).copied().unwrap_or(0)
    }

    /// Has the matrix of a cell computed again by the next update. Children come first.
    fn touch(&mut self, hierarchy: &Hierarchy, l: usize, id: u32) {
        let at = id as usize;
        let holds = match l {
            0 => held(&self.fixed, &hierarchy.levels[0].vertices[at]),
            _ => {
                let below = &self.levels[l - 1].holds;
                let children = hierarchy.steps[l - 1].children_of(at).iter();
                children.fold([false; 2], |[a, b], &c| {
                    let [c, d] = below[c as usize];
                    [a | c, b | d]
                })
            }
        };
        let LevelMatrices { matrix, stored, touched, holds: of_cell, .. } = &mut self.levels[l];
        of_cell[at] = holds;
        match matrix[at] {
            CellMatrix::Stored(place) => {
                let n = hierarchy.steps[l - 1].children_of(at).len();
                let stored = &mut stored[place as usize];
                stored.stale = true;
                stored.relative.resize(n, Rotation::identity());
            }
            CellMatrix::Shared(_) => matrix[at] = CellMatrix::Shared(hierarchy.kind_of[l][at]),
        }
        touched.push(id);
    }

    /// Computes the matrices of children that are of a new kind, or at a new place.
    fn add_carried(&mut self, hierarchy: &Hierarchy, l: usize, cells: &[u32]) {
        let (shared, eighth) = (&self.shared, &self.eighth);
        self.carried.add(hierarchy, l, cells.iter().map(|&id| id as usize), |l, id| {
            let kind = hierarchy.kind_of[l][id] as usize;
            shared_matrix(&hierarchy.levels[l], id, &shared[kind], eighth[kind])
        });
    }

    /// Sums the lumped mass of vertex `v`.
    fn weigh(&mut self, hierarchy: &Hierarchy, l: usize, v: u32) {
        let (level, kinds) = (&hierarchy.levels[l], &hierarchy.kind_of[l]);
        let matrices = &mut self.levels[l];
        let mut sum = 0.0;
        for (id, c) in level.slots_of(v as usize) {
            if level.leaf[id] && !(l > 0 && matrices.holds[id][0]) {
                sum += mass_at(level, id, c, self.eighth[kinds[id] as usize]);
            }
        }
        matrices.mass[v as usize] = sum;
    }
}

/// Mass that leaf `id` has at its vertex `c`, with an `eighth` at every corner.
fn mass_at(level: &Level, id: usize, c: usize, eighth: f32) -> f32 {
    match level.hanging[id] {
        0 => eighth,
        hanging => corner_shares(&level.cells[id], hanging)[c] as f32 * eighth,
    }
}
