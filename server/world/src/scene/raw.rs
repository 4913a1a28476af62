//! The scene file as written: one type per table, one field per key.
//!
//! These types are the single source of the file format. The JSON Schema is generated from
//! them, and the checker enforces that schema, so documentation, editor completion and refusal
//! cannot drift apart. Ranges stand beside the keys as JSON Schema keywords; `x-next` says what
//! to do when a value lies outside. Every unit is SI and stands in the key.

mod contact;

mod cut;

mod look;

mod material;

mod mechanics;

mod obstacle;

mod octree;

mod skin;

mod tool;

pub use contact::*;
pub use cut::*;
pub use look::*;
pub use material::*;
pub use mechanics::*;
pub use obstacle::*;
pub use octree::*;
pub use skin::*;
pub use tool::*;

use schemars::JsonSchema;
use scindo_physics::material::Material;
use serde::{Deserialize, Serialize};

use crate::mesh_in::Organ;

/// A vector or point in world axes.
pub type Vec3 = [f64; 3];

/// A scindo scene: bodies, cuts, probes and tools, in SI units.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "scindo scene")]
pub struct RawScene {
    /// Version of the scene format.
    #[schemars(range(min = 1, max = 1), extend("x-next" = "write schema = 1"))]
    pub schema: u32,
    /// Name of the scene in results and clients.
    #[serde(default = "unnamed")]
    pub name: String,
    /// What the scene shows, in one sentence of at most 200 characters. Lists of scenes, `scindo check` and
    /// clients show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = r"^[^\r\n]+$"), length(min = 1, max = 200),
        extend("x-next" = "write one plain sentence"))]
    pub description: Option<String>,
    /// Seed of random numbers. The results record it.
    #[serde(default)]
    pub seed: u64,
    /// Gravity and time step, common to all bodies.
    #[serde(default)]
    pub world: RawWorld,
    /// Soft bodies.
    #[serde(default)]
    pub body: Vec<RawBody>,
    /// Rigid things that stand still: floors, tables, posts.
    #[serde(default)]
    pub obstacle: Vec<RawObstacle>,
    /// Scheduled cuts.
    #[serde(default)]
    pub cut: Vec<RawCut>,
    /// Material points whose motion is recorded.
    #[serde(default)]
    pub probe: Vec<RawProbe>,
    /// Rigid tools, moved along a given path or by a client.
    #[serde(default)]
    pub tool: Vec<RawTool>,
    /// Effects switched on or off explicitly. An effect without an entry is on if the rest of the scene needs
    /// it.
    #[serde(default)]
    pub effects: RawEffects,
    /// Rates at which the server publishes to clients.
    #[serde(default)]
    pub publish: RawPublish,
    /// Files written beside the summary.
    #[serde(default)]
    pub results: RawResults,
}

fn unnamed() -> String {
    "unnamed".into()
}

/// Gravity and time step, common to all bodies.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawWorld {
    /// Gravitational acceleration [m/s²]. Zero switches gravity off.
    pub gravity_m_s2: Vec3,
    /// Simulated time per step [s].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "0.005 to 0.04 suits real time"))]
    pub step_s: f64,
    /// Contact of bodies with each other and with themselves, where `effects` asks for it, and how contact is
    /// detected.
    pub contact: RawBodyContact,
}

impl Default for RawWorld {
    fn default() -> Self {
        Self { gravity_m_s2: [0.0; 3], step_s: 0.02, contact: RawBodyContact::default() }
    }
}

