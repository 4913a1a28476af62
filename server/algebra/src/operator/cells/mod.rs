//! The stiffness of cubical cells, matrix-free: the cells of an octree, and of the levels above it.
//!
//! The stiffness of an isotropic cube commutes with its three reflections. In Walsh–Hadamard coordinates over
//! the corners it falls into eight symmetric 3×3 [sectors](SectorTable). One application to a cell is: rotate,
//! 72 additions, 72 multiply-adds, 72 additions, rotate back, instead of 576 multiply-adds with a dense matrix.
//!
//! Every cell is held in the frame of its octant in the parent: *slot* j is the corner j ⊕ octant, so slot 0 is
//! the corner that cell and parent have in common, and a hanging corner always is the same mean of the same
//! slots. With D = diag(±1) the reflection and δ its determinant, δD is a rotation, and R K Rᵀ = R̂ K R̂ᵀ with
//! R̂ = δ R D.
//!
//! # Source
//! Dick, Georgii, Westermann 2011, §5 and §6.4 (the element, one rotation per cell, hanging vertices).

mod sectors;
mod lane;
mod batch;
mod interleave;
mod stored;
mod blocks;
mod chunk;
mod operator;
mod update;
mod stiffness;

pub use chunk::Given;
pub use lane::{CellLane, CellMatrix, slot_corners, slot_hanging};
pub use operator::{CellOperator, morton_order};
pub use sectors::{ENTRY, Matrix24, SectorTable, unit_stiffness};
pub use stiffness::CellStiffness;
pub use stored::{STORED, stored_entry};

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
