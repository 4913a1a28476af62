//! Constants of the loop and its safety rules: meaning, unit, reason.

/// Period of the loop [s]. 1 kHz is the norm: stiffness up to about 1 N/mm feels clean.
pub const PERIOD_S: f64 = 1.0e-3;

/// Period of the loop [ns].
pub const PERIOD_NS: u64 = 1_000_000;

/// Default hard clamp of the force [N]: a startled hand stays safe on any desktop device.
pub const DEFAULT_MAX_FORCE_N: f64 = 2.5;

/// Default slew limit [N/s]: 0.05 N per tick is felt as firm, never as a kick.
pub const DEFAULT_SLEW_N_S: f64 = 50.0;

/// Fraction of the slew limit that applies while force rises at the start of a touch (20 of 50 N/s).
pub const FIRST_CONTACT_SLEW: f64 = 0.4;

/// A touch counts as just begun for this long [s].
pub const FIRST_CONTACT_S: f64 = 0.1;

/// Below this force the tool counts as free [N]; it is a tenth of what a fingertip notices.
pub const FREE_FORCE_N: f64 = 1.0e-3;

/// Time in free space, with fresh contact messages, before force is allowed [ns].
pub const FREE_SPACE_NS: u64 = 200_000_000;

/// Rise of the gain from zero to one after engagement [ns].
pub const ENGAGE_RAMP_NS: u64 = 200_000_000;

/// Longest validity granted to a contact message [ns], whatever the server asks for. Together with the
/// shortest ramp it guarantees zero force within 200 ms of silence.
pub const MAX_VALIDITY_NS: u64 = 90_000_000;

/// Validity of a message that does not state one [ns].
pub const DEFAULT_VALIDITY_NS: u64 = 50_000_000;

/// Longest and shortest ramp-down after the validity has run out [ns].
pub const RAMP_DOWN_NS: [u64; 2] = [100_000_000, 145_000_000];

/// Silence after which force must be zero [ns], 5 ms before the promised 200 ms.
pub const SILENT_ZERO_NS: u64 = 195_000_000;

/// Silence after which the link counts as lost [ns] and the fault flag is raised.
pub const LOST_NS: u64 = 500_000_000;

/// Damping that holds the hand while the spring ramps down [N·s/m].
pub const HOLD_DAMPING_NS_M: f64 = 2.0;

/// Largest plausible motion in one tick [m]; a larger one means a broken sensor.
pub const MAX_JUMP_M: f64 = 0.020;

/// Largest plausible speed of a working hand [m/s].
pub const MAX_SPEED_M_S: f64 = 2.0;

/// Shortest blend when the contact changes [ns]: two ticks.
pub const MIN_BLEND_NS: u64 = 2_000_000;

/// Longest blend between two messages of one topology [ns]: contact at 50 Hz.
pub const MAX_BLEND_NS: u64 = 20_000_000;

/// Blend after a cut has changed the topology [ns].
pub const EPOCH_BLEND_NS: u64 = 20_000_000;

/// Horizon of the extrapolation of a surface, in simulation steps.
pub const EXTRAPOLATION_STEPS: f64 = 1.5;

/// Longest extrapolation [s], also used until two simulation times are known.
pub const MAX_EXTRAPOLATION_S: f64 = 0.030;

/// Beyond the trusted radius of a plane, its weight falls to zero over this fraction of the radius.
pub const PATCH_FADE: f64 = 0.5;

/// Fraction of the device's own damping that virtual damping may use; the rest carries stiffness.
pub const VIRTUAL_DAMPING_SHARE: f64 = 0.25;

/// Most energy that the passivity observer may bank [J]: the elastic energy of a firm press. Without this
/// bound, earlier dissipation would pay for any later activity.
pub const MAX_BANKED_ENERGY_J: f64 = 0.1;

/// Rows of the log that may wait for the writer: 8 s.
pub const LOG_QUEUE_ROWS: usize = 8192;

/// With a deadband, a pose is sent after this time even if nothing has changed [ns]: a sign of life.
pub const KEEP_ALIVE_NS: u64 = 50_000_000;

/// Poses that may wait for the sender: 64 ms. Newer poses are dropped when it is full.
pub const POSE_QUEUE: usize = 64;
