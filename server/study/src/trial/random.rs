//! Random numbers of cases and studies. They are the same on every run and machine.

use nalgebra::Vector3;

/// SplitMix64: a small generator whose sequence depends only on the seed.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next number, uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The next vector, uniform in the cube of half width `r` around the origin.
    pub fn vector(&mut self, r: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| (2.0 * self.uniform() - 1.0) * r)
    }
}
