//! The plan of effects: what a scene calls for, why, and what it costs.
//!
//! An effect that is off costs nothing: no memory, no thread, no work in the step. What depends
//! on who is listening (surfaces, haptic contact, energies) is decided anew at every step.

mod mechanics;

use std::fmt;

use serde::Serialize;

use crate::body::BodySize;
use crate::contact::pairs::TouchSettings;
use crate::inputs::Wants;
use crate::scene::{AdaptSpec, BodySpec, CheckedScene};

/// Seconds per element and step for energies.
const SECONDS_PER_ELEMENT: f64 = 80e-9;

/// Seconds per element near a moving blade and step, and per element for the surface afterwards.
const SECONDS_PER_ELEMENT_CUT: f64 = 200e-9;

/// Seconds per surface vertex: gather four copies, write three numbers.
const SECONDS_PER_VERTEX: f64 = 10e-9;

/// Seconds per surface triangle: refit of the surface tree.
const SECONDS_PER_TRIANGLE: f64 = 30e-9;

/// Seconds per surface vertex and obstacle: where the vertex is, and how far away.
const SECONDS_PER_VERTEX_AND_OBSTACLE: f64 = 15e-9;

/// Seconds per surface vertex that looks for the body itself.
const SECONDS_PER_SELF_QUERY: f64 = 1e-6;

/// One effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Stable name.
    pub name: String,
    /// Whether it is computed.
    pub on: bool,
    /// Why it is on or off.
    pub why: String,
    /// Predicted cost per step [ms]; 0 when off.
    pub predicted_ms: f64,
    /// Measured mean cost per step [ms]; none before the first step or where it cannot be told apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_ms: Option<f64>,
}

/// All effects, on and off.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Plan {
    /// In the order of the step.
    pub effects: Vec<Effect>,
}

impl Plan {
    /// The plan of a scene whose bodies have these sizes.
    pub fn new(scene: &CheckedScene, sizes: &[BodySize]) -> Self {
        let mut plan = Self::default();
        plan.external_forces(scene);
        plan.mechanics(scene, sizes);
        plan.cutting(scene, sizes);
        plan.adaptation(scene);
        plan.contact(scene, sizes);
        plan.obstacles(scene, sizes);
        plan.listeners(scene, sizes);
        plan
    }

    /// Whether an effect is on.
    pub fn is_on(&self, name: &str) -> bool {
        self.effects.iter().any(|effect| effect.name == name && effect.on)
    }

