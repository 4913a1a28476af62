//! What may change while a scene runs: one list of keys with their units and ranges.
//!
//! A key that is not on the list takes effect only at a start. The ranges are narrower than those of a
//! scene file: whoever may change a running scene must not be able to stop it.

use nalgebra::Vector3;
use scindo_physics::body::Arithmetic;
use toml::Value;

use super::checked::{BodySpec, CheckedScene};
use super::problem::nearest_word;
use super::raw::{RawIntegrator, RawMethod};

/// Largest magnitude of gravity [m/s²]: a hundred times that of the Earth.
const MAX_GRAVITY_M_S2: f64 = 1000.0;
/// Most iterations of a linear solve.
const MAX_ITERATIONS: f64 = 10_000.0;
/// A solver that stops here has hardly begun.
const MAX_TOLERANCE: f64 = 0.5;
/// Below this the rounding of double precision decides.
const MIN_TOLERANCE: f64 = 1e-12;
/// Below this the rounding of single precision decides.
const MIN_SINGLE_TOLERANCE: f64 = 1e-7;

/// A value that may change while the scene runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LiveKey {
    /// `world.gravity_m_s2`.
    Gravity,
    /// `effects.energy`.
    Energy,
    /// `effects.error_estimate`.
    ErrorEstimate,
    /// `body.<id>.…`, by the index of the body.
    Body(usize, BodyKey),
}

/// A value of a body that may change while the scene runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodyKey {
    /// `young_pa`.
    YoungPa,
    /// `poisson`.
    Poisson,
    /// `rayleigh.mass_1_s`.
    DampingMass,
    /// `rayleigh.stiffness_s`.
    DampingStiffness,
    /// `solver.iterations`.
    Iterations,
    /// `solver.tolerance`.
    Tolerance,
}

/// A present or new value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LiveValue {
    /// On or off.
    Switch(bool),
    /// A number.
    Number(f64),
    /// A whole number.
    Integer(u32),
    /// A vector; the range is that of its magnitude.
    Vector(Vector3<f64>),
}

/// A key with everything a slider needs.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveParameter {
    /// The key, as in a scene file.
    pub key: String,
    /// What it says.
    pub meaning: &'static str,
    /// Unit; empty for numbers without one.
    pub unit: &'static str,
    /// The present value.
    pub value: LiveValue,
    /// Allowed values, inclusive; of a vector, its magnitude. Not used for switches.
    pub range: [f64; 2],
    /// The part of `range` that is worth a slider, around the present value.
    pub usual: [f64; 2],
    /// Whether a slider should be logarithmic.
    pub logarithmic: bool,
}

impl BodyKey {
    /// Every key of a body.
    pub const ALL: [Self; 6] = [
        Self::YoungPa,
        Self::Poisson,
        Self::DampingMass,
        Self::DampingStiffness,
        Self::Iterations,
        Self::Tolerance,
    ];

