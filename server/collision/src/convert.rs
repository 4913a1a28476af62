//! Conversions of positions.

use nalgebra::Vector3;

/// A surface position as an `f64` vector [m].
pub(crate) fn widen(p: [f32; 3]) -> Vector3<f64> {
    Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}
