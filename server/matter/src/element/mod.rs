//! Elements: the linear tetrahedron and the rotation of its deformation gradient, the quadratic tetrahedron,
//! the trilinear hexahedron, and the spring between two nodes.

mod polar;
mod lanes;
#[cfg(target_arch = "x86_64")]
pub mod avx2;
#[cfg(target_arch = "x86_64")]
pub mod avx512;
mod polar_lanes;
mod eigen_lanes;
mod tet4;
pub mod quadrature;
pub mod tet10;
pub mod piece_rule;
pub mod hex8;
mod prefetch;
mod spring;
mod points;
mod kinds;
mod held;
mod material_point;

pub use crate::for_eight;
pub use eigen_lanes::symmetric_eigen;
pub use held::{FixedCopy, Held};
pub use kinds::ElementKind;
pub use lanes::{Batched, Halves, Ids, LANES, Lanes, Simd, Vector, Vector8};
pub use material_point::{MOST_CARRIERS, MaterialPoint};
pub use points::{Point, Points};
pub use polar::polar_rotation;
pub use polar_lanes::{Mat3, polar_newton};
pub use prefetch::{prefetch, prefetch_at};
pub use spring::Spring;
pub use tet4::{TET_EDGES, deformation_gradient, piece_energy, piece_forces};
