//! A two-level preconditioner for bodies of tetrahedra: M⁻¹ = D⁻¹ + P A_c⁻¹ Pᵀ.
//!
//! Block-Jacobi D⁻¹ sees single nodes, so a force at one end of a body reaches the other end only after as many
//! iterations as there are elements between them. The second term adds a coarse space: trilinear displacements on a
//! regular lattice that is laid over the body at rest and need not fit its surface. P interpolates
//! from the lattice to the nodes, and A_c is PᵀA P, solved by sparse Cholesky factorisation. Iterations then
//! hardly depend on the number of elements, the stiffness, and the time step.
//!
//! - **Cuts.** The lattice is cut where the body is: what a cut separates within a cell gets unknowns of its own.
//! - **Rotations.** A_c is summed from one small matrix per cell, made at rest and turned with the mean rotation of its
//!   material. It is factorised anew once a cell has turned notably since the last time. A matrix that is out of date
//!   costs iterations, never accuracy.
//! - **Held nodes and springs.** Both are stiff springs in A_c. Held directions are 0 in M⁻¹.
//!
//! All terms are symmetric and positive semidefinite, whatever the rounding of A_c, so plain conjugate gradients apply.
//!
//! # Source
//! Additive two-level methods with a coarse space: Nicolaides 1987; Smith, Bjørstad, Gropp 1996, ch. 2. Coarse unknowns
//! for each side of a cut: Dick, Georgii, Westermann 2011, §6, here for tetrahedra embedded in the lattice.

mod coarse_matrix;
mod interpolation;
mod lattice;
mod parts;
mod precondition;
mod space;
mod system;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

pub use precondition::TwoLevel;
pub use space::CoarseSpace;
pub use system::CoarseSystem;
