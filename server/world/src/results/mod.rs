//! Results on disk: summary, probes and fields.
