//! Why a skin may not fit its lips.

use thiserror::Error;

/// Why skin and lips could not be sewn together. A conforming cut curve excludes it.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Misfit {
    /// Two parts of the cut curve run along one edge of the skin.
    #[error("two parts of the cut curve run along one edge of the skin")]
    SharedEdge,
    /// A face of the boundary is cut and no fragment below it is found.
    #[error("a face of the boundary has no material below it")]
    NoPiece,
    /// An edge of the cut curve has no edges of the skin along it, or two have the same.
    #[error("an edge of the cut curve has no edges of the skin of its own")]
    NoChain,
    /// An edge of the skin or of a lip stays open.
    #[error("an edge of the skin or of a lip has no other side")]
    OpenSeam,
}
