//! What other threads see of a simulation: one coherent copy per step.
//!
//! A snapshot is made for triple buffering: its buffers are reused, so filling one allocates
//! only when the number of surface vertices grows. Topology is shared behind an `Arc` and
//! changes only with a body's epoch. No snapshot holds a non-finite number.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};

use crate::inputs::{ToolMode, ToolShape};

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
}

/// One body.
#[derive(Debug, Clone)]
pub struct BodySnapshot {
    /// Name.
    pub id: Arc<str>,
    /// Triangles that the positions belong to.
    pub topology: Arc<SurfaceTopology>,
    /// Surface positions [m]; empty when nobody asked.
    pub positions: Vec<[f32; 3]>,
    /// Surface velocities [m/s]; empty when nobody asked for contact.
    pub velocities: Vec<[f32; 3]>,
    /// Solver iterations of the step.
    pub iterations: u32,
    /// Relative preconditioned residual after the step.
    pub residual: f64,
    /// Elements of the mesh.
    pub elements: u32,
    /// Pieces that the cuts made of them.
    pub pieces: u32,
    /// Node copies, three unknowns each.
    pub copies: u32,
    /// Volume at the last change of topology or when last asked for [m³].
    pub volume_m3: f64,
}

/// Triangles of a body's surface; immutable, one object per epoch.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceTopology {
    /// Rises whenever the triangles change.
    pub epoch: u32,
    /// Vertices that the triangles refer to.
    pub vertex_count: u32,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Per triangle: 0 = skin, n > 0 = lip of incision n.
    pub tags: Vec<u32>,
}

/// One tool.
#[derive(Debug, Clone)]
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
    /// Largest force [N].
    pub max_force_n: f64,
    /// Sequence number of the newest sample used.
    pub seq: u64,
    /// The client's clock at that sample [ns].
    pub client_time_ns: u64,
}
