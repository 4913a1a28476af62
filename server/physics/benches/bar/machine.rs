//! Limits of the machine: memory bandwidth by working set, and multiply-adds.

use std::time::Instant;

use scindo_physics::team::{Team, blocks};

use super::peak;

/// Measured limits of this machine for one number of threads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Machine {
    /// Bandwidth of the triad a = b + s c [byte/s], with all three arrays in the second-level cache, in
    /// the third-level cache, and in memory.
    pub bandwidth: [f64; 3],
    /// Multiply-adds in registers [flop/s].
    pub flops: f64,
}

/// Total size [byte] of the three arrays of the triad that measures each level.
const WORKING_SETS: [usize; 3] = [384 << 10, 8 << 20, 192 << 20];
/// Largest working sets [byte] that fit the second-level and the third-level cache.
const LEVELS: [usize; 2] = [512 << 10, 16 << 20];
pub(crate) const LEVEL_NAMES: [&str; 3] = ["L2", "L3", "DRAM"];

impl Machine {
    /// Best of several runs with `threads` threads.
    pub(crate) fn measure(threads: usize, quick: bool) -> Self {
        let mut team = Team::new(threads).unwrap();
        let bandwidth = WORKING_SETS.map(|bytes| triad(&mut team, bytes, if quick { 3 } else { 25 }));
        Self { bandwidth, flops: peak::multiply_adds(&mut team, if quick { 3 } else { 25 }) }
    }

    /// Index into [`LEVEL_NAMES`] of the level that holds `bytes`; each thread has a second-level cache.
    pub(crate) fn level(bytes: usize, threads: usize) -> usize {
        LEVELS
            .iter()
            .enumerate()
            .filter(|(l, size)| bytes > *size * if *l == 0 { threads } else { 1 })
            .count()
    }

    /// Least time [s] to stream `bytes` from a working set of `working_set` bytes or to make `flops`
    /// operations, whichever takes longer.
    pub(crate) fn roof(&self, bytes: f64, working_set: usize, flops: f64, threads: usize) -> f64 {
        (bytes / self.bandwidth[Self::level(working_set, threads)]).max(flops / self.flops)
    }
}

/// Bytes per second of a ← b + s c (two reads and one write counted).
fn triad(team: &mut Team, bytes: usize, runs: usize) -> f64 {
    let n = bytes / 12;
    let (mut a, b, c) = (vec![0.0_f32; n], vec![1.0_f32; n], vec![2.0_f32; n]);
    let (piece, repeats) = (8192, (64 << 20) / bytes + 1);
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = Instant::now();
        for k in 0..repeats {
            let s = 0.5 + k as f32;
            team.for_blocks(blocks(&mut a, piece), |block, a| {
                let (b, c) = (&b[block * piece..][..a.len()], &c[block * piece..][..a.len()]);
                for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
                    *a = b + s * c;
                }
            });
        }
        best = best.min(start.elapsed().as_secs_f64() / repeats as f64);
    }
    assert!(a[n / 2] > 1.0);
    (12 * n) as f64 / best
}
