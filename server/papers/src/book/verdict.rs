//! What comes of a printed number beside a measured one.

use super::catalogue::{Good, Number, Paper};

/// The verdict on a printed number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The measured value agrees.
    Reproduced,
    /// The measured value is better, on equal cores where these matter.
    Better,
    /// The printed value cannot be right, for a stated reason.
    Refuted,
    /// The measured value is another one, for a stated reason, and neither is better.
    Explained,
    /// The measured value is worse, or another one.
    Worse,
    /// There is no measured value yet.
    NotYet,
}

impl Verdict {
    /// All verdicts, the best first.
    pub const ALL: [Self; 6] =
        [Self::Reproduced, Self::Better, Self::Refuted, Self::Explained, Self::Worse, Self::NotYet];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Better => "better",
            Self::Refuted => "refuted",
            Self::Explained => "explained",
            Self::Worse => "worse",
            Self::NotYet => "not yet",
        }
    }
}

/// A value that stands for a printed 0.
const NEAR_ZERO: f64 = 0.1;

/// Judges a measured value.
pub fn judge(paper: &Paper, number: &Number, ours: Option<f64>) -> Verdict {
    let refuted = number.refuted.is_some();
    let Some(ours) = ours.filter(|ours| ours.is_finite()) else {
        // Without a measurement only a number that needs none can be refuted.
        return if refuted && number.from.is_none() { Verdict::Refuted } else { Verdict::NotYet };
    };
    let bar = number.bar(paper);
    let apart = ours / bar - 1.0;
    let verdict = match number.good {
        Good::Zero if ours < NEAR_ZERO => Verdict::Reproduced,
        Good::Zero => Verdict::Worse,
        _ if apart.abs() <= number.within => Verdict::Reproduced,
        Good::Told => Verdict::Explained,
        Good::Less if apart < 0.0 => Verdict::Better,
        Good::More if apart > 0.0 => Verdict::Better,
        _ => Verdict::Worse,
    };
    if verdict == Verdict::Worse && refuted { Verdict::Refuted } else { verdict }
}

/// The reason for a verdict that the values do not give by themselves.
pub fn reason(number: &Number, verdict: Verdict) -> Option<&str> {
    let open = number.open.as_deref().filter(|_| verdict == Verdict::NotYet);
    let because =
        number.because.as_deref().filter(|_| matches!(verdict, Verdict::Worse | Verdict::Explained));
    number.refuted.as_deref().or(open).or(because)
}
