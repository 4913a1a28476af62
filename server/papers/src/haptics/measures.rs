//! Figures of one trial.

use nalgebra::Vector3;
use serde::Serialize;

/// Force below which nothing counts as touched [N]: a fifth of the least error that is judged.
const TOUCHED_N: f64 = 0.01;
/// Error that is always allowed [N].
const FLOOR_N: f64 = 0.05;
/// Largest step of force per tick [N], with room for rounding.
const MAX_STEP_N: f64 = 0.05 + 1e-9;
/// Most energy that the hand may have received beyond what it gave [J].
const MAX_GAIN_J: f64 = 2e-3;
/// Largest amplitude of a limit cycle [m].
const MAX_CYCLE_M: f64 = 1e-4;

/// One tick of a trial.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Time [s].
    pub time_s: f64,
    /// Tip [m].
    pub tip_m: Vector3<f64>,
    /// Force on the hand [N].
    pub felt_n: Vector3<f64>,
    /// Force of the tissue solved at 1 kHz [N].
    pub truth_n: Vector3<f64>,
    /// Work of the felt force on the hand so far [J].
    pub work_j: f64,
    /// Age of the pose behind the newest model [ms]; NaN before the first.
    pub age_ms: f64,
}

/// Figures of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    /// Root mean square of the force error while touched [N].
    pub error_rms_n: f64,
    /// The same over the root mean square of the true force.
    pub error_rms: f64,
    /// 95th percentile of the force error [N].
    pub error_p95_n: f64,
    /// 95th percentile of the error over the true force, where an error of 0.05 N counts as the allowed share.
    pub error_p95: f64,
    /// Largest true force [N].
    pub peak_n: f64,
    /// Largest change of force in a tick [N].
    pub step_n: f64,
    /// Most energy that the hand had received beyond what it gave [J].
    pub gain_j: f64,
    /// Amplitude of the tip's motion while the hand is still, without drift [m].
    pub cycle_m: f64,
    /// Mean age of the pose behind the model [ms].
    pub age_ms: f64,
}

impl Figures {
    /// Reduces the samples of a trial. `allowed` is the share of the true force that an error may have, and
    /// `still` the interval in which the hand keeps still [s].
    pub fn of(samples: &[Sample], allowed: f64, still: [f64; 2]) -> Self {
        let touched =
            || samples.iter().filter(|s| s.truth_n.norm() > TOUCHED_N || s.felt_n.norm() > TOUCHED_N);
        let error = |s: &Sample| (s.felt_n - s.truth_n).norm();
        let root = |of: &dyn Fn(&Sample) -> f64| {
            let n = touched().count().max(1) as f64;
            (touched().map(|s| of(s).powi(2)).sum::<f64>() / n).sqrt()
        };
        let (error_rms_n, truth_rms_n) = (root(&error), root(&|s| s.truth_n.norm()));
        let share = |s: &Sample| allowed * error(s) / (allowed * s.truth_n.norm()).max(FLOOR_N);
        let step = |w: &[Sample]| (w[1].felt_n - w[0].felt_n).norm();
        let aged = samples.iter().map(|s| s.age_ms).filter(|age| age.is_finite());
        let ages = aged.clone().count().max(1) as f64;
        Self {
            error_rms_n,
            error_rms: error_rms_n / truth_rms_n.max(TOUCHED_N),
            error_p95_n: percentile(touched().map(error).collect()),
            error_p95: percentile(touched().map(share).collect()),
            peak_n: samples.iter().map(|s| s.truth_n.norm()).fold(0.0, f64::max),
            step_n: samples.windows(2).map(step).fold(0.0, f64::max),
            gain_j: samples.iter().map(|s| s.work_j).fold(0.0, f64::max),
            cycle_m: amplitude(samples, still),
            age_ms: aged.sum::<f64>() / ages,
        }
    }

