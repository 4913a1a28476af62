//! Output of a run: every tick as a line of CSV, and a plot of its force.

pub mod row;

pub mod force_plot;

pub mod recorder;
