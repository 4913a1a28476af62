//! What people see of a machine and of a server: `scindo doctor`, `scindo top`, and figures for a monitor of the
//! laboratory.

pub mod doctor;
pub mod metrics;
pub mod top;
