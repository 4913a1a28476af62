//! Why something is not taken, for the counts and for the sender.

use scindo_proto::messages::Error;

/// Why a message is refused; the reason is counted and, for cuts, answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Stable name, such as `not-owner`.
    pub code: &'static str,
    /// What is wrong.
    pub message: String,
    /// What to do next.
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
