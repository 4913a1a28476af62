//! Smoothers of one level.
//!
//! # Source
//! Chebyshev polynomials of the fourth kind with optimal weights: Lottes 2023, *Optimal polynomial smoothers for
//! multigrid V-cycles*; Phillips, Fischer 2022. Gauss–Seidel and over-relaxation: Dick, Georgii, Westermann
//! 2011, §6.

use super::operator::LevelOperator;
use super::stiff_springs::Sprung;
use crate::operator::{BLOCK, Inverse3, Padded, block_of};
use crate::team::{Team, blocks};

/// y = A x.
pub type Multiply<'a> = dyn FnMut(&mut Team, &[Padded], &mut [Padded]) + 'a;

/// How a cycle smooths, before and after the correction by the coarser level.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Smoother {
    /// Chebyshev polynomial of the fourth kind in D⁻¹A, D the 3×3 diagonal blocks, of this degree: 1 … 4.
    /// Symmetric, and the same on any number of threads.
    Chebyshev {
        /// Products with A per smoothing.
        degree: u8,
    },
    /// Gauss–Seidel sweeps by vertex, forward both times, on one thread: for comparison. The cycle is not
    /// symmetric, and springs are not smoothed.
    GaussSeidel {
        /// Sweeps per smoothing.
        sweeps: u8,
        /// Factor of over-relaxation ω; 1 is Gauss–Seidel.
        omega: f32,
    },
}

impl Default for Smoother {
    fn default() -> Self {
        Self::Chebyshev { degree: 2 }
    }
}

/// Optimal weights β by degree.
const WEIGHTS: [&[f64]; 4] = [
    &[1.125],
    &[1.023_872_875_703_13, 1.264_089_053_710_85],
    &[1.008_425_447_820_28, 1.088_678_392_087_30, 1.337_531_259_096_18],
    &[1.003_913_104_272_85, 1.040_358_111_885_93, 1.148_634_985_462_54, 1.382_688_692_410_00],
];

/// β of step `i` of `degree`; 1 for degrees without a table.
pub fn weight(degree: u32, i: u32) -> f32 {
    let weights = WEIGHTS.get(degree.saturating_sub(1) as usize);
    weights.and_then(|w| w.get(i as usize)).copied().unwrap_or(1.0) as f32
}

/// Vectors of a smoothing, one entry per vertex.
#[derive(Debug)]
pub struct Smoothing<'a> {
    /// The solution.
    pub x: &'a mut [Padded],
    /// Its residual.
    pub r: &'a mut [Padded],
    /// The last change of the solution, and what A makes of it.
    pub d: &'a mut [Padded],
    /// A d.
    pub q: &'a mut [Padded],
}

/// What stands for the operator in a smoother.
#[derive(Debug)]
pub struct Diagonal<'a> {
    /// Inverses of the diagonal blocks of A. At the vertices of stiff springs they may have these or not.
    pub inverse: &'a [Inverse3],
    /// A bound of the largest eigenvalue of D⁻¹A.
    pub largest: f64,
    /// Stiff springs, if there are any.
    pub sprung: Option<Sprung<'a>>,
}

/// Chebyshev steps from `x` with residual `r`. `multiply` is A. The last residual is computed if `residual` is
/// set; otherwise `r` belongs to the iterate before.
pub fn chebyshev(
    team: &mut Team,
    multiply: &mut Multiply<'_>,
    diagonal: Diagonal<'_>,
    degree: u32,
    (v, residual): (Smoothing<'_>, bool),
) {
    let Smoothing { x, r, d, q } = v;
    let Diagonal { inverse, largest, mut sprung } = diagonal;
    for i in 0..degree {
        let k = f64::from(i) + 1.0;
        // d ← (2k − 3)/(2k + 1) d + (8k − 4)/(2k + 1)/λ D⁻¹ r, x ← x + β d, r ← r − A d
        let keep = if i == 0 { 0.0 } else { ((2.0 * k - 3.0) / (2.0 * k + 1.0)) as f32 };
        let gain = ((8.0 * k - 4.0) / (2.0 * k + 1.0) / largest) as f32;
        let beta = weight(degree, i);
        let known = &*r;
        team.for_blocks((blocks(d, BLOCK), blocks(x, BLOCK)), |block, (d, x)| {
            let given = block_of(known, block).iter().zip(block_of(inverse, block));
            for ((d, x), (r, M)) in d.iter_mut().zip(x).zip(given) {
                let z = M.times(r);
                for k in 0..4 {
                    d[k] = if i == 0 { gain * z[k] } else { keep * d[k] + gain * z[k] };
                    x[k] += beta * d[k];
                }
            }
        });
        if let Some(Sprung { columns, blocks }) = &mut sprung {
            blocks.correct(columns, (inverse, &*r), |v, z| {
                for k in 0..4 {
                    d[v][k] += gain * z[k];
                    x[v][k] += beta * gain * z[k];
                }
            });
        }
        if i + 1 < degree || residual {
            multiply(team, d, q);
            let q = &*q;
            team.for_blocks(blocks(r, BLOCK), |block, r| {
                for (r, q) in r.iter_mut().zip(block_of(q, block)) {
                    (0..4).for_each(|k| r[k] -= q[k]);
                }
            });
        }
    }
}

/// A forward Gauss–Seidel sweep on A x = b with factor ω.
pub fn gauss_seidel(A: &LevelOperator<'_>, inverse: &[Inverse3], b: &[Padded], x: &mut [Padded], omega: f32) {
    for v in 0..x.len() {
        let product = A.row(v, x);
        let r = [b[v][0] - product[0], b[v][1] - product[1], b[v][2] - product[2], 0.0];
        let change = inverse[v].times(&r);
        (0..3).for_each(|k| x[v][k] += omega * change[k]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Optimal weights make the maxima of λ p(λ)²/(1 − p(λ)²) on [0, 1] equal.
    #[test]
    fn weights_are_optimal() {
        for degree in 1..=4_u32 {
            let value = |lambda: f64| {
                let (mut x, mut r, mut d) = (0.0, 1.0, 0.0);
                for i in 0..degree {
                    let k = f64::from(i) + 1.0;
                    d = (2.0 * k - 3.0) / (2.0 * k + 1.0) * d + (8.0 * k - 4.0) / (2.0 * k + 1.0) * r;
                    x += WEIGHTS[degree as usize - 1][i as usize] * d;
                    r -= lambda * d;
                }
                let p = 1.0 - lambda * x;
                lambda * p * p / (1.0 - p * p)
            };
            let n = 200_000;
            let f: Vec<f64> = (1..=n).map(|i| value(f64::from(i) / f64::from(n))).collect();
            let mut maxima: Vec<f64> =
                (1..f.len() - 1).filter(|&i| f[i] >= f[i - 1] && f[i] > f[i + 1]).map(|i| f[i]).collect();
            maxima.push(f[f.len() - 1]);
            maxima.push(value(1e-7)); // the limit at 0
            let (least, most) = maxima.iter().fold((f64::MAX, 0.0_f64), |(a, b), &m| (a.min(m), b.max(m)));
            assert_eq!(maxima.len(), degree as usize + 1, "degree {degree}: {maxima:?}");
            assert!((most - least) < 1e-5 * most, "degree {degree}: {maxima:?}");
        }
    }
}
