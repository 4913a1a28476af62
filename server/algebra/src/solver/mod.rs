//! Solution of A x = b, and of nonlinear equilibrium by Newton's method.
//!
//! Every solver stops on the *preconditioned* residual √(rᵀM⁻¹r), M the 3×3 diagonal blocks of A: the
//! plain norm is blind to slivers. Each reports its number of iterations, its residual and why it
//! stopped. None iterates through a direction of non-positive curvature.

pub mod multigrid;
pub mod two_level;
mod real;
mod report;
mod algebraic_error;
mod constraint;
mod block_jacobi;
mod conjugate_gradients;
mod differences;
mod cholesky;
mod substituted;
mod linear;
mod newton;
mod mixed;
mod eigen;
mod pcg;
mod cycles;

pub use algebraic_error::AlgebraicError;
pub use block_jacobi::DiagonalInverse;
pub use cholesky::Cholesky;
pub use constraint::Filter;
pub use eigen::{EigenError, EigenSettings, Modes, natural_frequencies};
pub use linear::{LinearSettings, LinearSolver, Method, Precision};
pub use newton::LEAST_REFERENCE;
pub use newton::{Curvature, Newton, NewtonReport, NewtonSettings, Potential};
pub use pcg::{Pcg, PcgSettings};
pub use report::{LinearReport, StopReason};

#[cfg(test)]
mod tests;
