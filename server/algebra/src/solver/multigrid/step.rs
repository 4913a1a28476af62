//! From a level to the next coarser one.

use scindo_matter::storage::jagged::Jagged;

use super::level::Level;
use super::transfer::Transfer;

/// What leads from a level to the next coarser one.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Step {
    /// Coarse cell of every fine cell.
    pub parent: Vec<u32>,
    /// Fine cells of every coarse cell, ascending.
    pub children: Jagged<u32>,
    /// P.
    pub transfer: Transfer,
}

impl Step {
    /// Between `fine` and `coarse`, by the coarse cell of every fine one.
    pub(super) fn new(fine: &Level, coarse: &Level, parent: Vec<u32>) -> Self {
        let by_parent = |visit: &mut dyn FnMut(u32, u32)| {
            (0u32..).zip(&parent).for_each(|(child, &parent)| visit(parent, child));
        };
        let children = Jagged::by_counting(coarse.cells.len(), by_parent, 0);
        let transfer = Transfer::new(fine, coarse, &parent);
        Self { parent, children, transfer }
    }

    /// Fine cells of coarse cell `id`.
    #[inline]
    pub(super) fn children_of(&self, id: usize) -> &[u32] {
        self.children.get(id)
    }
}