    /// The key below `body.<id>`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::YoungPa => "young_pa",
            Self::Poisson => "poisson",
            Self::DampingMass => "rayleigh.mass_1_s",
            Self::DampingStiffness => "rayleigh.stiffness_s",
            Self::Iterations => "solver.iterations",
            Self::Tolerance => "solver.tolerance",
        }
    }

    /// Whether a change of it changes anything for this body: an equilibrium knows no damping, and an
    /// explicit integrator solves no equations.
    fn matters(self, body: &BodySpec) -> bool {
        let mechanics = &body.mechanics;
        match self {
            Self::YoungPa | Self::Poisson => true,
            Self::DampingMass | Self::DampingStiffness => mechanics.integrator != RawIntegrator::Static,
            Self::Tolerance => !mechanics.integrator.is_explicit(),
            // Factors are exact but for rounding: one solve is enough.
            Self::Iterations => {
                !mechanics.integrator.is_explicit() && mechanics.method != RawMethod::Cholesky
            }
        }
    }

    fn value(self, body: &BodySpec) -> LiveValue {
        LiveValue::Number(match self {
            Self::YoungPa => body.young_pa,
            Self::Poisson => body.poisson,
            Self::DampingMass => body.damping_mass_1_s,
            Self::DampingStiffness => body.damping_stiffness_s,
            Self::Iterations => return LiveValue::Integer(body.mechanics.iterations.unwrap_or(1)),
            Self::Tolerance => body.mechanics.tolerance,
        })
    }

    fn range(self, body: &BodySpec) -> [f64; 2] {
        match self {
            Self::YoungPa => [1.0, 1e12],
            Self::Poisson => [-0.9, 0.499],
            Self::DampingMass => [0.0, 1e3],
            Self::DampingStiffness => [0.0, 10.0],
            Self::Iterations => [1.0, MAX_ITERATIONS.max(body.mechanics.iterations.map_or(1.0, f64::from))],
            Self::Tolerance if body.mechanics.arithmetic() == Arithmetic::Single => {
                [MIN_SINGLE_TOLERANCE, MAX_TOLERANCE]
            }
            Self::Tolerance => [MIN_TOLERANCE, MAX_TOLERANCE],
        }
    }

    /// The range of a slider around the present value.
    fn usual(self, present: f64) -> [f64; 2] {
        match self {
            Self::YoungPa => [present / 30.0, present * 30.0],
            Self::Poisson => [0.0, 0.495],
            Self::DampingMass => [0.0, 20.0_f64.max(2.0 * present)],
            Self::DampingStiffness => [0.0, 0.1_f64.max(2.0 * present)],
            Self::Iterations => [1.0, 200.0_f64.max(2.0 * present)],
            Self::Tolerance => [1e-6, 0.1],
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::YoungPa => "Pa",
            Self::DampingMass => "1/s",
            Self::DampingStiffness => "s",
            Self::Poisson | Self::Iterations | Self::Tolerance => "",
        }
    }

    fn meaning(self) -> &'static str {
        match self {
            Self::YoungPa => "Stiffness: Young's modulus",
            Self::Poisson => "Resistance to a change of volume: Poisson's ratio",
            Self::DampingMass => "Damping of all motion: mass term of Rayleigh damping",
            Self::DampingStiffness => "Damping of deformation: stiffness term of Rayleigh damping",
            Self::Iterations => "Maximum number of solver iterations",
            Self::Tolerance => "Relative residual at which the solver stops",
        }
    }
}

impl LiveKey {
    /// Every key of a scene that may change while it runs.
    pub fn all(scene: &CheckedScene) -> Vec<Self> {
        let of_bodies = scene.bodies.iter().enumerate().flat_map(|(i, body)| {
            BodyKey::ALL.into_iter().filter(|key| key.matters(body)).map(move |key| Self::Body(i, key))
        });
        [Self::Gravity, Self::Energy, Self::ErrorEstimate].into_iter().chain(of_bodies).collect()
    }

    /// The key as in a scene file.
    pub fn path(self, scene: &CheckedScene) -> String {
        match self {
            Self::Gravity => "world.gravity_m_s2".to_owned(),
            Self::Energy => "effects.energy".to_owned(),
            Self::ErrorEstimate => "effects.error_estimate".to_owned(),
            Self::Body(i, key) => format!("body.{}.{}", scene.bodies[i].id, key.as_str()),
        }
    }

    /// The key with its present value, unit and range.
    pub fn parameter(self, scene: &CheckedScene) -> LiveParameter {
        let switch = |on: Option<bool>, meaning| (LiveValue::Switch(on == Some(true)), meaning, "");
        let (value, meaning, unit) = match self {
            Self::Gravity => (LiveValue::Vector(scene.gravity_m_s2), "Gravitational acceleration", "m/s²"),
            Self::Energy => switch(scene.effects.energy, "Energies in every step report"),
            Self::ErrorEstimate => {
                switch(scene.effects.error_estimate, "Discretisation error in every step report")
            }
            Self::Body(i, key) => (key.value(&scene.bodies[i]), key.meaning(), key.unit()),
        };
        let (range, usual) = match self {
            Self::Gravity => ([0.0, MAX_GRAVITY_M_S2], [0.0, 20.0]),
            Self::Energy | Self::ErrorEstimate => ([0.0, 1.0], [0.0, 1.0]),
            Self::Body(i, key) => {
                let range = key.range(&scene.bodies[i]);
                let [low, high] = key.usual(value.size());
                (range, [low.clamp(range[0], range[1]), high.clamp(range[0], range[1])])
            }
        };
        let logarithmic = matches!(self, Self::Body(_, BodyKey::YoungPa | BodyKey::Tolerance));
        LiveParameter { key: self.path(scene), meaning, unit, value, range, usual, logarithmic }
    }

