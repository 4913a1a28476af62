//! Errors of the program, and the exit codes they mean.

use crate::device::path::PathError;
use scindo_client::LinkError;

/// Reason why the program ends early.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// An argument that cannot be used.
    #[error("{what} = {found}: {next}")]
    Argument {
        /// The argument, as typed.
        what: &'static str,
        /// The value that was given.
        found: String,
        /// What the user can do instead.
        next: String,
    },
    /// The path of the hand cannot be followed.
    #[error(transparent)]
    Path(#[from] PathError),
    /// The network failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A file or thread could not be used.
    #[error("{what}: {source}")]
    Io {
        /// The attempted action.
        what: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The whole run passed without one contact message.
    #[error("no contact message arrived for tool '{tool}' in {seconds:.1} s; {hint}")]
    NoContact {
        /// Id of the tool.
        tool: String,
        /// Duration of the run [s].
        seconds: f64,
        /// What the user should check.
        hint: &'static str,
    },
}

impl CommandError {
    /// 2: bad input. 1: the run failed.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Argument { .. }
            | Self::Path(_)
            | Self::Link(LinkError::Config { .. } | LinkError::Key(_)) => 2,
            Self::Link(_) | Self::Io { .. } | Self::NoContact { .. } => 1,
        }
    }
}
