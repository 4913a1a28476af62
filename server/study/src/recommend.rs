//! A configuration for a time budget.

use serde::Serialize;

use crate::pareto::front;
use crate::sources::{Source, Sources};

/// What is recommended, in indices of the points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recommendation {
    /// The budget [ms].
    pub budget_ms: f64,
    /// The most accurate point within it; none if nothing is fast enough.
    pub choice: Option<usize>,
    /// The next point on the front: what more time would buy, or the fastest where nothing fits.
    pub next: Option<usize>,
    /// Which error dominates the choice.
    pub dominant: Option<Source>,
    /// In words.
    pub words: String,
}

/// A point as the recommendation sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate<'a> {
    /// Time that must fit [ms]: the 99th percentile.
    pub p99_ms: f64,
    /// Relative error; not finite for a run without result.
    pub error: f64,
    /// The configuration in words.
    pub words: &'a str,
    /// Its sources of error, where they are known.
    pub sources: Option<&'a Sources>,
}

/// Picks the most accurate candidate whose slow steps, too, fit the budget.
pub fn recommend(budget_ms: f64, candidates: &[Candidate<'_>]) -> Recommendation {
    let points: Vec<(f64, f64)> = candidates.iter().map(|c| (c.p99_ms, c.error)).collect();
    let front = front(&points);
    let fitting = front.iter().take_while(|&&i| points[i].0 <= budget_ms).count();
    let choice = fitting.checked_sub(1).map(|i| front[i]);
    let next = front.get(fitting).copied();
    let dominant = choice.and_then(|i| candidates[i].sources).and_then(Sources::dominant);
    Recommendation {
        budget_ms,
        choice,
        next,
        dominant,
        words: words(budget_ms, candidates, choice, next, dominant),
    }
}

fn words(
    budget_ms: f64,
    candidates: &[Candidate<'_>],
    choice: Option<usize>,
    next: Option<usize>,
    dominant: Option<Source>,
) -> String {
    let told = |i: usize| {
        let c = candidates[i];
        format!("{} (p99 {} ms, error {})", c.words, crate::axes::short(c.p99_ms), percent(c.error))
    };
    let mut text = match (choice, next) {
        (Some(i), _) => format!("Within {} ms: {}.", crate::axes::short(budget_ms), told(i)),
        (None, Some(i)) => {
            return format!(
                "Nothing fits into {} ms; the fastest is {}.",
                crate::axes::short(budget_ms),
                told(i)
            );
        }
        (None, None) => return "No configuration gave a result.".to_owned(),
    };
    if let Some(source) = dominant {
        text += &format!(" Its {} error dominates: {} would help most.", source.name(), source.remedy());
    }
    match next {
        Some(i) => text += &format!(" With more time: {}.", told(i)),
        None => text += " Nothing that was tried is more accurate.",
    }
    text
}

/// A relative error in per cent with two significant digits.
pub fn percent(error: f64) -> String {
    if !error.is_finite() {
        return "–".to_owned();
    }
    let value = 100.0 * error;
    if value != 0.0 && value < 0.001 { format!("{value:.1e} %") } else { format!("{} %", two_digits(value)) }
}

fn two_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (1 - value.abs().log10().floor() as i32).clamp(0, 6);
    format!("{value:.*}", digits as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(p99_ms: f64, error: f64, words: &str) -> Candidate<'_> {
        Candidate { p99_ms, error, words, sources: None }
    }

    #[test]
    fn the_most_accurate_that_fits() {
        let sources = Sources(vec![(Source::Discretisation, 0.04), (Source::Time, 0.1)]);
        let mut all = vec![
            candidate(1.0, 0.2, "fast"),
            candidate(8.0, 0.1, "good"),
            candidate(30.0, 0.01, "fine"),
            candidate(5.0, f64::NAN, "exploded"),
            candidate(9.0, 0.15, "beaten"),
        ];
        all[1].sources = Some(&sources);
        let r = recommend(10.0, &all);
        assert_eq!((r.choice, r.next, r.dominant), (Some(1), Some(2), Some(Source::Time)));
        assert_eq!(
            r.words,
            "Within 10 ms: good (p99 8 ms, error 10 %). Its time error dominates: a shorter step or an integrator \
             of higher order would help most. With more time: fine (p99 30 ms, error 1.0 %)."
        );
    }

    #[test]
    fn nothing_fits_or_nothing_works() {
        let r = recommend(0.5, &[candidate(1.0, 0.2, "fast")]);
        assert_eq!((r.choice, r.next), (None, Some(0)));
        assert!(r.words.starts_with("Nothing fits into 0.5 ms; the fastest is fast"));
        assert_eq!(recommend(1.0, &[]).words, "No configuration gave a result.");
    }

    #[test]
    fn per_cents() {
        assert_eq!(percent(0.0312), "3.1 %");
        assert_eq!(percent(1.234), "123 %");
        assert_eq!(percent(0.00012), "0.012 %");
        assert_eq!(percent(3e-9), "3.0e-7 %");
    }
}
