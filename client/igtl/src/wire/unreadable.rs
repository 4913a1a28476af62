//! What is wrong with a message.

/// Why one message cannot be read. The next one can.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unreadable {
    /// The check sum is wrong.
    #[error("{kind} '{device}': check sum {found:016x} instead of {stated:016x}")]
    CheckSum {
        /// Type of the message.
        kind: String,
        /// Name of the device.
        device: String,
        /// What the header says.
        stated: u64,
        /// What the body gives.
        found: u64,
    },
    /// Less content than the type needs.
    #[error("{kind}: {needed} more bytes are needed, {found} are left")]
    Short {
        /// Type of the message.
        kind: &'static str,
        /// Bytes of the next field.
        needed: usize,
        /// Bytes that are left.
        found: usize,
    },
    /// The lengths in an extended header exceed the body.
    #[error("extended header: {stated} bytes around the content of a body of {body}")]
    Extended {
        /// Length of extended header and metadata [bytes].
        stated: u64,
        /// Length of the body [bytes].
        body: usize,
    },
    /// A number that is not finite.
    #[error("{kind}: entry {entry} of a transform is {value}")]
    NotFinite {
        /// Type of the message.
        kind: &'static str,
        /// Number of the entry.
        entry: usize,
        /// The value, as text.
        value: String,
    },
    /// Content whose length fits no number of tools, or too many.
    #[error("TDATA: {bytes} bytes of content; allowed are 70 for each of at most {most} tools")]
    Tracking {
        /// Length of the content [bytes].
        bytes: usize,
        /// Most tools of a message.
        most: usize,
    },
}
