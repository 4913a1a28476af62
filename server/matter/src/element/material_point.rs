//! A point of the material, carried by nodes.

use nalgebra::Vector3;

/// Largest number of carriers: the nodes of a hexahedron.
pub const MOST_CARRIERS: usize = 8;

/// A point bound to the material: x = Σ weights · x\[copies\], over at most [`MOST_CARRIERS`] copies.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MaterialPoint<T = f64> {
    copies: [u32; MOST_CARRIERS],
    weights: [T; MOST_CARRIERS],
    n: u8,
}

impl<T: Copy + Default> MaterialPoint<T> {
    /// The point with these carriers and weights, Σ = 1; carriers beyond the eighth are left out.
    pub fn new(carriers: impl IntoIterator<Item = (u32, T)>) -> Self {
        let mut point = Self::default();
        for (k, (copy, weight)) in carriers.into_iter().take(MOST_CARRIERS).enumerate() {
            (point.copies[k], point.weights[k], point.n) = (copy, weight, k as u8 + 1);
        }
        point
    }

    /// The point with these barycentric coordinates in a tetrahedron.
    #[inline]
    pub fn in_tet([a, b, c, d]: [u32; 4], [p, q, r, s]: [T; 4]) -> Self {
        let zero = T::default();
        Self { copies: [a, b, c, d, 0, 0, 0, 0], weights: [p, q, r, s, zero, zero, zero, zero], n: 4 }
    }

    /// Its carriers.
    #[inline]
    pub fn copies(&self) -> &[u32] {
        &self.copies[..usize::from(self.n)]
    }

    /// Their weights.
    #[inline]
    pub fn weights(&self) -> &[T] {
        &self.weights[..usize::from(self.n)]
    }

    /// Carriers with their weights.
    #[inline]
    pub fn carriers(&self) -> impl Iterator<Item = (usize, T)> + '_ {
        self.copies().iter().map(|&copy| copy as usize).zip(self.weights().iter().copied())
    }

    /// The same point with other numbers of its carriers.
    pub fn renumbered(&self, number: impl Fn(u32) -> u32) -> Self {
        let mut point = *self;
        point.copies[..usize::from(self.n)].iter_mut().for_each(|copy| *copy = number(*copy));
        point
    }

    /// The same point with weights of another type.
    pub fn map<U: Copy + Default>(&self, to: impl Fn(T) -> U) -> MaterialPoint<U> {
        MaterialPoint { copies: self.copies, weights: self.weights.map(to), n: self.n }
    }
}

impl MaterialPoint {
    /// Position [m] at the positions `x` of the copies, or the same mean of any other vectors.
    #[inline]
    pub fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.carriers().map(|(copy, w)| x[copy] * w).sum()
    }

    /// The carrier with the largest weight, which tells the part of the body that the point is in.
    pub fn main_copy(&self) -> u32 {
        let sizes = self.copies().iter().zip(self.weights());
        let largest = sizes.reduce(|most, next| if next.1.abs() > most.1.abs() { next } else { most });
        largest.map_or(0, |(&copy, _)| copy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_carriers_reproduce_a_point_and_a_ninth_is_left_out() {
        let x: Vec<Vector3<f64>> = (0..9).map(|i| Vector3::new(f64::from(i), 1.0, -f64::from(i))).collect();
        let point = MaterialPoint::new((0..9).map(|copy| (copy, 0.125)));
        assert_eq!((point.copies().len(), point.position(&x)), (8, Vector3::new(3.5, 1.0, -3.5)));
        let inside = MaterialPoint::in_tet([4, 2, 7, 1], [0.1, 0.2, -0.9, 1.6]);
        assert_eq!(inside.copies(), [4, 2, 7, 1]);
        assert_eq!((inside.main_copy(), MaterialPoint::default().main_copy()), (1, 0));
        assert_eq!(inside.map(|w| w as f32).weights(), [0.1, 0.2, -0.9, 1.6]);
    }
}
