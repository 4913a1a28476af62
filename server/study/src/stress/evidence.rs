//! What a case leaves behind: figures with bounds, charts, pictures.

use super::chart::Chart;
use super::view::Picture;

/// Where a figure must lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// ≤.
    AtMost(f64),
    /// ≥.
    AtLeast(f64),
    /// =, bit for bit.
    Exactly(f64),
    /// Anywhere: it is only told.
    Told,
}

/// A number that a case is judged by.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What it is.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit; empty for a plain number.
    pub unit: &'static str,
    /// Where it must lie.
    pub bound: Bound,
}

impl Figure {
    /// Whether it is where it must be; NaN is nowhere.
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
        format!("{name}: {}{space}{unit}{}", short(*value), self.bound_words())
    }

    /// The bound in words, such as `, at most 0.01`.
    fn bound_words(&self) -> String {
        match self.bound {
            Bound::AtMost(bound) => format!(", at most {}", short(bound)),
            Bound::AtLeast(bound) => format!(", at least {}", short(bound)),
            Bound::Exactly(bound) => format!(", to be {}", short(bound)),
            Bound::Told => String::new(),
        }
    }
}

/// A number for people: four digits, without zeros at their end.
pub fn short(value: f64) -> String {
    let size = value.abs();
    if value == value.round() && size < 1e7 {
        return format!("{value:.0}");
    }
    if (1e-3..1e5).contains(&size) {
        let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
        return trimmed(&format!("{value:.digits$}")).to_owned();
    }
    let text = format!("{value:.2e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{}e{exponent}", trimmed(mantissa)),
        None => text,
    }
}

/// A decimal number without zeros at the end of its fraction.
fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// What a case leaves behind.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    /// What it is judged by.
    pub figures: Vec<Figure>,
    /// Energies, iterations and others over time.
    pub charts: Vec<Chart>,
    /// What it looks like.
    pub pictures: Vec<Picture>,
    /// What else there is to say.
    pub notes: Vec<String>,
}

impl Evidence {
    /// A figure that must not exceed `bound`.
    pub fn at_most(&mut self, name: impl Into<String>, value: f64, bound: f64, unit: &'static str) {
        self.figure(name, value, Bound::AtMost(bound), unit);
    }

    /// A figure that must reach `bound`.
    pub fn at_least(&mut self, name: impl Into<String>, value: f64, bound: f64, unit: &'static str) {
        self.figure(name, value, Bound::AtLeast(bound), unit);
    }

    /// A count that must be what is expected.
    pub fn exactly(&mut self, name: impl Into<String>, found: usize, expected: usize) {
        self.figure(name, found as f64, Bound::Exactly(expected as f64), "");
    }

    /// A figure without bound.
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

    #[test]
    fn numbers_for_people() {
        assert_eq!(
            [3.0, 0.12345, 1.5, 1e-3, 1.5e-9, 1e-15, -2.664e-15, 1234.6, 99_999.7, 0.0].map(short),
            ["3", "0.1235", "1.5", "0.001", "1.5e-9", "1e-15", "-2.66e-15", "1235", "100000", "0"]
                .map(str::to_owned)
        );
    }
}
