//! Linear operators on the copies of a body: K̂ matrix-free, and the system matrix of a step.

mod chunks;
mod elastic;
mod kernel;
mod preconditioner;
mod system;

pub use elastic::{Elastic, ElasticUpdate};
pub use kernel::Block6;
pub use preconditioner::{BlockJacobi, Inverse3};
pub use system::{FixedCopy, Spring, SystemOperator, filter};

use crate::team::Team;

/// A vector of three components with an unused fourth (always 0), so that one copy is one register.
pub type Padded = [f32; 4];

/// Copies per block of the vector loops: the unit of work and of summation.
pub const BLOCK: usize = 256;

/// A symmetric linear map on vectors with one [`Padded`] entry per copy.
pub trait LinearOperator {
    /// y = A x. Both slices have one entry per copy.
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]);
}

/// x, y, z of a double-precision vector, rounded.
pub fn padded(v: &nalgebra::Vector3<f64>) -> Padded {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}
