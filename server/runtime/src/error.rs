//! Errors of the server, and their exit codes.

use std::process::ExitCode;

use scindo_client::LinkError;
use scindo_proto::KeyError;
use scindo_study::StudyError;
use scindo_study::study::effects::EffectsError;
use scindo_world::format::MeshInError;
use scindo_world::results::ResultsError;
use scindo_world::scene::SceneError;
use thiserror::Error;

/// Failure of a command.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// The scene, or a value in it, is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A mesh file cannot be read or written.
    #[error(transparent)]
    Mesh(#[from] MeshInError),
    /// Results cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A mesh cannot be written to the requested file.
    #[error("{0}; check that the directory exists and is writable")]
    Unwritten(MeshInError),
    /// A study of accuracy failed.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The effects of a scene cannot be measured.
    #[error(transparent)]
    Effects(#[from] EffectsError),
    /// The program that runs a command is not there.
    #[error(
        "`scindo {command}` is run by the program {program}, which is neither beside scindo nor on the PATH. Build it with \
         `cargo build --release -p {program}`, or install the package, which holds both"
    )]
    NoSibling {
        /// The program that was looked for beside this one.
        program: &'static str,
        /// The command that it runs.
        command: &'static str,
    },
    /// An option of the command line cannot be used.
    #[error("{option} '{value}': {reason}. {next}")]
    Option {
        /// The option, as typed.
        option: &'static str,
        /// The value that was given.
        value: String,
        /// Why the value cannot be used.
        reason: String,
        /// What the user can do instead.
        next: String,
    },
    /// Realm, session or id cannot stand in a key.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// A port is taken or an address is not ours.
    #[error(
        "cannot listen at {endpoints}: {reason}. Another server may be running there; choose another address \
         with --listen tcp/HOST:PORT (PORT and the next one are used)"
    )]
    Listen {
        /// The endpoints that could not be opened.
        endpoints: String,
        /// Zenoh's message.
        reason: String,
    },
    /// Zenoh rejected something.
    #[error("{what}: {reason}")]
    Zenoh {
        /// The attempted action.
        what: String,
        /// Zenoh's message.
        reason: String,
    },
    /// The browser viewer cannot start.
    #[error("viewer at {address}: {reason}. Choose another address with --viewer HOST:PORT")]
    Viewer {
        /// The address that was tried.
        address: String,
        /// The system's message.
        reason: String,
    },
    /// A server that is looked at does not answer as it should.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The figures for a monitor cannot be served.
    #[error("cannot serve metrics at {address}: {reason}. Choose another address with --metrics")]
    Metrics {
        /// The address that was tried.
        address: String,
        /// The system's message.
        reason: String,
    },
    /// A recording cannot be written.
    #[error("cannot record into {file}: {reason}. Choose another file with --record; it must not exist yet")]
    Recording {
        /// The recording that cannot be read.
        file: String,
        /// What went wrong.
        reason: String,
    },
    /// A file is no recording.
    #[error(
        "{file} is no recording that can be read: {reason}. Give a file that `scindo run --record` wrote"
    )]
    NoRecording {
        /// The file that was named.
        file: String,
        /// What went wrong.
        reason: String,
    },
    /// A recording cannot be computed again.
    #[error("the recording cannot be computed again: {reason}")]
    Replay {
        /// What went wrong.
        reason: String,
    },
    /// An exported file cannot be written.
    #[error("cannot write {file}: {reason}. Check that the directory exists and is writable")]
    Export {
        /// The file that cannot be written.
        file: String,
        /// What went wrong.
        reason: String,
    },
    /// The system refused a thread or a signal handler.
    #[error("{what}: {reason}")]
    System {
        /// The attempted action.
        what: String,
        /// The system's message.
        reason: String,
    },
    /// A laboratory cannot be as asked.
    #[error("{0}")]
    Lab(String),
    /// A thread of the server panicked.
    #[error(
        "thread '{thread}' panicked. This is a defect of scindo; the message of the panic is printed above"
    )]
    Died {
        /// Name of the thread.
        thread: String,
    },
}

impl RuntimeError {
    /// 2: the request is impossible as written. 1: it was possible but failed.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Study(StudyError::Io { .. }) => ExitCode::from(1),
            Self::Effects(EffectsError::Body(_)) => ExitCode::from(1),
            Self::Study(_) | Self::Effects(_) => ExitCode::from(2),
            Self::Scene(_) | Self::Mesh(_) | Self::Option { .. } | Self::Key(_) | Self::Lab(_) => {
                ExitCode::from(2)
            }
            Self::NoRecording { .. } => ExitCode::from(2),
            _ => ExitCode::from(1),
        }
    }

    /// Stable name of the error in `--json` output.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Scene(_) | Self::Study(StudyError::Scene(_)) | Self::Effects(EffectsError::Scene(_)) => {
                "scene"
            }
            Self::Study(_) => "study",
            Self::Effects(_) => "effects",
            Self::Option { .. } => "option",
            Self::Key(_) => "key",
            Self::Lab(_) => "lab",
            Self::Listen { .. } => "listen",
            Self::Zenoh { .. } => "zenoh",
            Self::Viewer { .. } => "viewer",
            Self::Link(_) => "link",
            Self::Metrics { .. } => "metrics",
            Self::Mesh(_) => "mesh",
            Self::Unwritten(_) => "unwritten",
            Self::Results(_) => "results",
            Self::Recording { .. } => "recording",
            Self::NoRecording { .. } => "no-recording",
            Self::Replay { .. } => "replay",
            Self::Export { .. } => "export",
            Self::System { .. } => "system",
            Self::Died { .. } => "died",
            Self::NoSibling { .. } => "no-sibling",
        }
    }
}

/// Zenoh's message without the location in its source.
pub fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or(&text).to_owned()
}