/// One soft body.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBody {
    /// Name, unique among bodies; becomes part of network keys.
    #[schemars(regex(pattern = r"^[a-z0-9_-]+$"), length(min = 1, max = 64))]
    pub id: String,
    /// Source of the elements: exactly one of `box`, `grid`, `file`, `surface`, `organ`.
    pub mesh: RawMesh,
    /// A surface finer than the elements. It is drawn and touched in place of their boundary, and every cut
    /// splits it too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skin: Option<RawSkin>,
    /// Finite element.
    #[serde(default)]
    pub element: RawElement,
    /// Cells of `element = "octree"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub octree: Option<RawOctree>,
    /// Constitutive law. `neo-hookean` is the stable law of Smith et al. 2018. `stvk` is modified below a
    /// stretch of 0.65, so that it resists inversion.
    #[serde(default)]
    pub law: RawLaw,
    /// Young's modulus [Pa].
    #[schemars(extend("minimum" = *Material::YOUNG_PA.start(), "maximum" = *Material::YOUNG_PA.end(),
        "x-next" = "soft tissue lies between 1e3 and 1e6 Pa"))]
    pub young_pa: f64,
    /// Poisson's ratio.
    #[schemars(extend("minimum" = *Material::POISSON.start(), "maximum" = *Material::POISSON.end(),
        "x-next" = "0.45 to 0.49 for nearly incompressible tissue; 0.5 would need a pressure field"))]
    pub poisson: f64,
    /// Density in the rest state [kg/m³].
    #[schemars(extend("minimum" = *Material::DENSITY_KG_M3.start(), "maximum" = *Material::DENSITY_KG_M3.end(),
        "x-next" = "soft tissue has about 1000 kg/m3"))]
    pub density_kg_m3: f64,
    /// Regions of another material, such as a tumour. Law and damping are those of the body.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub material: Vec<RawMaterial>,
    /// Families of parallel fibres in the whole body, such as muscle.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 3))]
    pub fibre: Vec<RawFibre>,
    /// Viscoelasticity: terms of a Prony series.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 3))]
    pub prony: Vec<RawProny>,
    /// Rayleigh damping: a mass term and a stiffness term.
    #[serde(default)]
    pub rayleigh: RawRayleigh,
    /// Velocity at the start [m/s]. Held nodes do not take part in it.
    #[serde(default)]
    pub velocity_m_s: Vec3,
    /// Time integration scheme.
    #[serde(default)]
    pub integrator: RawIntegrator,
    /// Equal steps that the body makes in each step of the world. A stiff or fast body can take short steps beside
    /// others that take long ones. Not for bodies that touch each other or themselves.
    #[serde(default = "one_step")]
    #[schemars(range(min = 1, max = 64), extend("x-next" = "2 halves the error that BDF2 leaves by four, and doubles the cost"))]
    pub sub_steps: u32,
    /// Most stable steps that an explicit integrator may divide a step into. Default: 256.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 100000), extend("x-next" = "256; a step that needs more is refused"))]
    pub most_stable_steps: Option<u32>,
    /// Parameters of `integrator = "newmark"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub newmark: Option<RawNewmark>,
    /// What a step of `integrator = "generalised-alpha"` leaves of the fastest oscillations. Default: 0.8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0), extend("x-next" = "0.8; 1 damps nothing, 0 removes what a step does not resolve"))]
    pub spectral_radius: Option<f64>,
    /// Mass matrix. `lumped` integrates the shape functions over each piece; with explicit integrators on tet4 it is
    /// `menouillard`.
    #[serde(default)]
    pub mass: RawMass,
    /// Remedy for volumetric locking of nearly incompressible material. For the last percent of accuracy,
    /// take `tet10`, or `hex8` with `selective`.
    #[serde(default)]
    pub locking: RawLocking,
    /// Settings of the solver.
    #[serde(default)]
    pub solver: RawSolver,
    /// How cuts act on the body: those of the scene, of tools and of clients.
    #[serde(default)]
    pub cutting: RawCutting,
    /// Regions that are held or displaced.
    #[serde(default)]
    pub fix: Vec<RawFix>,
    /// Time over which every `displacement_m` of the body grows from zero [s]. 0 applies it at once.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e6), extend("x-next" = "1 often avoids inverted elements where a sudden \
        displacement would cause them"))]
    pub displacement_over_s: f64,
    /// In place of `displacement_over_s`, the share of every `displacement_m` over time: points of time [s] and share,
    /// with linear interpolation. The share may be negative or above 1, and is constant before the first point and
    /// after the last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 10000))]
    pub displacement_table: Vec<[f64; 2]>,
    /// Loads.
    #[serde(default)]
    pub load: Vec<RawLoad>,
    /// Appearance of the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look: Option<RawLook>,
}

/// Source of a body's elements: exactly one of `box`, `grid`, `file`, `surface`, `organ`.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["box"]}, {"required": ["grid"]},
    {"required": ["file"]}, {"required": ["surface"]}, {"required": ["organ"]}]))]
