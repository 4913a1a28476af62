//! Queries on surfaces: pairs, closest points, sweeps and impacts, by every method.

#![allow(clippy::unwrap_used)]

mod closest;
mod continuous;
mod methods;
mod pairs;
mod refit;
mod shapes;
mod sweep;

#[global_allocator]
static ALLOCATOR: scindo_allocations::Counting = scindo_allocations::Counting;
