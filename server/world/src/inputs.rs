//! What goes into a step from outside: tool poses, cuts, and what is asked for.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};

/// Most obstacles of a scene.
pub const MAX_OBSTACLES: usize = 64;

/// Most tools of a simulation, those of the scene and those brought by clients.
pub const MAX_TOOLS: usize = 64;

/// Most poses of a blade between two steps.
pub const MAX_PASSED: usize = 64;

/// Geometry of a rigid tool in its own axes: tip in the origin, shaft along +z.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum ToolShape {
    /// Cutting edge from the tip (origin) to the heel (0, 0, `length_m`).
    Blade {
        /// Length of the edge [m].
        length_m: f64,
        /// Thickness [m].
        thickness_m: f64,
    },
    /// Ball around the tip.
    Sphere {
        /// Radius [m].
        radius_m: f64,
    },
    /// Rod from the tip (origin) to (0, 0, `length_m`) with round ends.
    Capsule {
        /// Radius [m].
        radius_m: f64,
        /// Length of the axis [m].
        length_m: f64,
    },
    /// Two jaws that hinge at (0, 0, `length_m`) and open along x, with the tip midway between their ends.
    Forceps {
        /// Radius of a jaw [m].
        radius_m: f64,
        /// Length of a jaw, from its end to the hinge [m].
        length_m: f64,
        /// Distance between the inner faces of the open jaws at their ends [m].
        opening_m: f64,
        /// Largest force with which each jaw squeezes [N].
        grip_force_n: f64,
        /// Coefficient of dry friction μ between jaw and tissue.
        friction: f64,
    },
    /// A shaft along +z with two bars across it, along x: one at the tip and one above it.
    Retractor {
        /// Radius of bars and shaft [m].
        radius_m: f64,
        /// Length of the shaft [m].
        length_m: f64,
        /// Length of the bars [m].
        width_m: f64,
        /// Distance of the bars [m].
        height_m: f64,
    },
    /// A shaft along +z whose end is bent towards +x, and up again at its point.
    Hook {
        /// Radius of the rod [m].
        radius_m: f64,
        /// Length of the shaft [m].
        length_m: f64,
        /// Distance of the point from the shaft [m].
        reach_m: f64,
        /// Length of the point [m].
        point_m: f64,
    },
}

impl Default for ToolShape {
    fn default() -> Self {
        Self::Sphere { radius_m: 0.005 }
    }
}

/// What a hand does with a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum ToolMode {
    /// Exists, touches nothing.
    #[default]
    Hover,
    /// Pushes what it meets.
    Touch,
    /// Holds the tissue nearest to the tip when the mode began; forceps hold what is between their jaws.
    Grab,
    /// A blade that cuts along its path.
    Cut,
    /// Pushes what it meets, and cuts the skin that it is drawn over as deep as it is pressed.
    Scalpel,
}

/// The newest sample of a tool held by a client. A step reads one per held tool; a tool without
/// a sample is let go: back to its script, or removed if the scene does not declare it.
#[derive(Debug, Clone)]
pub struct ToolInput {
    /// Name of the tool, declared in the scene or brought along.
    pub id: Arc<str>,
    /// Name of the client that holds it.
    pub owner: Arc<str>,
    /// Tool axes to world axes; the translation is the tip [m].
    pub pose: Isometry3<f64>,
    /// Poses of a cutting blade since the last step, before `pose`, oldest first; at most [`MAX_PASSED`].
    pub passed: Vec<Isometry3<f64>>,
    /// Velocity of the tip [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// What the hand does.
    pub mode: ToolMode,
    /// How far the hand closes the jaws of forceps, 0 to 1; none: they close to grab, and are open else.
    pub closed: Option<f64>,
    /// Geometry of a tool that the scene does not declare.
    pub shape: Option<ToolShape>,
    /// Sequence number of the sample.
    pub seq: u64,
    /// The client's clock at the sample [ns].
    pub client_time_ns: u64,
}

impl ToolInput {
    /// The first sample of the tool `id`, held still by `owner`, which touches.
    #[must_use]
    pub fn new(id: &str, owner: &str, pose: Isometry3<f64>) -> Self {
        Self {
            id: id.into(),
            owner: owner.into(),
            pose,
            passed: Vec::new(),
            velocity_m_s: Vector3::zeros(),
            mode: ToolMode::Touch,
            closed: None,
            shape: None,
            seq: 1,
            client_time_ns: 0,
        }
    }
}

/// A cut asked for by a client, applied once in the next step.
#[derive(Debug, Clone)]
pub struct CutRequest {
    /// Number given by the caller; comes back in the [`CutOutcome`].
    pub request: u64,
    /// Tool that cuts; successive requests of a tool continue its incision when they connect.
    pub tool: Arc<str>,
    /// The body, or none for every body.
    pub body: Option<Arc<str>>,
    /// Successive blade segments [tip, heel] in world axes [m].
    pub segments: Vec<[Vector3<f64>; 2]>,
}

/// What became of a [`CutRequest`].
#[derive(Debug, Clone, PartialEq)]
pub struct CutOutcome {
    /// The caller's number.
    pub request: u64,
    /// Elements cut, or why nothing was.
    pub result: Result<usize, String>,
}

/// What somebody waits for; nothing else is computed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Wants {
    /// Surface positions in the snapshot, per body.
    pub surface: Vec<bool>,
    /// Contact for haptic clients: surface positions and velocities of all bodies.
    pub contact: bool,
    /// Kinetic and elastic energy in the report.
    pub energy: bool,
    /// Von Mises stress on the surface in the snapshot, per body.
    pub stress: Vec<bool>,
    /// Positions of probes and energies in the snapshot.
    pub measures: bool,
    /// Forces of contact in the snapshot.
    pub forces: bool,
}

impl Wants {
    /// Becomes equal to `other` without a new allocation.
    pub(crate) fn take(&mut self, other: &Wants) {
        self.surface.clone_from(&other.surface);
        self.stress.clone_from(&other.stress);
        (self.contact, self.energy) = (other.contact, other.energy);
        (self.measures, self.forces) = (other.measures, other.forces);
    }
}

/// Everything a step reads from outside.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// Tools held by clients.
    pub tools: Vec<ToolInput>,
    /// Cuts to apply in this step.
    pub cuts: Vec<CutRequest>,
    /// What is asked for.
    pub wants: Wants,
}
