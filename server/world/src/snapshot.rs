//! What other threads see of a simulation: one coherent copy per step.
//!
//! A snapshot is made for triple buffering: its buffers are reused, so filling one allocates
//! only when the number of surface vertices grows. Topology is shared behind an `Arc` and
//! changes only with a body's epoch. No snapshot holds a non-finite number.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_physics::body::Body;

pub use crate::body::SurfaceTopology;
use crate::body::{Probe, SimBody, StepCounts};
use crate::inputs::{ToolMode, ToolShape, Wants};
use crate::report::{BodyReport, Energy, StepReport};
use crate::tool::{Tool, Tools};

/// The state after one step.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// Steps done.
    pub step: u64,
    /// Simulated time [s].
    pub time_s: f64,
    /// Bodies in the order of the scene.
    pub bodies: Vec<BodySnapshot>,
    /// Tools of the scene, then those brought by clients.
    pub tools: Vec<ToolSnapshot>,
    /// Positions of the probes [m], in the order of the scene; empty when nobody asked.
    pub probes: Vec<Vector3<f64>>,
}

/// One body.
#[derive(Debug, Clone, Default)]
pub struct BodySnapshot {
    /// Name.
    pub id: Arc<str>,
    /// Topology epoch of the body now.
    pub epoch: u32,
    /// Triangles that the positions belong to; of this epoch whenever there are positions.
    pub topology: Arc<SurfaceTopology>,
    /// Surface positions [m]; empty when nobody asked.
    pub positions: Vec<[f32; 3]>,
    /// Ends [m] of the lines on the surface where incisions have not opened yet; empty when nobody asked.
    pub marks: Vec<[[f32; 3]; 2]>,
    /// Surface velocities [m/s]; empty when nobody asked for contact.
    pub velocities: Vec<[f32; 3]>,
    /// Von Mises stress on the surface [Pa]; empty when nobody asked.
    pub stress: Vec<f32>,
    /// Kinetic and elastic energy; none when nobody asked.
    pub energy: Option<Energy>,
    /// Solver iterations of the step.
    pub iterations: u32,
    /// Relative preconditioned residual after the step.
    pub residual: f64,
    /// What it has to reach; 0 where the integrator solves nothing.
    pub tolerance: f64,
    /// Whether the step ended above it.
    pub unconverged: bool,
    /// What went wrong since the start or the last reset.
    pub counts: StepCounts,
    /// Elements that are turned inside out.
    pub inverted: u32,
    /// Whether the scene means a fixed number of iterations.
    pub fixed_iterations: bool,
    /// Elements of the mesh.
    pub elements: u32,
    /// Pieces that the cuts made of them.
    pub pieces: u32,
    /// Node copies, three unknowns each.
    pub copies: u32,
    /// Volume at rest [m³].
    pub rest_volume_m3: f64,
}

impl Snapshot {
    pub(crate) fn fill(&mut self, step: u64, time_s: f64, wants: &Wants, from: Sources<'_>) {
        self.step = step;
        self.time_s = time_s;
        self.bodies.resize_with(from.bodies.len(), BodySnapshot::default);
        for (i, (body, out)) in from.bodies.iter_mut().zip(&mut self.bodies).enumerate() {
            let asked = |flags: &[bool]| flags.get(i).copied().unwrap_or(false);
            let surface = wants.contact || asked(&wants.surface);
            out.fill(body, &from.report.bodies[i], surface, wants.contact);
            out.stress.clear();
            if asked(&wants.stress) {
                out.topology = body.topology();
                body.surface_stress(&mut out.stress);
            }
            out.energy =
                wants.measures.then(|| from.report.bodies[i].energy.unwrap_or_else(|| body.energy()));
        }
        self.probes.clear();
        if wants.measures {
            let position = |probe: &Probe| probe.position(from.bodies[probe.body].body.positions());
            self.probes.extend(from.probes.iter().map(position));
        }
        self.tools.resize_with(from.tools.len(), ToolSnapshot::default);
        from.tools.iter().zip(&mut self.tools).for_each(|(tool, out)| out.fill(tool));
    }
}

