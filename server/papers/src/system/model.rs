//! The bodies of the experiments, and the blades that cut them.

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Rotation3, Vector3};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::Simd;
use scindo_physics::material::Region;
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings, Shape};
use scindo_physics::operator::cells::CellStiffness;
use scindo_physics::space::OctreeSpace;
use scindo_physics::team::Team;

use super::shape::Animal;
use crate::lab::Trouble;

type V = Vector3<f64>;

/// Finest cells across the cube of the paper. With four levels it has 83,299 leaves, the 83.3 K of the paper.
pub const CUBE: u32 = 80;
/// Finest cells across the cube at which the blades stand, 80 cells wide. With aligned blades the cube has 203,503
/// leaves, the 204 K of the paper, where the places are not printed.
const BLADES: [f64; 11] = [7.0, 13.0, 21.0, 27.0, 33.0, 41.0, 47.0, 53.0, 61.0, 67.0, 73.0];
/// Angle of the rotated blades about the vertical [°]; the paper does not print it. The cube has as many leaves as
/// printed, 230 K ± 2 %.
pub const ROTATION_DEG: f64 = 37.0;

/// How a cube is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grid {
    /// Not at all.
    Uncut,
    /// By blades along faces of cells, to half depth.
    Aligned,
    /// By the same blades, turned about the vertical.
    Rotated,
}

impl Grid {
    /// Stable name for programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uncut => "uncut",
            Self::Aligned => "aligned",
            Self::Rotated => "rotated",
        }
    }
}

/// Whether a vertex with this rest position is held.
pub type Held = fn(&V) -> bool;
/// Force per mass [N/kg] at a rest position.
pub type Pull = fn(&V) -> V;

/// A body before it is cut.
#[derive(Clone, Debug)]
pub struct Model {
    /// Name in tables.
    pub name: String,
    /// Its cells.
    pub octree: Octree,
    /// The blades that cut it, one incision each.
    pub blades: Vec<BladeSweep>,
    /// Whether a vertex with this rest position is held.
    pub held: Held,
    /// Force per mass [N/kg] at a rest position.
    pub pull: Pull,
}

/// A body that was cut by all its blades at once.
#[derive(Debug)]
pub struct Cut {
    /// Cells, links and surface.
    pub space: OctreeSpace,
    /// Seconds that the paper's column *cutting* takes: links, refinement, vertices and the kernels of the cells.
    pub seconds: f64,
    /// Seconds of volumes and surface, made anew.
    pub surface_s: f64,
    /// Number of links that are cut.
    pub links: usize,
}

/// A cube of 1 m on the ground, with blades down to half its height, that a radial force fans out.
///
/// # Errors
/// More cells than a lattice may have.
pub fn cube(across: u32, levels: u8, grid: Grid) -> Result<Model, Trouble> {
    layered_cube(across, levels, (grid, 0.5), None)
}

/// The same with a horizontal layer of another material: its lowest and highest height [m], and its constants.
///
/// # Errors
/// More cells than a lattice may have.
pub fn layered_cube(
    across: u32,
    levels: u8,
    (grid, tip): (Grid, f64),
    layer: Option<([f64; 2], Region)>,
) -> Result<Model, Trouble> {
    let shape = BoxShape { min: V::zeros(), max: V::repeat(1.0) };
    let inside = |p: &V| layer.is_some_and(|([low, high], _)| low < p.z && p.z < high);
    let mut octree =
        Octree::fill(&shape, OctreeSettings { cells: across, levels }, &|p| u16::from(inside(p)))?;
    octree.set_regions(layer.iter().map(|(_, region)| *region).collect());
    Ok(Model {
        name: format!("Cube, {}", grid.name()),
        octree,
        blades: match grid {
            Grid::Uncut => Vec::new(),
            Grid::Aligned => grid_of_blades(&places(across), 0.0, tip),
            Grid::Rotated => grid_of_blades(&places(across), ROTATION_DEG, tip),
        },
        held: |X| X.z == 0.0,
        pull: |X| 9.81 * V::new(2.0 * X.x - 1.0, 2.0 * X.y - 1.0, 0.0),
    })
}

/// Places of the paper's blades [m]. Smaller cubes have the same blades on their own faces.
fn places(across: u32) -> Vec<f64> {
    let snapped = |place: &f64| (place / 80.0 * f64::from(across)).round() / f64::from(across);
    let mut places: Vec<f64> = BLADES.iter().map(snapped).collect();
    places.dedup();
    places
}

/// Two families of upright blades at these `places` [m], turned by an angle [°], from above the cube down to the
/// height `tip` [m].
pub fn grid_of_blades(places: &[f64], angle_deg: f64, tip: f64) -> Vec<BladeSweep> {
    let turn = Rotation3::from_axis_angle(&V::z_axis(), angle_deg.to_radians());
    let middle = V::new(0.5, 0.5, 0.0);
    let blade = |place: f64, axis: usize| {
        let edge = |z: f64| {
            [-2.0, 3.0].map(|along| {
                let mut end = V::new(along, along, z);
                end[axis] = place;
                middle + turn * (end - middle)
            })
        };
        BladeSweep { segments: vec![edge(1.5), edge(tip)] }
    };
    (0..2).flat_map(|axis| places.iter().map(move |&place| (place, axis))).map(|(p, a)| blade(p, a)).collect()
}

