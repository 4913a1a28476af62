//! The two precisions in which vectors and matrices are kept.

use nalgebra::{RealField, Vector3};

/// Single or double precision.
pub trait Real: RealField + Copy + Default {
    /// Rounds to this precision.
    fn of(value: f64) -> Self;
    /// The same number in double precision.
    fn wide(self) -> f64;
}

impl Real for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}

/// x · y, in double precision.
#[inline(always)]
pub(super) fn dot<T: Real>(x: &Vector3<T>, y: &Vector3<T>) -> f64 {
    x.x.wide() * y.x.wide() + x.y.wide() * y.y.wide() + x.z.wide() * y.z.wide()
}
