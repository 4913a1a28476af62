//! A scene as ready objects: names resolved to indices, words to types, lists to vectors.

use nalgebra::{Unit, Vector3};
use scindo_collision::Method;
use scindo_physics::element::Held;
use scindo_physics::octree::AdaptSettings;

use super::course::Course;
use super::mechanics::Mechanics;
use crate::inputs::{ToolMode, ToolShape};
use crate::mesh_in::Organ;

/// A scene whose values are all in range and fit each other. Files are not opened yet.
#[derive(Debug, Clone)]
pub struct CheckedScene {
    /// What the scene is called.
    pub name: String,
    /// What it shows, in one sentence; empty if the file does not say.
    pub description: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Acceleration of free fall [m/s²].
    pub gravity_m_s2: Vector3<f64>,
    /// Simulated time per step [s].
    pub step_s: f64,
    /// Friction μ of bodies on bodies, and stiffness of their contact in multiples of E/h.
    pub body_contact: [f64; 2],
    /// How the triangles of surfaces are arranged.
    pub broad_phase: Method,
    /// Soft bodies.
    pub bodies: Vec<BodySpec>,
    /// Rigid things that stand still.
    pub obstacles: Vec<ObstacleSpec>,
    /// Cuts by time, in the order of the file.
    pub cuts: Vec<CutSpec>,
    /// Recorded material points.
    pub probes: Vec<ProbeSpec>,
    /// Rigid tools.
    pub tools: Vec<ToolSpec>,
    /// Effects switched by hand.
    pub effects: EffectSwitches,
    /// Publication rates.
    pub publish: PublishRates,
    /// Write the fields every so many steps; 0: only the final state.
    pub series_steps: u32,
}

/// A soft body.
#[derive(Debug, Clone)]
pub struct BodySpec {
    /// Name.
    pub id: String,
    /// Where its elements come from.
    pub mesh: MeshSource,
    /// Its cells, if it consists of octree cells.
    pub octree: Option<OctreeSpec>,
    /// Regions of another material; the last one that holds a point counts.
    pub materials: Vec<MaterialSpec>,
    /// Its skin; none: the elements' boundary.
    pub skin: Option<SkinSpec>,
    /// Whether only the largest part of the mesh is kept.
    pub largest_part: bool,
    /// How it is computed.
    pub mechanics: Mechanics,
    /// Young's modulus [Pa].
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Density at rest [kg/m³].
    pub density_kg_m3: f64,
    /// Rayleigh damping by mass [1/s].
    pub damping_mass_1_s: f64,
    /// Rayleigh damping by stiffness [s].
    pub damping_stiffness_s: f64,
    /// Fracture toughness [J/m²]; 0: none.
    pub toughness_j_m2: f64,
    /// Velocity at the start [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Held parts.
    pub fixes: Vec<FixSpec>,
    /// What share of the displacements of held parts is reached when.
    pub displacement: Course,
    /// Forces, weights and pressures on parts of it.
    pub loads: Vec<LoadSpec>,
    /// How it is drawn.
    pub look: LookSpec,
}

impl BodySpec {
    /// From when on displacements and loads no longer change [s].
    pub fn settled_s(&self) -> f64 {
        self.loads.iter().map(|load| load.course.end_s()).fold(self.displacement.end_s(), f64::max)
    }
}

/// Cells of an octree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OctreeSpec {
    /// Finest cells along the longest side.
    pub cells: u32,
    /// The largest cells are 2^levels finest cells wide.
    pub levels: u8,
    /// Level that is simulated; 0: the cells themselves.
    pub simulate_level: u8,
    /// Refinement and coarsening between steps; none: the cells stay as they are.
    pub adapt: Option<AdaptSpec>,
}

/// When cells of an octree are divided and joined between steps.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AdaptSpec {
    /// Where cells are fine.
    pub settings: AdaptSettings,
    /// Steps from one adaptation to the next.
    pub every_steps: u32,
    /// Steps from one estimate of the error to the next; each is followed by an adaptation.
    pub error_every_steps: u32,
}

/// A region of another material.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialSpec {
    /// The part of the body that has this material.
    pub place: MaterialPlace,
    /// Young's modulus [Pa].
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Density at rest [kg/m³].
    pub density_kg_m3: f64,
}

/// Where a material is.
#[derive(Debug, Clone, PartialEq)]
pub enum MaterialPlace {
    /// In a region of rest space.
    Region(Region),
    /// Inside a surface file.
    Surface {
        /// Path as written.
        path: String,
        /// Metres per length unit of the file.
        scale: f64,
    },
    /// In a group of elements of the mesh file.
    Group {
        /// Its name or number.
        group: String,
        /// Cell array that the number is a value of.
        array: Option<String>,
    },
}

/// How a body is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct LookSpec {
    /// Colour of the skin, 0xRRGGBB in sRGB; none: the viewer's choice.
    pub colour: Option<u32>,
    /// 1 is opaque.
    pub opacity: f64,
    /// Layers inside wounds: where each ends below the skin [m], rising, and its colour.
    pub layers: Vec<(f64, u32)>,
    /// Image on the skin.
    pub texture: Option<TextureSpec>,
}

