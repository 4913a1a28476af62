//! The reason of a refusal, for the counts and for the sender.

use scindo_proto::messages::Error;

/// A refused message. Its reason is counted and, for cuts, sent as the answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Stable name of the reason, such as `not-owner`.
    pub code: &'static str,
    /// What is wrong, with values.
    pub message: String,
    /// What the sender can do next.
    pub hint: &'static str,
}

impl From<Refusal> for Error {
    fn from(refusal: Refusal) -> Self {
        Self { code: refusal.code.to_owned(), message: refusal.message, hint: refusal.hint.to_owned() }
    }
}

pub(super) fn refuse(code: &'static str, message: String, hint: &'static str) -> Refusal {
    Refusal { code, message, hint }
}
