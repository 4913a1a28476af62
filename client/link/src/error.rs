//! What can go wrong on a link.

use std::time::Duration;

use scindo_proto::{DecodeError, KeyError};
use thiserror::Error;

/// Failure of a link or of something asked over it.
#[derive(Debug, Clone, Error)]
pub enum LinkError {
    /// A setting that zenoh or the key space does not accept.
    #[error("cannot use {what}: {reason}")]
    Config {
        /// The setting.
        what: String,
        /// Why not.
        reason: String,
    },
    /// An id, realm or session that cannot stand in a key.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// Nobody listens at the endpoints.
    #[error(
        "no scindo server answers at {endpoints} within {waited:?}: {reason}. \
         Start one with `scindo run SCENE --listen {first}`, or name its address with --connect"
    )]
    Unreachable {
        /// The endpoints tried.
        endpoints: String,
        /// The first of them.
        first: String,
        /// Time spent trying.
        waited: Duration,
        /// Zenoh's words.
        reason: String,
    },
    /// The network is up, but no server of this realm and session answers.
    #[error("no server answers '{key}': it may be down, or of another --realm or --session")]
    NoServer {
        /// The key that was asked.
        key: String,
    },
    /// The server did not answer in time.
    #[error("'{key}' was not answered within {waited:?}")]
    Timeout {
        /// The key that was asked.
        key: String,
        /// Time spent waiting.
        waited: Duration,
    },
    /// The server understood and refused.
    #[error("{message} ({code}). {hint}")]
    Refused {
        /// Stable name of the reason.
        code: String,
        /// What is wrong.
        message: String,
        /// What to do next.
        hint: String,
    },
    /// The server sent something that is not the expected message.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// Zenoh failed.
    #[error("{doing}: {reason}")]
    Zenoh {
        /// What was tried.
        doing: &'static str,
        /// Zenoh's words.
        reason: String,
    },
    /// The link was dropped while somebody waited on it.
    #[error("the link is closed")]
    Closed,
}

impl LinkError {
    pub(crate) fn zenoh(doing: &'static str) -> impl FnOnce(zenoh::Error) -> Self {
        move |e| Self::Zenoh { doing, reason: words(&e) }
    }
}

/// What zenoh says, without the place in its source.
pub(crate) fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or(&text).to_owned()
}
