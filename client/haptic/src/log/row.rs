//! One tick as the log keeps it.

use nalgebra::Vector3;

/// State of hand, contact and safety at one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogRow {
    /// Loop clock [s].
    pub time_s: f64,
    /// Tip [m].
    pub position_m: Vector3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Force of the tissue before blend and safety [N].
    pub tissue_n: Vector3<f64>,
    /// Force that left [N].
    pub force_n: Vector3<f64>,
    /// Contact message in use.
    pub contact_seq: u64,
    /// Its age [ms].
    pub contact_age_ms: f64,
    /// Its topology.
    pub epoch: u32,
    /// Energy of the passivity observer [J].
    pub energy_j: f64,
    /// See [`crate::safety::flag`].
    pub flags: u32,
}
