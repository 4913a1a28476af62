//! What can go wrong in the server, and the exit code it means.

use std::process::ExitCode;

use scindo_proto::KeyError;
use scindo_study::StudyError;
use scindo_study::stress::StressError;
use scindo_world::format::MeshInError;
use scindo_world::results::ResultsError;
use scindo_world::scene::SceneError;
use thiserror::Error;

/// Failure of a command.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// The scene or a value in it.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A mesh file that cannot be read or written.
    #[error(transparent)]
    Mesh(#[from] MeshInError),
    /// Results that cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A mesh that cannot be written where it was asked for.
    #[error("{0}; check that the directory exists and is writable")]
    Unwritten(MeshInError),
    /// A study of accuracy.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A case that does not exist, or a page that cannot be written.
    #[error(transparent)]
    Stress(#[from] StressError),
    /// An option of the command line that cannot be used.
    #[error("{option} '{value}': {reason}. {next}")]
    Option {
        /// The option.
        option: &'static str,
        /// What was given.
        value: String,
        /// Why it cannot be used.
        reason: String,
        /// What to do instead.
        next: String,
    },
    /// Realm, session or id that cannot stand in a key.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// A port is taken or an address is not ours.
    #[error(
        "cannot listen at {endpoints}: {reason}. Another server may run there; \
         choose another address with --listen tcp/HOST:PORT (PORT and the next one are used)"
    )]
    Listen {
        /// The endpoints.
        endpoints: String,
        /// Zenoh's words.
        reason: String,
    },
    /// Zenoh does not accept something.
    #[error("{what}: {reason}")]
    Zenoh {
        /// What was tried.
        what: String,
        /// Zenoh's words.
        reason: String,
    },
    /// The browser viewer does not start.
    #[error("viewer at {address}: {reason}. Choose another address with --viewer HOST:PORT")]
    Viewer {
        /// The address.
        address: String,
        /// Why not.
        reason: String,
    },
    /// The machine refuses a thread or a signal handler.
    #[error("{what}: {reason}")]
    System {
        /// What was tried.
        what: String,
        /// The system's words.
        reason: String,
    },
    /// A thread of the server panicked.
    #[error("thread '{thread}' died; this is a defect of scindo, its message stands above")]
    Died {
        /// Name of the thread.
        thread: String,
    },
}

impl RuntimeError {
    /// 2: what was asked for is not possible as written. 1: it was, but failed.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Study(StudyError::Io { .. }) => ExitCode::from(1),
            Self::Stress(StressError::Io { .. }) => ExitCode::from(1),
            Self::Study(_) | Self::Stress(_) => ExitCode::from(2),
            Self::Scene(_) | Self::Mesh(_) | Self::Option { .. } | Self::Key(_) => ExitCode::from(2),
            _ => ExitCode::from(1),
        }
    }

    /// Stable name for `--json`.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Scene(_) | Self::Study(StudyError::Scene(_)) => "scene",
            Self::Study(_) => "study",
            Self::Stress(_) => "stress",
            Self::Option { .. } => "option",
            Self::Key(_) => "key",
            Self::Listen { .. } => "listen",
            Self::Zenoh { .. } => "zenoh",
            Self::Viewer { .. } => "viewer",
            Self::Mesh(_) => "mesh",
            Self::Unwritten(_) => "unwritten",
            Self::Results(_) => "results",
            Self::System { .. } => "system",
            Self::Died { .. } => "died",
        }
    }
}

/// What zenoh says, without the place in its source.
pub fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or(&text).to_owned()
}
