//! The most that the arithmetic units of the machine do.

#![allow(unsafe_code)] // instructions that are detected

use std::time::Instant;

use scindo_physics::element::Simd;
use scindo_physics::team::{Team, blocks};

/// Flops per second of independent multiply-adds in registers.
pub(crate) fn multiply_adds(team: &mut Team, runs: usize) -> f64 {
    const REPEATS: usize = 100_000;
    let mut results = vec![0.0_f32; team.threads()];
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = Instant::now();
        team.for_blocks(blocks(&mut results, 1), |_, result| result[0] = chains(REPEATS));
        best = best.min(start.elapsed().as_secs_f64());
    }
    assert!(results.iter().all(|r| r.is_finite()));
    let lanes = if Simd::detect() == Simd::Avx512 { 16 } else { 8 };
    (results.len() * REPEATS * CHAINS * lanes * 2) as f64 / best
}

const CHAINS: usize = 12;

/// Twelve chains of multiply-adds, each of as many lanes as the machine has at most.
fn chains(repeats: usize) -> f32 {
    #[cfg(target_arch = "x86_64")]
    {
        use scindo_physics::element::avx2::Register;
        use scindo_physics::element::avx512::Register512;
        use scindo_physics::element::{Batched, Vector8};

        #[inline(always)]
        fn work<V: Batched<N>, const N: usize>(repeats: usize) -> f32 {
            let (factor, term) = (V::splat(std::hint::black_box(0.999)), V::splat(1e-3));
            let mut x = [V::splat(1.0); CHAINS];
            for _ in 0..repeats {
                for x in &mut x {
                    *x = x.mul_add(factor, term);
                }
            }
            let mut sum = 0.0;
            for x in x {
                sum += x.part(0).store().0[0];
            }
            sum
        }
        #[target_feature(enable = "avx2,fma")]
        fn eight(repeats: usize) -> f32 {
            work::<Register, 1>(repeats)
        }
        #[target_feature(enable = "avx512f,avx2,fma")]
        fn sixteen(repeats: usize) -> f32 {
            work::<Register512, 2>(repeats)
        }
        match Simd::detect() {
            // SAFETY: the instructions were detected.
            Simd::Avx2 => return unsafe { eight(repeats) },
            // SAFETY: as above.
            Simd::Avx512 => return unsafe { sixteen(repeats) },
            Simd::Baseline => {}
        }
    }
    let mut x = [[1.0_f32; 8]; CHAINS];
    let factor = std::hint::black_box(0.999);
    for _ in 0..repeats {
        for x in x.iter_mut().flatten() {
            *x = *x * factor + 1e-3;
        }
    }
    x.iter().flatten().sum()
}
