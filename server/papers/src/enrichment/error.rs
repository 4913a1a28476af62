//! Why a cut element cannot be analysed.

use thiserror::Error;

/// Why a cut element cannot be analysed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EnrichmentError {
    /// The cut leaves one side without material or goes through a node.
    #[error("the cut does not separate the nodes of the element into two sides")]
    NotCut,
    /// The mass matrix is singular in double precision.
    #[error("the mass matrix is singular: pivot {pivot} of the scaled matrix is {value:e}")]
    SingularMass {
        /// Index of the degree of freedom.
        pivot: usize,
        /// Its pivot. A mass matrix without coupling has pivots of 1.
        value: f64,
    },
}
