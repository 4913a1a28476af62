//! One tick, as a row of the log.

use nalgebra::Vector3;

/// State of hand, contact and safety at one tick.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LogRow {
    /// Loop clock [s].
    pub time_s: f64,
    /// Tip [m].
    pub position_m: Vector3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Force of the tissue before blend and safety [N].
    pub tissue_n: Vector3<f64>,
    /// Force sent to the device [N].
    pub force_n: Vector3<f64>,
    /// Number of the contact message in use.
    pub contact_seq: u64,
    /// Age of that message [ms].
    pub contact_age_ms: f64,
    /// Newest time from a pose to its contact [ms]; zero if none is known.
    pub round_trip_ms: f64,
    /// Epoch of the topology of that message.
    pub epoch: u32,
    /// Energy of the passivity observer [J].
    pub energy_j: f64,
    /// Flags of the tick, see [`crate::safety::flag`].
    pub flags: u32,
}
