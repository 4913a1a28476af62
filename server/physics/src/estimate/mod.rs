//! How wrong a solution is, estimated while the simulation runs.
//!
//! [`StressRecovery`] estimates the error of the mesh (Zienkiewicz, Zhu 1987); the error of the
//! iterative solver comes with its report ([`crate::solver::LinearReport::algebraic_error`]). Both
//! are energy norms in √J, so they can be compared: a solver may stop when its error is a third of
//! the mesh's.

mod stress_recovery;
mod tets;

pub use stress_recovery::{MeshError, StressRecovery};
pub use tets::{CutTets, Tets};