pub struct RawMesh {
    /// An axis-aligned block.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r#box: Option<RawBox>,
    /// An axis-aligned block with cell boundaries at given coordinates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<RawGrid>,
    /// File of a volume mesh: Gmsh .msh, .vtk or .vtu. The path is relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub file: Option<String>,
    /// File of a surface to be filled with tetrahedra: .obj, .stl, .ply, .vtk or .vtp. It need not be closed.
    /// The path is relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub surface: Option<String>,
    /// A shape that the program generates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub organ: Option<RawOrgan>,
    /// Lattice cells along the longest side of a `surface`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 2, max = 256), extend("x-next" = "16 to 48 cells run in real time"))]
    pub cells: Option<u32>,
    /// Factor from the file's length unit to metres: 0.001 for millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "0.001 for a file in millimetres"))]
    pub scale: Option<f64>,
    /// Whether coincident nodes of a `file` are merged, with a warning (default: true). Write false for a
    /// mesh that already contains a cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weld: Option<bool>,
    /// Which connected parts of a `file` or `surface` are kept (default: all).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<RawParts>,
}

/// Which parts of a mesh are kept.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawParts {
    /// All of them.
    #[default]
    All,
    /// The one of the largest volume.
    Largest,
}

/// An axis-aligned block of equal cells.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBox {
    /// Lower corner [m].
    pub min_m: Vec3,
    /// Upper corner [m].
    pub max_m: Vec3,
    /// Cells along x, y, z.
    #[schemars(inner(range(min = 1, max = 1024)), extend("x-next" = "give at least one cell per axis"))]
    pub cells: [u32; 3],
    /// How each cell is split into elements.
    #[serde(default)]
    pub pattern: RawPattern,
}

/// An axis-aligned block with cell boundaries at given coordinates, finer where they lie closer.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawGrid {
    /// Cell boundaries along x in ascending order [m].
    #[schemars(length(min = 2, max = 1025))]
    pub x_m: Vec<f64>,
    /// Cell boundaries along y in ascending order [m].
    #[schemars(length(min = 2, max = 1025))]
    pub y_m: Vec<f64>,
    /// Cell boundaries along z in ascending order [m].
    #[schemars(length(min = 2, max = 1025))]
    pub z_m: Vec<f64>,
    /// How each cell is split into elements.
    #[serde(default)]
    pub pattern: RawPattern,
}

/// How a cubic cell is split into elements.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawPattern {
    /// Five tetrahedra, mirrored from cell to cell.
    #[default]
    Tet5,
    /// Six tetrahedra around the cell's diagonal (Kuhn).
    Tet6,
    /// Six tetrahedra without a preferred diagonal, as in Nienhuys 2003.
    Oct6,
    /// One hexahedron, for `element = "hex8"`.
    Hex,
}

/// A shape that the program generates.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawOrgan {
    /// Name of the shape.
    #[serde(default)]
    pub shape: Organ,
    /// Lattice cells along the longest side of the shape.
    #[schemars(range(min = 4, max = 128), extend("x-next" = "20 to 24 cells run in real time"))]
    pub cells: u32,
}

/// A region of a body that is held or displaced.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawFix {
    /// Selection of nodes: exactly one of `box`, `sphere`, `half_space`, `slab`.
    pub r#where: RawWhere,
    /// Axes along which the nodes are held: all three, unless `normal` or `rail` is given.
    pub axes: Option<RawAxes>,
    /// In place of `axes`, the nodes are held along this vector only, like rollers on an incline: they move in the
    /// plane that it is the normal of. It may have any length except zero.
    pub normal: Option<Vec3>,
    /// In place of `axes`, the nodes move along this vector only, like rollers in a straight groove. It may have any
    /// length except zero.
    pub rail: Option<Vec3>,
    /// Prescribed displacement from the rest position [m]. Only its part in held directions counts.
    #[serde(default)]
    pub displacement_m: Vec3,
}

/// World axes that a fix holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RawAxes {
    /// x only.
    X,
    /// y only.
    Y,
    /// z only.
    Z,
    /// x and y.
    Xy,
    /// x and z.
    Xz,
    /// y and z.
    Yz,
    /// All three.
    Xyz,
}

