//! A logarithmic axis: range, position, ticks.

/// A logarithmic axis from `low` to `high`, drawn from `from` to `to` pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

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
    pub fn around(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let usable = values.filter(|value| value.is_finite() && *value > 0.0);
        let (low, high) = usable.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.1, 10.0) };
        // At least a decade, so that a scatter of one per cent does not look like ten.
        let middle = (low * high).sqrt();
        let (low, high) = (low.min(middle / 3.2), high.max(middle * 3.2));
        let air = (high / low).powf(0.06);
        Self { low: low / air, high: high * air, from, to }
    }

    /// Position of a value [px]. Values beyond the axis lie at its end.
    pub fn at(&self, value: f64) -> f64 {
        let share = (value / self.low).ln() / (self.high / self.low).ln();
        self.from + (self.to - self.from) * if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Whether a value lies on the axis.
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Grid lines at 1 to 9 of every decade. Decades are labelled; with few decades, 2 and 5 as well.
    pub fn ticks(&self) -> Vec<Tick> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithmic_axis() {
        let scale = Scale::around([1.0, 100.0, f64::NAN, 0.0].into_iter(), 0.0, 100.0);
        assert!((scale.at(10.0) - 50.0).abs() < 1e-9);
        assert!(scale.at(1.0) > 0.0 && scale.at(100.0) < 100.0);
        let labels: Vec<f64> = scale.ticks().iter().filter(|t| t.labelled).map(|t| t.value).collect();
        assert_eq!(labels, [1.0, 10.0, 100.0]);
    }

    #[test]
    fn a_short_axis_has_more_labels_and_an_empty_one_some() {
        let scale = Scale::around([3.0, 8.0].into_iter(), 0.0, 100.0);
        assert!(scale.ticks().iter().filter(|t| t.labelled).count() >= 3);
        assert!(!Scale::around(std::iter::empty(), 0.0, 1.0).ticks().is_empty());
    }
}
