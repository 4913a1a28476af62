//! Results of a case: figures with bounds, charts, pictures.

use scindo_study::report::chart::Chart;
use scindo_study::report::view::Picture;
use scindo_study::words::compact;

/// The range that a figure must lie in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// At most this value.
    AtMost(f64),
    /// At least this value.
    AtLeast(f64),
    /// Exactly this value, bit for bit.
    Exactly(f64),
    /// No bound: the figure is only reported.
    Told,
}

/// A number by which a case is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name of the quantity.
    pub name: String,
    /// Measured value.
    pub value: f64,
    /// Unit; empty for a plain number.
    pub unit: &'static str,
    /// Range that the value must lie in.
    pub bound: Bound,
}

impl Figure {
    /// Whether the value is within its bound. NaN never is.
    pub fn holds(&self) -> bool {
        match self.bound {
            Bound::AtMost(bound) => self.value <= bound,
            Bound::AtLeast(bound) => self.value >= bound,
            Bound::Exactly(bound) => self.value == bound,
            Bound::Told => true,
        }
    }

    /// Name, value and bound in words.
    pub fn words(&self) -> String {
        let Self { name, value, unit, .. } = self;
        let space = if unit.is_empty() { "" } else { " " };
        format!("{name}: {}{space}{unit}{}", compact(*value), self.bound_words())
    }

    /// The bound in words, such as `, at most 0.01`.
    fn bound_words(&self) -> String {
        match self.bound {
            Bound::AtMost(bound) => format!(", at most {}", compact(bound)),
            Bound::AtLeast(bound) => format!(", at least {}", compact(bound)),
            Bound::Exactly(bound) => format!(", to be {}", compact(bound)),
            Bound::Told => String::new(),
        }
    }
}

/// All results of a case.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    /// Figures by which the case is judged.
    pub figures: Vec<Figure>,
    /// Charts over time: energies, iterations and others.
    pub charts: Vec<Chart>,
    /// Pictures of bodies.
    pub pictures: Vec<Picture>,
    /// Further remarks.
    pub notes: Vec<String>,
}

impl Evidence {
    /// Adds a figure that must not exceed `bound`.
    pub fn at_most(&mut self, name: impl Into<String>, value: f64, bound: f64, unit: &'static str) {
        self.figure(name, value, Bound::AtMost(bound), unit);
    }

    /// Adds a figure that must reach `bound`.
    pub fn at_least(&mut self, name: impl Into<String>, value: f64, bound: f64, unit: &'static str) {
        self.figure(name, value, Bound::AtLeast(bound), unit);
    }

    /// Adds a count that must equal `expected`.
    pub fn exactly(&mut self, name: impl Into<String>, found: usize, expected: usize) {
        self.figure(name, found as f64, Bound::Exactly(expected as f64), "");
    }

    /// Adds a figure without a bound.
    pub fn tell(&mut self, name: impl Into<String>, value: f64, unit: &'static str) {
        self.figure(name, value, Bound::Told, unit);
    }

    fn figure(&mut self, name: impl Into<String>, value: f64, bound: Bound, unit: &'static str) {
        self.figures.push(Figure { name: name.into(), value, unit, bound });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_is_within_no_bound() {
        let mut evidence = Evidence::default();
        evidence.at_most("a", f64::NAN, 1.0, "");
        evidence.at_least("b", f64::NAN, 1.0, "");
        evidence.at_most("c", 1.0, 1.0, "");
        evidence.exactly("d", 2, 3);
        let holds: Vec<bool> = evidence.figures.iter().map(Figure::holds).collect();
        assert_eq!(holds, [false, false, true, false]);
    }
}
