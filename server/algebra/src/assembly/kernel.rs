//! Contribution of one quadrature point to the forces and to the tangent of its element.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::material::{Lame, Matrix9};

/// f_a += w P g_a.
#[inline]
pub(super) fn add_forces(P: &Matrix3<f64>, g: &[Vector3<f64>], w: f64, f: &mut [Vector3<f64>]) {
    for (f, g) in f.iter_mut().zip(g) {
        *f += w * (P * g);
    }
}

/// K_ab += w g_a · A · g_b for a ≤ b; `K` is row-major in (a, b), blocks row-major.
#[inline]
pub(super) fn add_upper_blocks<const N: usize>(A: &Matrix9, g: &[Vector3<f64>], w: f64, K: &mut [[f64; 9]]) {
    let A = A.as_slice();
    for b in 0..N {
        let g_b = w * g[b];
        // T = A : (· ⊗ g_b), 9 × 3: T[r][k] = Σ_l A[r][k + 3 l] g_b[l].
        let mut T = [[0.0; 3]; 9];
        for k in 0..3 {
            for l in 0..3 {
                let column = &A[9 * (k + 3 * l)..][..9];
                for r in 0..9 {
                    T[r][k] += column[r] * g_b[l];
                }
            }
        }
        for a in 0..=b {
            let block = &mut K[a * N + b];
            for j in 0..3 {
                let g_aj = g[a][j];
                for i in 0..3 {
                    for k in 0..3 {
                        block[3 * i + k] += g_aj * T[i + 3 * j][k];
                    }
                }
            }
        }
    }
}

/// The same for St. Venant–Kirchhoff's law at F under the stress S, without ∂P/∂F: with h = F g
/// K_ab += w ((g_a·S g_b) I + λ h_a h_bᵀ + μ h_b h_aᵀ + μ (g_a·g_b) F Fᵀ).
#[inline]
pub(super) fn add_green_blocks<const N: usize>(
    (F, S): (&Matrix3<f64>, &Matrix3<f64>),
    lame: Lame,
    g: &[Vector3<f64>],
    w: f64,
    K: &mut [[f64; 9]],
) {
    let h: [Vector3<f64>; N] = std::array::from_fn(|a| F * g[a]);
    let B = F * F.transpose();
    let (lambda, mu) = (w * lame.lambda, w * lame.mu);
    for b in 0..N {
        let s = w * (S * g[b]);
        for a in 0..=b {
            let (block, stress, along) = (&mut K[a * N + b], g[a].dot(&s), mu * g[a].dot(&g[b]));
            for i in 0..3 {
                for k in 0..3 {
                    block[3 * i + k] +=
                        lambda * h[a][i] * h[b][k] + mu * h[b][i] * h[a][k] + along * B[(i, k)];
                }
                block[4 * i] += stress;
            }
        }
    }
}

/// Copies the blocks above the diagonal to below it: K_ba = K_abᵀ.
pub(super) fn mirror<const N: usize>(K: &mut [[f64; 9]]) {
    for b in 0..N {
        for a in 0..b {
            let block = K[a * N + b];
            K[b * N + a] = std::array::from_fn(|e| block[3 * (e % 3) + e / 3]);
        }
        let block = &mut K[b * N + b];
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            block[3 * j + i] = block[3 * i + j];
        }
    }
}
