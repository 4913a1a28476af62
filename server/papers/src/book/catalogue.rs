//! The numbers that the papers print: `book/printed.toml`.

use scindo_study::report::result::Unit;
use serde::Deserialize;

/// A paper.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paper {
    /// Stable name, also of its page.
    pub id: String,
    /// Title of the paper.
    pub title: String,
    /// Authors as the paper prints them.
    pub authors: String,
    /// Year of publication.
    pub year: u32,
    /// Machine of its measurements.
    pub machine: String,
    /// How many times as fast a core of today runs the same scalar code: an assumption.
    #[serde(default = "one")]
    pub core: f64,
    /// What it is about.
    pub about: String,
    /// The numbers that it prints.
    pub number: Vec<Number>,
}

/// What makes a measured value good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Good {
    /// The printed value.
    Same,
    /// Less than the printed value.
    Less,
    /// More than the printed value.
    More,
    /// The printed value; another one is neither better nor worse.
    Told,
    /// A printed 0.
    Zero,
}

/// A printed number.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Number {
    /// Table, figure or section.
    pub place: String,
    /// The quantity, in the paper's words.
    pub what: String,
    /// Its value.
    pub printed: f64,
    unit: String,
    /// What counts as good.
    pub good: Good,
    /// Relative difference that does not count.
    #[serde(default = "twentieth")]
    pub within: f64,
    /// Where it is measured: part, table, row, column; or `stress`, case, figure.
    pub from: Option<String>,
    /// The same in the quick form of the book, if it differs; empty if that measures something smaller.
    pub quick: Option<String>,
    /// Where more is better: the same on fewer cores, for machines that do not have as many.
    pub fewer_cores: Option<String>,
    /// Factor from the measured to the printed unit.
    #[serde(default = "one")]
    pub scale: f64,
    /// Whether the paper's factor of cores applies though this is not a time.
    #[serde(default)]
    pub core_scales: bool,
    /// Why it is not measured.
    pub open: Option<String>,
    /// Why it cannot be right.
    pub refuted: Option<String>,
    /// Why the measured value is worse, or another one, where it is.
    pub because: Option<String>,
}

fn one() -> f64 {
    1.0
}

fn twentieth() -> f64 {
    0.05
}

impl Number {
    /// How it is shown.
    pub fn unit(&self) -> Unit {
        match self.unit.as_str() {
            "s" => Unit::Seconds,
            "count" => Unit::Count,
            "times" => Unit::Times,
            _ => Unit::Number,
        }
    }

    /// Where it is measured, in parts.
    pub fn source(&self, quick: bool) -> Option<Vec<&str>> {
        let from = self.quick.as_ref().filter(|_| quick).or(self.from.as_ref())?;
        (!from.is_empty()).then(|| from.split(" / ").collect())
    }

    /// Where it is measured on fewer cores, in parts.
    pub fn source_on_fewer_cores(&self) -> Option<Vec<&str>> {
        self.fewer_cores.as_ref().map(|from| from.split(" / ").collect())
    }

    /// The command that measures it.
    pub fn command(&self, quick: bool) -> Option<String> {
        let source = self.source(quick)?;
        match source[..] {
            ["stress", case, ..] => Some(format!("scindo stress --case {case}")),
            [part, ..] => Some(format!("scindo accuracy {part}{}", if quick { " --quick" } else { "" })),
            [] => None,
        }
    }

    /// The value that has to be reached on this machine: a time of the same scalar code on a core of today, where
    /// cores matter.
    pub fn bar(&self, paper: &Paper) -> f64 {
        match self.good {
            Good::Less if self.unit == "s" || self.core_scales => self.printed / paper.core,
            Good::More if self.core_scales => self.printed * paper.core,
            _ => self.printed,
        }
    }
}

#[derive(Deserialize)]
struct File {
    paper: Vec<Paper>,
}

/// All papers.
///
/// # Errors
/// A list that is not well formed.
pub fn papers() -> Result<Vec<Paper>, toml::de::Error> {
    toml::from_str::<File>(include_str!("../../book/printed.toml")).map(|file| file.paper)
}
