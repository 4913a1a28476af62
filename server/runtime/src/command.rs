//! The commands, one file each.

pub mod run;

pub mod check;

pub mod mesh;

pub mod accuracy;

pub mod stress;
