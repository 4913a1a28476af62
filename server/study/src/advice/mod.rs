//! What the points of a case show: which of them form the Pareto front, where their errors come from, and
//! which one to use within a time budget.

pub mod pareto;

pub mod sources;

pub mod recommend;
