//! The simulation as the runtime drives it: the world's [`Simulation`] and its results on disk.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use scindo_proto::limits::{HEADER_BYTES, MAX_PARAMS, POSITION_BYTES, TAG_BYTES, TRIANGLE_BYTES};
use scindo_proto::messages::{
    BodyInfo, BodyLook, Effect, LookLayer, ParamsReply, Plan, SessionInfo, ToolInfo,
};
use scindo_proto::{Chunk, WIRE_VERSION};
use scindo_world::inputs::{CutOutcome, Inputs, Wants};
use scindo_world::results::{Results, ResultsError};
use scindo_world::scene::{BodySpec, LookSpec};
use scindo_world::simulation::{SimBody, Simulation, StepReport};
use scindo_world::snapshot::Snapshot;
use scindo_world::tool::SCRIPT;

use crate::error::RuntimeError;
use crate::wire::convert::{to_param, to_shape, to_vec3};

/// See the module.
pub struct Engine {
    sim: Simulation,
    results: Option<Results>,
    /// Steps that panicked.
    panics: u64,
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
        Ok(Self { sim, results, panics: 0, failure: None })
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
            bodies: self.sim.bodies().iter().zip(&scene.bodies).map(body_info).collect(),
            tools: tools.collect(),
            up: Some(to_vec3(&up(&scene.gravity_m_s2))),
            ..SessionInfo::default()
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

    /// What [`Self::set`] may change, with present values and ranges.
    pub fn params(&self) -> ParamsReply {
        let params = self.sim.parameters().into_iter().take(MAX_PARAMS).map(to_param);
        ParamsReply { params: params.collect() }
    }

    /// Bytes of the longest message that tells a whole surface of now.
    pub fn longest_surface(&self) -> usize {
        let bytes = |body: &SimBody| {
            let surface = body.body.surface();
            surface.vertices.len() * POSITION_BYTES + surface.triangles.len() * (TRIANGLE_BYTES + TAG_BYTES)
        };
        self.sim.bodies().iter().map(bytes).max().unwrap_or(0) + HEADER_BYTES
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

    /// A step under way ends as soon as `flag` is raised.
    pub fn set_stop_flag(&mut self, flag: &Arc<AtomicBool>) {
        self.sim.set_stop_flag(flag);
    }

    /// Forgets the cuts that wait or are being made; their outcomes say `reason`.
    pub fn discard_cuts(&mut self, reason: &str) -> Vec<CutOutcome> {
        self.sim.discard_cuts(reason)
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

    /// Why the run so far does not count as one that succeeded; empty if it does.
    pub fn failures(&self) -> Vec<String> {
        let mut failures = self.sim.failures();
        if self.panics > 0 {
            failures.push(format!("{} steps panicked, after which the scene started again", self.panics));
        }
        failures
    }

    /// A step panicked: a defect of the program, which a reset does not excuse.
    pub fn count_panic(&mut self) {
        self.panics += 1;
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

    /// Takes the last cut back; says which.
    ///
    /// # Errors
    /// That there is none.
    pub fn undo(&mut self) -> Result<String, String> {
        let undone = self.sim.undo()?;
        let ids: Vec<&str> = undone.bodies.iter().map(|&body| &*self.sim.bodies()[body].id).collect();
        Ok(format!("{}: incision {} is taken back", ids.join(", "), undone.incision))
    }

    /// Changes one parameter of the scene.
    ///
    /// # Errors
    /// What is wrong with key or value, in words.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        self.sim.set(key, value)
    }
}

/// Against gravity; z without it.
fn up(gravity: &Vector3<f64>) -> Vector3<f64> {
    (-gravity).try_normalize(1e-9).unwrap_or_else(Vector3::z)
}

fn to_look(look: &LookSpec) -> BodyLook {
    let layer = |&(depth_m, colour): &(f64, u32)| LookLayer { depth_m: depth_m as f32, colour };
    BodyLook {
        colour: look.colour,
        opacity: look.opacity as f32,
        layers: look.layers.iter().map(layer).collect(),
    }
}

fn body_info((body, spec): (&SimBody, &BodySpec)) -> BodyInfo {
    let positions = body.body.positions();
    let first = positions.first().copied().unwrap_or_default();
    let (min, max) = positions.iter().fold((first, first), |(min, max), x| (min.inf(x), max.sup(x)));
    BodyInfo {
        id: body.id.to_string(),
        epoch: body.epoch(),
        elements: body.body.n_elements() as u32,
        nodes: body.body.n_nodes() as u32,
        min_m: Some(to_vec3(&min)),
        max_m: Some(to_vec3(&max)),
        look: Some(to_look(&spec.look)),
    }
}
