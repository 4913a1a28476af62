//! What other threads see of a simulation: one coherent copy per step.
//!
//! A snapshot is made for triple buffering: its buffers are reused, so filling one allocates
//! only when the number of surface vertices grows. Topology is shared behind an `Arc` and
//! changes only with a body's epoch. No snapshot holds a non-finite number.

pub mod forces;

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_collision::Method;

pub use crate::body::SurfaceTopology;
use crate::body::texture::Texture;
use crate::body::{AdaptCounts, StepCounts};
use crate::inputs::{ToolMode, ToolShape};
use crate::report::Energy;
use crate::tool::compound::{MAX_PARTS, Part};
use smallvec::SmallVec;

/// The state after one step.
///
/// ```
/// # use std::path::Path;
/// # use scindo_world::scene::Scene;
/// # use scindo_world::simulation::Simulation;
/// use scindo_world::inputs::{Inputs, Wants};
/// use scindo_world::snapshot::Snapshot;
///
/// # const TEXT: &str = r#"
/// # schema = 1
/// # world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }
/// # [[body]]
/// # id = "block"
/// # mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [2, 2, 2] } }
/// # young_pa = 1e4
/// # poisson = 0.4
/// # density_kg_m3 = 1000
/// # "#;
/// # let mut simulation = Simulation::new(&Scene::from_toml(TEXT)?, Path::new(""))?;
/// simulation.step(&Inputs::default());
/// let mut snapshot = Snapshot::default();
/// simulation.snapshot_into(&Wants::default(), &mut snapshot);
/// assert_eq!((snapshot.step, snapshot.bodies.len()), (1, 1));
/// assert!(snapshot.bodies[0].positions.is_empty(), "nobody wants the surface");
///
/// simulation.snapshot_into(&Wants { surface: vec![true], ..Wants::default() }, &mut snapshot);
/// let body = &snapshot.bodies[0];
/// assert_eq!(body.positions.len(), body.topology.vertex_count as usize);
/// # Ok::<(), scindo_world::scene::SceneError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// Steps done.
    pub step: u64,
    /// Simulated time [s].
    pub time_s: f64,
    /// Length of the step [s].
    pub step_s: f64,
    /// How the triangles of surfaces are to be arranged.
    pub broad_phase: Method,
    /// Bodies in the order of the scene.
    pub bodies: Vec<BodySnapshot>,
    /// Tools of the scene, then those brought by clients.
    pub tools: Vec<ToolSnapshot>,
    /// Positions of the probes [m], in the order of the scene; empty when nobody asked.
    pub probes: Vec<Vector3<f64>>,
    /// Forces of contact; empty when nobody asked.
    pub forces: forces::Forces,
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
    /// Image on the skin.
    pub texture: Option<Arc<Texture>>,
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
    /// What adaptations of the cells did since the start or the last reset; zeros where they are not adapted.
    pub adapted: AdaptCounts,
    /// Young's modulus of the body [Pa].
    pub young_pa: f64,
    /// Viscosity β of Rayleigh damping [s].
    pub viscosity_s: f64,
    /// Volume at rest [m³].
    pub rest_volume_m3: f64,
}

/// One capsule of a compound tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimbSnapshot {
    /// The capsule, in the axes of the tool.
    pub part: Part,
    /// Where the tissue lets it be.
    pub proxy: Isometry3<f64>,
    /// Force of the tissue on it from the step's solve [N].
    pub force_n: Vector3<f64>,
    /// The part of it that is friction [N].
    pub friction_n: Vector3<f64>,
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
    /// How far the jaws of forceps are closed, 0 to 1; tissue between them keeps them apart.
    pub closed: f64,
    /// Force of the tissue on the tool from the step's solve [N].
    pub force_n: Vector3<f64>,
    /// The part of it that is friction under a tool that presses [N].
    pub friction_n: Vector3<f64>,
    /// Coefficient of that friction.
    pub friction: f64,
    /// The capsules of a compound tool that touches; none of others.
    pub limbs: SmallVec<[LimbSnapshot; MAX_PARTS]>,
    /// Stiffness of the spring between hand and tissue [N/m].
    pub stiffness_n_m: f64,
    /// Body that it touched last, and the compliance of its tissue in a step [m/N]; none before a first touch.
    pub tissue: Option<(usize, f64)>,
    /// Hand and tissue in series [N/m], for predictions about `pose`; 0: not known.
    pub contact_stiffness_n_m: f64,
    /// Largest force [N].
    pub max_force_n: f64,
    /// Force at which a blade that cuts with force goes on [N]; 0 for other tools.
    pub resistance_n: f64,
    /// Middle of the tissue in its grip [m]; none when it holds nothing.
    pub held_m: Option<Vector3<f64>>,
    /// Sequence number of the newest sample used.
    pub seq: u64,
    /// The client's clock at that sample [ns].
    pub client_time_ns: u64,
}
