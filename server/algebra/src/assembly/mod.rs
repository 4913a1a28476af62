//! The general discretisation in double precision: any element with any law, its energy, internal
//! forces, assembled tangent and masses.
//!
//! A [`Model`] holds quadrature points: shape function gradients in the rest configuration and
//! weights. With F = Σ_a x_a ⊗ ∇N_a at a point, the energy is Ψ = Σ w ψ(F), the internal force on
//! node a is f_a = Σ w P(F) ∇N_a, and the tangent block is K_ab = Σ w ∇N_a · ∂P/∂F · ∇N_b.
//!
//! On cut tetrahedra each material piece is an element of its own on its copies, with its volume as
//! weight. This is exact, since F is constant in a linear tetrahedron. On quadratic ones a piece has quadrature points
//! of its own ([`piece_rule`](scindo_matter::element::piece_rule)).
//!
//! # Source
//! Zienkiewicz, Taylor, Zhu, *The Finite Element Method*; Bonet, Wood, *Nonlinear Continuum Mechanics
//! for Finite Element Analysis*.

mod block_csr;
pub mod pressure;
mod point;
mod error;
mod volumetric;
mod model;
mod build;
mod quadratic;
mod follow;
mod kernel;
mod averaging;
mod scratch;
mod elastic;
mod parallel;
mod mass;
mod mass_matrix;
mod rotated;
mod viscous;
mod viscoelastic;

pub use block_csr::BlockCsr;
pub use error::ModelError;
pub use scindo_matter::material::Tangent;

pub use mass::MassSharing;
pub use model::Model;
pub use quadratic::QuadraticPiece;
pub use volumetric::Volumetric;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
