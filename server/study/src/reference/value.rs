//! A right answer, and how well it is known.

use serde::Serialize;

use crate::trial::series::Series;

/// The reference of a case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reference {
    /// The field.
    #[serde(skip)]
    pub series: Series,
    /// The goal, where it is known better than the field.
    pub goal: Option<f64>,
    /// Relative half-width of its error bar: below it no error can be told.
    pub error_bar: f64,
    /// The law it was computed with.
    pub law: String,
    /// Where it comes from, in words.
    pub source: String,
}
