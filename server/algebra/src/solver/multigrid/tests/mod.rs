//! Tests of multigrid against brute force, stored numbers and known rates.

pub(super) mod support;
mod follow;
mod galerkin;
mod levels;
mod rates;
mod reference;
mod simulated;
