//! The mechanics held against independent solutions, closed forms and orders of convergence.

#![allow(clippy::unwrap_used)]

mod critical_step;