    /// The live key that `path` names.
    ///
    /// # Errors
    /// That it is none, with the list of those that are.
    pub fn parse(scene: &CheckedScene, path: &str) -> Result<Self, String> {
        let keys = Self::all(scene);
        let names: Vec<String> = keys.iter().map(|key| key.path(scene)).collect();
        if let Some(found) = names.iter().position(|name| name == path.trim()) {
            return Ok(keys[found]);
        }
        let meant = nearest_word(path, names.iter().map(String::as_str));
        let hint = meant.map_or(String::new(), |name| format!("did you mean `{name}`? "));
        let shown: String = path.chars().take(80).collect();
        Err(format!("`{shown}` cannot change while the scene runs; {hint}These can: {}", names.join(", ")))
    }

    /// The new value that `text` gives for this key.
    ///
    /// # Errors
    /// A value of another type, not finite, or out of range, with the range.
    pub fn read(self, scene: &CheckedScene, text: &str) -> Result<LiveValue, String> {
        let parameter = self.parameter(scene);
        let shown: String = text.chars().take(80).collect();
        let refuse = |expected: &str| Err(format!("`{}`: found {shown}, allowed: {expected}", parameter.key));
        let parsed = format!("v = {text}").parse::<toml::Table>().ok();
        let parsed = parsed.filter(|table| table.len() == 1).and_then(|mut table| table.remove("v"));
        let Some(parsed) = parsed else { return refuse(&parameter.allowed()) };
        let value = match (parameter.value, &parsed) {
            (LiveValue::Switch(_), Value::Boolean(on)) => Some(LiveValue::Switch(*on)),
            (LiveValue::Integer(_), Value::Integer(n)) => u32::try_from(*n).ok().map(LiveValue::Integer),
            (LiveValue::Number(_), number) => of_number(number).map(LiveValue::Number),
            (LiveValue::Vector(_), Value::Array(items)) => {
                let parts: Vec<f64> = items.iter().filter_map(of_number).collect();
                let whole = parts.len() == 3 && items.len() == 3;
                whole.then(|| LiveValue::Vector(Vector3::from_column_slice(&parts)))
            }
            _ => None,
        };
        match value {
            Some(value) if parameter.allows(&value) => Ok(value),
            _ => refuse(&parameter.allowed()),
        }
    }
}

fn of_number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
}

impl LiveValue {
    /// The number, or the magnitude of the vector.
    fn size(&self) -> f64 {
        match self {
            Self::Switch(on) => f64::from(u8::from(*on)),
            Self::Number(value) => *value,
            Self::Integer(value) => f64::from(*value),
            Self::Vector(vector) => vector.norm(),
        }
    }
}

impl std::fmt::Display for LiveValue {
    /// As in a scene file.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Switch(on) => write!(f, "{on}"),
            Self::Number(value) => write!(f, "{value:?}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Vector(v) => write!(f, "[{:?}, {:?}, {:?}]", v.x, v.y, v.z),
        }
    }
}

impl LiveParameter {
    fn allows(&self, value: &LiveValue) -> bool {
        let [low, high] = self.range;
        matches!(value, LiveValue::Switch(_)) || (low..=high).contains(&value.size())
    }

