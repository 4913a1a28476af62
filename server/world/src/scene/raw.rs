//! The scene file as written: one type per table, one field per key.
//!
//! These types are the single source of the file format. The JSON Schema is generated from
//! them, and the checker enforces that schema, so documentation, editor completion and refusal
//! cannot drift apart. Ranges stand beside the keys as JSON Schema keywords; `x-next` says what
//! to do when a value lies outside. Every unit is SI and stands in the key.

mod look;

mod mechanics;

pub use look::*;
pub use mechanics::*;

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
    /// Version of this format.
    #[schemars(range(min = 1, max = 1), extend("x-next" = "write schema = 1"))]
    pub schema: u32,
    /// What the scene is called in results and clients.
    #[serde(default = "unnamed")]
    pub name: String,
    /// Seed of everything random; recorded in the results.
    #[serde(default)]
    pub seed: u64,
    /// What acts on all bodies.
    #[serde(default)]
    pub world: RawWorld,
    /// Soft bodies.
    #[serde(default)]
    pub body: Vec<RawBody>,
    /// Cuts that happen by themselves at a given time.
    #[serde(default)]
    pub cut: Vec<RawCut>,
    /// Material points whose path is recorded.
    #[serde(default)]
    pub probe: Vec<RawProbe>,
    /// Rigid tools, moved by a path or by a client.
    #[serde(default)]
    pub tool: Vec<RawTool>,
    /// Effects switched by hand; what is absent follows from the rest of the scene.
    #[serde(default)]
    pub effects: RawEffects,
    /// How often clients hear of what.
    #[serde(default)]
    pub publish: RawPublish,
    /// What is written to disk.
    #[serde(default)]
    pub results: RawResults,
}

fn unnamed() -> String {
    "unnamed".into()
}

/// What acts on all bodies.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawWorld {
    /// Acceleration of free fall [m/s²]; zero switches gravity off.
    pub gravity_m_s2: Vec3,
    /// Simulated time per step [s].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "0.005 to 0.04 suits real time"))]
    pub step_s: f64,
}

impl Default for RawWorld {
    fn default() -> Self {
        Self { gravity_m_s2: [0.0; 3], step_s: 0.02 }
    }
}

/// One soft body.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBody {
    /// Name, unique among bodies; becomes part of network keys.
    #[schemars(regex(pattern = r"^[a-z0-9_-]+$"), length(min = 1, max = 64))]
    pub id: String,
    /// Where its elements come from.
    pub mesh: RawMesh,
    /// A skin finer than the elements, shown and touched in place of their boundary and cut with them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skin: Option<RawSkin>,
    /// Finite element.
    #[serde(default)]
    pub element: RawElement,
    /// Constitutive law; `neo-hookean` is the stable one of Smith et al. 2018, and `stvk` is continued below a
    /// stretch of 0.65.
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
    /// Rayleigh damping.
    #[serde(default)]
    pub rayleigh: RawRayleigh,
    /// Time integration.
    #[serde(default)]
    pub integrator: RawIntegrator,
    /// Parameters of `integrator = "newmark"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub newmark: Option<RawNewmark>,
    /// Mass matrix.
    #[serde(default)]
    pub mass: RawMass,
    /// Remedy against locking of nearly incompressible material; the last percent takes `tet10`, or `hex8` with
    /// `selective`.
    #[serde(default)]
    pub locking: RawLocking,
    /// Solver of a step.
    #[serde(default)]
    pub solver: RawSolver,
    /// What a cut does to it, whoever makes the cut.
    #[serde(default)]
    pub cutting: RawCutting,
    /// Held or displaced parts.
    #[serde(default)]
    pub fix: Vec<RawFix>,
    /// Time over which every `displacement_m` of its fixes grows from zero [s]; 0: at once.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e6), extend("x-next" = "1 lets a body follow what would turn its elements inside out at once"))]
    pub displacement_over_s: f64,
    /// Constant loads.
    #[serde(default)]
    pub load: Vec<RawLoad>,
    /// How it is drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look: Option<RawLook>,
}

/// Where the elements of a body come from: exactly one of `box`, `grid`, `file`, `surface`, `organ`.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["box"]}, {"required": ["grid"]},
    {"required": ["file"]}, {"required": ["surface"]}, {"required": ["organ"]}]))]
pub struct RawMesh {
    /// An axis-aligned block.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r#box: Option<RawBox>,
    /// A block whose cells end at given coordinates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<RawGrid>,
    /// A volumetric mesh: Gmsh .msh, .vtk or .vtu; relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub file: Option<String>,
    /// A closed or dirty surface: .obj, .stl or .ply; relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub surface: Option<String>,
    /// A shape that the program makes itself.
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
    /// Whether nodes of a `file` that lie at the same place become one, which is told; absent: true. False
    /// keeps a mesh as it was made with its cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weld: Option<bool>,
    /// Which parts of a `file` or `surface` are kept, where no element joins them.
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
    /// How a cell is split.
    #[serde(default)]
    pub pattern: RawPattern,
}