/// An image on the skin of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureSpec {
    /// Path of the image as written.
    pub image: String,
    /// Where the skin lies on it.
    pub mapping: TextureMapping,
}

/// Where the skin lies on an image.
#[derive(Debug, Clone, PartialEq)]
pub enum TextureMapping {
    /// As on a surface with texture coordinates: its path as written and metres per length unit; none: the surface that
    /// the mesh was made from.
    Surface(Option<(String, f64)>),
    /// Along the axes, repeated after this length [m].
    Axes(f64),
}

/// A skin finer than the elements.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinSpec {
    /// Parts of each edge of the elements' boundary; none: the skin consists of the triangles of the surface.
    pub divisions: Option<usize>,
    /// Share of an edge from which a corner is moved onto a cut.
    pub snapping: f64,
    /// Surface it rests on as path and metres per length unit; none: the one the mesh was made from.
    pub surface: Option<(String, f64)>,
}

/// Where the elements of a body come from.
#[derive(Debug, Clone, PartialEq)]
pub enum MeshSource {
    /// A block.
    Box {
        /// Lower corner [m].
        min_m: Vector3<f64>,
        /// Upper corner [m].
        max_m: Vector3<f64>,
        /// Cells along x, y, z.
        cells: [usize; 3],
        /// How a cell is split.
        split: CellSplit,
    },
    /// A block whose cells end at given coordinates.
    Grid {
        /// Rising coordinates along x, y, z [m].
        lines_m: [Vec<f64>; 3],
        /// How a cell is split.
        split: CellSplit,
    },
    /// A volumetric mesh file.
    File {
        /// Path as written.
        path: String,
        /// Metres per length unit of the file.
        scale: f64,
        /// Whether nodes at the same place become one.
        weld: bool,
    },
    /// A surface file, turned into a lattice with the surface embedded.
    Surface {
        /// Path as written.
        path: String,
        /// Cells along the longest side.
        cells: usize,
        /// Metres per length unit of the file.
        scale: f64,
    },
    /// A shape of our own.
    Organ {
        /// The shape, by its name.
        shape: Organ,
        /// Cells along the longest side.
        cells: usize,
    },
}

impl MeshSource {
    /// How the cells of a block are split; none for other meshes.
    pub fn split(&self) -> Option<CellSplit> {
        match self {
            MeshSource::Box { split, .. } | MeshSource::Grid { split, .. } => Some(*split),
            _ => None,
        }
    }

    /// Whether it is a block of hexahedra that are equal cubes.
    pub fn has_cubes(&self) -> bool {
        let MeshSource::Box { min_m, max_m, cells, split: CellSplit::Hex } = self else { return false };
        let extent = max_m - min_m;
        let h = extent.x / cells[0] as f64;
        // As far as rounding of the corners goes; see `Octree::of_cubes`.
        h > 0.0 && (1..3).all(|k| (extent[k] / h - cells[k] as f64).abs() < 5e-7)
    }
}

/// How a cubic cell is split into elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellSplit {
    /// Five tetrahedra, mirrored from cell to cell.
    Five,
    /// Six tetrahedra around the cell's diagonal.
    Six,
    /// Six tetrahedra as Nienhuys cut his cube.
    Octahedral,
    /// Not at all: a hexahedron.
    Hex,
}

/// Held nodes.
#[derive(Debug, Clone)]
pub struct FixSpec {
    /// The nodes that are held.
    pub region: Region,
    /// Held directions.
    pub held: Held,
    /// Displacement from rest that is held [m].
    pub displacement_m: Vector3<f64>,
}

/// A load.
#[derive(Debug, Clone)]
pub struct LoadSpec {
    /// Which nodes.
    pub region: Region,
    /// What acts there.
    pub kind: LoadKind,
    /// What part of it acts when.
    pub course: Course,
}

/// What a load is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadKind {
    /// A force that keeps its direction.
    Force {
        /// Total [N].
        force_n: Vector3<f64>,
        /// How it is shared; none: by area where possible, else by volume.
        share: Option<Share>,
    },
    /// A pressure that follows the surface.
    Pressure {
        /// It pushes into the body if it is positive [Pa].
        pressure_pa: f64,
    },
}

/// How a total force is shared over nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Share {
    /// By boundary area.
    Area,
    /// By volume.
    Volume,
}

/// A region of rest space that selects nodes.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Region {
    /// An axis-aligned box, faces included.
    Box {
        /// Lower corner [m].
        min_m: Vector3<f64>,
        /// Upper corner [m].
        max_m: Vector3<f64>,
    },
    /// A ball.
    Ball {
        /// Centre [m].
        centre_m: Vector3<f64>,
        /// Radius [m].
        radius_m: f64,
    },
    /// One side of a plane, the plane included.
    HalfSpace {
        /// A point of the plane [m].
        point_m: Vector3<f64>,
        /// Towards the selected side.
        normal: Unit<Vector3<f64>>,
    },
    /// A slice of the body's own bounding box.
    Slab {
        /// Axis index 0, 1, 2.
        axis: usize,
        /// From this fraction of the extent …
        from: f64,
        /// … to this one.
        to: f64,
    },
}

