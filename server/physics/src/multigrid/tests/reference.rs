//! The reference cube R7.
