//! The vector loops of a solver iteration over one block of copies.
//!
//! Vectors are single precision, scalar products double. On x86-64 the loops are also written for AVX,
//! because the compiler would transpose rows. The operations are the same one by one, so the bits are the
//! same.

#![allow(unsafe_code)] // vector instructions behind run-time detection

use super::{Inverse3, Padded};

/// p ← z + β p (z if β = 0), q ← factor · mass · p + the two rows of `sums` that `pairs` names;
/// returns p·q.
#[inline]
pub fn advance_direction(
    z: &[Padded],
    beta: f32,
    (mass, factor): (&[f32], f32),
    (pairs, sums): (&[[u32; 2]], &[Padded]),
    [p, q]: [&mut [Padded]; 2],
) -> f64 {
    let mut sum = Sum::default();
    #[cfg(target_arch = "x86_64")]
    let done = if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the instructions were detected.
        unsafe { avx::advance_direction(z, beta, (mass, factor), (pairs, sums), [p, q], &mut sum) }
    } else {
        0
    };
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    for i in done..p.len() {
        direction(&mut p[i], &z[i], beta);
        let (inertia, [a, b]) = (factor * mass[i], pairs[i].map(|row| &sums[row as usize]));
        q[i] = std::array::from_fn(|k| inertia * p[i][k] + (a[k] + b[k]));
        sum.add(&p[i], &q[i]);
    }
    sum.total()
}

/// x·y.
#[inline]
pub fn dot(x: &[Padded], y: &[Padded]) -> f64 {
    let mut sum = Sum::default();
    for (x, y) in x.iter().zip(y) {
        sum.add(x, y);
    }
    sum.total()
}

/// z = M⁻¹ r; returns r·z.
#[inline]
pub fn precondition(M: &[Inverse3], r: &[Padded], z: &mut [Padded]) -> f64 {
    let mut sum = Sum::default();
    for ((z, r), M) in z.iter_mut().zip(r).zip(M) {
        *z = M.times(r);
        sum.add(r, z);
    }
    sum.total()
}

/// x += α p, r −= α q, z = M⁻¹ r; returns r·z.
#[inline]
pub fn advance_solution(
    alpha: f32,
    [p, q]: [&[Padded]; 2],
    M: &[Inverse3],
    [x, r, z]: [&mut [Padded]; 3],
) -> f64 {
    let mut sum = Sum::default();
    #[cfg(target_arch = "x86_64")]
    let done = if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the instructions were detected.
        unsafe { avx::advance_solution(alpha, [p, q], M, [x, r, z], &mut sum) }
    } else {
        0
    };
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    for i in done..x.len() {
        for k in 0..4 {
            x[i][k] += alpha * p[i][k];
            r[i][k] -= alpha * q[i][k];
        }
        z[i] = M[i].times(&r[i]);
        sum.add(&r[i], &z[i]);
    }
    sum.total()
}

/// What a step of a Chebyshev smoother starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// x = 0.
    Zero,
    /// x, to which the correction in d is added first.
    Correction,
    /// The step before.
    Step,
}

