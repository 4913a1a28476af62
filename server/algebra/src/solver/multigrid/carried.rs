//! Matrices of children in the corners of their parents, which most children of one kind and place share.

use scindo_matter::element::Lanes;
use scindo_matter::octree::Cell;

use super::dense::{Dense, Weights};
use super::hierarchy::Hierarchy;
use super::level::{Level, NONE, place_in, trilinear};

/// Places in a parent, and combinations of hanging corners.
const OCTANTS: usize = 8;
const HANGING: usize = 256;

/// One matrix for every kind, octant and combination of hanging corners that children have.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Carried {
    /// Number of the matrix by kind, octant and hanging corners, or [`NONE`].
    number: Vec<u32>,
    matrices: Vec<Dense>,
}

impl Carried {
    /// Computes the matrices of all children that merge; `matrix` gives that of a cell of a level over the vertices
    /// that carry it, if it is the one of its kind.
    pub(super) fn update(&mut self, hierarchy: &Hierarchy, matrix: impl Fn(usize, usize) -> Dense) {
        self.matrices.clear();
        self.number.clear();
        for l in 0..hierarchy.steps.len() {
            self.add(hierarchy, l, 0..hierarchy.levels[l].cells.len(), &matrix);
        }
    }

    /// Adds the matrices of these cells of level `l`, if they are not known.
    pub(super) fn add(
        &mut self,
        hierarchy: &Hierarchy,
        l: usize,
        cells: impl Iterator<Item = usize>,
        matrix: impl Fn(usize, usize) -> Dense,
    ) {
        let Some(step) = hierarchy.steps.get(l) else { return };
        let (fine, coarse) = (&hierarchy.levels[l], &hierarchy.levels[l + 1]);
        self.number.resize(hierarchy.kinds.len() * OCTANTS * HANGING, NONE);
        for id in cells {
            let (kind, parent) = (hierarchy.kind_of[l][id], &coarse.cells[step.parent[id] as usize]);
            if kind == NONE || fine.cells[id].level == parent.level {
                continue;
            }
            let number = &mut self.number[slot(kind, &fine.cells[id], fine.hanging[id])];
            if *number == NONE {
                *number = self.matrices.len() as u32;
                self.matrices.push(matrix(l, id).carried::<Lanes>(&corners_in(fine, id, parent)));
            }
        }
    }

    /// That of a child with the matrix of its kind.
    #[inline]
    pub(super) fn get(&self, kind: u32, cell: &Cell, hanging: u8) -> Option<&Dense> {
        let number = *self.number.get(slot(kind, cell, hanging))?;
        self.matrices.get(number as usize)
    }
}

/// Weights of the corners of `parent` in the vertices that carry the fine cell `id`.
pub(super) fn corners_in(fine: &Level, id: usize, parent: &Cell) -> Weights {
    std::array::from_fn(|c| trilinear(place_in(fine, id, c, parent)))
}

fn slot(kind: u32, cell: &Cell, hanging: u8) -> usize {
    (kind as usize * OCTANTS + cell.octant()) * HANGING + usize::from(hanging)
}
