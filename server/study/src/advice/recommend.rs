//! Recommends a configuration for a time budget, as far as the reference can tell configurations apart.
//!
//! Errors are distances from a reference that is itself known only to its error bar b. The true error of a
//! point therefore lies within e ± b. An error below b may be the reference's own, so points there cannot be
//! told apart. The cheapest of them is then recommended, as indistinguishable.

use serde::Serialize;

use super::pareto::front;
use super::sources::{Source, Sources};
use crate::words::{percent, short};

/// The recommendation; points are given by their indices.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recommendation {
    /// Time budget per solution or frame [ms].
    pub budget_ms: f64,
    /// The most accurate point within the budget, or the cheapest one below the error bar. `None` if nothing
    /// is fast enough or nothing is known.
    pub choice: Option<usize>,
    /// Whether the error of the choice is below the error bar, so that it cannot be told from others.
    pub indistinguishable: bool,
    /// Relative error of the choice.
    pub error: Option<f64>,
    /// Half-width of the error bar of that error.
    pub error_bar: f64,
    /// The 99th percentile of its time [ms].
    pub p99_ms: Option<f64>,
    /// Overrides of the scene that the choice needs, as `key=value`.
    pub set: Vec<String>,
    /// The next point on the front that is better by more than the bar: it shows what more time would buy.
    /// Where nothing fits the budget, the fastest point.
    pub next: Option<usize>,
    /// Source of error that dominates the choice.
    pub dominant: Option<Source>,
    /// The recommendation as a sentence.
    pub words: String,
}

/// What the recommendation needs to know of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate<'a> {
    /// Time that must fit the budget [ms]: the 99th percentile.
    pub p99_ms: f64,
    /// Relative error; not finite for a run without result.
    pub error: f64,
    /// The configuration in words.
    pub words: &'a str,
    /// Sources of its error, where they are known.
    pub sources: Option<&'a Sources>,
}

/// Picks the most accurate candidate whose slow steps fit the budget as well. Where errors fall below the
/// reference's own error bar, it picks the cheapest of those.
pub fn recommend(budget_ms: f64, error_bar: f64, candidates: &[Candidate<'_>]) -> Recommendation {
    let points: Vec<(f64, f64)> = candidates.iter().map(|c| (c.p99_ms, c.error)).collect();
    let front = front(&points);
    let fitting = front.iter().take_while(|&&i| points[i].0 <= budget_ms).count();
    // Costs rise and errors fall along the front: the first point below the bar is the cheapest there.
    let hidden = front[..fitting].iter().position(|&i| points[i].1 <= error_bar);
    let choice = hidden.or(fitting.checked_sub(1)).map(|at| front[at]);
    let next = match choice {
        None => front.first().copied(),
        Some(i) => front[fitting..].iter().copied().find(|&j| points[j].1 + error_bar < points[i].1),
    };
    let dominant = choice.and_then(|i| candidates[i].sources).and_then(Sources::dominant);
    let mut advice = Recommendation {
        budget_ms,
        choice,
        indistinguishable: hidden.is_some(),
        error: choice.map(|i| points[i].1),
        error_bar,
        p99_ms: choice.map(|i| points[i].0),
        set: Vec::new(),
        next,
        dominant: dominant.filter(|_| hidden.is_none()),
        words: String::new(),
    };
    let alike = front[..fitting].iter().filter(|&&i| points[i].1 <= error_bar).count();
    advice.words = words(&advice, candidates, alike);
    advice
}

/// The sentence. `alike` counts the points that cannot be told apart.
fn words(advice: &Recommendation, candidates: &[Candidate<'_>], alike: usize) -> String {
    let (budget, bar) = (short(advice.budget_ms), percent(advice.error_bar));
    let told = |i: usize| {
        let c = candidates[i];
        format!("{} (p99 {} ms, error {} ± {bar})", c.words, short(c.p99_ms), percent(c.error))
    };
    let mut text = match (advice.choice, advice.next) {
        (Some(i), _) if advice.indistinguishable => {
            let c = candidates[i];
            let others = match alike {
                0 | 1 => String::new(),
                n => format!(", the cheapest of {n} that are indistinguishable"),
            };
            format!(
                "Within {budget} ms: {} (p99 {} ms){others}. Its error cannot be resolved: the error bar is \
                 {bar}, so the error is at most {}. Give the study more time: --within 20m.",
                c.words,
                short(c.p99_ms),
                percent(c.error + advice.error_bar)
            )
        }
        (Some(i), _) => format!("Within {budget} ms: {}.", told(i)),
        (None, Some(i)) => return format!("Nothing fits into {budget} ms; the fastest is {}.", told(i)),
        (None, None) => return "No configuration gave a result whose error is known.".to_owned(),
    };
    if let Some(source) = advice.dominant {
        text += &format!(" Its {} error dominates: {} would help most.", source.name(), source.remedy());
    }
    match advice.next {
        Some(i) => text += &format!(" With more time per step: {}.", told(i)),
        None if advice.indistinguishable => {}
        None => text += " No configuration is more accurate by more than the error bar.",
    }
    text
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
        let r = recommend(10.0, 0.02, &all);
        assert_eq!((r.choice, r.next, r.dominant), (Some(1), Some(2), Some(Source::Time)));
        assert!(!r.indistinguishable && r.error == Some(0.1));
        assert_eq!(
            r.words,
            "Within 10 ms: good (p99 8 ms, error 10 % ± 2.0 %). Its time error dominates: a shorter step or an \
             integrator of higher order would help most. With more time per step: fine (p99 30 ms, error 1.0 % ± \
             2.0 %)."
        );
    }

    #[test]
    fn below_the_bar_the_cheapest_is_named_as_such() {
        let all = [
            candidate(1.0, 0.2, "fast"),
            candidate(3.0, 0.04, "good"),
            candidate(8.0, 0.01, "better by chance"),
            candidate(30.0, 0.001, "fine"),
        ];
        let r = recommend(10.0, 0.05, &all);
        assert_eq!((r.choice, r.indistinguishable, r.next), (Some(1), true, None));
        for part in ["good (p99 3 ms)", "cheapest of 2", "bar is 5.0 %", "at most 9.0 %", "--within 20m"] {
            assert!(r.words.contains(part), "{part}: {}", r.words);
        }
        assert!(!r.words.contains("by chance"), "{}", r.words);
    }

    #[test]
    fn more_time_is_offered_only_for_what_can_be_told_apart() {
        let all = [candidate(1.0, 0.2, "fast"), candidate(20.0, 0.18, "hardly better")];
        let r = recommend(10.0, 0.05, &all);
        assert_eq!((r.choice, r.next), (Some(0), None));
    }

    #[test]
    fn nothing_fits_or_nothing_works() {
        let r = recommend(0.5, 0.01, &[candidate(1.0, 0.2, "fast")]);
        assert_eq!((r.choice, r.next), (None, Some(0)));
        assert!(r.words.starts_with("Nothing fits into 0.5 ms; the fastest is fast"));
        let nothing = recommend(1.0, f64::INFINITY, &[]);
        assert_eq!(nothing.words, "No configuration gave a result whose error is known.");
    }
}
