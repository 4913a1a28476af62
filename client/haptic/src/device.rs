//! Haptic devices: they measure the hand and exert a force on it.

pub mod path;

pub mod simulated;

pub mod haply;

pub mod list;

use nalgebra::Vector3;

/// Action of the hand with the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ToolMode {
    /// The tool exists but touches nothing.
    Hover,
    /// The tool touches and presses.
    #[default]
    Touch,
    /// The tool holds the tissue nearest to its tip.
    Grab,
    /// The blade cuts along its path.
    Cut,
    /// The tool presses, and cuts the skin that it is drawn over as deep as it is pressed.
    Scalpel,
}

/// State of the device at one tick, in world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceState {
    /// Tip of the tool [m].
    pub position_m: Vector3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Unit quaternion x, y, z, w: tool axes to world axes; the shaft points along tool +z.
    pub orientation: [f64; 4],
    /// Action of the hand.
    pub mode: ToolMode,
}

/// Capability of a device. Presets follow the *usable* figures that CHAI3D ships.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capability {
    /// Name of the device model.
    pub model: &'static str,
    /// Largest force [N].
    pub max_force_n: f64,
    /// Largest force that the device can hold for minutes [N].
    pub max_continuous_force_n: f64,
    /// Largest stiffness that feels clean [N/m].
    pub max_stiffness_n_m: f64,
    /// Damping of the device itself, hand included [N·s/m]. It pays for stiffness in the passivity bound.
    pub damping_ns_m: f64,
    /// Delay between sensing and force beyond the sample hold [s].
    pub latency_s: f64,
    /// Radius of the workspace [m].
    pub workspace_radius_m: f64,
}

/// The device does not answer: unplugged, switched off, or its driver failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceGone;

/// A kinesthetic device with three degrees of freedom in force, and three in torque if it has motors for them.
///
/// ```
/// use nalgebra::Vector3;
/// use scindo_haptic::device::{Capability, DeviceGone, DeviceState, HapticDevice, ToolMode, simulated};
///
/// /// A hand that nothing moves, and that remembers the force on it.
/// #[derive(Default)]
/// struct Clamped {
///     force_n: Vector3<f64>,
/// }
///
/// impl HapticDevice for Clamped {
///     fn capability(&self) -> Capability {
///         Capability { model: "clamped", max_force_n: 3.0, ..simulated::CAPABILITY }
///     }
///     fn read(&mut self, _elapsed_s: f64) -> Result<DeviceState, DeviceGone> {
///         let (position_m, velocity_m_s) = (Vector3::zeros(), Vector3::zeros());
///         let (orientation, mode) = ([0.0, 0.0, 0.0, 1.0], ToolMode::Touch);
///         Ok(DeviceState { position_m, velocity_m_s, orientation, mode })
///     }
///     fn write(&mut self, force_n: Vector3<f64>) {
///         self.force_n = force_n;
///     }
/// }
///
/// let mut device = Clamped::default();
/// device.write(Vector3::new(0.0, 0.0, 1.0));
/// assert_eq!(device.force_n.z, 1.0);
/// assert_eq!(device.read(1e-3).map(|state| state.mode), Ok(ToolMode::Touch));
/// ```
pub trait HapticDevice: Send {
    /// Limits of the device.
    fn capability(&self) -> Capability;

    /// Measures the present state. `elapsed_s` is the time since the last call: one period, more after a
    /// stall.
    ///
    /// # Errors
    /// The device does not answer. It is asked again at the next tick, so that one that was unplugged comes back
    /// when it is plugged in; until then it gets no force. The call must not wait for the device.
    fn read(&mut self, elapsed_s: f64) -> Result<DeviceState, DeviceGone>;

    /// Sets the force on the hand [N], which holds until the next call.
    fn write(&mut self, force_n: Vector3<f64>);

    /// Sets the torque on the hand about the tip [N·m], which holds until the next call. A device without motors for it
    /// has nothing to do.
    fn write_torque(&mut self, torque_nm: Vector3<f64>) {
        let _ = torque_nm;
    }
}
