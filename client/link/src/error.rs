//! Errors of a link.

use std::time::Duration;

use scindo_proto::{DecodeError, KeyError};
use thiserror::Error;

/// Failure of a link or of a request over it.
#[derive(Debug, Clone, Error)]
pub enum LinkError {
    /// zenoh or the key space rejects a setting.
    #[error("cannot use {what}: {reason}")]
    Config {
        /// The setting.
        what: String,
        /// Why the setting is rejected.
        reason: String,
    },
    /// An id, realm or session cannot stand in a key.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// Nobody listens at the endpoints.
    #[error(
        "no scindo server answers at {endpoints} within {waited:?}: {reason}. \
         Start one with `scindo run SCENE --listen {first}`, or name its address with --connect"
    )]
    Unreachable {
        /// The endpoints that were tried.
        endpoints: String,
        /// The first of these endpoints.
        first: String,
        /// Time spent trying.
        waited: Duration,
        /// Zenoh's message.
        reason: String,
    },
    /// The network is up, but no server of this realm and session answers.
    #[error("no server answers '{key}': it may be down, or of another --realm or --session")]
    NoServer {
        /// The key of the request.
        key: String,
    },
    /// The server did not answer in time.
    #[error("'{key}' was not answered within {waited:?}")]
    Timeout {
        /// The key of the request.
        key: String,
        /// Time spent waiting.
        waited: Duration,
    },
    /// The server understood the request and refused it.
    #[error("{message} ({code}). {hint}")]
    Refused {
        /// Stable name of the reason.
        code: String,
        /// What is wrong.
        message: String,
        /// What the caller can do next.
        hint: String,
    },
    /// The server sent something other than the expected message.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// Zenoh failed.
    #[error("{doing}: {reason}")]
    Zenoh {
        /// The attempted action.
        doing: &'static str,
        /// Zenoh's message.
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

/// Zenoh's message without the location in its source.
pub(crate) fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or(&text).to_owned()
}
