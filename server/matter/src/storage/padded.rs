//! Vectors of three components in single precision, one register each.

/// A vector of three components with an unused fourth (always 0), so that one copy is one register.
pub type Padded = [f32; 4];

/// x, y, z of a double-precision vector, rounded.
pub fn padded(v: &nalgebra::Vector3<f64>) -> Padded {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

/// x, y, z of a padded vector in double precision.
#[inline(always)]
pub fn unpadded(v: &Padded) -> nalgebra::Vector3<f64> {
    nalgebra::Vector3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}
