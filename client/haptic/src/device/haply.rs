//! Haply Inverse3, over the WebSocket of Haply's Inverse Service (3.x, port 10001).
//!
//! A thread of its own exchanges one message for one with the service: the newest force out, the newest state in. The
//! tick reads and writes through triple buffers and waits for nothing. A force that the tick has not renewed for
//! [`FORCE_VALID`] is sent as zero; without a state for [`STATE_VALID`] the device counts as gone, so that the
//! watchdog takes the force away. The thread connects again with growing pauses.
//!
//! The device measures metres in right-handed axes with z up. Where the hand is when the client starts becomes the start
//! point in the scene, and z up becomes up there. Motion is not scaled: the force would have to be, too.

pub mod service;

pub(crate) mod exchange;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use triple_buffer::{Input, Output, triple_buffer};

use self::service::Hand;
use super::{Capability, DeviceGone, DeviceState, HapticDevice};

/// Address of the service on this machine.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:10001";

/// A force that the tick has not renewed for so long is sent as zero: the loop stands still.
pub const FORCE_VALID: Duration = Duration::from_millis(20);

/// Without a state for so long the device counts as gone; the service answers within a millisecond.
pub const STATE_VALID: Duration = Duration::from_millis(50);

/// Figures of an Inverse3. The data sheet gives 10 N at the peak; what lasts and what feels clean is chosen with care:
/// 2 N·s/m of damping, hand included, and 2 ms of delay by USB and service allow 800 N/m.
pub const CAPABILITY: Capability = Capability {
    model: "haply-inverse3",
    max_force_n: 8.0,
    max_continuous_force_n: 2.0,
    max_stiffness_n_m: 1000.0,
    damping_ns_m: 2.0,
    latency_s: 2.0e-3,
    workspace_radius_m: 0.1,
};

/// Where a service is, and which of its devices is meant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HaplyAddress {
    /// Host and port.
    pub address: String,
    /// Id of the device; `None`: the first one.
    pub id: Option<String>,
}

impl HaplyAddress {
    /// Reads `[HOST[:PORT]][/ID]`, each of which may be left out.
    ///
    /// # Errors
    /// A port that is no number.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (address, id) = match text.split_once('/') {
            Some((address, id)) => (address, Some(id.to_owned()).filter(|id| !id.is_empty())),
            None => (text, None),
        };
        let address = match address.rsplit_once(':') {
            _ if address.is_empty() => DEFAULT_ADDRESS.to_owned(),
            // The end of an IPv6 address without a port.
            Some((_, end)) if end.ends_with(']') => format!("{address}:10001"),
            Some((_, port)) if port.parse::<u16>().is_ok_and(|port| port != 0) => address.to_owned(),
            Some(_) => return Err("expected haply, haply:HOST, haply:HOST:PORT or haply:HOST:PORT/ID".into()),
            None => format!("{address}:10001"),
        };
        Ok(Self { address, id })
    }
}

/// The force that the tick wants, and when it said so.
#[derive(Debug, Clone, Copy, Default)]
struct Commanded {
    /// In axes of the device [N].
    force_n: Vector3<f64>,
    at: Option<Instant>,
}

/// What the service measured last; nothing while the device is away.
#[derive(Debug, Clone, Copy, Default)]
struct Measured {
    hand: Option<(Hand, Instant)>,
}

/// From axes of the device to those of the scene.
#[derive(Debug, Clone, Copy)]
struct Frame {
    /// Where in the scene the hand starts [m].
    start_m: Vector3<f64>,
    /// Turns z of the device to up in the scene.
    turn: UnitQuaternion<f64>,
    /// Where the device was when the client started [m]; kept when it comes back.
    origin_m: Option<Vector3<f64>>,
}

impl Frame {
    fn new(start_m: Vector3<f64>, up: &Vector3<f64>) -> Self {
        let opposite = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), up).unwrap_or_else(opposite);
        Self { start_m, turn, origin_m: None }
    }

    fn state(&mut self, hand: &Hand) -> DeviceState {
        let origin_m = *self.origin_m.get_or_insert(hand.position_m);
        let [x, y, z, w] = hand.orientation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let q = self.turn * UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        DeviceState {
            position_m: self.start_m + self.turn * (hand.position_m - origin_m),
            velocity_m_s: self.turn * hand.velocity_m_s,
            orientation: [q.i, q.j, q.k, q.w],
            mode: hand.mode,
        }
    }
}

/// An Inverse3 behind its service.
pub struct HaplyDevice {
    measured: Output<Measured>,
    commanded: Input<Commanded>,
    frame: Frame,
    stop: Arc<AtomicBool>,
    exchange: Option<JoinHandle<()>>,
}

impl HaplyDevice {
    /// Starts to exchange messages with the service. The hand starts at `start_m` [m] of a scene whose up is `up`.
    ///
    /// # Errors
    /// The system cannot start another thread.
    pub fn start(address: HaplyAddress, start_m: Vector3<f64>, up: &Vector3<f64>) -> std::io::Result<Self> {
        let (measured_in, measured) = triple_buffer(&Measured::default());
        let (commanded, commanded_out) = triple_buffer(&Commanded::default());
        let stop = Arc::new(AtomicBool::new(false));
        let shared = stop.clone();
        let exchange = std::thread::Builder::new()
            .name("haptic-haply".into())
            .spawn(move || exchange::run(&address, commanded_out, measured_in, &shared))?;
        Ok(Self { measured, commanded, frame: Frame::new(start_m, up), stop, exchange: Some(exchange) })
    }
}

impl HapticDevice for HaplyDevice {
    fn capability(&self) -> Capability {
        CAPABILITY
    }

    fn read(&mut self, _elapsed_s: f64) -> Result<DeviceState, DeviceGone> {
        match self.measured.read().hand {
            Some((hand, at)) if at.elapsed() < STATE_VALID => Ok(self.frame.state(&hand)),
            _ => Err(DeviceGone),
        }
    }

    fn write(&mut self, force_n: Vector3<f64>) {
        let force_n = self.frame.turn.inverse() * force_n;
        self.commanded.write(Commanded { force_n, at: Some(Instant::now()) });
        if let Some(exchange) = &self.exchange {
            exchange.thread().unpark();
        }
    }
}

impl Drop for HaplyDevice {
    /// Sends zero force and ends the thread.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(exchange) = self.exchange.take() {
            exchange.thread().unpark();
            if exchange.join().is_err() {
                tracing::error!("the exchange with the Haply service panicked");
            }
        }
    }
}

/// A service as Haply documents it, made for tests.
#[cfg(test)]
pub(crate) mod fake;

#[cfg(test)]
mod tests;
