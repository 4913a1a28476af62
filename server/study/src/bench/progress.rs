//! What a study tells while it runs.

/// How far it is.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Progress {
    /// Case that is worked on.
    pub case: String,
    /// What is run now.
    pub what: String,
    /// Points of this case done; 0 while its reference is computed.
    pub done: usize,
    /// Points of this case in all; 0 before they are known.
    pub total: usize,
    /// When this case began and must end [s since the study began]; infinite without a budget.
    pub case_s: [f64; 2],
    /// Something to be said once, such as the estimate.
    pub note: Option<String>,
}