    /// What is out of its bound; the error only if `allowed` is given.
    pub fn failures(&self, allowed: Option<f64>) -> Vec<&'static str> {
        let error = allowed.is_some_and(|allowed| self.error_p95 > allowed);
        let checks = [
            ("error", error),
            ("step", self.step_n > MAX_STEP_N),
            ("energy", self.gain_j > MAX_GAIN_J),
            ("cycle", self.cycle_m > MAX_CYCLE_M),
        ];
        checks.into_iter().filter(|(_, out)| *out).map(|(name, _)| name).collect()
    }
}

fn percentile(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = (0.95 * values.len() as f64).ceil() as usize;
    values.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// Half of the range of the tip within `still`, after the line that fits it best is taken out [m].
fn amplitude(samples: &[Sample], still: [f64; 2]) -> f64 {
    let tips: Vec<Vector3<f64>> =
        samples.iter().filter(|s| s.time_s >= still[0] && s.time_s <= still[1]).map(|s| s.tip_m).collect();
    let n = tips.len().max(1) as f64;
    let from_middle = |i: usize| i as f64 - 0.5 * (n - 1.0);
    let mean = tips.iter().sum::<Vector3<f64>>() / n;
    let spread: f64 = (0..tips.len()).map(|i| from_middle(i).powi(2)).sum();
    let slope = tips.iter().enumerate().map(|(i, p)| p * from_middle(i)).sum::<Vector3<f64>>()
        / spread.max(f64::MIN_POSITIVE);
    let range = |axis: usize| {
        let rest = (0..tips.len()).map(|i| (tips[i] - mean - slope * from_middle(i))[axis]);
        let (low, high) = rest.fold((0.0, 0.0), |(low, high), v| (f64::min(low, v), f64::max(high, v)));
        0.5 * (high - low)
    };
    (0..3).map(range).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(i: usize, felt: f64, truth: f64, z: f64) -> Sample {
        Sample {
            time_s: i as f64 * 1e-3,
            tip_m: Vector3::new(0.0, 0.0, z),
            felt_n: Vector3::new(0.0, 0.0, felt),
            truth_n: Vector3::new(0.0, 0.0, truth),
            work_j: 0.0,
            age_ms: 5.0,
        }
    }

    #[test]
    fn a_constant_error_of_a_tenth_is_a_tenth() {
        let samples: Vec<_> = (0..100).map(|i| sample(i, 1.1, 1.0, 0.0)).collect();
        let figures = Figures::of(&samples, 0.07, [0.0, 0.1]);
        for share in [figures.error_rms, figures.error_p95, figures.error_rms_n, figures.error_p95_n] {
            assert!((share - 0.1).abs() < 1e-12, "{figures:?}");
        }
        assert_eq!(figures.failures(Some(0.07)), ["error"]);
        assert!(figures.failures(None).is_empty() && figures.failures(Some(0.15)).is_empty());
    }

    #[test]
    fn small_forces_are_judged_by_the_floor_and_drift_is_no_cycle() {
        let drifting: Vec<_> =
            (0..100).map(|i| sample(i, 0.14, 0.1, 1e-5 * i as f64 + 2e-4 * (i as f64).sin())).collect();
        let figures = Figures::of(&drifting, 0.07, [0.0, 0.1]);
        assert!((figures.error_p95 - 0.07 * 0.8).abs() < 1e-12);
        assert!((figures.cycle_m - 2e-4).abs() < 2e-5, "{}", figures.cycle_m);
        assert_eq!(figures.failures(Some(0.07)), ["cycle"]);
    }

    #[test]
    fn steps_and_gains_are_the_largest() {
        let mut samples: Vec<_> = (0..10).map(|i| sample(i, 0.02 * i as f64, 0.0, 0.0)).collect();
        samples[5].work_j = 3e-3;
        samples[9].felt_n.z += 0.06;
        let figures = Figures::of(&samples, 0.07, [0.0, 0.0]);
        assert!((figures.step_n - 0.08).abs() < 1e-12);
        assert_eq!(figures.failures(None), ["step", "energy"]);
    }
}
