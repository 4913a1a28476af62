//! Messages of the Inverse Service, as Haply documents them (docs.haply.co, *Simulation channel*, 3.0 to 3.5).
//!
//! The service first sends an inventory of devices with configuration, state and status. Then it sends one update of
//! states for each message that it gets, and nothing else. Up to 3.4 the force is in the field `values`, from 3.5 on in
//! `vector`; the configuration of a device of 3.5 has a `preset`, `filters` and `mount`, earlier ones have none.

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::json;

use crate::device::ToolMode;

/// Name of this program among the sessions of the service.
const PROFILE: &str = "org.scindo:haptic";

/// A message of the service. Fields that are not named here are left aside.
#[derive(Debug, Default, Deserialize)]
pub struct Update {
    /// Devices of the family Inverse.
    #[serde(default)]
    pub inverse3: Vec<Inverse3>,
    #[serde(default)]
    verse_grip: Vec<Grip>,
    #[serde(default)]
    wireless_verse_grip: Vec<Grip>,
    #[serde(default)]
    custom_verse_grip: Vec<Grip>,
}

/// A device.
#[derive(Debug, Default, Deserialize)]
pub struct Inverse3 {
    /// The name by which the service knows the device.
    pub device_id: String,
    /// Only in an inventory.
    #[serde(default)]
    config: Option<Config>,
    #[serde(default)]
    state: State,
    /// What is wrong with it.
    #[serde(default)]
    pub status: Status,
}

#[derive(Debug, Default, Deserialize)]
struct Config {
    #[serde(default)]
    preset: Option<IgnoredAny>,
    #[serde(default)]
    filters: Option<IgnoredAny>,
    #[serde(default)]
    mount: Option<IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
struct State {
    #[serde(default)]
    cursor_position: Option<Xyz>,
    #[serde(default)]
    cursor_velocity: Option<Xyz>,
}

/// State of health. A service that does not say it means yes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(default)]
pub struct Status {
    /// The device answers.
    pub ready: bool,
    /// It knows where its arm is.
    pub calibrated: bool,
    /// It has the power for forces.
    pub power_supply: bool,
}

impl Default for Status {
    fn default() -> Self {
        Self { ready: true, calibrated: true, power_supply: true }
    }
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

impl From<Xyz> for Vector3<f64> {
    fn from(v: Xyz) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

#[derive(Debug, Default, Deserialize)]
struct Grip {
    #[serde(default)]
    state: GripState,
}

#[derive(Debug, Default, Deserialize)]
struct GripState {
    #[serde(default)]
    orientation: Option<Wxyz>,
    /// The button of a grip with a wire.
    #[serde(default)]
    button: Option<bool>,
    /// The buttons of a grip without.
    #[serde(default)]
    buttons: Buttons,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Wxyz {
    w: f64,
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Debug, Default, Clone, Copy, Deserialize)]
#[serde(default)]
struct Buttons {
    a: bool,
    b: bool,
}

/// Name of the field of a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceField {
    /// Up to 3.4.
    Values,
    /// From 3.5 on.
    Vector,
}

/// What a hand does, in axes of the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    /// Where the cursor is [m].
    pub position_m: Vector3<f64>,
    /// How fast it moves [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Unit quaternion x, y, z, w of the grip; `None` without one.
    pub orientation: Option<[f64; 4]>,
    /// Button a, or the only one, grabs; button b cuts.
    pub mode: ToolMode,
}

impl Update {
    /// Reads a message.
    ///
    /// # Errors
    /// It is no JSON, or has other types than documented.
    pub fn read(text: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }

    /// The device with the id, or the first one.
    pub fn device(&self, id: Option<&str>) -> Option<&Inverse3> {
        self.inverse3.iter().find(|device| id.is_none_or(|id| device.device_id == id))
    }

    /// The hand on a device; `None` if it does not say where it is. The first grip counts.
    pub fn hand(&self, device: &Inverse3) -> Option<Hand> {
        let grips = [&self.custom_verse_grip, &self.wireless_verse_grip, &self.verse_grip];
        let grip = grips.into_iter().flatten().next().map(|grip| &grip.state);
        let orientation = grip.and_then(|grip| grip.orientation).and_then(|Wxyz { w, x, y, z }| {
            let norm = (w * w + x * x + y * y + z * z).sqrt();
            (norm.is_finite() && norm > 0.5).then(|| [x / norm, y / norm, z / norm, w / norm])
        });
        let pressed = |grip: &GripState| (grip.buttons.a || grip.button == Some(true), grip.buttons.b);
        let mode = match grip.map(pressed) {
            Some((true, _)) => ToolMode::Grab,
            Some((false, true)) => ToolMode::Cut,
            _ => ToolMode::Touch,
        };
        Some(Hand {
            position_m: device.state.cursor_position?.into(),
            velocity_m_s: device.state.cursor_velocity.map_or(Vector3::zeros(), Vector3::from),
            orientation,
            mode,
        })
    }
}

impl Inverse3 {
    /// The field of a force, if the message says so.
    pub fn force_field(&self) -> Option<ForceField> {
        let Config { preset, filters, mount } = self.config.as_ref()?;
        let is_new = preset.is_some() || filters.is_some() || mount.is_some();
        Some(if is_new { ForceField::Vector } else { ForceField::Values })
    }
}

/// A message that sets the force on a device [N]. The first one of a session also names the session.
pub fn force(id: &str, field: ForceField, force_n: &Vector3<f64>, is_first: bool) -> String {
    let vector = json!({ "x": force_n.x, "y": force_n.y, "z": force_n.z });
    let command = match field {
        ForceField::Vector => json!({ "vector": vector, "execute": true }),
        ForceField::Values => json!({ "values": vector }),
    };
    let device = json!({ "device_id": id, "commands": { "set_cursor_force": command } });
    match (is_first, field) {
        (true, ForceField::Vector) => {
            let configure = json!({ "profile": { "name": PROFILE }, "basis": { "permutation": "XYZ" } });
            json!({ "session": { "configure": configure }, "inverse3": [device] })
        }
        _ => json!({ "inverse3": [device] }),
    }
    .to_string()
}

/// A message that asks for the inventory.
pub fn inventory() -> String {
    json!({ "session": { "force_render_full_state": {} } }).to_string()
}