/// What a snapshot is taken of.
pub(crate) struct Sources<'a> {
    pub bodies: &'a mut [SimBody],
    pub report: &'a StepReport,
    pub tools: &'a Tools,
    pub probes: &'a [Probe],
}

impl BodySnapshot {
    fn fill(&mut self, body: &mut SimBody, report: &BodyReport, surface: bool, velocities: bool) {
        if self.id != body.id {
            self.id = body.id.clone();
        }
        self.epoch = body.epoch();
        self.iterations = report.solve.iterations;
        self.residual = if report.solve.residual.is_finite() { report.solve.residual } else { f64::MAX };
        self.tolerance = report.solve.tolerance;
        self.unconverged = report.solve.is_unconverged();
        self.inverted = u32::try_from(report.solve.inverted_pieces).unwrap_or(u32::MAX);
        self.counts = body.counts();
        self.fixed_iterations = body.fixed_iterations;
        self.elements = body.body.n_elements() as u32;
        self.pieces = body.body.n_pieces() as u32;
        self.copies = body.body.rest_positions().len() as u32;
        self.rest_volume_m3 = body.rest_volume_m3;
        self.positions.clear();
        self.marks.clear();
        self.velocities.clear();
        if surface {
            self.topology = body.topology();
            self.positions.extend_from_slice(body.surface_positions());
            hide_sleepers(&body.body, &mut self.positions);
            body.incision_marks(&mut self.marks);
        }
        if velocities {
            body.surface_velocities(&mut self.velocities);
        }
    }
}

/// Vertices of parts that sleep far away are put where the body was, so that no view looks for them; no
/// triangle of the topology is on them.
fn hide_sleepers(body: &Body, positions: &mut [[f32; 3]]) {
    if !body.sleeps() {
        return;
    }
    let place = body.rest_positions().first().map_or([0.0; 3], |x| [x.x as f32, x.y as f32, x.z as f32]);
    for (position, vertex) in positions.iter_mut().zip(&body.surface().vertices) {
        if body.is_asleep(vertex.copies[0]) {
            *position = place;
        }
    }
}

impl ToolSnapshot {
    fn fill(&mut self, tool: &Tool) {
        if self.id != tool.id {
            self.id = tool.id.clone();
        }
        if self.owner != tool.owner {
            self.owner = tool.owner.clone();
        }
        self.shape = tool.shape;
        self.pose = tool.pose;
        self.proxy = *tool.proxy_pose();
        self.velocity_m_s = tool.velocity_m_s;
        self.mode = tool.mode;
        self.force_n = tool.force_n;
        self.stiffness_n_m = tool.stiffness_n_m;
        self.contact_stiffness_n_m = tool.contact_stiffness_n_m();
        self.max_force_n = tool.max_force_n;
        self.held_m = tool.held_point();
        self.seq = tool.seq;
        self.client_time_ns = tool.client_time_ns;
    }
}

/// One tool.
#[derive(Debug, Clone, Default)]
pub struct ToolSnapshot {
    /// Name.
    pub id: Arc<str>,
    /// Geometry.
    pub shape: ToolShape,
    /// Client that holds it, `script`, or empty when nobody does.
    pub owner: Arc<str>,
    /// Where the hand holds it.
    pub pose: Isometry3<f64>,
    /// Where the tissue lets it be.
    pub proxy: Isometry3<f64>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// What the hand does.
    pub mode: ToolMode,
    /// Force of the tissue on the tool from the step's solve [N].
    pub force_n: Vector3<f64>,
    /// Stiffness of the spring between hand and tissue [N/m].
    pub stiffness_n_m: f64,
    /// Hand and tissue in series [N/m], for predictions about `pose`; 0: not known.
    pub contact_stiffness_n_m: f64,
    /// Largest force [N].
    pub max_force_n: f64,
    /// Middle of the tissue in its grip [m]; none when it holds nothing.
    pub held_m: Option<Vector3<f64>>,
    /// Sequence number of the newest sample used.
    pub seq: u64,
    /// The client's clock at that sample [ns].
    pub client_time_ns: u64,
}
