//! Tissue under one tool: stepped by the server at its own pace, or every millisecond as the truth.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_world::inputs::{Inputs, ToolInput, ToolMode, ToolShape, Wants};
use scindo_world::scene::{Scene, SceneError};
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

/// Height of the top of the tissue [m].
pub const TOP_M: f64 = 0.02;
/// The tip of the tool.
pub const SHAPE: ToolShape = ToolShape::Sphere { radius_m: 0.005 };
/// Its name.
pub const TOOL: &str = "probe";
/// Name of the client that holds it.
pub const OWNER: &str = "hand";

/// A pad of soft tissue, glued to a table. Its cells are finer than the tip: otherwise the hand feels the facets of the
/// dent, which no message can foretell.
const SCENE: &str = r#"
schema = 1
name = "pad"
world = { gravity_m_s2 = [0, 0, 0], step_s = STEP }
[[body]]
id = "pad"
mesh = { box = { min_m = [-0.03, -0.03, 0], max_m = [0.03, 0.03, 0.02], cells = [15, 15, 5] } }
law = "corotational"
young_pa = 3e4
poisson = 0.4
density_kg_m3 = 1060
rayleigh = { mass_1_s = 1.0, stiffness_s = 0.01 }
solver = { iterations = 100, tolerance = 1e-5 }
[[body.fix]]
where = { slab = { axis = "z", from = 0.0, to = 0.05 } }
"#;

/// The pad and the tool that a client holds.
pub struct Tissue {
    sim: Simulation,
    inputs: Inputs,
}

impl Tissue {
    /// The pad at rest, stepped by `step_s` [s].
    ///
    /// # Errors
    /// If the scene cannot be built.
    pub fn new(step_s: f64) -> Result<Self, SceneError> {
        let scene = Scene::from_toml(&SCENE.replace("STEP", &format!("{step_s:?}")))?;
        let sim = Simulation::new(&scene, Path::new(""))?;
        let inputs = Inputs { wants: Wants { contact: true, ..Wants::default() }, ..Inputs::default() };
        Ok(Self { sim, inputs })
    }

    /// One step with the tool as `pose` says; without a tool if nothing has arrived yet.
    pub fn step(&mut self, pose: Option<&ToolInput>) {
        self.inputs.tools.clear();
        self.inputs.tools.extend(pose.cloned());
        self.sim.step(&self.inputs);
    }

    /// Force of the tissue on the tool in the last step [N].
    pub fn force_n(&self) -> Vector3<f64> {
        self.sim.tools().iter().next().map_or_else(Vector3::zeros, |tool| tool.force_n)
    }

    /// Fills `snapshot` with what the contact thread reads.
    pub fn show(&mut self, snapshot: &mut Snapshot) {
        self.sim.snapshot_into(&self.inputs.wants, snapshot);
    }
}

/// A pose as the server's inbox holds it.
pub fn tool_input(
    (position_m, velocity_m_s): (Vector3<f64>, Vector3<f64>),
    mode: ToolMode,
    seq: u64,
    client_time_ns: u64,
) -> ToolInput {
    ToolInput {
        id: Arc::from(TOOL),
        owner: Arc::from(OWNER),
        pose: Isometry3::from_parts(position_m.into(), nalgebra::UnitQuaternion::identity()),
        passed: Vec::new(),
        velocity_m_s,
        mode,
        closed: None,
        shape: Some(SHAPE),
        seq,
        client_time_ns,
    }
}
