//! Linear systems of octree cells, taken apart: solids and blades, the matrix of a step, solvers and refinement.
//!
//! [`shape`] and [`model`] build solids and blades, [`linear`] is the linear system of a step, and [`solve`] and
//! [`refine`] run solvers on it.

pub mod shape;

pub mod model;

pub mod linear;

pub mod solve;

pub mod refine;
