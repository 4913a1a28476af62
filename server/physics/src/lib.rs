//! Continuum mechanics of one deformable, cuttable body.
//!
//! Modules stand in the order of the data. A [`mesh`] is the material at rest, a [`material`] its law and
//! constants, an [`element`] its resistance to deformation. [`cut`] divides elements into pieces and
//! nodes into copies; [`snap`] cuts the mesh itself instead. A [`skin`] is a finer surface that follows
//! the cuts, and [`enrichment`] views one cut element in the bases of the literature. An [`assembly`]
//! gives the forces and matrices of any element with any law; [`pressure`] follows the surface; an [`operator`] is the fast way from
//! displacements to forces. A [`solver`] inverts it, and an [`integrator`] makes a step of it. A [`body`]
//! holds all of this together for the world.
//!
//! # Invariants
//! No input or output, no clock, no thread that outlives its owner, no global state; the result of
//! a step does not depend on the number of threads; no non-finite number leaves a body.
//! SI units throughout. State is `f64`, kernels and solver vectors are `f32`.

#![allow(non_snake_case)] // the symbols of the field: F, R, P, K, M
#![allow(clippy::needless_range_loop)] // i, j, k are tensor indices and lanes

mod saved;
mod sync;
pub mod mesh;
pub mod material;
pub mod element;
pub mod cut;
pub mod skin;
pub mod snap;
pub mod octree;
pub mod enrichment;
pub mod phase;
pub mod team;
pub mod assembly;
pub mod pressure;
pub mod operator;
pub mod solver;
pub mod multigrid;
pub mod two_level;
pub mod space;
pub mod integrator;
pub mod estimate;
pub mod body;
mod lists;
#[cfg(test)]
mod testing;
