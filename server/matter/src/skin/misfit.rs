//! Errors of joining a skin with its lips.

use thiserror::Error;

/// Why skin and lips could not be joined. It cannot happen on a conforming cut curve.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Misfit {
    /// Two parts of the cut curve run along one edge of the skin.
    #[error("two parts of the cut curve run along one edge of the skin")]
    SharedEdge,
    /// A boundary face is cut, and no fragment below it is found.
    #[error("a face of the boundary has no material below it")]
    NoPiece,
    /// An edge of the cut curve has no skin edges along it, or shares them with another.
    #[error("an edge of the cut curve has no edges of the skin of its own")]
    NoChain,
    /// An edge of the skin or of a lip has no opposite.
    #[error("an edge of the skin or of a lip has no other side")]
    OpenSeam,
}
