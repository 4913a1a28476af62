//! The mechanics held against independent solutions, closed forms and orders of convergence.

#![allow(clippy::unwrap_used)]
#![allow(non_snake_case)] // the symbols of the field: F, P, K, M

mod bodies;
mod critical_step;
mod cut_through_elements;
mod explicit;
mod ruined_starts;
mod spinning;
mod time_orders;
