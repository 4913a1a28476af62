//! The vector loops of a solver iteration over one block of copies.
//!
//! Vectors are single precision, scalar products double. On x86-64 the loops are written for AVX as well
//! (the compiler's own idea of them is to transpose rows); the operations are the same one by one,
//! so the bits are the same.

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
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the instructions were detected.
        return unsafe { avx::advance_direction(z, beta, (mass, factor), (pairs, sums), [p, q]) };
    }
    for (((p, q), (z, mass)), &[a, b]) in p.iter_mut().zip(&mut *q).zip(z.iter().zip(mass)).zip(pairs) {
        direction(p, z, beta);
        let (a, b) = (&sums[a as usize], &sums[b as usize]);
        *q = std::array::from_fn(|k| factor * mass * p[k] + (a[k] + b[k]));
    }
    dot(p, q)
}

/// x·y.
#[inline]
pub fn dot(x: &[Padded], y: &[Padded]) -> f64 {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the instructions were detected.
        return unsafe { avx::dot(x, y) };
    }
    let mut sum = Sum::default();
    for (x, y) in x.iter().zip(y) {
        sum.add(x, y);
    }
    sum.total()
}

/// z = M⁻¹ r; returns r·z.
#[inline]
pub fn precondition(M: &[Inverse3], r: &[Padded], z: &mut [Padded]) -> f64 {
    for ((z, r), M) in z.iter_mut().zip(r).zip(M) {
        *z = M.times(r);
    }
    dot(r, z)
}

/// x += α p, r −= α q, z = M⁻¹ r; returns r·z.
#[inline]
pub fn advance_solution(
    alpha: f32,
    [p, q]: [&[Padded]; 2],
    M: &[Inverse3],
    [x, r, z]: [&mut [Padded]; 3],
) -> f64 {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the instructions were detected.
        return unsafe { avx::advance_solution(alpha, [p, q], M, [x, r, z]) };
    }
    for (((x, r), z), ((p, q), M)) in x.iter_mut().zip(&mut *r).zip(&mut *z).zip(p.iter().zip(q).zip(M)) {
        for k in 0..4 {
            x[k] += alpha * p[k];
            r[k] -= alpha * q[k];
        }
        *z = M.times(r);
    }
    dot(r, z)
}

#[cfg(target_arch = "x86_64")]
mod avx {
    //! The same operations, one register per row.

    use std::arch::x86_64::{
        __m128, __m256d, _mm_add_ps, _mm_loadu_ps, _mm_mul_ps, _mm_permute_ps, _mm_set1_ps, _mm_storeu_ps,
        _mm_sub_ps, _mm256_add_pd, _mm256_cvtps_pd, _mm256_mul_pd, _mm256_setzero_pd, _mm256_storeu_pd,
    };

    use super::{Inverse3, Padded, Sum};

    #[target_feature(enable = "avx")]
    pub fn dot(x: &[Padded], y: &[Padded]) -> f64 {
        let mut sum = _mm256_setzero_pd();
        for (x, y) in x.iter().zip(y) {
            // SAFETY: a row holds four numbers.
            let (x, y) = unsafe { (_mm_loadu_ps(x.as_ptr()), _mm_loadu_ps(y.as_ptr())) };
            sum = _mm256_add_pd(sum, product(x, y));
        }
        total(sum)
    }

    #[target_feature(enable = "avx")]
    pub fn advance_direction(
        z: &[Padded],
        beta: f32,
        (mass, factor): (&[f32], f32),
        (pairs, sums): (&[[u32; 2]], &[Padded]),
        [p, q]: [&mut [Padded]; 2],
    ) -> f64 {
        let (turns, beta) = (beta != 0.0, _mm_set1_ps(beta));
        let mut sum = _mm256_setzero_pd();
        for (((p, q), (z, mass)), &[a, b]) in p.iter_mut().zip(q).zip(z.iter().zip(mass)).zip(pairs) {
            let (a, b) = (&sums[a as usize], &sums[b as usize]);
            // SAFETY: a row holds four numbers.
            unsafe {
                let mut next_p = _mm_loadu_ps(z.as_ptr());
                if turns {
                    next_p = _mm_add_ps(next_p, _mm_mul_ps(beta, _mm_loadu_ps(p.as_ptr())));
                }
                let inertia = _mm_mul_ps(_mm_set1_ps(factor * mass), next_p);
                let elastic = _mm_add_ps(_mm_loadu_ps(a.as_ptr()), _mm_loadu_ps(b.as_ptr()));
                let next_q = _mm_add_ps(inertia, elastic);
                _mm_storeu_ps(p.as_mut_ptr(), next_p);
                _mm_storeu_ps(q.as_mut_ptr(), next_q);
                sum = _mm256_add_pd(sum, product(next_p, next_q));
            }
        }
        total(sum)
    }