/// An axis-aligned block whose cells end at given coordinates, finer where they lie closer.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawGrid {
    /// Rising coordinates along x [m].
    #[schemars(length(min = 2, max = 1025))]
    pub x_m: Vec<f64>,
    /// Rising coordinates along y [m].
    #[schemars(length(min = 2, max = 1025))]
    pub y_m: Vec<f64>,
    /// Rising coordinates along z [m].
    #[schemars(length(min = 2, max = 1025))]
    pub z_m: Vec<f64>,
    /// How a cell is split.
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
    /// Six tetrahedra without a preferred diagonal, as Nienhuys cut his cube.
    Oct6,
    /// Not split: one hexahedron, for `element = "hex8"`.
    Hex,
}

/// A shape that the program makes itself.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawOrgan {
    /// Which.
    #[serde(default)]
    pub shape: Organ,
    /// Lattice cells along its longest side.
    #[schemars(range(min = 4, max = 128), extend("x-next" = "20 to 24 cells run in real time"))]
    pub cells: u32,
}

/// A skin finer than the elements.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSkin {
    /// Parts of each edge of the elements' boundary: n² skin triangles per face.
    #[serde(default = "four")]
    #[schemars(range(min = 1, max = 32), extend("x-next" = "2 to 6 is smooth; triangles rise with the square"))]
    pub divisions: u32,
    /// The surface that the skin rests on: .obj, .stl or .ply, relative to the scene file. Absent: the one
    /// that the mesh was made from, or the elements' own boundary where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1))]
    pub surface: Option<String>,
    /// Factor from the length unit of `surface` to metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "0.001 for a file in millimetres"))]
    pub scale: Option<f64>,
    /// Share of an edge from which a corner is moved onto a cut instead of the triangle split; 0 splits
    /// always.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.5), extend("x-next" = "0.3 leaves few thin triangles along a cut"))]
    pub snapping: f64,
}

fn four() -> u32 {
    4
}

/// A held or displaced part of a body.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawFix {
    /// Which nodes.
    pub r#where: RawWhere,
    /// Which axes are held.
    #[serde(default)]
    pub axes: RawAxes,
    /// Displacement from rest that is held [m].
    #[serde(default)]
    pub displacement_m: Vec3,
}

/// World axes that a fix holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
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
    #[default]
    Xyz,
}

/// A constant load.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLoad {
    /// Which nodes.
    pub r#where: RawWhere,
    /// Total force [N], shared over the selected nodes.
    pub force_n: Vec3,
    /// How it is shared; absent: by area where the selection holds boundary faces, else by volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<RawShare>,
}

/// How a total force is shared over nodes.
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
    /// Inside an axis-aligned box, its faces included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r#box: Option<RawRegionBox>,
    /// Inside a ball.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<RawBall>,
    /// On the side of a plane that the normal points to, the plane included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_space: Option<RawHalfSpace>,
    /// Between two fractions of the body's own extent along an axis.
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

/// A ball.
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
    /// A point of the plane [m].
    pub point_m: Vec3,
    /// Towards the selected side; any length but zero.
    pub normal: Vec3,
}

/// A slice of a body's bounding box.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSlab {
    /// Axis of the slice.
    pub axis: RawAxis,
    /// Start as a fraction of the extent, 0 = lowest node.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-next" = "0 is the lowest node, 1 the highest"))]
    pub from: f64,
    /// End as a fraction of the extent, 1 = highest node.
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

/// A cut that happens by itself: along a blade's sweep, or along a path on the skin to a depth.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["sweep_m"]}, {"required": ["path_m", "depth_m"]}]))]
pub struct RawCut {
    /// The body that is cut.
    pub body: String,
    /// Simulated time of the cut [s].
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-next" = "0 cuts before the first step"))]
    pub at_s: f64,
    /// How the mesh is cut; absent: as `cutting.method` of the body says, with which it has to agree.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<RawCutMethod>,
    /// Successive blade segments [tip, heel] in the deformed body [m]; they span the cut surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 2, max = 1024))]
    pub sweep_m: Option<Vec<[Vec3; 2]>>,
    /// Points near the skin of the deformed body [m]; the incision follows the skin between them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 2, max = 64))]
    pub path_m: Option<Vec<Vec3>>,
    /// How deep the tool goes into the skin along `path_m` [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-next" = "elements are opened that the blade cuts through"))]
    pub depth_m: Option<f64>,
}

/// How a mesh is cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawCutMethod {
    /// Pieces and copies inside the elements; the mesh stays.
    #[default]
    Xfem,
    /// Along element faces, nodes moved onto the sweep; the mesh changes. For `tet4`.
    Snap,
    /// Unlinked cells of a hexahedral body; not supported yet.
    Links,
}

