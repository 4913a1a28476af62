//! What a deformable, cuttable body is made of, before any equation of it is solved.
//!
//! Modules stand in the order of the data, and each knows only those before it. [`storage`] holds lists of numbers, and a
//! [`team`] of threads shares the work of a step. A [`material`] is a law with its constants, an [`element`] its
//! resistance to deformation, a [`mesh`] the material at rest. [`cut`] divides elements into pieces and nodes into copies,
//! or makes a new mesh ([`cut::remesh`]). A [`skin`] is a surface finer than the elements, and an [`octree`] holds
//! hexahedral cells and the links between them, which cuts open.
//!
//! The crate `scindo-physics` hands all this on, with what is built from it; its overview holds the symbols and the
//! invariants.
#![allow(non_snake_case)] // the symbols of the field: F, R, P, K, M
#![allow(clippy::needless_range_loop)] // i, j, k are tensor indices and lanes

pub mod storage;
pub mod team;
pub mod material;
pub mod element;
pub mod mesh;
pub mod cut;
pub mod skin;
pub mod octree;
#[cfg(test)]
mod testing;
