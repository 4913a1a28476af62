//! The haptic client of scindo: a 1 kHz loop beside a device, on a local contact model.
//!
//! The server sends planes with a linearised force (*contact model*), 200 times a second or more. It never
//! streams a force. This crate renders the force from the newest model at 1 kHz. Network delay therefore ages
//! the model but never sits inside the stiff loop.
//!
//! # Layout, in the order of the data
//! * [`device`]: measures the hand; the simulated device and the path that its hand follows; Haply
//!   Inverse3; a list of what is there.
//! * [`contact`]: the newest message, parsed, ordered and handed over without a lock, and the force of the
//!   tissue at the present tip.
//! * [`virtual_coupling`]: stiffness and damping that the device can render passively.
//! * [`blend`]: force continuity when the model changes.
//! * [`safety`]: when force is allowed (watchdog, engagement), energy (tank, passivity), clamp and slew.
//! * [`tick`]: one millisecond, the table of contents of the client.
//! * [`haptic_loop`]: absolute deadlines, and [`statistics`] of the run.
//! * [`log`]: every tick as a line of CSV, written by another thread, and the force plot at the end of the
//!   run.
//! * [`live`]: figures shown while the loop runs.
//! * [`link`]: contact messages in, poses that are [worth sending](link::deadband) out, on threads of their own.
//! * [`command`]: the command line and the summary.
//!
//! Invariants: the tick takes no lock, allocates nothing and waits for nothing · no rule of the
//! safety stage can be undone by a later stage · a force is never extrapolated beyond its validity.

pub mod constants;

pub mod clock;

pub mod device;

pub mod statistics;

pub mod contact;

pub mod safety;

pub mod virtual_coupling;

pub mod blend;

pub mod log;

pub mod live;

pub mod link;

pub mod tick;

pub mod haptic_loop;

pub mod command;
