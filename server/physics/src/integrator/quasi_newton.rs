//! Limited-memory quasi-Newton directions around a stiffness that is only nearly the Hessian.
//!
//! The last steps s and the changes y of the gradient along them correct the inverse of the stiffness K̂ that the
//! linear solver applies: p = −H g, where H starts from K̂⁻¹. K̂ knows how the material stretches, the pairs know
//! how its stress turns.
//!
//! # Source
//! Nocedal 1980: Updating quasi-Newton matrices with limited storage; Nocedal, Wright 2006, algorithm 7.4. K̂⁻¹ in
//! place of a multiple of I: Liu, Bouaziz, Kavan 2017: Quasi-Newton methods for real-time simulation of
//! hyperelastic materials, §4.

use scindo_algebra::operator::Padded;
use scindo_matter::storage::reserve::resize_reserving;

/// Pairs that are kept.
const PAIRS: usize = 6;
/// Least cosine of the angle between s and y: pairs below it have no positive curvature worth knowing.
const LEAST_COSINE: f64 = 1e-6;

/// A step and the change of the residual r = −g along it.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Pair {
    s: Vec<Padded>,
    y: Vec<Padded>,
    /// 1/(sᵀy).
    rho: f64,
    /// ρ sᵀq of the present direction.
    alpha: f64,
}

/// The last pairs.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct QuasiNewton {
    pairs: [Pair; PAIRS],
    /// Number of pairs in use; the newest is at `next − 1`, modulo [`PAIRS`].
    known: usize,
    next: usize,
    /// Residual and step of the last solve, whose pair is not complete yet.
    residual: Vec<Padded>,
    step: Vec<Padded>,
    is_waiting: bool,
}

impl QuasiNewton {
    /// Forgets all pairs.
    pub(super) fn clear(&mut self) {
        (self.known, self.is_waiting) = (0, false);
    }

    /// Whether no pair is known.
    pub(super) fn is_empty(&self) -> bool {
        self.known == 0
    }

    /// Takes the residual r = −g at the start of a solve, which completes the pair of the last step, and replaces
    /// it by the right-hand side of the solve. Returns whether that is another one.
    pub(super) fn begin(&mut self, r: &mut [Padded]) -> bool {
        if self.residual.len() != r.len() {
            self.resize(r.len());
        }
        if self.is_waiting {
            self.complete(r);
        }
        self.residual.copy_from_slice(r);
        self.is_waiting = false;
        for age in 0..self.known {
            let pair = &mut self.pairs[(self.next + PAIRS - 1 - age) % PAIRS];
            pair.alpha = pair.rho * dot(&pair.s, r);
            add(r, -pair.alpha, &pair.y);
        }
        self.known > 0
    }

    /// Turns the solution δ of the solve into the direction.
    pub(super) fn end(&self, delta: &mut [Padded]) {
        for age in (0..self.known).rev() {
            let pair = &self.pairs[(self.next + PAIRS - 1 - age) % PAIRS];
            let beta = pair.rho * dot(&pair.y, delta);
            add(delta, pair.alpha - beta, &pair.s);
        }
    }

    /// Takes the step that was made from the residual of the last [`begin`](Self::begin).
    pub(super) fn stepped(&mut self, delta: &[Padded]) {
        self.step.copy_from_slice(delta);
        self.is_waiting = true;
    }

    /// Makes room for all pairs at once, so that later steps allocate nothing.
    fn resize(&mut self, n: usize) {
        self.clear();
        let pairs = self.pairs.iter_mut().flat_map(|pair| [&mut pair.s, &mut pair.y]);
        for v in pairs.chain([&mut self.residual, &mut self.step]) {
            resize_reserving(v, n, [0.0; 4]);
        }
    }

    fn complete(&mut self, r: &[Padded]) {
        let pair = &mut self.pairs[self.next];
        // y = g₊ − g = r − r₊
        for ((y, before), now) in pair.y.iter_mut().zip(&self.residual).zip(r) {
            *y = std::array::from_fn(|k| before[k] - now[k]);
        }
        std::mem::swap(&mut pair.s, &mut self.step);
        let (sy, ss, yy) = (dot(&pair.s, &pair.y), dot(&pair.s, &pair.s), dot(&pair.y, &pair.y));
        if sy > LEAST_COSINE * (ss * yy).sqrt() && sy.is_finite() {
            pair.rho = 1.0 / sy;
            self.next = (self.next + 1) % PAIRS;
            self.known = (self.known + 1).min(PAIRS);
        }
    }
}

fn dot(a: &[Padded], b: &[Padded]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (0..3).map(|k| f64::from(a[k]) * f64::from(b[k])).sum::<f64>()).sum()
}

fn add(to: &mut [Padded], factor: f64, from: &[Padded]) {
    for (to, from) in to.iter_mut().zip(from) {
        (0..3).for_each(|k| to[k] = (f64::from(to[k]) + factor * f64::from(from[k])) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Minimises ½ xᵀ A x − bᵀ x in three unknowns, where the "solver" knows the diagonal of A only.
    #[test]
    fn pairs_repair_a_stiffness_that_is_not_the_hessian() {
        let A = [[4.0_f32, 1.5, 0.5], [1.5, 3.0, 1.0], [0.5, 1.0, 2.0]];
        let b = [1.0_f32, -2.0, 3.0];
        let gradient = |x: &[f32; 3]| -> [f32; 3] {
            std::array::from_fn(|i| (0..3).map(|j| A[i][j] * x[j]).sum::<f32>() - b[i])
        };
        let residual = |x: &[f32; 3]| gradient(x).iter().map(|g| g * g).sum::<f32>().sqrt();
        let run = |with: bool| {
            let (mut memory, mut x) = (QuasiNewton::default(), [0.0_f32; 3]);
            for _ in 0..6 {
                let g = gradient(&x);
                let mut r = [[-g[0], -g[1], -g[2], 0.0]];
                if with {
                    memory.begin(&mut r);
                }
                let mut delta = [[r[0][0] / 4.0, r[0][1] / 3.0, r[0][2] / 2.0, 0.0]];
                if with {
                    memory.end(&mut delta);
                    memory.stepped(&delta);
                }
                (0..3).for_each(|k| x[k] += delta[0][k]);
            }
            residual(&x)
        };
        let (plain, repaired) = (run(false), run(true));
        assert!(repaired < 1e-3 * plain && repaired < 1e-4, "{plain} {repaired}");
    }

    #[test]
    fn a_pair_without_curvature_is_not_taken() {
        let mut memory = QuasiNewton::default();
        memory.begin(&mut [[1.0, 0.0, 0.0, 0.0]]);
        memory.stepped(&[[1.0, 0.0, 0.0, 0.0]]);
        // The gradient has become steeper along the step.
        assert!(!memory.begin(&mut [[2.0, 0.0, 0.0, 0.0]]) && memory.is_empty());
    }
}
