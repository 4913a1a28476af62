//! What a run leaves behind: every tick as a line of CSV, and a picture of its force.

pub mod row;

pub mod force_plot;

pub mod recorder;
