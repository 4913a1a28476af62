//! Results on disk: summary, probes and fields.

pub mod vtu;