/// Where a cut goes.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum CutPath {
    /// Successive blade segments [tip, heel] [m].
    Sweep(Vec<[Vector3<f64>; 2]>),
    /// Along the skin, to a depth.
    Incision {
        /// Points near the skin [m].
        points: Vec<Vector3<f64>>,
        /// Depth below the skin [m].
        depth_m: f64,
    },
    /// Along a plane, through the whole body.
    Plane {
        /// A point on the plane [m].
        point_m: Vector3<f64>,
        /// Unit vector across it.
        normal: Unit<Vector3<f64>>,
    },
}

/// A cut by time.
#[derive(Debug, Clone)]
pub struct CutSpec {
    /// Index of the body.
    pub body: usize,
    /// When [s].
    pub at_s: f64,
    /// Where it goes.
    pub blade: CutPath,
}

/// A recorded material point.
#[derive(Debug, Clone)]
pub struct ProbeSpec {
    /// Name.
    pub id: String,
    /// Index of the body.
    pub body: usize,
    /// Rest position [m].
    pub point_m: Vector3<f64>,
    /// Towards its side of a cut.
    pub side: Option<Unit<Vector3<f64>>>,
}

/// A rigid thing that stands still.
#[derive(Debug, Clone, PartialEq)]
pub struct ObstacleSpec {
    /// Name.
    pub id: String,
    /// The shape that bodies and tools cannot enter.
    pub solid: Solid,
    /// Coefficient of dry friction μ.
    pub friction: f64,
    /// Stiffness of the contact in multiples of E/h.
    pub stiffness: f64,
}

/// What is solid of an obstacle.
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// Everything behind a plane.
    HalfSpace {
        /// A point of the plane [m].
        point_m: Vector3<f64>,
        /// Out of the solid.
        normal: Unit<Vector3<f64>>,
    },
    /// A box along the axes.
    Box {
        /// Lower corner [m].
        min_m: Vector3<f64>,
        /// Upper corner [m].
        max_m: Vector3<f64>,
    },
    /// A ball, or a segment with a radius.
    Capsule {
        /// The ends of the segment [m].
        ends_m: [Vector3<f64>; 2],
        /// Radius [m].
        radius_m: f64,
    },
    /// The inside of a closed surface.
    Surface {
        /// Path as written.
        path: String,
        /// Metres per length unit of the file.
        scale: f64,
        /// Where the origin of the file lies [m].
        at_m: Vector3<f64>,
    },
}

/// A rigid tool.
#[derive(Debug, Clone)]
pub struct ToolSpec {
    /// Name.
    pub id: String,
    /// Geometry.
    pub shape: ToolShape,
    /// Spring between hand and tissue [N/m].
    pub stiffness_n_m: f64,
    /// Largest force [N].
    pub max_force_n: f64,
    /// Coefficient of dry friction between it and the tissue on which it presses.
    pub friction: f64,
    /// Script, by rising time; empty: moved by a client.
    pub path: Vec<PathPoint>,
    /// The script starts again after this time [s].
    pub repeat_s: Option<f64>,
}

impl ToolSpec {
    /// Whether the tool can cut.
    pub fn cuts(&self) -> bool {
        matches!(self.shape, ToolShape::Blade { .. })
    }
}

/// One pose of a script.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PathPoint {
    /// When [s].
    pub at_s: f64,
    /// Tip [m].
    pub tip_m: Vector3<f64>,
    /// From the tip along the shaft.
    pub toward: Unit<Vector3<f64>>,
    /// The tool's x axis, as far as it is across the shaft; none: any.
    pub across: Option<Unit<Vector3<f64>>>,
    /// What the tool does from here on.
    pub mode: ToolMode,
}

/// Effects switched by hand; none: as the scene calls for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectSwitches {
    /// Cuts by tools and clients.
    pub cutting: Option<bool>,
    /// Blades need force to cut.
    pub cutting_force: Option<bool>,
    /// Tools push bodies.
    pub contact: Option<bool>,
    /// Obstacles stop bodies.
    pub obstacles: Option<bool>,
    /// Bodies touch each other.
    pub body_collision: Option<bool>,
    /// Bodies touch themselves.
    pub self_collision: Option<bool>,
    /// Bodies at rest sleep.
    pub sleep: Option<bool>,
    /// Late steps give up accuracy.
    pub governor: Option<bool>,
    /// Energies in every report.
    pub energy: Option<bool>,
    /// Estimated discretisation error in every report.
    pub error_estimate: Option<bool>,
}

/// How often clients hear of what [Hz].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishRates {
    /// Surface frames.
    pub surface_hz: f64,
    /// Contact models.
    pub contact_hz: f64,
    /// Rates and costs.
    pub stats_hz: f64,
}
