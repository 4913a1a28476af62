//! Smoothers of one level.
//!
//! # Source
//! Chebyshev polynomials of the fourth kind with optimal weights: Lottes 2023, *Optimal polynomial smoothers for
//! multigrid V-cycles*; Phillips, Fischer 2022. Gauss–Seidel and over-relaxation: Dick, Georgii, Westermann
//! 2011, §6.

use scindo_matter::team::{Team, blocks};

use super::operator::LevelOperator;
use super::stiff_springs::Sprung;
use crate::operator::rows::{self, Start};
use crate::operator::{BLOCK, Inverse3, LinearOperator, Padded, block_of};

/// How a cycle smooths, before and after the correction by the coarser level.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Smoother {
    /// Chebyshev polynomial of the fourth kind in D⁻¹A, D the 3×3 diagonal blocks. Symmetric, and the same on any
    /// number of threads.
    Chebyshev {
        /// Products with A per smoothing, 1 … 8.
        degree: u8,
        /// Coarse levels have more, 2, 4, 8 on the first, second, and all others, but no more than this. They cost little
        /// there, and make up for parts between cuts that coarse cells make too stiff.
        most: u8,
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
        Self::Chebyshev { degree: 2, most: HIGHEST as u8 }
    }
}

/// The highest degree of a Chebyshev smoother.
const HIGHEST: u32 = 8;

/// Degree of the Chebyshev smoother `below` levels below the one that is solved on, where it is `degree`; `most` as in
/// [`Smoother::Chebyshev`].
pub(super) fn degree_on(below: usize, degree: u8, most: u8) -> u32 {
    let more = (1 << below.min(3)).min(u32::from(most));
    u32::from(degree.max(1)).max(more).min(HIGHEST)
}

/// Optimal weights β by degree.
const WEIGHTS: [&[f64]; HIGHEST as usize] = [
    &[1.125],
    &[1.023_872_875_703_13, 1.264_089_053_710_85],
    &[1.008_425_447_820_28, 1.088_678_392_087_30, 1.337_531_259_096_18],
    &[1.003_913_104_272_85, 1.040_358_111_885_93, 1.148_634_985_462_54, 1.382_688_692_410_00],
    &[
        1.002_129_301_461_65,
        1.021_737_115_492_61,
        1.078_724_331_926_03,
        1.198_100_652_926_63,
        1.413_225_427_916_82,
    ],
    &[
        1.001_285_172_559_40,
        1.013_042_930_352_33,
        1.046_782_151_241_13,
        1.116_164_894_196_76,
        1.238_290_202_184_44,
        1.435_242_971_067_45,
    ],
    &[
        1.000_834_643_979_12,
        1.008_439_494_301_23,
        1.030_087_077_687_14,
        1.074_083_840_920_03,
        1.150_361_867_073_66,
        1.271_164_740_461_40,
        1.451_866_586_493_64,
    ],
    &[
        1.000_572_466_311_98,
        1.005_774_276_624_15,
        1.020_501_879_229_42,
        1.050_198_034_445_66,
        1.101_155_729_849_41,
        1.180_860_428_068_58,
        1.298_385_853_825_75,
        1.464_860_731_511_01,
    ],
];

/// β of step `i` of `degree`; 1 for degrees without a table.
pub(super) fn weight(degree: u32, i: u32) -> f32 {
    let weights = WEIGHTS.get(degree.saturating_sub(1) as usize);
    weights.and_then(|w| w.get(i as usize)).copied().unwrap_or(1.0) as f32
}

/// Vectors of a smoothing, one entry per vertex.
#[derive(Debug)]
pub(super) struct Smoothing<'a> {
    /// The right-hand side.
    pub b: &'a [Padded],
    /// The solution.
    pub x: &'a mut [Padded],
    pub r: &'a mut [Padded],
    /// The last change of the solution.
    pub d: &'a mut [Padded],
    /// Room for a product with A.
    pub q: &'a mut [Padded],
}

/// What is smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// x from 0, and its residual: before the correction.
    Before,
    /// x with the residual r, after the correction d is added to it. Of r nothing is left.
    After,
    /// x from 0, without its residual: instead of a solution.
    Alone,
}

/// What stands for the diagonal of the operator in a smoother.
#[derive(Debug)]
pub(super) struct Diagonal<'a> {
    /// Inverses of the diagonal blocks of A. At the vertices of stiff springs they may have these or not.
    pub inverse: &'a [Inverse3],
    /// A bound of the largest eigenvalue of D⁻¹A.
    pub largest: f64,
    /// Stiff springs, if there are any.
    pub sprung: Option<Sprung<'a>>,
}

