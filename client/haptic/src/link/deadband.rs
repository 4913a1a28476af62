//! Which poses are worth sending: those that differ from the last one sent by more than a deadband.

use nalgebra::Vector3;

use crate::constants::KEEP_ALIVE_NS;
use crate::device::{DeviceState, ToolMode};

/// A pose is withheld while it differs less than this from the last one sent.
///
/// The server goes on with the last pose that it has, so its tool is never further than `position_m` from where the
/// hand was when a pose was due. Where tissue has a stiffness of k, its force is then wrong by k · `position_m` at
/// most. The velocity belongs to the pose: what its change would carry the tool away before the next sign of life
/// counts as a distance too, so a hand that stops is told of at once.
///
/// While poses are withheld the server keeps the last one, and its tissue relaxes around it. The client reckons with
/// that ([`contact::relaxation`](crate::contact::relaxation)), so that nothing relaxes twice.
///
/// # Source
/// Hinterseer, Hirche, Chaudhuri, Steinbach, Buss 2008, *Perception-based data reduction and transmission of haptic
/// data in telepresence and teleaction systems*, IEEE Transactions on Signal Processing 56(2). There the deadband is
/// a share of the signal (Weber). Positions have no natural zero, so here it is a length and an angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deadband {
    /// Distance [m].
    pub position_m: f64,
    /// Angle [rad].
    pub angle_rad: f64,
}

/// The deadband around the last pose that was sent.
#[derive(Debug, Clone)]
pub(crate) struct Withholding {
    deadband: Deadband,
    last: Option<(DeviceState, u64)>,
}

impl Withholding {
    /// Nothing has been sent yet, so the first pose is.
    pub(crate) fn new(deadband: Deadband) -> Self {
        Self { deadband, last: None }
    }

    /// Whether the server has to know of this pose: after 50 ms in any case, as a sign of life.
    pub(crate) fn lets_pass(&self, state: &DeviceState, now_ns: u64) -> bool {
        let Some((last, sent_ns)) = &self.last else { return true };
        now_ns.saturating_sub(*sent_ns) >= KEEP_ALIVE_NS
            || self.is_urgent(state.mode)
            || self.differs(last, state)
    }

    /// Whether the mode is another one than the server knows, because a button was pressed or released. Such a pose
    /// does not wait until one is due.
    pub(crate) fn is_urgent(&self, mode: ToolMode) -> bool {
        self.last.as_ref().is_some_and(|(last, _)| last.mode != mode)
    }

    /// Notes the pose that is sent.
    pub(crate) fn sent(&mut self, state: &DeviceState, now_ns: u64) {
        self.last = Some((*state, now_ns));
    }

    fn differs(&self, last: &DeviceState, state: &DeviceState) -> bool {
        let Deadband { position_m, angle_rad } = self.deadband;
        let within = |apart: Vector3<f64>| apart.norm() <= position_m;
        let drift = (state.velocity_m_s - last.velocity_m_s) * (KEEP_ALIVE_NS as f64 * 1e-9);
        // What is not a number is no reason to keep silent.
        !(within(state.position_m - last.position_m)
            && within(drift)
            && angle(&state.orientation, &last.orientation) <= angle_rad)
    }
}

/// Angle between two unit quaternions [rad].
fn angle(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    // By the chord of the half angle: an inverse cosine would lose small angles.
    let chord = |sign: f64| a.iter().zip(b).map(|(a, b)| (a - sign * b).powi(2)).sum::<f64>().sqrt();
    4.0 * (0.5 * chord(1.0).min(chord(-1.0))).asin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::HapticDevice;
    use crate::device::path::{Path, Touch};
    use crate::device::simulated::{Hand, SimulatedDevice};

    const MS: u64 = 1_000_000;
    const BAND: Deadband = Deadband { position_m: 2e-4, angle_rad: 0.01 };

    fn still() -> DeviceState {
        DeviceState {
            position_m: Vector3::new(0.1, 0.0, 0.02),
            velocity_m_s: Vector3::zeros(),
            orientation: [0.0, 0.0, 0.0, 1.0],
            mode: ToolMode::Touch,
        }
    }

    fn turned(angle_rad: f64) -> [f64; 4] {
        [0.0, (0.5 * angle_rad).sin(), 0.0, (0.5 * angle_rad).cos()]
    }

    #[test]
    fn a_pose_passes_if_anything_of_it_leaves_the_deadband() {
        let mut band = Withholding::new(BAND);
        assert!(band.lets_pass(&still(), 0), "the first pose");
        band.sent(&still(), 0);
        let x = |mm: f64| still().position_m + Vector3::x() * mm * 1e-3;
        let v = |mm_s: f64| Vector3::z() * mm_s * 1e-3;
        let minus = turned(0.009).map(|q| -q);
        for (state, passes) in [
            (still(), false),
            (DeviceState { position_m: x(0.19), ..still() }, false),
            (DeviceState { position_m: x(0.21), ..still() }, true),
            (DeviceState { orientation: turned(0.009), ..still() }, false),
            (DeviceState { orientation: minus, ..still() }, false),
            (DeviceState { orientation: turned(0.011), ..still() }, true),
            (DeviceState { velocity_m_s: v(3.9), ..still() }, false),
            (DeviceState { velocity_m_s: v(4.1), ..still() }, true),
            (DeviceState { mode: ToolMode::Grab, ..still() }, true),
            (DeviceState { position_m: x(f64::NAN), ..still() }, true),
        ] {
            assert_eq!(band.lets_pass(&state, 10 * MS), passes, "{state:?}");
        }
        assert!(!band.lets_pass(&still(), 49 * MS) && band.lets_pass(&still(), 50 * MS));
        assert!((angle(&turned(1e-7), &turned(0.0)) - 1e-7).abs() < 1e-15);
        assert!((angle(&turned(3.0), &turned(0.0)) - 3.0).abs() < 1e-12);
    }

    /// Tissue at the server under the last pose that it got, against tissue under every pose.
    #[test]
    fn the_error_of_force_stays_below_stiffness_times_deadband_and_most_poses_are_saved() {
        let stiffness_n_m = 800.0;
        let touch =
            Touch { point_m: Vector3::zeros(), direction: -Vector3::z(), depth_m: 0.006, clearance_m: 0.01 };
        for (path, saved) in [(Path::press(&touch), 0.5), (Path::circle(&touch), 0.0)] {
            let mut device = SimulatedDevice::new(path, Hand::default());
            let mut band = Withholding::new(BAND);
            let (mut sent, mut withheld, mut worst_n, mut most_n) = (0, 0, 0.0_f64, 0.0_f64);
            let mut known = DeviceState { position_m: Vector3::repeat(f64::NAN), ..still() };
            let force = |state: &DeviceState| stiffness_n_m * (-state.position_m.z).max(0.0);
            for ms in 0..5000 {
                let state = device.read(1e-3).unwrap();
                if ms % 2 == 0 {
                    if band.lets_pass(&state, ms * MS) {
                        band.sent(&state, ms * MS);
                        (known, sent) = (state, sent + 1);
                    } else {
                        withheld += 1;
                    }
                    worst_n = worst_n.max((force(&known) - force(&state)).abs());
                }
                most_n = most_n.max(force(&state));
                device.write(Vector3::z() * force(&known).min(2.5));
            }
            assert!(most_n > 1.0, "the hand must press: {most_n} N");
            assert!(worst_n <= stiffness_n_m * BAND.position_m + 1e-12, "{worst_n} N");
            assert!(
                f64::from(withheld) > saved * f64::from(sent + withheld),
                "{sent} sent, {withheld} withheld"
            );
        }
    }
}
