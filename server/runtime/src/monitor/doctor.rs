//! `scindo doctor` looks at a machine before a laboratory relies on it, and says what to do next. It starts nothing and
//! writes nothing: a port is opened for an instant, to see that it is free.

use serde::Serialize;

pub mod listen;

pub mod papers;

pub mod machine;

/// How good a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Nothing to do.
    Ok,
    /// It works, with less safety, speed or comfort.
    Warning,
    /// It cannot work.
    Wrong,
}

impl State {
    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Wrong => "wrong",
        }
    }
}

/// What was looked at, and what was found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How good it is.
    pub state: State,
    /// What was looked at: `port`, `certificate`, `key`, ….
    pub about: &'static str,
    /// What the check saw, in words.
    pub found: String,
    /// What to do about it; empty if nothing.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub next: String,
}

impl Finding {
    /// Nothing to do.
    pub fn ok(about: &'static str, found: impl Into<String>) -> Self {
        Self { state: State::Ok, about, found: found.into(), next: String::new() }
    }

    /// It works, but `next` is better.
    pub fn warning(about: &'static str, found: impl Into<String>, next: impl Into<String>) -> Self {
        Self { state: State::Warning, about, found: found.into(), next: next.into() }
    }

    /// It cannot work before `next` is done.
    pub fn wrong(about: &'static str, found: impl Into<String>, next: impl Into<String>) -> Self {
        Self { state: State::Wrong, about, found: found.into(), next: next.into() }
    }
}
