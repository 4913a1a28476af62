//! Estimates of the error of a solution, made while the simulation runs.
//!
//! [`StressRecovery`] estimates the error of the mesh (Zienkiewicz, Zhu 1987). The error of the iterative
//! solver is part of its report ([`scindo_algebra::solver::LinearReport::algebraic_error`]). Both are energy norms in
//! √J, so they can be compared: a solver may stop when its error is a third of that of the mesh.

mod cells;
mod stress_recovery;
mod tets;

pub use cells::CellRecovery;
pub use stress_recovery::{MeshError, StressRecovery};
pub use tets::{CutTets, Tets};