    /// Enters the measured cost of the effect `name`; where it has a line per body or pair, each
    /// gets a share as large as predicted.
    pub fn measured(&mut self, name: &str, milliseconds: f64) {
        let is_it = |effect: &Effect| effect.on && effect.name.split(' ').next() == Some(name);
        let lines = self.effects.iter().filter(|effect| is_it(effect));
        let (count, predicted) = lines.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e.predicted_ms));
        for effect in self.effects.iter_mut().filter(|effect| is_it(effect)) {
            let share = if predicted > 0.0 { effect.predicted_ms / predicted } else { 1.0 / count };
            effect.measured_ms = Some(milliseconds * share);
        }
    }

    /// Switches on what clients subscribe to now.
    pub fn listening(&mut self, wants: &Wants) {
        let surface = wants.contact || wants.surface.contains(&true);
        let now_on = |name: &str| match name {
            "surface publication" => surface,
            "surface stress" => wants.stress.contains(&true),
            "haptic contact" => wants.contact,
            "force publication" => wants.forces,
            "energies" => wants.energy || wants.measures,
            _ => false,
        };
        for effect in self.effects.iter_mut().filter(|effect| !effect.on && now_on(&effect.name)) {
            effect.on = true;
            effect.why = "a client subscribes".into();
        }
    }

    /// Predicted cost of a step [ms].
    pub fn predicted_ms(&self) -> f64 {
        self.effects.iter().map(|effect| effect.predicted_ms).sum()
    }

    fn push(&mut self, name: &str, on: bool, why: impl Into<String>, predicted_s: f64) {
        let predicted_ms = if on { predicted_s * 1e3 } else { 0.0 };
        self.effects.push(Effect { name: name.into(), on, why: why.into(), predicted_ms, measured_ms: None });
    }

    fn external_forces(&mut self, scene: &CheckedScene) {
        let g = scene.gravity_m_s2.norm();
        let why = if g > 0.0 {
            format!("world.gravity_m_s2 has {g:.3} m/s2")
        } else {
            "world.gravity_m_s2 is zero".into()
        };
        self.push("gravity", g > 0.0, why, 0.0);
        let loads: usize = scene.bodies.iter().map(|body| body.loads.len()).sum();
        self.push("loads", loads > 0, count(loads, "load"), 0.0);
    }

    fn cutting(&mut self, scene: &CheckedScene, sizes: &[BodySize]) {
        let blades = scene.tools.iter().filter(|tool| tool.cuts()).count();
        let allowed = scene.effects.cutting != Some(false);
        let cuts = scene.cuts.len();
        let why = match (allowed, cuts, blades) {
            (false, ..) => "effects.cutting = false".into(),
            (true, 0, 0) => {
                "no cut and no blade in the scene; cuts by clients cost time only when they are made".into()
            }
            (true, cuts, blades) => format!(
                "{} and {}; costs time only while a blade moves",
                count(cuts, "scheduled cut"),
                count(blades, "blade")
            ),
        };
        let snapped: Vec<&str> = scene
            .bodies
            .iter()
            .filter(|body| body.mechanics.cutting.changes_mesh())
            .map(|body| &*body.id)
            .collect();
        let why = match (allowed, snapped.is_empty()) {
            (true, false) => {
                format!("{why}; cuts that change the mesh rebuild the model: {}", snapped.join(", "))
            }
            _ => why,
        };
        let seconds: f64 = sizes.iter().map(|size| size.elements as f64 * SECONDS_PER_ELEMENT_CUT).sum();
        let always = if blades > 0 { seconds } else { 0.0 };
        self.push("cutting", allowed, why, always);
        let tough = scene.bodies.iter().filter(|body| body.toughness_j_m2 > 0.0).count();
        let forced = tough > 0 && allowed && scene.effects.cutting_force != Some(false);
        let why = match (tough, allowed, forced) {
            (0, ..) => "no body has cutting.toughness_j_m2".into(),
            (_, false, _) => "effects.cutting = false".into(),
            (_, true, false) => "effects.cutting_force = false".into(),
            _ => format!(
                "{} with cutting.toughness_j_m2; costs time only while a blade cuts",
                count(tough, "body")
            ),
        };
        self.push("cutting force", forced, why, 0.0);
    }

    fn adaptation(&mut self, scene: &CheckedScene) {
        let of = |body: &BodySpec| Some((body.id.clone(), body.octree?.adapt?));
        let bodies: Vec<_> = scene.bodies.iter().filter_map(of).collect();
        let each = |(id, adapt): &(String, AdaptSpec)| {
            format!("{id} every {}", count(adapt.every_steps as usize, "step"))
        };
        let why = match bodies.is_empty() {
            true => "no body has octree.adapt".into(),
            false => format!("octree.adapt: {}", bodies.iter().map(each).collect::<Vec<_>>().join(", ")),
        };
        self.push("adaptation", !bodies.is_empty(), why, 0.0);
    }

    fn contact(&mut self, scene: &CheckedScene, sizes: &[BodySize]) {
        for tool in &scene.tools {
            for (body, size) in scene.bodies.iter().zip(sizes) {
                let on = scene.effects.contact != Some(false);
                let why = match (on, tool.path.is_empty()) {
                    (false, _) => "effects.contact = false",
                    (true, false) => "the tool has a path",
                    (true, true) => "while a client holds the tool",
                };
                let seconds = size.triangles as f64 * SECONDS_PER_TRIANGLE;
                let scripted = if tool.path.is_empty() { 0.0 } else { seconds };
                self.push(&format!("contact {} x {}", tool.id, body.id), on, why, scripted);
            }
        }
        self.touch(scene, sizes);
    }

    fn touch(&mut self, scene: &CheckedScene, sizes: &[BodySize]) {
        let touch = TouchSettings::of(scene);
        let why = |key: Option<bool>, what: &str| match key {
            Some(on) => format!("effects.{what} = {on}"),
            None => format!("effects.{what} is not asked for"),
        };
        let triangles: usize = sizes.iter().map(|size| size.triangles).sum();
        let vertices: usize = sizes.iter().map(|size| size.vertices).sum();
        let seconds = triangles as f64 * SECONDS_PER_TRIANGLE;
        let itself = touch.is_some_and(|touch| touch.itself);
        let of_itself = seconds + vertices as f64 * SECONDS_PER_SELF_QUERY;
        let effects = &scene.effects;
        self.push("self-collision", itself, why(effects.self_collision, "self_collision"), of_itself);
        let others = touch.is_some_and(|touch| touch.others);
        self.push("body-body contact", others, why(effects.body_collision, "body_collision"), seconds);
        self.push("sleep", effects.sleep == Some(true), why(effects.sleep, "sleep"), 0.0);
        self.push("governor", effects.governor == Some(true), why(effects.governor, "governor"), 0.0);
    }

    fn obstacles(&mut self, scene: &CheckedScene, sizes: &[BodySize]) {
        let n = scene.obstacles.len();
        let on = n > 0 && scene.effects.obstacles != Some(false);
        let why = if scene.effects.obstacles == Some(false) {
            "effects.obstacles = false".into()
        } else {
            count(n, "obstacle")
        };
        let vertices: usize = sizes.iter().map(|size| size.vertices).sum();
        self.push("obstacles", on, why, (n * vertices) as f64 * SECONDS_PER_VERTEX_AND_OBSTACLE);
    }

    fn listeners(&mut self, scene: &CheckedScene, sizes: &[BodySize]) {
        let vertices: usize = sizes.iter().map(|size| size.vertices).sum();
        self.push("probes", !scene.probes.is_empty(), count(scene.probes.len(), "probe"), 0.0);
        let energy = scene.effects.energy == Some(true);
        let why = if energy { "effects.energy = true" } else { "not requested" };
        let elements: f64 = sizes.iter().map(|size| size.elements as f64).sum();
        self.push("energies", energy, why, elements * SECONDS_PER_ELEMENT);
        let rate = scene.publish.surface_hz;
        let why = format!("on demand: {vertices} vertices, at most {rate} Hz, while a client subscribes");
        self.push("surface publication", false, why, vertices as f64 * SECONDS_PER_VERTEX);
        let why = "on demand: von Mises stress on the surface, while a client subscribes";
        self.push("surface stress", false, why, elements * SECONDS_PER_ELEMENT);
        let why = "on demand: total and points of every contact, while a client subscribes";
        self.push("force publication", false, why, 0.0);
        let rate = scene.publish.contact_hz;
        let why = format!("on demand: {rate} Hz beside the step, while a haptic client is connected");
        self.push("haptic contact", false, why, 0.0);
    }
}

fn count(n: usize, what: &str) -> String {
    match (n, what.strip_suffix('y')) {
        (0, _) => format!("no {what}"),
        (1, _) => format!("1 {what}"),
        (n, Some(stem)) => format!("{n} {stem}ies"),
        (n, None) => format!("{n} {what}s"),
    }
}

/// A table for people.
impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.effects.iter().map(|effect| effect.name.len()).max().unwrap_or(0);
        writeln!(f, "{:width$}  on   predicted  measured  why", "effect")?;
        for effect in &self.effects {
            let on = if effect.on { "yes" } else { "-" };
            let cost =
                |ms: Option<f64>| ms.filter(|ms| *ms > 0.0).map_or(String::new(), |ms| format!("{ms:.3} ms"));
            let predicted = cost(Some(effect.predicted_ms));
            let measured = cost(effect.measured_ms);
            writeln!(f, "{:width$}  {on:3}  {predicted:>9}  {measured:>8}  {}", effect.name, effect.why)?;
        }
        write!(f, "{:width$}       {:6.3} ms per step", "together", self.predicted_ms())
    }
}
