//! What a scene saves without an effect, from pairs of steps.

use serde::Serialize;

/// What switching an effect off does.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "outcome", rename_all = "kebab-case")]
pub enum Off {
    /// The effect is off in the scene.
    AlreadyOff,
    /// Both were stepped.
    Measured(Saving),
    /// The scene is refused without it, or it has no switch.
    Impossible {
        /// Why the scene cannot do without the effect.
        reason: String,
    },
    /// The scene can be built without it, but its steps fail.
    Fails {
        /// What went wrong without the effect.
        reason: String,
    },
    /// The measurement was interrupted before this effect.
    NotMeasured,
}

/// The difference that an effect makes to the processor time of a step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Saving {
    /// Median of the step with the effect minus the step without it [ms]. Negative if a step is dearer without it.
    pub saves_ms: f64,
    /// Standard error of that median [ms].
    pub standard_error_ms: f64,
    /// Median step without the effect [ms].
    pub without_ms: f64,
    /// Pairs of steps.
    pub pairs: usize,
    /// Pairs that began in the same state. None do for gravity, loads and inertia, without which the twin goes its own
    /// way, and none after a cut or an adaptation that only one of the two made.
    pub same_state: usize,
    /// The keys that switch the effect off.
    pub keys: Vec<String>,
}

impl Saving {
    /// From the times of steps with and without the effect [ms], pair by pair.
    pub(super) fn of(pairs: &[[f64; 2]], same_state: usize, keys: Vec<String>) -> Self {
        let mut differences: Vec<f64> = pairs.iter().map(|[with, without]| with - without).collect();
        let [low, saves_ms, high] = quartiles(&mut differences);
        let mut without: Vec<f64> = pairs.iter().map(|pair| pair[1]).collect();
        // σ ≈ IQR/1.349 for a normal distribution, whose median has the standard error 1.2533 σ/√n.
        let standard_error_ms = 1.2533 / 1.349 * (high - low) / (pairs.len().max(1) as f64).sqrt();
        let [_, without_ms, _] = quartiles(&mut without);
        Self { saves_ms, standard_error_ms, without_ms, pairs: pairs.len(), same_state, keys }
    }

    /// Whether the difference stands out from the noise by two standard errors.
    pub fn is_certain(&self) -> bool {
        self.saves_ms.abs() > 2.0 * self.standard_error_ms
    }
}

/// Quartiles of `values`, 0 if there are none. Sorts them.
pub(super) fn quartiles(values: &mut [f64]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = share * values.len().saturating_sub(1) as f64;
        let (low, high) = (values.get(place.floor() as usize), values.get(place.ceil() as usize));
        let (low, high) = (low.copied().unwrap_or(0.0), high.copied().unwrap_or(0.0));
        low + place.fract() * (high - low)
    };
    [at(0.25), at(0.5), at(0.75)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drift_that_hits_both_steps_of_a_pair_is_no_saving() {
        // The machine gets slower by far more than the effect costs; an outlier hits one step.
        let mut pairs: Vec<[f64; 2]> =
            (0..40).map(f64::from).map(|i| [10.0 + i + 0.5, 10.0 + i + 0.01 * (i % 3.0)]).collect();
        pairs[7][0] += 100.0;
        let saving = Saving::of(&pairs, 40, Vec::new());
        assert!((saving.saves_ms - 0.49).abs() < 0.02, "{saving:?}");
        assert!(saving.standard_error_ms < 0.01 && saving.is_certain(), "{saving:?}");
        assert!((saving.without_ms - 29.51).abs() < 0.05, "{saving:?}");
    }

    #[test]
    fn noise_is_not_certain() {
        let pairs: Vec<[f64; 2]> =
            (0..40).map(|i| [1.0 + f64::from(i * 7 % 11), 1.0 + f64::from(i * 5 % 11)]).collect();
        assert!(!Saving::of(&pairs, 40, Vec::new()).is_certain());
        assert_eq!(Saving::of(&[], 0, Vec::new()).saves_ms, 0.0);
    }
}
