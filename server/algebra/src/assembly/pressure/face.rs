//! Shape functions of a triangular face, and what pressure on it needs: n da, the volume between the face and a point,
//! and the derivatives of that volume.

use nalgebra::{Matrix3, Vector3};

/// A quadrature point of a triangle with N nodes.
pub(super) struct FacePoint<const N: usize> {
    /// Shape functions.
    shape: [f64; N],
    /// Their derivatives by the two coordinates of the triangle.
    along: [[f64; N]; 2],
    /// Weight; the weights of a triangle sum to ½.
    weight: f64,
}

/// The rule for linear triangles: exact, because n is constant and N is linear.
pub(super) fn linear() -> [FacePoint<3>; 1] {
    let along = [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]];
    [FacePoint { shape: [1.0 / 3.0; 3], along, weight: 0.5 }]
}

/// The rule of degree 4 for triangles with the nodes 0, 1, 2, 01, 12, 20. It is exact: N is quadratic and so is n.
///
/// # Source
/// Dunavant 1985, "High degree efficient symmetrical Gaussian quadrature rules for the triangle", in closed form.
pub(super) fn quadratic() -> [FacePoint<6>; 6] {
    let root = (38.0 - 44.0 * 0.4_f64.sqrt()).sqrt();
    let part = (213_125.0 - 53_320.0 * 10.0_f64.sqrt()).sqrt();
    let rule = [root, -root].map(|root| (8.0 - 10.0_f64.sqrt() + root) / 18.0);
    let weights = [part, -part].map(|part| (620.0 + part) / 7440.0);
    std::array::from_fn(|q| {
        let (a, weight) = (rule[q / 3], weights[q / 3]);
        let mut L = [a; 3];
        L[q % 3] = 1.0 - 2.0 * a;
        let edges = [[0, 1], [1, 2], [2, 0]];
        let corner = |i: usize| L[i] * (2.0 * L[i] - 1.0);
        let shape = std::array::from_fn(|i| match i {
            0..3 => corner(i),
            _ => 4.0 * L[edges[i - 3][0]] * L[edges[i - 3][1]],
        });
        // dL along the coordinates ξ = L₁ and η = L₂.
        let along = [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]].map(|dL| {
            std::array::from_fn(|i| match i {
                0..3 => (4.0 * L[i] - 1.0) * dL[i],
                _ => {
                    let [a, b] = edges[i - 3];
                    4.0 * (L[a] * dL[b] + L[b] * dL[a])
                }
            })
        });
        FacePoint { shape, along, weight }
    })
}

impl<const N: usize> FacePoint<N> {
    fn mean(weights: &[f64; N], y: &[Vector3<f64>; N]) -> Vector3<f64> {
        weights.iter().zip(y).map(|(w, y)| *w * y).sum()
    }

    /// Tangents of the face with its nodes at `y`.
    fn tangents(&self, y: &[Vector3<f64>; N]) -> [Vector3<f64>; 2] {
        self.along.each_ref().map(|along| Self::mean(along, y))
    }

    /// n da [m²] of the point.
    fn area(&self, y: &[Vector3<f64>; N]) -> Vector3<f64> {
        let [s, t] = self.tangents(y);
        self.weight * s.cross(&t)
    }

    /// Adds `p` ∫ N_a n da to `f`.
    pub(super) fn add_flux(&self, p: f64, y: &[Vector3<f64>; N], f: &mut [Vector3<f64>; N]) {
        let area = p * self.area(y);
        f.iter_mut().zip(self.shape).for_each(|(f, share)| *f += share * area);
    }

    /// Volume between the face and the origin, ⅓ ∫ y·n da [m³].
    pub(super) fn volume(&self, y: &[Vector3<f64>; N]) -> f64 {
        self.swept(y, y) / 3.0
    }

    /// Rate of the volume that the face sweeps, ∫ d·n da, where its nodes move by `d`.
    pub(super) fn swept(&self, y: &[Vector3<f64>; N], d: &[Vector3<f64>; N]) -> f64 {
        Self::mean(&self.shape, d).dot(&self.area(y))
    }

    /// Adds `p` times the gradient of [`volume`](Self::volume) to `g`.
    pub(super) fn add_gradient(&self, p: f64, y: &[Vector3<f64>; N], g: &mut [Vector3<f64>; N]) {
        let ([s, t], m) = (self.tangents(y), Self::mean(&self.shape, y));
        let [by_shape, by_s, by_t] = [s.cross(&t), t.cross(&m), m.cross(&s)];
        let factor = p * self.weight / 3.0;
        for a in 0..N {
            let gradient = self.shape[a] * by_shape + self.along[0][a] * by_s + self.along[1][a] * by_t;
            g[a] += factor * gradient;
        }
    }

    /// `p` times ∂²/∂y_a∂y_b of [`volume`](Self::volume), a symmetric matrix of blocks.
    pub(super) fn hessian(&self, p: f64, y: &[Vector3<f64>; N], (a, b): (usize, usize)) -> Matrix3<f64> {
        let ([s, t], m) = (self.tangents(y), Self::mean(&self.shape, y));
        let (M, [S, T]) = (&self.shape, &self.along);
        // The volume is the triple product of m, s and t, each of them linear in the nodes.
        let by_t = M[a] * S[b] - S[a] * M[b];
        let by_s = M[a] * T[b] - T[a] * M[b];
        let by_m = S[a] * T[b] - T[a] * S[b];
        (p * self.weight / 3.0 * (by_s * s - by_t * t - by_m * m)).cross_matrix()
    }
}
