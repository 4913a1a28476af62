//! Material points that are followed through cuts.

use nalgebra::Vector3;

/// A material point, as the [`Space`](super::Space) that located it finds it again after cuts.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RestPoint {
    /// Its rest position [m].
    pub rest_m: Vector3<f64>,
    /// The short vector from there to the side of a cut that it belongs to [m]; 0 if no side was given.
    pub towards_m: Vector3<f64>,
    /// The element or tetrahedron of the uncut body that contains it.
    pub element: u32,
}
