//! The linear tetrahedron and the rotation of its deformation gradient.

mod polar;
mod lanes;
mod polar_lanes;
mod tet4;

#[cfg(target_arch = "x86_64")]
pub use lanes::avx2;
pub use lanes::{LANES, Lanes, Simd, Vector8};
pub use polar::polar_rotation;
pub use polar_lanes::{Mat3, polar_newton};
pub use tet4::{deformation_gradient, piece_energy, piece_forces};