/// One step of a polynomial: what it starts from, and the factors of d, of D⁻¹r, and of the new d in x.
type Step = (Start, [f32; 3]);

/// d ← (2k − 3)/(2k + 1) d + (8k − 4)/(2k + 1)/λ D⁻¹ r, x ← x + β d with k = `i` + 1.
fn step(start: Start, i: u32, degree: u32, largest: f64) -> Step {
    let k = f64::from(i) + 1.0;
    let keep = if i == 0 { 0.0 } else { (2.0 * k - 3.0) / (2.0 * k + 1.0) };
    let gain = (8.0 * k - 4.0) / (2.0 * k + 1.0) / largest;
    (start, [keep as f32, gain as f32, weight(degree, i)])
}

/// Chebyshev steps for A x = b.
///
/// Products with A are subtracted from r, and make the next step, where they are computed: block by block.
pub(super) fn chebyshev(
    team: &mut Team,
    A: &mut dyn LinearOperator,
    mut diagonal: Diagonal<'_>,
    degree: u32,
    (mut v, stage): (Smoothing<'_>, Stage),
) {
    let largest = diagonal.largest;
    let mut first = stage != Stage::After;
    for i in 0..degree {
        let start = match (i, stage) {
            (0, Stage::After) => Start::Correction,
            (0, _) => Start::Zero,
            _ => Start::Step,
        };
        let step = step(start, i, degree, largest);
        if start == Start::Zero {
            v.begin(team, step, &diagonal);
        } else {
            v.go_on(team, A, (first, Some(step)), &diagonal);
            first = false;
        }
        if let Some(Sprung { columns, blocks }) = &mut diagonal.sprung {
            let r = if start == Start::Zero { v.b } else { &*v.r };
            let (gain, beta) = (step.1[1], step.1[2]);
            blocks.correct(columns, (diagonal.inverse, r), |at, z| {
                for k in 0..4 {
                    v.d[at][k] += gain * z[k];
                    v.x[at][k] += beta * gain * z[k];
                }
            });
        }
    }
    if stage == Stage::Before {
        v.go_on(team, A, (first, None), &diagonal);
    }
}

impl Smoothing<'_> {
    /// The first step from x = 0, where the residual is b.
    fn begin(&mut self, team: &mut Team, step: Step, diagonal: &Diagonal<'_>) {
        let (b, inverse) = (self.b, diagonal.inverse);
        let state = (blocks(self.d, BLOCK), blocks(self.x, BLOCK));
        team.for_blocks(state, |block, (d, x)| {
            rows::smooth(block_of(inverse, block), block_of(b, block), step, [d, x]);
        });
    }

    /// r ← r − A d, or b − A d for the `first` residual, and a `step` from there.
    fn go_on(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        (first, step): (bool, Option<Step>),
        diagonal: &Diagonal<'_>,
    ) {
        let Self { b, x, r, d, q, .. } = self;
        let (b, inverse) = (&**b, diagonal.inverse);
        let follow = |block: usize, q: &[Padded], [r, d, x]: [&mut [Padded]; 3]| {
            if first {
                r.copy_from_slice(block_of(b, block));
            }
            subtract(r, q);
            if let Some(step) = step {
                rows::smooth(block_of(inverse, block), r, step, [d, x]);
            }
        };
        if A.start(team, d) {
            let A = &*A;
            let state = (blocks(r, BLOCK), blocks(d, BLOCK), blocks(x, BLOCK));
            team.for_blocks(state, |block, (r, d, x)| {
                let mut q = [[0.0; 4]; BLOCK];
                let q = &mut q[..r.len()];
                A.finish(block, d, q);
                follow(block, q, [r, d, x]);
            });
        } else {
            A.apply(team, d, q);
            let q = &**q;
            let state = (blocks(r, BLOCK), blocks(d, BLOCK), blocks(x, BLOCK));
            team.for_blocks(state, |block, (r, d, x)| follow(block, block_of(q, block), [r, d, x]));
        }
    }
}

/// r ← r − q.
pub(super) fn subtract(r: &mut [Padded], q: &[Padded]) {
    for (r, q) in r.iter_mut().zip(q) {
        (0..4).for_each(|k| r[k] -= q[k]);
    }
}

/// A forward Gauss–Seidel sweep on A x = b with factor ω.
pub(super) fn gauss_seidel(
    A: &LevelOperator<'_>,
    inverse: &[Inverse3],
    b: &[Padded],
    x: &mut [Padded],
    omega: f32,
) {
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
        for degree in 1..=HIGHEST {
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