    #[target_feature(enable = "avx")]
    pub fn advance_solution(
        alpha: f32,
        [p, q]: [&[Padded]; 2],
        M: &[Inverse3],
        [x, r, z]: [&mut [Padded]; 3],
    ) -> f64 {
        let alpha = _mm_set1_ps(alpha);
        let mut sum = _mm256_setzero_pd();
        for (((x, r), z), ((p, q), M)) in x.iter_mut().zip(r).zip(z).zip(p.iter().zip(q).zip(M)) {
            // SAFETY: a row holds four numbers.
            unsafe {
                let (p, q) = (_mm_loadu_ps(p.as_ptr()), _mm_loadu_ps(q.as_ptr()));
                let next_x = _mm_add_ps(_mm_loadu_ps(x.as_ptr()), _mm_mul_ps(alpha, p));
                let next_r = _mm_sub_ps(_mm_loadu_ps(r.as_ptr()), _mm_mul_ps(alpha, q));
                let a = _mm_mul_ps(_mm_loadu_ps(M.0[0].as_ptr()), _mm_permute_ps::<0x00>(next_r));
                let b = _mm_mul_ps(_mm_loadu_ps(M.0[1].as_ptr()), _mm_permute_ps::<0x55>(next_r));
                let c = _mm_mul_ps(_mm_loadu_ps(M.0[2].as_ptr()), _mm_permute_ps::<0xAA>(next_r));
                let next_z = _mm_add_ps(_mm_add_ps(a, b), c);
                _mm_storeu_ps(x.as_mut_ptr(), next_x);
                _mm_storeu_ps(r.as_mut_ptr(), next_r);
                _mm_storeu_ps(z.as_mut_ptr(), next_z);
                sum = _mm256_add_pd(sum, product(next_r, next_z));
            }
        }
        total(sum)
    }

    /// In double precision: that of two small numbers would be denormal, and slow.
    #[target_feature(enable = "avx")]
    fn product(x: __m128, y: __m128) -> __m256d {
        _mm256_mul_pd(_mm256_cvtps_pd(x), _mm256_cvtps_pd(y))
    }

    #[target_feature(enable = "avx")]
    fn total(sum: __m256d) -> f64 {
        let mut parts = [0.0; 4];
        // SAFETY: four numbers.
        unsafe { _mm256_storeu_pd(parts.as_mut_ptr(), sum) };
        Sum(parts).total()
    }
}

/// p ← z + β p; z if β = 0, also where p is not finite.
#[inline(always)]
pub fn direction(p: &mut Padded, z: &Padded, beta: f32) {
    *p = if beta == 0.0 { *z } else { row::add_product(z, beta, p) };
}

/// local ← z\[copies\] + β local (z\[copies\] if β = 0).
#[inline(always)]
pub fn gather_direction(local: &mut [Padded], copies: &[u32], z: &[Padded], beta: f32) {
    if beta == 0.0 {
        for (local, &copy) in local.iter_mut().zip(copies) {
            *local = z[copy as usize];
        }
    } else {
        for (local, &copy) in local.iter_mut().zip(copies) {
            *local = row::add_product(&z[copy as usize], beta, local);
        }
    }
}

/// One row at a time in one register: left to itself the compiler takes rows apart.
mod row {
    use super::Padded;

    /// z + β p.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub fn add_product(z: &Padded, beta: f32, p: &Padded) -> Padded {
        use std::arch::x86_64::{_mm_add_ps, _mm_loadu_ps, _mm_mul_ps, _mm_set1_ps, _mm_storeu_ps};
        let mut sum = [0.0; 4];
        // SAFETY: SSE belongs to x86-64, and a row holds four numbers.
        unsafe {
            let product = _mm_mul_ps(_mm_set1_ps(beta), _mm_loadu_ps(p.as_ptr()));
            _mm_storeu_ps(sum.as_mut_ptr(), _mm_add_ps(_mm_loadu_ps(z.as_ptr()), product));
        }
        sum
    }

    /// z + β p.
    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    pub fn add_product(z: &Padded, beta: f32, p: &Padded) -> Padded {
        std::array::from_fn(|k| z[k] + beta * p[k])
    }
}

/// A scalar product in the making, in double precision.
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

    /// The sum.
    pub fn total(&self) -> f64 {
        (self.0[0] + self.0[1]) + (self.0[2] + self.0[3])
    }
}
