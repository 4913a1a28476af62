//! A right answer, and how well it is known.

use serde::Serialize;

use crate::trial::series::Series;

/// The reference of a case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reference {
    /// Displacements and energy.
    #[serde(skip)]
    pub series: Series,
    /// Value of the goal, if it is known better than the field.
    pub goal: Option<f64>,
    /// Relative half-width of the error bar. Smaller errors cannot be told apart.
    pub error_bar: f64,
    /// Law with which the reference was computed.
    pub law: String,
    /// Origin of the reference, in words.
    pub source: String,
}
