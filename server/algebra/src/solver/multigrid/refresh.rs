//! Stored matrices, computed anew where something below them changed.

#![allow(unsafe_code)] // vector instructions behind run-time detection

use scindo_matter::element::Held;
use scindo_matter::element::{Lanes, Simd, Vector8};

use super::carried::{Carried, corners_in};
use super::dense::Dense;
use super::hierarchy::Hierarchy;
use super::level::NONE;
use super::matrices::{
    CellMatrix, INCLINED, LevelMatrices, Rotation, SAME, Stored, Within, cell_matrix, weights,
};
use super::thin::{Equations, Thin, is_thin};

/// What the matrices of level `l` are computed from.
pub(super) struct Context<'a> {
    pub hierarchy: &'a Hierarchy,
    pub l: usize,
    pub fine: &'a LevelMatrices,
    pub shared: &'a [Dense],
    pub carried: &'a Carried,
    /// Prescribed directions of the fine vertices; empty where they are in the matrices already.
    pub held: &'a [u8],
    pub inclined: &'a [Held],
    pub eighth: &'a [f32],
    /// Whether inner vertices of thin cells move as in equilibrium.
    pub may_be_thin: bool,
}

impl Context<'_> {
    /// Computes stored matrices of this level, whose cells have these frames, if anything below them changed.
    pub(super) fn refresh(
        &self,
        simd: Simd,
        stored: &mut [Stored],
        frame: &[Rotation],
        with: (Within, bool),
    ) {
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: both come from `Simd::detect` only.
            Simd::Avx2 | Simd::Avx512 => unsafe { avx2::refresh(self, stored, frame, with) },
            _ => self.refresh_all::<Lanes>(stored, frame, with),
        }
    }

    #[inline(always)]
    fn refresh_all<V: Vector8>(&self, stored: &mut [Stored], frame: &[Rotation], with: (Within, bool)) {
        let mut equations = None;
        for stored in stored.iter_mut().filter(|stored| stored.cell != NONE) {
            self.refresh_one::<V>(stored, &frame[stored.cell as usize], with, &mut equations);
        }
    }

    #[inline(always)]
    fn refresh_one<V: Vector8>(
        &self,
        stored: &mut Stored,
        frame: &Rotation,
        (within, anew): (Within, bool),
        equations: &mut Option<Equations>,
    ) {
        let id = stored.cell as usize;
        let children = self.hierarchy.steps[self.l - 1].children_of(id);
        let to_frame = frame.inverse();
        let relative = |c: u32| to_frame * self.fine.frame[c as usize];
        // Rotations count relative to the frame: where all children turn alike, nothing is computed.
        stored.stale |= anew
            || children
                .iter()
                .zip(&stored.relative)
                .any(|(&c, known)| self.fine.changed[c as usize] || !within.holds(&relative(c), known));
        if !stored.stale {
            return;
        }
        let (fine, coarse) = (&self.hierarchy.levels[self.l - 1], &self.hierarchy.levels[self.l]);
        let cell = &coarse.cells[id];
        let mut sum = Dense::default();
        stored.inner.clear();
        let is_held = |v: u32| self.held.get(v as usize).is_some_and(|&held| held != 0);
        let mut thin = (self.may_be_thin && is_thin(coarse, id))
            .then(|| {
                let room = equations.get_or_insert_default();
                Thin::new((fine, coarse), &self.hierarchy.steps[self.l - 1], id, is_held, room)
            })
            .flatten();
        let same = Within::new(SAME);
        for (&child, known) in children.iter().zip(&mut stored.relative) {
            *known = relative(child);
            let child = child as usize;
            let turn =
                (!same.holds(known, &Rotation::identity())).then(|| known.to_rotation_matrix().into_inner());
            let merges = fine.cells[child].level != cell.level;
            // The usual child: its kind and place have a matrix in the corners of the parent, ready to be added.
            if let Some(A) = self.carried(child).filter(|_| merges && thin.is_none()) {
                match turn {
                    Some(Q) => sum.add::<V>(&A.rotated::<V>(&Q)),
                    None => sum.add::<V>(A),
                }
                continue;
            }
            let mut A = cell_matrix(self.hierarchy, (self.l - 1, child), self.fine, self.shared, self.eighth);
            let holds =
                !self.held.is_empty() && fine.vertices[child].iter().any(|&v| self.held[v as usize] != 0);
            // One that rests on its own corners needs its octant only, not the weights of every corner.
            if merges && thin.is_none() && !holds && fine.hanging[child] == 0 {
                let A = match turn {
                    Some(Q) => A.rotated_flipped::<V>(&Q),
                    None => A.flipped::<V>(),
                };
                A.add_to_parent::<V>(fine.cells[child].octant(), &mut sum);
                continue;
            }
            if let Some(Q) = turn {
                A = A.rotated::<V>(&Q);
            }
            // Directions are those of the world, and so is the frame of a cell that is held in some of them only.
            if holds {
                for (c, &v) in fine.vertices[child].iter().enumerate() {
                    match self.held[v as usize] {
                        fixed @ 0..INCLINED => A.hold(c, fixed),
                        fixed => A.filter(c, &self.inclined[usize::from(fixed - INCLINED)]),
                    }
                }
            }
            if let Some(thin) = &mut thin {
                thin.add::<V>(fine, child, &A);
            }
            if merges {
                sum.add::<V>(&A.carried::<V>(&corners_in(fine, child, cell)));
            } else {
                sum.add::<V>(&A);
            }
        }
        if !coarse.leaf[id] && coarse.hanging[id] != 0 {
            sum = sum.carried::<V>(&weights(cell, coarse.hanging[id]));
        }
        // Last, because every child adds to the equations of the inner vertices.
        if let Some(thin) = thin {
            thin.relax::<V>(&mut sum, &mut stored.inner);
        }
        stored.matrix = sum.packed();
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same compiled for AVX2 and FMA.

    use super::{Context, Rotation, Stored, Within};
    use scindo_matter::element::avx2::Register;

    /// # Safety
    /// The machine has AVX2 and FMA.
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn refresh(
        context: &Context<'_>,
        stored: &mut [Stored],
        frame: &[Rotation],
        with: (Within, bool),
    ) {
        context.refresh_all::<Register>(stored, frame, with);
    }
}

impl Context<'_> {
    /// The matrix of a child in the corners of its parent, if its kind and place alone give it.
    #[inline(always)]
    fn carried(&self, child: usize) -> Option<&Dense> {
        let CellMatrix::Shared(kind) = self.fine.matrix[child] else { return None };
        let fine = &self.hierarchy.levels[self.l - 1];
        if !self.held.is_empty() && fine.vertices[child].iter().any(|&v| self.held[v as usize] != 0) {
            return None;
        }
        self.carried.get(kind, &fine.cells[child], fine.hanging[child])
    }
}
