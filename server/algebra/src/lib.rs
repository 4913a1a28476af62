//! From elements to forces and matrices, and from these to the solution of their equations.
//!
//! Modules stand in the order of the data, and each knows only those before it. An [`assembly`] gives the forces and
//! matrices of any element with any law, and those of pressure; an [`operator`] is the fast way from displacements to
//! forces. A [`solver`] inverts it, with multigrid among its preconditioners.
//!
//! The crate `scindo-physics` hands all this on, with the step that is built from it; its overview holds the symbols and
//! the invariants.
#![allow(non_snake_case)] // the symbols of the field: F, R, P, K, M
#![allow(clippy::needless_range_loop)] // i, j, k are tensor indices and lanes

pub mod assembly;
pub mod operator;
pub mod solver;
