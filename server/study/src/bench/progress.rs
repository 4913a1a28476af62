//! What a study reports while it runs.

/// Present state of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Progress {
    /// Name of the present case.
    pub case: String,
    /// The present run in words.
    pub what: String,
    /// Finished points of this case; 0 while its reference is computed.
    pub done: usize,
    /// All points of this case; 0 before they are known.
    pub total: usize,
    /// When this case began and must end [s since the start of the study]; infinite without a budget.
    pub case_s: [f64; 2],
    /// A message to show once, such as the estimate of the duration.
    pub note: Option<String>,
}
