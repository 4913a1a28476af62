//! The stiffness of the unit cube, and matrices that commute with its reflections.

use std::array::from_fn;

use scindo_matter::element::{hex8, quadrature};
use scindo_matter::material::Lame;

/// A matrix on the corners of a cell: row and column 3 c + i for corner c and component i.
pub type Matrix24 = [[f64; 24]; 24];

/// Row of a symmetric 3×3 matrix (xx, xy, xz, yy, yz, zz) that holds entry (i, j).
pub const ENTRY: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// A symmetric matrix on the corners of a cube that commutes with the three reflections of the cube.
///
/// In coordinates û_p = Σ_c (−1)^{|c & p|} u_c component i of parity p belongs to sector p ⊕ e_i, and only
/// components of the same sector are coupled.
#[derive(Clone, Debug, PartialEq)]
pub struct SectorTable {
    /// Block (xx, xy, xz, yy, yz, zz) of every sector q; its component i has parity q ⊕ e_i. The factor 1/64 of
    /// both inverse transforms is included: K u = Hᵀ S H u with H the unnormalised transform.
    pub sectors: [[f64; 6]; 8],
}

impl SectorTable {
    /// K of a cube of side 1 m, integrated exactly [N/m]; that of side s is s K.
    pub fn elastic(lame: Lame) -> Self {
        Self::of_matrix(&unit_stiffness(lame)).0
    }

    /// The sectors of `K`, and the largest entry (in these coordinates) that couples different ones.
    pub fn of_matrix(K: &Matrix24) -> (Self, f64) {
        // Columns, then rows; K is symmetric, so both are the same transform.
        let mut S = *K;
        for _ in 0..2 {
            S = from_fn(|r| {
                let (p, i) = (r / 3, r % 3);
                from_fn(|column| (0..8).map(|c| sign(c, p) * S[column][3 * c + i]).sum::<f64>() / 8.0)
            });
        }
        let (mut table, mut rest) = (Self { sectors: [[0.0; 6]; 8] }, 0.0_f64);
        for r in 0..24 {
            for s in 0..24 {
                let ((p, i), (q, j)) = ((r / 3, r % 3), (s / 3, s % 3));
                if p ^ 1 << i == q ^ 1 << j {
                    table.sectors[p ^ 1 << i][ENTRY[i][j]] = S[r][s];
                } else {
                    rest = rest.max(S[r][s].abs());
                }
            }
        }
        // Rigid translations are exactly without force, so that products of far displacements stay exact.
        let size = table.sectors.iter().flatten().fold(0.0_f64, |size, s| size.max(s.abs()));
        for entry in table.sectors.iter_mut().flatten().filter(|s| s.abs() < 1e-14 * size) {
            *entry = 0.0;
        }
        (table, rest)
    }

    /// The matrix that the table stands for.
    pub fn matrix(&self) -> Matrix24 {
        from_fn(|r| {
            let (a, i) = (r / 3, r % 3);
            from_fn(|s| {
                let (b, j) = (s / 3, s % 3);
                let term =
                    |q: usize| sign(a, q ^ 1 << i) * sign(b, q ^ 1 << j) * self.sectors[q][ENTRY[i][j]];
                (0..8).map(term).sum()
            })
        })
    }

    /// Adds `factor` times `other`.
    pub fn add(&mut self, factor: f64, other: &Self) {
        let entries = self.sectors.iter_mut().flatten();
        entries.zip(other.sectors.iter().flatten()).for_each(|(s, o)| *s += factor * o);
    }
}

/// (−1)^{|c & p|}.
fn sign(c: usize, p: usize) -> f64 {
    if (c & p).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// ∫ Bᵀ D B over the unit cube by 2×2×2 Gauss points, which is exact [N/m].
pub fn unit_stiffness(Lame { mu, lambda }: Lame) -> Matrix24 {
    let mut K = [[0.0; 24]; 24];
    for (xi, weight) in quadrature::cube_gauss(2) {
        // From [−1, 1]³ to side 1: gradients double, the volume is an eighth.
        let g = hex8::reference_gradients(&xi).map(|g| 2.0 * g);
        for r in 0..24 {
            for s in 0..24 {
                let ((a, i), (b, j)) = ((r / 3, r % 3), (s / 3, s % 3));
                let shear = g[a][j] * g[b][i] + if i == j { g[a].dot(&g[b]) } else { 0.0 };
                K[r][s] += weight / 8.0 * (mu * shear + lambda * g[a][i] * g[b][j]);
            }
        }
    }
    K
}

/// Weights of the slots' vertices in the displacement of slot `j`, which hangs: bit s of the first number is set
/// for slots s that count, each with the second number.
pub(super) fn hanging_slots(j: usize) -> (u8, f64) {
    let slots = (0..8).filter(|s| s & !j == 0).fold(0_u8, |slots, s| slots | 1 << s);
    (slots, 1.0 / f64::from(slots.count_ones()))
}

/// Diagonal blocks (xx, xy, xz, yy, yz, zz) of Wᵀ K W for a cell whose slots `hanging` hang, one per slot.
pub(super) fn diagonal_blocks(K: &Matrix24, hanging: u8) -> [[f64; 6]; 8] {
    let W: [[f64; 8]; 8] = from_fn(|j| {
        let (slots, weight) = if hanging >> j & 1 == 1 { hanging_slots(j) } else { (1 << j, 1.0) };
        from_fn(|v| if slots >> v & 1 == 1 { weight } else { 0.0 })
    });
    from_fn(|v| {
        let mut block = [0.0; 6];
        for (a, b) in (0..64).map(|ab| (ab / 8, ab % 8)).filter(|&(a, b)| W[a][v] != 0.0 && W[b][v] != 0.0) {
            for i in 0..3 {
                for j in i..3 {
                    block[ENTRY[i][j]] += W[a][v] * W[b][v] * K[3 * a + i][3 * b + j];
                }
            }
        }
        block
    })
}