/// A load, constant or changing over time: a force or a pressure.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["force_n"]}, {"required": ["pressure_pa"]}]))]
pub struct RawLoad {
    /// Selection of nodes: exactly one of `box`, `sphere`, `half_space`, `slab`.
    pub r#where: RawWhere,
    /// Total force [N], distributed over the selected nodes. It keeps its direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_n: Option<Vec3>,
    /// Pressure [Pa] on the boundary faces all of whose nodes are selected. It pushes into the body; a negative one
    /// pulls. It follows the deformed surface, except with the law `linear`, where it keeps the directions and areas
    /// of the body at rest. Cut faces carry no pressure. On octree cells it acts on their outer faces, so its position
    /// is accurate to one cell. Not with cuts that change the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -1e9, max = 1e9), extend("x-next" = "blood in arteries has about 13000 (100 mmHg)"))]
    pub pressure_pa: Option<f64>,
    /// Whether the force is distributed by area or by volume. Default: by area if the selection contains
    /// boundary faces, otherwise by volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<RawShare>,
    /// Time over which force or pressure grows from zero [s]. 0 applies it at once.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e6), extend("x-next" = "some periods of the body's slowest vibration let it arrive \
        without swinging"))]
    pub ramp_s: f64,
    /// In place of `ramp_s`, the share of force or pressure over time: points of time [s] and share, with linear
    /// interpolation. The share may be negative or above 1, and is constant before the first point and after the last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 10000))]
    pub table: Vec<[f64; 2]>,
}

/// How a total force is distributed over nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawShare {
    /// By the area of the boundary faces whose three nodes are selected.
    Area,
    /// By the volume around each node.
    Volume,
}

/// A selection of nodes by rest position: exactly one key.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["box"]}, {"required": ["sphere"]},
    {"required": ["half_space"]}, {"required": ["slab"]}]))]
pub struct RawWhere {
    /// Nodes inside an axis-aligned box or on its faces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r#box: Option<RawRegionBox>,
    /// Nodes inside a sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<RawBall>,
    /// Nodes on a plane or on the side that its normal points to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_space: Option<RawHalfSpace>,
    /// Nodes between two fractions of the body's extent along an axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slab: Option<RawSlab>,
}

/// An axis-aligned region.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRegionBox {
    /// Lower corner [m].
    pub min_m: Vec3,
    /// Upper corner [m].
    pub max_m: Vec3,
}

/// A sphere.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBall {
    /// Centre [m].
    pub centre_m: Vec3,
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-next" = "give a positive radius"))]
    pub radius_m: f64,
}

/// One side of a plane.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawHalfSpace {
    /// A point on the plane [m].
    pub point_m: Vec3,
    /// Vector towards the selected side. It may have any length except zero.
    pub normal: Vec3,
}

/// A slice of a body's bounding box.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSlab {
    /// Axis of the slab.
    pub axis: RawAxis,
    /// Start as a fraction of the extent. 0 is the lowest node.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-next" = "0 is the lowest node, 1 the highest"))]
    pub from: f64,
    /// End as a fraction of the extent. 1 is the highest node.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-next" = "0 is the lowest node, 1 the highest"))]
    pub to: f64,
}

/// One world axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RawAxis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

/// A material point whose motion is recorded.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProbe {
    /// Name, unique among probes.
    #[schemars(regex(pattern = r"^[a-z0-9_-]+$"), length(min = 1, max = 64))]
    pub id: String,
    /// Body that the probe is attached to.
    pub body: String,
    /// Position in the body at rest [m].
    pub point_m: Vec3,
    /// Vector towards the material that the probe belongs to. Only needed if the point lies on a cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<Vec3>,
}

/// A rigid tool.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTool {
    /// Name, unique among tools; becomes part of network keys.
    #[schemars(regex(pattern = r"^[a-z0-9_-]+$"), length(min = 1, max = 64))]
    pub id: String,
    /// Shape of the tool: exactly one of `blade`, `sphere`, `capsule`, `forceps`, `retractor`, `hook`.
    pub shape: RawShape,
    /// Stiffness of the virtual coupling between hand and tissue [N/m].
    #[serde(default = "tool_stiffness")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "200 to 2000 N/m suits haptic devices"))]
    pub stiffness_n_m: f64,
    /// Largest force on the tool [N].
    #[serde(default = "tool_force")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e4, "x-next" = "desktop devices give 3 to 20 N"))]
    pub max_force_n: f64,
    /// Coefficient of dry friction between it and the tissue on which it presses; 0: it slides freely.
    #[serde(default)]
    #[schemars(extend("minimum" = 0.0, "maximum" = 10.0, "x-next" = "0.05 is wet tissue, 0.5 a dry fingertip on skin"))]
    pub friction: f64,
    /// Poses over time, interpolated linearly. Without a path, a client moves the tool.
    #[serde(default)]
    pub path: Vec<RawPathPoint>,
    /// Period after which the path starts again [s]. Without it, the tool stays at the end of the path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-next" = "give the duration of one cycle"))]
    pub repeat_s: Option<f64>,
}

