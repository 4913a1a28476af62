//! The book: what the studies measured, beside every number that the papers print.
//!
//! The [`catalogue`] lists the printed numbers and where each of them is measured. [`measured`] finds these values in
//! the files that the studies leave, [`verdict`] compares, and [`page`] writes the site: an index, a page per paper,
//! and the cost of the effects. The book runs nothing itself; `scindo book` does, [`part`] by part.

pub mod catalogue;

pub mod measured;

pub mod verdict;

pub mod part;

mod page;

use std::io;
use std::path::{Path, PathBuf};

use scindo_study::bench::store::Origin;
use scindo_study::report::frame::put;
use serde_json::{Value, json};
use thiserror::Error;

use catalogue::{Paper, papers};
use measured::Measured;
use part::Part;
use verdict::{Verdict, judge, reason};

/// Why a book could not be written.
#[derive(Debug, Error)]
pub enum BookError {
    /// A file cannot be read or written.
    #[error("cannot write {}: {source}; check that the directory is writable and has room", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        source: io::Error,
    },
    /// The list of printed numbers is broken, which a test keeps from happening.
    #[error("the list of printed numbers cannot be read: {0}")]
    Catalogue(#[from] toml::de::Error),
}

/// How many rows of a paper have which verdict, in the order of [`Verdict::ALL`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tally {
    /// Id of the paper.
    pub paper: String,
    /// Rows per verdict.
    pub counts: [usize; Verdict::ALL.len()],
}

impl Tally {
    /// For programs.
    pub fn to_json(&self) -> Value {
        let counts = Verdict::ALL.iter().zip(self.counts).map(|(v, n)| (v.name().to_owned(), json!(n)));
        json!({ "paper": self.paper, "rows": counts.collect::<serde_json::Map<_, _>>() })
    }
}

/// Writes the pages into `directory` from what the parts in it have left. A page can be written after every part.
///
/// # Errors
/// A file that cannot be written.
pub fn write(
    directory: &Path,
    parts: &[Part],
    origin: &Origin,
    quick: bool,
) -> Result<Vec<Tally>, BookError> {
    let papers = papers()?;
    let measured = Measured::read(directory, parts);
    let tallies: Vec<Tally> = papers.iter().map(|paper| tally(paper, &measured, quick)).collect();
    let rows = papers.iter().map(|paper| rows(paper, &measured, quick));
    let book = json!({
        "origin": origin,
        "quick": quick,
        "papers": rows.collect::<Vec<_>>(),
        "tallies": tallies.iter().map(Tally::to_json).collect::<Vec<_>>(),
    });
    let of_papers =
        papers.iter().map(|paper| (page::name(paper), page::paper(paper, &measured, origin, quick)));
    let of_all = [
        ("effects.html".to_owned(), page::effects(&measured)),
        ("index.html".to_owned(), page::index(&papers, &tallies, parts, &measured, (origin, quick))),
        ("book.json".to_owned(), format!("{book:#}\n")),
    ];
    put(directory, of_papers.chain(of_all)).map_err(|(path, source)| BookError::Io { path, source })?;
    Ok(tallies)
}

fn tally(paper: &Paper, measured: &Measured, quick: bool) -> Tally {
    let mut counts = [0; Verdict::ALL.len()];
    for number in &paper.number {
        let verdict = judge(paper, number, measured.of(paper, number, quick));
        if let Some(i) = Verdict::ALL.iter().position(|v| *v == verdict) {
            counts[i] += 1;
        }
    }
    Tally { paper: paper.id.clone(), counts }
}

fn rows(paper: &Paper, measured: &Measured, quick: bool) -> Value {
    let row = |number: &catalogue::Number| {
        let ours = measured.of(paper, number, quick);
        let verdict = judge(paper, number, ours);
        json!({
            "place": number.place,
            "what": number.what,
            "printed": number.printed,
            "ours": ours,
            "ratio": ours.filter(|_| number.printed != 0.0).map(|ours| ours / number.printed),
            "verdict": verdict.name(),
            "reason": reason(number, verdict),
        })
    };
    json!({ "id": paper.id, "machine": paper.machine, "rows": paper.number.iter().map(row).collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests;
