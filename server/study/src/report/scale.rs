//! An axis, logarithmic or linear: range, position, ticks.

/// How values lie along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spacing {
    /// Equal ratios have equal lengths.
    Logarithmic,
    /// Equal differences have equal lengths; the axis begins at 0.
    Linear,
}

/// An axis from `low` to `high`, drawn from `from` to `to` pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    spacing: Spacing,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

/// Most labels of a linear axis beside its zero.
const LABELS: f64 = 7.0;

/// A grid line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Value at the line.
    pub value: f64,
    /// Whether it has a label.
    pub labelled: bool,
}

impl Scale {
    /// An axis that holds all positive finite `values`, with some margin.
    pub fn around(values: impl Iterator<Item = f64>, from: f64, to: f64, spacing: Spacing) -> Self {
        let usable = values.filter(|value| value.is_finite() && *value > 0.0);
        let (low, high) = usable.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.1, 10.0) };
        if spacing == Spacing::Linear {
            return Self { spacing, low: 0.0, high: 1.06 * high, from, to };
        }
        // At least a decade, so that a scatter of one per cent does not look like ten.
        let middle = (low * high).sqrt();
        let (low, high) = (low.min(middle / 3.2), high.max(middle * 3.2));
        let air = (high / low).powf(0.06);
        Self { spacing, low: low / air, high: high * air, from, to }
    }

    /// Position of a value [px]. Values beyond the axis lie at its end.
    pub fn at(&self, value: f64) -> f64 {
        let share = match self.spacing {
            Spacing::Logarithmic => (value / self.low).ln() / (self.high / self.low).ln(),
            Spacing::Linear => (value - self.low) / (self.high - self.low),
        };
        self.from + (self.to - self.from) * if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Whether a value lies on the axis.
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Grid lines. Logarithmic: at 1 to 9 of every decade; decades are labelled, with few decades 2 and 5 as well. Linear:
    /// at multiples of 1, 2 or 5 times a power of ten, all labelled.
    pub fn ticks(&self) -> Vec<Tick> {
        if self.spacing == Spacing::Linear {
            let step = round_step(self.high / LABELS);
            let last = (self.high / step).floor() as u32;
            return (0..=last).map(|k| Tick { value: f64::from(k) * step, labelled: true }).collect();
        }
        let decades = (self.high / self.low).log10();
        let labelled = |digit: i32| digit == 1 || (decades < 2.2 && (digit == 2 || digit == 5));
        let first = self.low.log10().floor() as i32;
        let last = self.high.log10().ceil() as i32;
        let all = (first..=last).flat_map(|power| (1..10).map(move |digit| (digit, power)));
        let tick = |(digit, power): (i32, i32)| {
            let value = f64::from(digit) * 10f64.powi(power);
            self.holds(value).then(|| Tick { value, labelled: labelled(digit) })
        };
        all.filter_map(tick).collect()
    }
}

/// The smallest of 1, 2 and 5 times a power of ten that is at least `least`, up to rounding.
pub fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().find(|digit| digit * power >= least).unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithmic_axis() {
        let scale = Scale::around([1.0, 100.0, f64::NAN, 0.0].into_iter(), 0.0, 100.0, Spacing::Logarithmic);
        assert!((scale.at(10.0) - 50.0).abs() < 1e-9);
        assert!(scale.at(1.0) > 0.0 && scale.at(100.0) < 100.0);
        let labels: Vec<f64> = scale.ticks().iter().filter(|t| t.labelled).map(|t| t.value).collect();
        assert_eq!(labels, [1.0, 10.0, 100.0]);
    }

    #[test]
    fn a_short_axis_has_more_labels_and_an_empty_one_some() {
        let spacing = Spacing::Logarithmic;
        let scale = Scale::around([3.0, 8.0].into_iter(), 0.0, 100.0, spacing);
        assert!(scale.ticks().iter().filter(|t| t.labelled).count() >= 3);
        assert!(!Scale::around(std::iter::empty(), 0.0, 1.0, spacing).ticks().is_empty());
    }
    #[test]
    fn a_linear_axis_begins_at_zero() {
        let scale = Scale::around([2.0, 46.0].into_iter(), 0.0, 100.0, Spacing::Linear);
        assert_eq!(scale.at(0.0), 0.0);
        assert!((scale.at(20.0) - 2.0 * scale.at(10.0)).abs() < 1e-9 && scale.at(46.0) < 100.0);
        let labels: Vec<f64> = scale.ticks().iter().map(|tick| tick.value).collect();
        assert_eq!(labels, [0.0, 10.0, 20.0, 30.0, 40.0]);
        for high in [1e-6, 0.7, 1.9, 3.0, 9.9, 1e5] {
            let ticks = Scale::around([high].into_iter(), 0.0, 1.0, Spacing::Linear).ticks();
            assert!((4..=8).contains(&ticks.len()), "{high}: {ticks:?}");
        }
    }
}
