//! The state of all bodies on disk, as ParaView and other readers of VTK files take it.
//!
//! * `NAME.vtu`: the material as tetrahedra or hexahedra that fill it once. A tetrahedron that is cut is written as
//!   those its pieces consist of, so that slices, volumes and integrals are right: their points are moved by the copies of
//!   the piece, their stress is that of the piece. `element` and `piece` say where a cell belongs, `region` which
//!   material it has (0 that of the body, n that of its n-th `[[body.material]]`), `copy` which copy of a node a
//!   point is.
//! * `NAME-surface.vtp`: the surface that is shown, lips included, every triangle with its cut tag.
//!
//! Points are current positions; `displacement_m` leads there from `rest_position_m`.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};

use scindo_physics::body::Body;
use scindo_physics::cut::SolidCells;
use scindo_physics::element::MaterialPoint;

use crate::body::{SimBody, von_mises};
use crate::format::vtu::{Cells, Field, FieldValues, Grid, SolidCell, VtuError, save_grid, save_vtm};
use crate::simulation::Simulation;

/// Copy of a point that is not at a node.
const NONE: i32 = -1;

/// Points that move with copies of nodes.
#[derive(Default)]
struct Points {
    current: Vec<Vector3<f64>>,
    rest: Vec<Vector3<f64>>,
    displacement: Vec<Vector3<f64>>,
    velocity: Vec<Vector3<f64>>,
    copy: Vec<i32>,
}

/// The material.
#[derive(Default)]
struct Solid {
    points: Points,
    cells: Vec<SolidCell>,
    body: Vec<i32>,
    element: Vec<i32>,
    piece: Vec<i32>,
    region: Vec<i32>,
    fraction: Vec<f64>,
    von_mises: Vec<f64>,
    stress: Vec<[f64; 6]>,
}

/// What is shown of it.
#[derive(Default)]
struct Skin {
    points: Points,
    triangles: Vec<[u32; 3]>,
    body: Vec<i32>,
    cut_tag: Vec<i32>,
}

/// Writes the present state of all bodies as `NAME.vtu` and `NAME-surface.vtp`; the names of the two files.
///
/// # Errors
/// What the disk says, and of which file.
pub fn write_fields(
    directory: &Path,
    name: &str,
    simulation: &Simulation,
) -> Result<[String; 2], (PathBuf, VtuError)> {
    let (mut solid, mut skin) = (Solid::default(), Skin::default());
    for (number, body) in (0..).zip(simulation.bodies()) {
        solid.add(number, body);
        skin.add(number, body);
    }
    let files = [format!("{name}.vtu"), format!("{name}-surface.vtp")];
    let [solid_path, skin_path] = [&files[0], &files[1]].map(|file| directory.join(file));
    let time_s = simulation.time_s();
    solid.write(&solid_path, time_s).map_err(|error| (solid_path, error))?;
    skin.write(&skin_path, time_s).map_err(|error| (skin_path, error))?;
    Ok(files)
}

/// Writes [`write_fields`] and `NAME.vtm`, which opens both files at once.
///
/// # Errors
/// What the disk says, and of which file.
pub(super) fn write_blocks(
    directory: &Path,
    name: &str,
    simulation: &Simulation,
) -> Result<(), (PathBuf, VtuError)> {
    let [solid, skin] = write_fields(directory, name, simulation)?;
    let path = directory.join(format!("{name}.vtm"));
    save_vtm(&path, &[("solid", &solid), ("surface", &skin)]).map_err(|error| (path, error.into()))
}

impl Points {
    /// Points bound to copies; the number of the first.
    fn add(&mut self, body: &Body, vertices: &[MaterialPoint]) -> u32 {
        let first = self.current.len() as u32;
        for vertex in vertices {
            let (x, rest) = (vertex.position(body.positions()), vertex.position(body.rest_positions()));
            self.current.push(x);
            self.rest.push(rest);
            self.displacement.push(x - rest);
            self.velocity.push(vertex.position(body.velocities()));
            let whole = vertex.carriers().find(|(_, weight)| *weight == 1.0);
            self.copy.push(whole.map_or(NONE, |(copy, _)| copy as i32));
        }
        first
    }

    fn fields(&self) -> [Field<'_>; 4] {
        [
            Field { name: "displacement_m", values: FieldValues::Vectors(&self.displacement) },
            Field { name: "rest_position_m", values: FieldValues::Vectors(&self.rest) },
            Field { name: "velocity_m_s", values: FieldValues::Vectors(&self.velocity) },
            Field { name: "copy", values: FieldValues::Integers(&self.copy) },
        ]
    }
}

impl Solid {
    fn add(&mut self, number: i32, sim: &SimBody) {
        let body = &sim.body;
        let solid = body.solid();
        let (stresses, regions) = (body.cauchy_stresses(), body.element_regions());
        let first = self.points.add(body, &solid.vertices);
        match &solid.cells {
            SolidCells::Tets(tets) => {
                self.cells.extend(tets.iter().map(|tet| SolidCell::Tet(tet.map(|vertex| first + vertex))));
            }
            SolidCells::Hexes(hexes) => {
                self.cells.extend(hexes.iter().map(|hex| SolidCell::Hex(hex.map(|vertex| first + vertex))));
            }
        }
        for origin in &solid.origins {
            let stress = &stresses[origin.stress as usize];
            self.body.push(number);
            self.element.push(origin.element as i32);
            self.piece.push(origin.piece as i32);
            self.region.push(i32::from(regions[origin.stress as usize]));
            self.fraction.push(origin.fraction);
            self.von_mises.push(von_mises(stress));
            self.stress.push(in_vtk_order(stress));
        }
    }

    fn write(&self, path: &Path, time_s: f64) -> Result<(), VtuError> {
        let field = |name, values| Field { name, values };
        let grid = Grid {
            points: &self.points.current,
            cells: Cells::Solids(&self.cells),
            point_fields: &self.points.fields(),
            cell_fields: &[
                field("body", FieldValues::Integers(&self.body)),
                field("element", FieldValues::Integers(&self.element)),
                field("piece", FieldValues::Integers(&self.piece)),
                field("region", FieldValues::Integers(&self.region)),
                field("volume_fraction", FieldValues::Scalars(&self.fraction)),
                field("von_mises_pa", FieldValues::Scalars(&self.von_mises)),
                field("cauchy_stress_pa", FieldValues::SymmetricTensors(&self.stress)),
            ],
            time_s: Some(time_s),
        };
        save_grid(path, &grid)
    }
}

impl Skin {
    fn add(&mut self, number: i32, sim: &SimBody) {
        let surface = sim.body.surface();
        let first = self.points.add(&sim.body, &surface.vertices);
        for (triangle, tag) in surface.triangles.iter().zip(&surface.tags) {
            self.triangles.push(triangle.map(|vertex| first + vertex));
            self.body.push(number);
            self.cut_tag.push(*tag as i32);
        }
    }

    fn write(&self, path: &Path, time_s: f64) -> Result<(), VtuError> {
        let grid = Grid {
            points: &self.points.current,
            cells: Cells::Triangles(&self.triangles),
            point_fields: &self.points.fields(),
            cell_fields: &[
                Field { name: "body", values: FieldValues::Integers(&self.body) },
                Field { name: "cut_tag", values: FieldValues::Integers(&self.cut_tag) },
            ],
            time_s: Some(time_s),
        };
        save_grid(path, &grid)
    }
}

/// xx, yy, zz, xy, yz, xz.
fn in_vtk_order(stress: &Matrix3<f64>) -> [f64; 6] {
    [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)].map(|entry| stress[entry])
}
