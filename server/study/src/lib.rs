//! Experiments and their reports: accuracy against time.
