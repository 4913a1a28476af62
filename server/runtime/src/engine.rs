//! The simulation as the runtime drives it: the world's [`Simulation`] and its results on disk.

use scindo_proto::messages::{BodyInfo, Effect, Plan, SessionInfo, ToolInfo};
use scindo_proto::{Chunk, WIRE_VERSION};
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::results::{Results, ResultsError};
use scindo_world::simulation::{SimBody, Simulation, StepReport};
use scindo_world::snapshot::Snapshot;
use scindo_world::tool::SCRIPT;

use crate::convert::{to_shape, to_vec3};
use crate::error::RuntimeError;

/// See the module.
pub struct Engine {
    sim: Simulation,
    results: Option<Results>,
    /// The first failure to write results; later steps are not recorded.
    failure: Option<ResultsError>,
}

impl Engine {
    /// Drives `sim` and records each step. Every id of the scene must be able to stand in a key.
    pub fn new(sim: Simulation, results: Option<Results>) -> Result<Self, RuntimeError> {
        for body in &sim.scene().bodies {
            Chunk::new("body id", &body.id)?;
        }
        for tool in &sim.scene().tools {
            Chunk::new("tool id", &tool.id)?;
        }
        Ok(Self { sim, results, failure: None })
    }

    /// The simulation.
    pub fn simulation(&self) -> &Simulation {
        &self.sim
    }

    /// Simulated time per step [s].
    pub fn step_s(&self) -> f64 {
        self.sim.step_s()
    }

    /// Scene, bodies and tools as they are now; tools in clients' hands are not told here.
    pub fn info(&self) -> SessionInfo {
        let scene = self.sim.scene();
        let tools = scene.tools.iter().map(|tool| ToolInfo {
            id: tool.id.clone(),
            shape: Some(to_shape(&tool.shape)),
            owner: if tool.path.is_empty() { String::new() } else { SCRIPT.to_owned() },
            cuts: tool.cuts(),
        });
        SessionInfo {
            server_version: env!("CARGO_PKG_VERSION").to_owned(),
            wire_version: WIRE_VERSION,
            scene_name: scene.name.clone(),
            step_s: scene.step_s,
            bodies: self.sim.bodies().iter().map(body_info).collect(),
            tools: tools.collect(),
        }
    }

    /// Which effects are on, why, and what they cost.
    pub fn plan(&self) -> Plan {
        let effects = self.sim.plan().effects.into_iter().map(|effect| Effect {
            name: effect.name,
            on: effect.on,
            why: effect.why,
            predicted_ms: effect.predicted_ms as f32,
            measured_ms: effect.measured_ms.unwrap_or(0.0) as f32,
        });
        Plan { effects: effects.collect() }
    }

    /// One step, recorded.
    pub fn step(&mut self, inputs: &Inputs) {
        self.sim.step(inputs);
        if let Some(results) = self.results.as_mut().filter(|_| self.failure.is_none())
            && let Err(error) = results.record(&self.sim)
        {
            tracing::error!(%error, "results end here");
            self.failure = Some(error);
        }
    }

    /// Completes the results. `status` is `done`, or why the run ended.
    ///
    /// # Errors
    /// What the disk said, now or in an earlier step.
    pub fn finish(&mut self, status: &str) -> Result<(), RuntimeError> {
        if let Some(error) = self.failure.take() {
            return Err(error.into());
        }
        if let Some(results) = &mut self.results {
            results.finish(&self.sim, status)?;
        }
        Ok(())
    }

    /// What the last step told.
    pub fn report(&self) -> &StepReport {
        self.sim.report()
    }

    /// Copies the present state; what nobody wants stays empty.
    pub fn snapshot_into(&mut self, wants: &Wants, snapshot: &mut Snapshot) {
        self.sim.snapshot_into(wants, snapshot);
    }

    /// Back to the start; epochs keep rising.
    ///
    /// # Errors
    /// Why a body cannot be built again, in words.
    pub fn reset(&mut self) -> Result<(), String> {
        self.sim.reset().map_err(|error| error.to_string())
    }

    /// Changes one parameter of the scene.
    ///
    /// # Errors
    /// What is wrong with key or value, in words.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        self.sim.set(key, value)
    }
}

fn body_info(body: &SimBody) -> BodyInfo {
    let mesh = body.body.cut_mesh();
    let positions = body.body.positions();
    let first = positions.first().copied().unwrap_or_default();
    let (min, max) = positions.iter().fold((first, first), |(min, max), x| (min.inf(x), max.sup(x)));
    BodyInfo {
        id: body.id.to_string(),
        epoch: body.epoch(),
        elements: mesh.mesh().tets.len() as u32,
        nodes: mesh.mesh().nodes.len() as u32,
        min_m: Some(to_vec3(&min)),
        max_m: Some(to_vec3(&max)),
    }
}
