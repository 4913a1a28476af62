//! Malformed input against everything that reads from outside.

#![allow(clippy::unwrap_used)]

mod files;
mod wire;