/// What a cut does to a body.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawCutting {
    /// How the mesh is cut.
    pub method: RawCutMethod,
    /// What becomes of a part that a cut leaves without a held node; `pinned` goes with `snap`.
    pub loose: RawLoose,
}

/// What becomes of a part that hangs on nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawLoose {
    /// It is a free body.
    #[default]
    Free,
    /// It is held where it is, at the corners of its largest skin face.
    Pinned,
}

/// A material point whose path is recorded.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProbe {
    /// Name, unique among probes.
    #[schemars(regex(pattern = r"^[a-z0-9_-]+$"), length(min = 1, max = 64))]
    pub id: String,
    /// The body it is bound to.
    pub body: String,
    /// Where it lies in the body at rest [m].
    pub point_m: Vec3,
    /// Towards the side it belongs to, where the point lies on a cut.
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
    /// Its geometry.
    pub shape: RawShape,
    /// Stiffness of the spring between hand and tissue [N/m].
    #[serde(default = "tool_stiffness")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6, "x-next" = "200 to 2000 N/m suits haptic devices"))]
    pub stiffness_n_m: f64,
    /// Largest force on the tool [N].
    #[serde(default = "tool_force")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e4, "x-next" = "desktop devices give 3 to 20 N"))]
    pub max_force_n: f64,
    /// Poses over time; the tool moves evenly between them. Absent: a client moves it.
    #[serde(default)]
    pub path: Vec<RawPathPoint>,
    /// Start the path again after this time [s]; absent: stay at its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "x-next" = "give the time of one round"))]
    pub repeat_s: Option<f64>,
}

fn tool_stiffness() -> f64 {
    800.0
}

fn tool_force() -> f64 {
    8.0
}

/// Geometry of a tool, its tip in the origin and its shaft along +z: exactly one key.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{"required": ["blade"]}, {"required": ["sphere"]}, {"required": ["capsule"]}]))]
pub struct RawShape {
    /// A cutting edge from tip to heel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blade: Option<RawBlade>,
    /// A ball.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<RawSphere>,
    /// A rod with round ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capsule: Option<RawCapsule>,
}

/// A blade.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBlade {
    /// Length of the cutting edge [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a scalpel has about 0.04 m"))]
    pub length_m: f64,
    /// Thickness of the blade [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0, "x-next" = "a scalpel has about 0.0005 m"))]
    pub thickness_m: f64,
}

/// A ball.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSphere {
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a fingertip has about 0.008 m"))]
    pub radius_m: f64,
}

/// A rod with round ends.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawCapsule {
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a probe has about 0.002 m"))]
    pub radius_m: f64,
    /// Length of its axis [m].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0, "x-next" = "a probe has about 0.1 m"))]
    pub length_m: f64,
}

/// One pose of a scripted tool.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawPathPoint {
    /// Simulated time [s].
    #[schemars(range(min = 0.0), extend("x-next" = "times start at 0 and rise"))]
    pub at_s: f64,
    /// Where the tip is [m].
    pub tip_m: Vec3,
    /// Direction from the tip along the shaft; any length but zero.
    #[serde(default = "upwards")]
    pub toward: Vec3,
    /// What the tool does from here on.
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
    /// Exists, touches nothing.
    Hover,
    /// Pushes what it meets.
    #[default]
    Touch,
    /// Holds the tissue nearest to the tip.
    Grab,
    /// A blade that cuts along its path.
    Cut,
}

/// Effects switched by hand. Absent: on when the rest of the scene calls for it.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawEffects {
    /// `false`: cuts by tools and clients are refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cutting: Option<bool>,
    /// `false`: tools pass through bodies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<bool>,
    /// Contact of a body with itself; `true` is not supported yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub self_collision: Option<bool>,
    /// `true`: kinetic and elastic energy in every step report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<bool>,
    /// `true`: estimate of the discretisation error in every step report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_estimate: Option<bool>,
}

/// How often clients hear of what.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPublish {
    /// Surface frames per second [Hz].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 240.0, "x-next" = "20 to 60 Hz suits eyes"))]
    pub surface_hz: f64,
    /// Contact models per second [Hz].
    #[schemars(range(min = 50.0, max = 2000.0), extend("x-next" = "200 to 1000 Hz suits hands"))]
    pub contact_hz: f64,
    /// Rates and costs per second [Hz].
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 60.0, "x-next" = "1 to 10 Hz is plenty"))]
    pub stats_hz: f64,
}

impl Default for RawPublish {
    fn default() -> Self {
        Self { surface_hz: 60.0, contact_hz: 500.0, stats_hz: 4.0 }
    }
}

/// What is written to disk beside the summary.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawResults {
    /// Write the fields every so many steps and a .pvd series over them; 0: only the final state.
    #[schemars(range(min = 0, max = 1000000), extend("x-next" = "0 writes the final state only"))]
    pub series_steps: u32,
}
