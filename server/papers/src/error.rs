//! Errors of the commands, and their exit codes.

use std::process::ExitCode;

use scindo::error::RuntimeError;
use thiserror::Error;

use crate::book::BookError;
use crate::stress::StressError;

/// Failure of a command.
#[derive(Debug, Error)]
pub enum PapersError {
    /// What fails in `scindo` too: a scene, an option, the study of accuracy, effects.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// A hard case does not exist, or its page cannot be written.
    #[error(transparent)]
    Stress(#[from] StressError),
    /// The pages of the book cannot be written.
    #[error(transparent)]
    Book(#[from] BookError),
}

impl PapersError {
    /// 2: the request is impossible as written. 1: it was possible but failed.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Runtime(error) => error.exit_code(),
            Self::Stress(StressError::Io { .. }) | Self::Book(_) => ExitCode::from(1),
            Self::Stress(_) => ExitCode::from(2),
        }
    }

    /// Stable name of the error in `--json` output.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Runtime(error) => error.code(),
            Self::Stress(_) => "stress",
            Self::Book(_) => "book",
        }
    }
}
