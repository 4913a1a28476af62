//! The mechanics held against independent solutions, closed forms and orders of convergence.

#![allow(clippy::unwrap_used)]

mod bodies;
mod critical_step;
mod explicit;
mod spinning;
mod time_orders;
