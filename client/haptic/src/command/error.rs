//! Errors of the program, and the exit codes they mean.

use crate::device::path::PathError;
use scindo_client::LinkError;

/// Why the program ends early.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// An argument that cannot be used.
    #[error("{what} = {found}: {next}")]
    Argument {
        /// Which.
        what: &'static str,
        /// What stood there.
        found: String,
        /// What to do.
        next: String,
    },
    /// The path of the hand.
    #[error(transparent)]
    Path(#[from] PathError),
    /// The network.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A file or thread.
    #[error("{what}: {source}")]
    Io {
        /// What was tried.
        what: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The whole run passed without one contact message.
    #[error("no contact message arrived for tool '{tool}' in {seconds:.1} s; {hint}")]
    NoContact {
        /// The tool.
        tool: String,
        /// How long.
        seconds: f64,
        /// What to look at.
        hint: &'static str,
    },
}

impl CommandError {
    /// 2: bad input; 1: the thing asked for failed.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Argument { .. }
            | Self::Path(_)
            | Self::Link(LinkError::Config { .. } | LinkError::Key(_)) => 2,
            Self::Link(_) | Self::Io { .. } | Self::NoContact { .. } => 1,
        }
    }
}
