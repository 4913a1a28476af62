//! Geometric multigrid for the cells of an octree, as a preconditioner and as a solver.
//!
//! Cells of a level are merged block by block into those of the next one; parts of a block that a cut separates
//! become cells of their own, so that every level is cut where the body is. The operators of the levels are
//! Galerkin products, cell by cell, and thin parts bend on them as softly as they are. One cycle smooths on every
//! level and solves on the coarsest one.
//!
//! # Source
//! Dick, Georgii, Westermann 2011, §6 (hierarchy and Galerkin operators on cut octrees); Lottes 2023 (smoother).

mod level;
mod transfer;
mod step;
mod follow;
mod hierarchy;
mod dense;
mod table;
mod carried;
mod thin;
mod matrices;
mod refresh;
mod galerkin;
mod inner;
mod touched;
mod operator;
mod lanczos;
mod kernel;
mod smoother;
mod bounds;
mod stiff_springs;
mod coarsest;
mod cycle;
mod precondition;
mod restricted;
mod simulated;

pub use coarsest::CoarsestSolve;
pub use cycle::{CycleShape, LevelReport, Multigrid, MultigridSettings};
pub use follow::LevelChange;
pub use galerkin::{CellMaterial, Coefficients};
pub use hierarchy::Hierarchy;
pub use precondition::Cycle;
pub use simulated::{Composite, CompositePreconditioner, CompositeSystem};
pub use smoother::Smoother;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
