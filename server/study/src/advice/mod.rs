//! What the points of a case tell: which of them nothing beats, where their errors come from, and which one to
//! take for a time budget.

pub mod pareto;

pub mod sources;

pub mod recommend;
