//! Tests of multigrid against brute force, stored numbers and known rates.

pub mod support;
mod follow;
mod galerkin;
mod levels;
mod rates;
mod reference;
mod simulated;
