//! Why a connection to a peer ends.

use std::time::Duration;

use scindo_client::LinkError;

use crate::wire::header::Broken;

/// Why a connection ends.
#[derive(Debug, thiserror::Error)]
pub enum Ended {
    /// The peer closed it.
    #[error("the peer closed the connection")]
    Closed,
    /// The network failed.
    #[error("the connection failed: {0}")]
    Io(#[from] std::io::Error),
    /// The peer sent what cannot be read.
    #[error(transparent)]
    Broken(#[from] Broken),
    /// The peer reads nothing.
    #[error("the peer has read nothing for {0:?}")]
    Slow(Duration),
    /// The server cannot be reached.
    #[error(transparent)]
    Link(#[from] LinkError),
}