/// Height below which an animal is held, in parts of its width.
const HELD: f64 = 0.02;

/// How an animal is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cuts {
    /// Not at all.
    Uncut,
    /// Three times along curves.
    Curved,
    /// Along two curves that cross each other.
    Crossed,
    /// Along two curves apart from each other.
    Apart,
    /// Twice from above, a thin slice apart.
    Slices,
}

impl Cuts {
    /// What is appended to the name of the animal.
    fn words(self) -> &'static str {
        match self {
            Self::Uncut | Self::Curved => "",
            Self::Crossed => ", crossing cuts",
            Self::Apart => ", two cuts",
            Self::Slices => ", slices",
        }
    }

    fn blades(self, [low, high]: [V; 2]) -> Vec<BladeSweep> {
        match self {
            Self::Uncut => Vec::new(),
            Self::Curved => ARCS.map(|arc| curved_blade(arc, [low, high])).into(),
            Self::Crossed => CROSSED.map(|arc| curved_blade(arc, [low, high])).into(),
            Self::Apart => APART.map(|arc| curved_blade(arc, [low, high])).into(),
            Self::Slices => {
                SLICES.map(|x| curved_blade(([x, 1.05], [x, 0.8], [x, SLICED]), [low, high])).into()
            }
        }
    }
}

/// The animal, or another solid that stands upright along y.
///
/// # Errors
/// A solid too thin for its cells, or more of them than a lattice may have.
pub fn animal(solid: Option<&dyn Shape>, across: u32, levels: u8, cuts: Cuts) -> Result<Model, Trouble> {
    let is_own = solid.is_none();
    let solid = solid.unwrap_or(&Animal);
    let octree = Octree::fill(solid, OctreeSettings { cells: across, levels }, &|_| 0)?;
    let blades = cuts.blades(solid.bounds());
    Ok(Model {
        name: format!("{}, {across} across{}", if is_own { "Animal" } else { "Surface" }, cuts.words()),
        octree,
        blades,
        held: |X| X.y < HELD,
        pull: |_| V::new(0.0, -9.81, 0.0),
    })
}

/// Three blades along z that are led into the solid on arcs, in parts of its bounds. The solid stays one
/// part: a part that falls freely would be all of the solution.
const ARCS: [Arc; 3] = [
    ([-0.05, 0.42], [0.25, 0.42], [0.52, 0.30]),
    ([0.56, 1.05], [0.72, 0.50], [0.58, 0.07]),
    ([0.76, 1.05], [0.90, 0.55], [0.74, 0.06]),
];
/// Two of them that cross, in the middle of the solid.
const CROSSED: [Arc; 2] =
    [([0.25, 1.05], [0.45, 0.50], [0.60, 0.12]), ([0.75, 1.05], [0.55, 0.50], [0.40, 0.12])];
/// Two of them apart from each other.
const APART: [Arc; 2] =
    [([0.56, 1.05], [0.72, 0.50], [0.58, 0.07]), ([0.30, 1.05], [0.42, 0.55], [0.30, 0.06])];
/// Where slices are cut, and how far down.
const SLICES: [f64; 2] = [0.45, 0.55];
const SLICED: f64 = 0.45;
/// Places of the blade along an arc.
const PLACES: u32 = 16;

/// Beginning, direction and end of a blade that is led on an arc, in parts of the bounds of the solid.
type Arc = ([f64; 2], [f64; 2], [f64; 2]);

fn curved_blade((a, b, c): Arc, [low, high]: [V; 2]) -> BladeSweep {
    let extent = high - low;
    let place = |k: u32| {
        let t = f64::from(k) / f64::from(PLACES);
        let w = [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
        [-0.2, 1.2].map(|z| {
            let in_plane = |i: usize| w[0] * a[i] + w[1] * b[i] + w[2] * c[i];
            low + V::new(in_plane(0), in_plane(1), z).component_mul(&extent)
        })
    };
    BladeSweep { segments: (0..=PLACES).map(place).collect() }
}

impl Model {
    /// Cuts the body at rest. Times are the least of two.
    ///
    /// # Errors
    /// A cut that is refused.
    pub fn cut(&self) -> Result<Cut, Trouble> {
        // The first body goes before the second is made: each may take gigabytes.
        let Cut { seconds, surface_s, .. } = self.cut_once()?;
        let again = self.cut_once()?;
        Ok(Cut { seconds: again.seconds.min(seconds), surface_s: again.surface_s.min(surface_s), ..again })
    }

    fn cut_once(&self) -> Result<Cut, Trouble> {
        let (mut team, mut octree, x) = (Team::alone(), self.octree.clone(), self.octree.rest_positions());
        let started = Instant::now();
        let links = octree.cut_along(&mut team, &x, &self.blades)?.links;
        let lame: Vec<_> = octree.regions().iter().map(Region::lame).collect();
        black_box(CellStiffness::new(Simd::detect(), &octree, &lame));
        let seconds = started.elapsed().as_secs_f64();
        let started = Instant::now();
        let space = OctreeSpace::new(octree);
        Ok(Cut { space, seconds, surface_s: started.elapsed().as_secs_f64(), links })
    }
}