    fn allowed(&self) -> String {
        let ([low, high], unit) = (self.range, self.unit);
        let number = |what: &str| format!("{what}, {low:?} to {high:?} {unit}").trim_end().to_owned();
        match self.value {
            LiveValue::Switch(_) => "true or false".to_owned(),
            LiveValue::Number(_) => number("a number"),
            LiveValue::Integer(_) => number("a whole number"),
            LiveValue::Vector(_) => number("[x, y, z] with a magnitude"),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::Scene;
    use super::*;

    fn scene(extra: &str) -> CheckedScene {
        let text = format!(
            "schema = 1\n[[body]]\nid = \"a\"\n{extra}young_pa = 1e4\npoisson = 0.4\ndensity_kg_m3 = 1000\n\
             mesh = {{ box = {{ min_m = [0, 0, 0], max_m = [1, 1, 1], cells = [1, 1, 1] }} }}\n\
             [[body.fix]]\nwhere = {{ slab = {{ axis = \"z\", from = 0, to = 0 }} }}\n"
        );
        Scene::from_toml(&text).unwrap().checked().clone()
    }

    #[test]
    fn every_key_is_found_by_its_path_and_takes_its_present_value() {
        for extra in [
            "",
            "integrator = \"rk4\"\n",
            "integrator = \"static\"\n",
            "solver = { method = \"cholesky\" }\n",
        ] {
            let scene = scene(extra);
            for key in LiveKey::all(&scene) {
                let parameter = key.parameter(&scene);
                assert_eq!(LiveKey::parse(&scene, &parameter.key), Ok(key));
                assert_eq!(
                    key.read(&scene, &parameter.value.to_string()),
                    Ok(parameter.value),
                    "{}",
                    parameter.key
                );
                assert!(parameter.range[0] <= parameter.usual[0] && parameter.usual[1] <= parameter.range[1]);
            }
        }
    }

    #[test]
    fn keys_without_effect_are_not_on_the_list() {
        let paths = |extra: &str| {
            let scene = scene(extra);
            LiveKey::all(&scene).iter().map(|key| key.path(&scene)).collect::<Vec<_>>().join(" ")
        };
        assert!(paths("").contains("body.a.solver.iterations"));
        assert!(!paths("integrator = \"rk4\"\n").contains("solver"));
        assert!(!paths("integrator = \"static\"\n").contains("rayleigh"));
        assert!(!paths("solver = { method = \"cholesky\" }\n").contains("iterations"));
    }

    #[test]
    fn what_is_refused_names_the_range_or_the_list() {
        let scene = scene("");
        let read =
            |path: &str, text: &str| LiveKey::parse(&scene, path).and_then(|key| key.read(&scene, text));
        for (path, text, said) in [
            ("body.a.solver.iterations", "100000", "1.0 to 10000.0"),
            ("body.a.solver.iterations", "1.5", "a whole number"),
            ("body.a.solver.tolerance", "1e-300", "1e-7 to 0.5"),
            ("body.a.young_pa", "-1", "1.0 to 1000000000000.0 Pa"),
            ("body.a.young_pa", "nan", "Pa"),
            ("body.a.young_pa", "1\nx = 2", "Pa"),
            ("body.a.poisson", "0.5", "-0.9 to 0.499"),
            ("world.gravity_m_s2", "[0, 0, -2000]", "0.0 to 1000.0"),
            ("world.gravity_m_s2", "[0, nan, 0]", "magnitude"),
            ("world.gravity_m_s2", "[0, 0]", "[x, y, z]"),
            ("effects.energy", "1", "true or false"),
            ("body.a.solver.method", "\"cholesky\"", "These can: world.gravity_m_s2"),
            ("body.a.density_kg_m3", "1", "These can"),
            ("world.gravty_m_s2", "1", "did you mean `world.gravity_m_s2`"),
        ] {
            let refusal = read(path, text).unwrap_err();
            assert!(refusal.contains(said), "{path} = {text}: {refusal}");
        }
        let vector = read("world.gravity_m_s2", "[0, 0, -9.81]").unwrap();
        assert_eq!(vector, LiveValue::Vector(Vector3::new(0.0, 0.0, -9.81)));
    }
}
