//! Continuum mechanics of one deformable, cuttable body.
//!
//! Three crates stand in the order of the data, and so do the modules of each, which know only those before them. The
//! first two are handed on here.
//!
//! *scindo-matter*: a [`team`] of threads shares the work of a step. A [`material`] is a law with its constants, an
//! [`element`] its resistance to deformation, a [`mesh`] the material at rest. [`cut`] divides elements into pieces and
//! nodes into copies, or makes a new mesh ([`cut::remesh`]). A [`skin`] is a surface finer than the elements, and an
//! [`octree`] holds hexahedral cells and the links between them, which cuts open.
//!
//! *scindo-algebra*: an [`assembly`] gives the forces and matrices of any element with any law, and those of pressure;
//! an [`operator`] is the fast way from displacements to forces. A [`solver`] inverts it, with multigrid among its
//! preconditioners.
//!
//! This crate: a [`space`] is what a discretisation offers a body, its surface included. An [`integrator`] makes a step
//! of all this, and a [`body`] holds it together for the world.
//!
//! # Invariants
//! No input or output, no clock, no thread that outlives its owner, no global state; the result of
//! a step does not depend on the number of threads; no non-finite number leaves a body.
//! SI units throughout. State is `f64`, kernels and solver vectors are `f32`.
#![doc = include_str!("../SYMBOLS.md")]
#![allow(non_snake_case)] // the symbols of the field: F, R, P, K, M
#![allow(clippy::needless_range_loop)] // i, j, k are tensor indices and lanes

pub use scindo_algebra::{assembly, operator, solver};
pub use scindo_matter::{cut, element, material, mesh, octree, skin, team};

pub mod space;
pub mod integrator;
pub mod body;