/// d ← keep d + gain M r, x ← x + β d. A [start](Start) other than a step sets d anew.
#[inline]
pub fn smooth(
    M: &[Inverse3],
    r: &[Padded],
    (start, [keep, gain, beta]): (Start, [f32; 3]),
    [d, x]: [&mut [Padded]; 2],
) {
    #[cfg(target_arch = "x86_64")]
    let done = if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the instructions were detected.
        unsafe { avx::smooth(M, r, (start, [keep, gain, beta]), [d, x]) }
    } else {
        0
    };
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    for i in done..x.len() {
        let z = M[i].times(&r[i]);
        for k in 0..4 {
            let next = match start {
                Start::Step => keep * d[i][k] + gain * z[k],
                Start::Zero | Start::Correction => gain * z[k],
            };
            x[i][k] = match start {
                Start::Zero => beta * next,
                Start::Correction => (x[i][k] + d[i][k]) + beta * next,
                Start::Step => x[i][k] + beta * next,
            };
            d[i][k] = next;
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx {
    //! The same operations with two rows in a register. Each function returns the number of rows it has
    //! done: all but an odd last one.

    use std::arch::x86_64::{
        __m256, __m256d, _mm_loadu_ps, _mm_set1_ps, _mm256_add_pd, _mm256_add_ps, _mm256_castps256_ps128,
        _mm256_cvtps_pd, _mm256_extractf128_ps, _mm256_loadu_pd, _mm256_loadu_ps, _mm256_mul_pd,
        _mm256_mul_ps, _mm256_permute_ps, _mm256_set_m128, _mm256_set1_ps, _mm256_shuffle_ps,
        _mm256_storeu_pd, _mm256_storeu_ps, _mm256_sub_ps,
    };

    use super::{Inverse3, Padded, Start, Sum};

    #[target_feature(enable = "avx")]
    pub(super) fn advance_direction(
        z: &[Padded],
        beta: f32,
        (mass, factor): (&[f32], f32),
        (pairs, sums): (&[[u32; 2]], &[Padded]),
        [p, q]: [&mut [Padded]; 2],
        sum: &mut Sum,
    ) -> usize {
        let (turns, beta) = (beta != 0.0, _mm256_set1_ps(beta));
        let mut product = load_sum(sum);
        let (p, q) = (p.as_chunks_mut::<2>().0, q.as_chunks_mut::<2>().0);
        let (z, mass, pairs) = (z.as_chunks::<2>().0, mass.as_chunks::<2>().0, pairs.as_chunks::<2>().0);
        for (((p, q), (z, mass)), pairs) in p.iter_mut().zip(q).zip(z.iter().zip(mass)).zip(pairs) {
            let mut next_p = load(z);
            if turns {
                next_p = _mm256_add_ps(next_p, _mm256_mul_ps(beta, load(p)));
            }
            let factors = _mm256_set_m128(_mm_set1_ps(factor * mass[1]), _mm_set1_ps(factor * mass[0]));
            let [[a0, b0], [a1, b1]] = *pairs;
            let a = load_halves(&sums[a0 as usize], &sums[a1 as usize]);
            let b = load_halves(&sums[b0 as usize], &sums[b1 as usize]);
            let next_q = _mm256_add_ps(_mm256_mul_ps(factors, next_p), _mm256_add_ps(a, b));
            store(p, next_p);
            store(q, next_q);
            product = add_products(product, next_p, next_q);
        }
        store_sum(sum, product);
        2 * p.len()
    }

    #[target_feature(enable = "avx")]
    pub(super) fn advance_solution(
        alpha: f32,
        [p, q]: [&[Padded]; 2],
        M: &[Inverse3],
        [x, r, z]: [&mut [Padded]; 3],
        sum: &mut Sum,
    ) -> usize {
        let alpha = _mm256_set1_ps(alpha);
        let mut product = load_sum(sum);
        let (x, r, z) = (x.as_chunks_mut::<2>().0, r.as_chunks_mut::<2>().0, z.as_chunks_mut::<2>().0);
        let (p, q, M) = (p.as_chunks::<2>().0, q.as_chunks::<2>().0, M.as_chunks::<2>().0);
        for (((x, r), z), ((p, q), M)) in x.iter_mut().zip(r).zip(z).zip(p.iter().zip(q).zip(M)) {
            let next_x = _mm256_add_ps(load(x), _mm256_mul_ps(alpha, load(p)));
            let next_r = _mm256_sub_ps(load(r), _mm256_mul_ps(alpha, load(q)));
            let next_z = times(M, next_r);
            store(x, next_x);
            store(r, next_r);
            store(z, next_z);
            product = add_products(product, next_r, next_z);
        }
        store_sum(sum, product);
        2 * x.len()
    }

    #[target_feature(enable = "avx")]
    pub(super) fn smooth(
        M: &[Inverse3],
        r: &[Padded],
        (start, factors): (Start, [f32; 3]),
        [d, x]: [&mut [Padded]; 2],
    ) -> usize {
        let [keep, gain, beta] = factors.map(|factor| _mm256_set1_ps(factor));
        let (d, x) = (d.as_chunks_mut::<2>().0, x.as_chunks_mut::<2>().0);
        let (r, M) = (r.as_chunks::<2>().0, M.as_chunks::<2>().0);
        for ((d, x), (r, M)) in d.iter_mut().zip(&mut *x).zip(r.iter().zip(M)) {
            let mut next = _mm256_mul_ps(gain, times(M, load(r)));
            let known = match start {
                Start::Zero => None,
                Start::Correction => Some(_mm256_add_ps(load(x), load(d))),
                Start::Step => {
                    next = _mm256_add_ps(_mm256_mul_ps(keep, load(d)), next);
                    Some(load(x))
                }
            };
            let change = _mm256_mul_ps(beta, next);
            match known {
                Some(known) => store(x, _mm256_add_ps(known, change)),
                None => store(x, change),
            }
            store(d, next);
        }
        2 * x.len()
    }

    /// M r of two rows.
    #[target_feature(enable = "avx")]
    fn times(M: &[Inverse3; 2], r: __m256) -> __m256 {
        // (xx, xy, yy, 0) and (xz, yz, zz, 0); the first two columns are parts of both.
        let upper = load_halves(&M[0].0[0], &M[1].0[0]);
        let column_z = load_halves(&M[0].0[1], &M[1].0[1]);
        let column_x = _mm256_shuffle_ps::<0b11_00_01_00>(upper, column_z);
        let column_y = _mm256_shuffle_ps::<0b11_01_10_01>(upper, column_z);
        let a = _mm256_mul_ps(column_x, _mm256_permute_ps::<0x00>(r));
        let b = _mm256_mul_ps(column_y, _mm256_permute_ps::<0x55>(r));
        let c = _mm256_mul_ps(column_z, _mm256_permute_ps::<0xAA>(r));
        _mm256_add_ps(_mm256_add_ps(a, b), c)
    }

    #[target_feature(enable = "avx")]
    pub(super) fn gather_direction(local: &mut [Padded], copies: &[u32], z: &[Padded], beta: f32) -> usize {
        let (turns, beta) = (beta != 0.0, _mm256_set1_ps(beta));
        let (mut done, copies) = (0, copies.as_chunks::<2>().0);
        for (local, &[a, b]) in local.as_chunks_mut::<2>().0.iter_mut().zip(copies) {
            let mut next = load_halves(&z[a as usize], &z[b as usize]);
            if turns {
                next = _mm256_add_ps(next, _mm256_mul_ps(beta, load(local)));
            }
            store(local, next);
            done += 2;
        }
        done
    }

    #[target_feature(enable = "avx")]
    fn load(rows: &[Padded; 2]) -> __m256 {
        // SAFETY: two rows hold eight numbers.
        unsafe { _mm256_loadu_ps(rows.as_ptr().cast()) }
    }

    #[target_feature(enable = "avx")]
    fn load_halves(lower: &Padded, upper: &Padded) -> __m256 {
        // SAFETY: a row holds four numbers.
        unsafe { _mm256_set_m128(_mm_loadu_ps(upper.as_ptr()), _mm_loadu_ps(lower.as_ptr())) }
    }

    #[target_feature(enable = "avx")]
    fn store(rows: &mut [Padded; 2], values: __m256) {
        // SAFETY: two rows hold eight numbers.
        unsafe { _mm256_storeu_ps(rows.as_mut_ptr().cast(), values) }
    }

    /// Adds x·y, one row after the other. In double precision: the product of two small numbers would be
    /// denormal, and slow.
    #[target_feature(enable = "avx")]
    fn add_products(sum: __m256d, x: __m256, y: __m256) -> __m256d {
        let (x0, y0) = (_mm256_castps256_ps128(x), _mm256_castps256_ps128(y));
        let (x1, y1) = (_mm256_extractf128_ps::<1>(x), _mm256_extractf128_ps::<1>(y));
        let sum = _mm256_add_pd(sum, _mm256_mul_pd(_mm256_cvtps_pd(x0), _mm256_cvtps_pd(y0)));
        _mm256_add_pd(sum, _mm256_mul_pd(_mm256_cvtps_pd(x1), _mm256_cvtps_pd(y1)))
    }

    #[target_feature(enable = "avx")]
    fn load_sum(sum: &Sum) -> __m256d {
        // SAFETY: four numbers.
        unsafe { _mm256_loadu_pd(sum.0.as_ptr()) }
    }

    #[target_feature(enable = "avx")]
    fn store_sum(sum: &mut Sum, values: __m256d) {
        // SAFETY: four numbers.
        unsafe { _mm256_storeu_pd(sum.0.as_mut_ptr(), values) }
    }
}

/// p ← z + β p; z if β = 0, also where p is not finite.
#[inline(always)]
pub fn direction(p: &mut Padded, z: &Padded, beta: f32) {
    *p = if beta == 0.0 { *z } else { std::array::from_fn(|k| z[k] + beta * p[k]) };
}

/// local ← z\[copies\] + β local (z\[copies\] if β = 0).
#[inline]
pub fn gather_direction(local: &mut [Padded], copies: &[u32], z: &[Padded], beta: f32) {
    #[cfg(target_arch = "x86_64")]
    let done = if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the instructions were detected.
        unsafe { avx::gather_direction(local, copies, z, beta) }
    } else {
        0
    };
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    for (local, &copy) in local.iter_mut().zip(copies).skip(done) {
        direction(local, &z[copy as usize], beta);
    }
}

/// Accumulator of a scalar product, in double precision.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum([f64; 4]);

impl Sum {
    /// Adds x·y.
    #[inline(always)]
    pub fn add(&mut self, x: &Padded, y: &Padded) {
        for k in 0..4 {
            self.0[k] += f64::from(x[k]) * f64::from(y[k]);
        }
    }

    /// Sum of the four lanes, in a fixed order.
    pub fn total(&self) -> f64 {
        (self.0[0] + self.0[1]) + (self.0[2] + self.0[3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::invert;

    /// A number for every place, between −1 and 1, of very different sizes.
    fn row(i: usize, seed: usize) -> Padded {
        let number = |k: usize| (((4 * i + k) * 7919 + seed * 104_729) % 1009) as f32 / 504.5 - 1.0;
        let size = [1.0, 1e-3, 1e-25, 1e5][i % 4];
        [size * number(0), size * number(1), size * number(2), 0.0]
    }

    fn rows(n: usize, seed: usize) -> Vec<Padded> {
        (0..n).map(|i| row(i, seed)).collect()
    }

    /// Whatever instructions there are, the bits are those of one row after the other; odd numbers of
    /// rows included.
    #[test]
    fn rows_are_worked_on_as_one_after_the_other() {
        for n in [0, 1, 2, 31, 256] {
            let copies: Vec<u32> = (0..n as u32).map(|i| (5 * i + 3) % n as u32).collect();
            let sums = rows(n + 5, 1);
            let pairs: Vec<[u32; 2]> = (0..n as u32).map(|i| [i + 1, (3 * i + 2) % (n as u32 + 5)]).collect();
            let mass: Vec<f32> = (0..n).map(|i| row(i, 2)[0].abs()).collect();
            for beta in [0.0, 0.37] {
                let (z, before) = (rows(n, 3), if beta == 0.0 { vec![[f32::NAN; 4]; n] } else { rows(n, 4) });
                let mut local = before.clone();
                gather_direction(&mut local, &copies, &z, beta);
                for (i, &copy) in copies.iter().enumerate() {
                    let mut expected = before[i];
                    direction(&mut expected, &z[copy as usize], beta);
                    assert_eq!(local[i], expected);
                }
                let (mut p, mut q) = (before.clone(), vec![[0.0; 4]; n]);
                let product = advance_direction(&z, beta, (&mass, 1.5), (&pairs, &sums), [&mut p, &mut q]);
                let (mut expected_p, mut expected_q) = (before, vec![[0.0; 4]; n]);
                for i in 0..n {
                    direction(&mut expected_p[i], &z[i], beta);
                    let [a, b] = pairs[i].map(|row| sums[row as usize]);
                    for k in 0..4 {
                        expected_q[i][k] = 1.5 * mass[i] * expected_p[i][k] + (a[k] + b[k]);
                    }
                }
                assert_eq!((&p, &q), (&expected_p, &expected_q));
                assert_eq!(product.to_bits(), dot(&p, &q).to_bits());
            }
            let M: Vec<Inverse3> = (0..n)
                .map(|i| {
                    let [a, b, c, _] = row(i, 5).map(|v| v / [1.0, 1e-3, 1e-25, 1e5][i % 4]);
                    invert(&[3.0, a, b, 0.0, 4.0, c, 5.0, 0.0], [i % 7 == 3, false, false])
                })
                .collect();
            let (p, q) = (rows(n, 6), rows(n, 7));
            let (mut x, mut r, mut z) = (rows(n, 8), rows(n, 9), vec![[0.0; 4]; n]);
            let (mut expected_x, mut expected_r) = (x.clone(), r.clone());
            let product = advance_solution(0.7, [&p, &q], &M, [&mut x, &mut r, &mut z]);
            for i in 0..n {
                for k in 0..4 {
                    expected_x[i][k] += 0.7 * p[i][k];
                    expected_r[i][k] -= 0.7 * q[i][k];
                }
                assert_eq!(z[i], M[i].times(&expected_r[i]));
            }
            assert_eq!((&x, &r), (&expected_x, &expected_r));
            assert_eq!(product.to_bits(), dot(&r, &z).to_bits());
            for start in [Start::Zero, Start::Correction, Start::Step] {
                let (d, x) = (rows(n, 10), rows(n, 11));
                let (mut next_d, mut next_x) = (d.clone(), x.clone());
                smooth(&M, &r, (start, [0.4, 0.7, 1.2]), [&mut next_d, &mut next_x]);
                for i in 0..n {
                    let z = M[i].times(&r[i]);
                    for k in 0..4 {
                        let (kept, known) = match start {
                            Start::Zero => (0.0, 0.0),
                            Start::Correction => (0.0, x[i][k] + d[i][k]),
                            Start::Step => (0.4 * d[i][k], x[i][k]),
                        };
                        let next = kept + 0.7 * z[k];
                        assert_eq!((next_d[i][k], next_x[i][k]), (next, known + 1.2 * next), "{start:?}");
                    }
                }
            }
        }
    }
}
