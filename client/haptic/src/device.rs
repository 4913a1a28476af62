//! Haptic devices: they say where the hand is and take a force.

pub mod path;

pub mod simulated;

use nalgebra::Vector3;

/// What the hand does with the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ToolMode {
    /// The tool exists but does not touch.
    Hover,
    /// The tool touches and presses.
    #[default]
    Touch,
    /// The tool holds the tissue nearest to its tip.
    Grab,
    /// A blade that cuts along its path.
    Cut,
}

/// The device at one tick, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceState {
    /// Tip of the tool [m].
    pub position_m: Vector3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Unit quaternion x, y, z, w: tool axes to world axes; the shaft points along tool +z.
    pub orientation: [f64; 4],
    /// What the hand does.
    pub mode: ToolMode,
}

/// What a device can do. Presets follow the *usable* figures that CHAI3D ships.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capability {
    /// Name of the model.
    pub model: &'static str,
    /// Largest force [N].
    pub max_force_n: f64,
    /// Largest force it can hold for minutes [N].
    pub max_continuous_force_n: f64,
    /// Largest stiffness that feels clean [N/m].
    pub max_stiffness_n_m: f64,
    /// Its own damping, hand included [N·s/m]; pays for stiffness in the passivity bound.
    pub damping_ns_m: f64,
    /// Delay between sensing and force beyond the sample hold [s].
    pub latency_s: f64,
    /// Radius of the workspace [m].
    pub workspace_radius_m: f64,
}

/// The device does not answer: unplugged, switched off, or its driver failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceGone;

/// A kinesthetic device with three degrees of freedom in force.
pub trait HapticDevice: Send {
    /// What it can do.
    fn capability(&self) -> Capability;

    /// State now. `elapsed_s` is the time since the last call: one period, more after a stall.
    ///
    /// # Errors
    /// The device does not answer. It is asked again at the next tick, so that one that was unplugged comes back
    /// when it is plugged in; until then it gets no force. The call must not wait for the device.
    fn read(&mut self, elapsed_s: f64) -> Result<DeviceState, DeviceGone>;

    /// Force on the hand [N], held until the next call.
    fn write(&mut self, force_n: Vector3<f64>);
}
