//! The safety stage: when force is allowed, how much of it, and how fast it may change.
//!
//! Order: [`tank`] (energy of new models) → [`watchdog`] (device faults, freshness, engagement) → [`passivity`]
//! (energy of the output) → [`limiter`] (slew and clamp). The limiter is last, so that no later stage can undo
//! it. Tank and passivity observer account for the force that was really sent.

pub mod tank;

pub mod watchdog;

pub mod passivity;

pub mod limiter;

/// Flags of one tick. `fault_flags` of a pose carries [`FAULTS`] of them.
pub mod flag {
    /// Force is not allowed yet: the tool must first be in free space.
    pub const WAITING: u32 = 1;
    /// The contact is older than its validity. Force ramps down or is zero.
    pub const STALE: u32 = 1 << 1;
    /// No contact for more than half a second.
    pub const LOST: u32 = 1 << 2;
    /// The device reported a value that is not finite.
    pub const NOT_FINITE: u32 = 1 << 3;
    /// The device reported an implausible jump.
    pub const JUMP: u32 = 1 << 4;
    /// The device moved faster than a working hand can.
    pub const OVER_SPEED: u32 = 1 << 5;
    /// Damping was injected to keep the output passive.
    pub const PASSIVITY: u32 = 1 << 6;
    /// The force was clamped.
    pub const CLAMPED: u32 = 1 << 7;
    /// The force was held back by the slew limit.
    pub const SLEWED: u32 = 1 << 8;
    /// Ticks were missed before this one.
    pub const MISSED: u32 = 1 << 9;
    /// The device did not answer.
    pub const GONE: u32 = 1 << 10;

    /// The force was held back by the energy tank.
    pub const UNPAID: u32 = 1 << 11;

    /// Faults of the device: the force is cut to zero at once.
    pub const DEVICE_FAULTS: u32 = NOT_FINITE | JUMP | OVER_SPEED | GONE;
    /// Flags that the server receives.
    pub const FAULTS: u32 = STALE | LOST | DEVICE_FAULTS;
}
