//! A simulated device in a hand: inertia, damping, quantised position, amplifier lag.
//!
//! m a = k_h (p*(t) − x) + b_h (v*(t) − v) − b_d v + f_a, τ_a ḟ_a = f − f_a
//!
//! p*: path that the hand means to follow; f: force that the client commands; f_a: force that the amplifier
//! gives. It is integrated by symplectic Euler in a tenth of a tick. The client sees the position in steps of
//! the encoder, and a filtered difference of it as velocity.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::Vector3;
use scindo_haptic::constants::PERIOD_S;
use scindo_haptic::device::simulated::CAPABILITY;
use scindo_haptic::device::{Capability, DeviceGone, DeviceState, HapticDevice, ToolMode};

/// Steps of the device per tick.
const SUBSTEPS: usize = 10;
/// Step of the encoder at the tip [m]; a Touch resolves 55 µm, an Inverse3 about 10 µm.
const ENCODER_M: f64 = 20e-6;
/// Time constant of the amplifier [s].
pub const AMPLIFIER_S: f64 = 1e-3;
/// Weight of the newest difference in the velocity, a low pass of about 40 Hz.
const VELOCITY_WEIGHT: f64 = 0.2;
/// Moving mass of the device [kg].
const MASS_KG: f64 = 0.05;
/// Its damping [N·s/m].
pub const DAMPING_NS_M: f64 = 3.0;

/// Impedance of a hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    /// How it holds the tool.
    pub name: &'static str,
    /// Stiffness [N/m].
    pub stiffness_n_m: f64,
    /// Damping [N·s/m].
    pub damping_ns_m: f64,
    /// Mass that moves with the tool [kg].
    pub mass_kg: f64,
}

/// The hands of the table, from the softest grip to the stiffest.
pub const HANDS: [Hand; 5] = [
    Hand { name: "fingertip", stiffness_n_m: 50.0, damping_ns_m: 2.0, mass_kg: 0.05 },
    Hand { name: "loose pen", stiffness_n_m: 150.0, damping_ns_m: 4.0, mass_kg: 0.1 },
    Hand { name: "pen", stiffness_n_m: 300.0, damping_ns_m: 8.0, mass_kg: 0.2 },
    Hand { name: "firm", stiffness_n_m: 600.0, damping_ns_m: 15.0, mass_kg: 0.5 },
    Hand { name: "clenched", stiffness_n_m: 1000.0, damping_ns_m: 30.0, mass_kg: 1.0 },
];

/// State of the simulated device.
#[derive(Debug, Clone, Copy, Default)]
pub struct Body {
    /// Tip [m].
    pub position_m: Vector3<f64>,
    /// Its velocity [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// State as the client saw it last [m], [m/s].
    pub measured_m: Vector3<f64>,
    /// Velocity that the client saw last [m/s].
    pub measured_m_s: Vector3<f64>,
    /// Work of the amplifier's force on the hand so far [J].
    pub work_j: f64,
    commanded_n: Vector3<f64>,
    given_n: Vector3<f64>,
    time_s: f64,
}

/// A device whose state the experiment can read.
pub struct BenchDevice {
    hand: Hand,
    target: fn(f64) -> Vector3<f64>,
    mode: fn(f64) -> ToolMode,
    body: Arc<Mutex<Body>>,
}

/// The experiment's view of a device.
pub struct Probe(Arc<Mutex<Body>>);

impl Probe {
    /// The present state.
    pub fn body(&self) -> Body {
        *lock(&self.0)
    }
}

fn lock(body: &Mutex<Body>) -> MutexGuard<'_, Body> {
    body.lock().unwrap_or_else(PoisonError::into_inner)
}

impl BenchDevice {
    /// A device at rest at the start of the path `target` [m], which `hand` follows over time [s].
    pub fn new(hand: Hand, target: fn(f64) -> Vector3<f64>, mode: fn(f64) -> ToolMode) -> (Self, Probe) {
        let start = target(0.0);
        let body = Body { position_m: start, measured_m: quantised(start), ..Body::default() };
        let body = Arc::new(Mutex::new(body));
        (Self { hand, target, mode, body: Arc::clone(&body) }, Probe(body))
    }
}

fn quantised(p: Vector3<f64>) -> Vector3<f64> {
    p.map(|x| (x / ENCODER_M).round() * ENCODER_M)
}

impl Body {
    fn advance(&mut self, hand: &Hand, target: fn(f64) -> Vector3<f64>, dt: f64) {
        let to = target(self.time_s + dt);
        let speed = (to - target(self.time_s)) / dt;
        let grip =
            hand.stiffness_n_m * (to - self.position_m) + hand.damping_ns_m * (speed - self.velocity_m_s);
        self.given_n += (self.commanded_n - self.given_n) * (1.0 - (-dt / AMPLIFIER_S).exp());
        let force = grip - DAMPING_NS_M * self.velocity_m_s + self.given_n;
        self.velocity_m_s += force * (dt / (hand.mass_kg + MASS_KG));
        self.position_m += self.velocity_m_s * dt;
        self.work_j += self.given_n.dot(&self.velocity_m_s) * dt;
        self.time_s += dt;
    }
}

impl HapticDevice for BenchDevice {
    fn capability(&self) -> Capability {
        Capability { model: "bench", latency_s: AMPLIFIER_S, ..CAPABILITY }
    }

    fn read(&mut self, elapsed_s: f64) -> Result<DeviceState, DeviceGone> {
        let mut body = lock(&self.body);
        let dt = PERIOD_S / SUBSTEPS as f64;
        for _ in 0..(elapsed_s / dt).round() as usize {
            body.advance(&self.hand, self.target, dt);
        }
        let seen = quantised(body.position_m);
        let difference = (seen - body.measured_m) / elapsed_s;
        body.measured_m_s = body.measured_m_s.lerp(&difference, VELOCITY_WEIGHT);
        body.measured_m = seen;
        Ok(DeviceState {
            position_m: seen,
            velocity_m_s: body.measured_m_s,
            orientation: [0.0, 0.0, 0.0, 1.0],
            mode: (self.mode)(body.time_s),
        })
    }

    fn write(&mut self, force_n: Vector3<f64>) {
        lock(&self.body).commanded_n = force_n;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_force_displaces_every_hand_by_its_stiffness_and_does_that_work() {
        for hand in HANDS {
            let (mut device, probe) = BenchDevice::new(hand, |_| Vector3::zeros(), |_| ToolMode::Touch);
            device.write(Vector3::new(0.0, 0.0, 0.5));
            for _ in 0..6000 {
                device.read(PERIOD_S).unwrap();
            }
            let (body, sag) = (probe.body(), 0.5 / hand.stiffness_n_m);
            assert!((body.position_m.z - sag).abs() < 1e-3 * sag, "{}: {}", hand.name, body.position_m.z);
            assert!((body.work_j - 0.5 * sag).abs() < 0.02 * 0.5 * sag, "{}: {}", hand.name, body.work_j);
            assert!((body.measured_m - body.position_m).norm() <= ENCODER_M);
        }
    }
}