fn one_step() -> u32 {
    1
}

fn tool_stiffness() -> f64 {
    800.0
}

fn tool_force() -> f64 {
    8.0
}

/// One pose of a scripted tool.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawPathPoint {
    /// Simulated time [s].
    #[schemars(range(min = 0.0), extend("x-next" = "times start at 0 and increase"))]
    pub at_s: f64,
    /// Position of the tip [m].
    pub tip_m: Vec3,
    /// Direction from the tip along the shaft. It may have any length except zero.
    #[serde(default = "upwards")]
    pub toward: Vec3,
    /// Direction in which jaws open, the bars of a retractor lie or a hook points; only its part across the shaft counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub across: Option<Vec3>,
    /// What the tool does from this time on.
    #[serde(default)]
    pub mode: RawMode,
}

fn upwards() -> Vec3 {
    [0.0, 0.0, 1.0]
}

/// What a tool does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawMode {
    /// Passes through everything.
    Hover,
    /// Pushes what it meets.
    #[default]
    Touch,
    /// Holds the tissue nearest to the tip. Forceps close, and hold what is between their jaws.
    Grab,
    /// A blade that cuts along its path.
    Cut,
    /// Pushes what it meets, and cuts the skin that it is drawn over as deep as it is pressed: by the force over the
    /// tool's stiffness. A toughness of the body, times the tool's width, is taken off the force.
    Scalpel,
}

/// Effects switched on or off explicitly. An effect without an entry is on if the rest of the scene needs it.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawEffects {
    /// `false` refuses cuts by tools and clients.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cutting: Option<bool>,
    /// `false` lets blades cut without force, also where a body has a toughness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cutting_force: Option<bool>,
    /// `false` lets tools pass through bodies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<bool>,
    /// `false` lets bodies pass through obstacles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub obstacles: Option<bool>,
    /// `true` lets bodies touch each other: they are stopped by, slide along and stick to each other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body_collision: Option<bool>,
    /// `true` lets bodies touch themselves, e.g. the two lips of a cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub self_collision: Option<bool>,
    /// `true` lets bodies at rest sleep until something touches them. Sleeping bodies are not stepped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sleep: Option<bool>,
    /// `true` lets a scene that runs in real time give up accuracy when its steps are late: first the estimate of the
    /// error, then tolerances of linear solves up to 1e-2. If steps are still late, it runs in slow motion and reports it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub governor: Option<bool>,
    /// `true` adds kinetic and elastic energy to every step report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<bool>,
    /// `true` adds an estimate of the discretisation error to every step report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_estimate: Option<bool>,
}

/// Rates at which the server publishes to clients.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPublish {
    /// Surface frames per second [Hz].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 240.0, "x-next" = "20 to 60 Hz looks smooth"))]
    pub surface_hz: f64,
    /// Contact models per second [Hz].
    #[schemars(range(min = 50.0, max = 2000.0), extend("x-next" = "200 to 1000 Hz feels smooth"))]
    pub contact_hz: f64,
    /// Statistics reports (rates and costs) per second [Hz].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 60.0, "x-next" = "1 to 10 Hz is plenty"))]
    pub stats_hz: f64,
}

impl Default for RawPublish {
    fn default() -> Self {
        Self { surface_hz: 60.0, contact_hz: 500.0, stats_hz: 4.0 }
    }
}

/// Files written beside the summary.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawResults {
    /// Number of steps between two field files. A .pvd file lists them in time. 0 writes only the final
    /// state.
    #[schemars(range(min = 0, max = 1000000), extend("x-next" = "0 writes only the final state"))]
    pub series_steps: u32,
}
