//! What can be wrong with a scene: where, what was found, what is allowed, what to do next.

use std::fmt;

use thiserror::Error;

use crate::quantity::coordinates;

/// Where in a scene a problem lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// File name as given by the user, or `scene` for text without a file.
    pub file: String,
    /// Line, counted from 1; unknown for JSON and for overrides of the command line.
    pub line: Option<usize>,
    /// Key path such as `body.beam.poisson`; tables of an array go by their id or index.
    pub key: String,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        Ok(())
    }
}

/// What is wrong.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Fault {
    /// The text is not TOML or JSON.
    #[error("not readable: {message}")]
    Syntax {
        /// What the parser says.
        message: String,
    },
    /// A key that the format does not know.
    #[error("unknown key `{key}`{}", hint(key, suggestion, known))]
    UnknownKey {
        /// The key found.
        key: String,
        /// The likely meant key.
        suggestion: Option<String>,
        /// All keys allowed here.
        known: Vec<String>,
    },
    /// A key that must be there.
    #[error("key `{key}` is missing: {meaning}")]
    MissingKey {
        /// The missing key.
        key: String,
        /// What it says.
        meaning: String,
    },
    /// A value of the wrong type.
    #[error("expected {expected}, found {found}")]
    WrongType {
        /// Type that is allowed.
        expected: String,
        /// Value that stands there.
        found: String,
    },
    /// Infinity or not-a-number.
    #[error("found {found}, but every number must be finite")]
    NotFinite {
        /// Value that stands there.
        found: String,
    },
    /// A value out of range.
    #[error("found {found}, allowed: {allowed}; {next}")]
    OutOfRange {
        /// Value that stands there.
        found: String,
        /// The allowed range.
        allowed: String,
        /// What to do.
        next: String,
    },
    /// A word out of a closed list that is not on the list.
    #[error("unknown value `{found}`{}", hint(found, suggestion, known))]
    UnknownValue {
        /// Value that stands there.
        found: String,
        /// The likely meant value.
        suggestion: Option<String>,
        /// All values.
        known: Vec<String>,
    },
    /// A table that must hold exactly one of several keys.
    #[error("needs exactly one of {}, found {}", one_of.join(", "), if found.is_empty() { "none".into() } else { found.join(" and ") })]
    Choice {
        /// The keys found.
        found: Vec<String>,
        /// The keys to choose from.
        one_of: Vec<String>,
    },
    /// The same id twice.
    #[error("the id `{id}` is taken already; ids are unique among {among}")]
    DuplicateId {
        /// The id.
        id: String,
        /// What has this id.
        among: &'static str,
    },
    /// A name that nothing in the scene has.
    #[error("no {what} is called `{found}`{}", hint(found, suggestion, known))]
    UnknownName {
        /// What is looked for.
        what: &'static str,
        /// The name that stands there.
        found: String,
        /// The likely meant name.
        suggestion: Option<String>,
        /// All names.
        known: Vec<String>,
    },
    /// A file that cannot be read.
    #[error("cannot read `{path}`: {reason}; {next}")]
    File {
        /// The path as resolved.
        path: String,
        /// Why.
        reason: String,
        /// What to do.
        next: String,
    },
    /// A mesh that cannot be simulated.
    #[error("{reason}")]
    Mesh {
        /// Why, with counts.
        reason: String,
    },
    /// A region without any node.
    #[error("selects no node; the body reaches from {} to {} m", coordinates(min_m), coordinates(max_m))]
    EmptySelection {
        /// Lower corner of the body's bounding box [m].
        min_m: [f64; 3],
        /// Upper corner of the body's bounding box [m].
        max_m: [f64; 3],
    },
    /// A probe beside its body.
    #[error(
        "the point {point_m:?} lies outside the body, {distance_m:.3e} m away from it; the nearest point inside is {}",
        coordinates(nearest_m)
    )]
    OutsideBody {
        /// The point asked for [m].
        point_m: [f64; 3],
        /// The nearest point of the body [m].
        nearest_m: [f64; 3],
        /// How far away that is [m].
        distance_m: f64,
    },
    /// Two values that do not fit each other.
    #[error("{what}; {next}")]
    Conflict {
        /// What does not fit.
        what: String,
        /// What to do.
        next: String,
    },
}

/// ", did you mean `x`?" or the list of what is known.
fn hint(key: &str, suggestion: &Option<String>, known: &[String]) -> String {
    match suggestion {
        Some(word) if word == key => format!("; `{key}` stands at the top level of a scene, in no table"),
        Some(word) => format!(", did you mean `{word}`?"),
        None if known.is_empty() => String::new(),
        None => format!("; known here: {}", known.join(", ")),
    }
}

/// One thing wrong with a scene.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{place}: {fault}")]
pub struct Problem {
    /// Where.
    pub place: Place,
    /// What.
    pub fault: Fault,
}

/// Everything wrong with a scene, in the order of its lines.
#[derive(Debug, Clone, PartialEq, Error)]
pub struct SceneError {
    /// At least one problem.
    pub problems: Vec<Problem>,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            if i > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

/// The known word nearest to `found`, if any is near enough to be a slip of the pen.
pub(crate) fn nearest_word<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    known
        .into_iter()
        .map(|word| (strsim::jaro_winkler(&found.to_lowercase(), word), word))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, word)| word.to_owned())
}
