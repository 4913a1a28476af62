//! `final.vtu`: the material as tetrahedra that fill it once, every surface triangle with its cut tag.
//!
//! An element that is cut is written as the tetrahedra its pieces consist of, so that slices, volumes and
//! integrals are right: their points are moved by the copies of the piece, their stress is that of the piece.
//! `element` and `piece` say where a tetrahedron belongs, `copy` which copy of a node a point is.
//! Triangles are the surface that is shown, lips included.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use scindo_physics::body::Body;
use scindo_physics::cut::SurfaceVertex;

use super::vtu::{CellBlock, Field, FieldValues, Grid, VtuError, save_vtu};
use crate::simulation::{SimBody, Simulation};

/// Cut tag of a tetrahedron, element and piece of a triangle, copy of a point that is not at a node.
const NONE: i32 = -1;

#[derive(Default)]
struct Fields {
    points: Vec<Vector3<f64>>,
    displacement: Vec<Vector3<f64>>,
    velocity: Vec<Vector3<f64>>,
    copy: Vec<i32>,
    tets: Vec<[u32; 4]>,
    triangles: Vec<[u32; 3]>,
    cell_body: [Vec<i32>; 2],
    cut_tag: [Vec<i32>; 2],
    element: Vec<i32>,
    piece: Vec<i32>,
    fraction: Vec<f64>,
    von_mises: Vec<f64>,
    normal_stress: Vec<Vector3<f64>>,
    shear_stress: Vec<Vector3<f64>>,
}

/// Writes the present state of all bodies.
///
/// # Errors
/// What the disk says.
pub fn write_fields(path: &Path, simulation: &Simulation) -> Result<(), VtuError> {
    let mut fields = Fields::default();
    for (number, body) in (0..).zip(simulation.bodies()) {
        fields.add(number, body);
    }
    let Fields { points, tets, triangles, .. } = &fields;
    // Triangles carry no stress of their own.
    let on_all = |values: &[f64]| [values, &vec![0.0; triangles.len()]].concat();
    let vectors = |values: &[Vector3<f64>]| [values, &vec![Vector3::zeros(); triangles.len()]].concat();
    let of_tets = |values: &[i32]| [values, &vec![NONE; triangles.len()]].concat();
    let (element, piece) = (of_tets(&fields.element), of_tets(&fields.piece));
    let (fraction, von_mises) = (on_all(&fields.fraction), on_all(&fields.von_mises));
    let (normal, shear) = (vectors(&fields.normal_stress), vectors(&fields.shear_stress));
    let (body, tag) = (fields.cell_body.concat(), fields.cut_tag.concat());
    let field = |name, values| Field { name, values };
    save_vtu(
        path,
        &Grid {
            points,
            cells: &[CellBlock::Tets(tets), CellBlock::Triangles(triangles)],
            point_fields: &[
                field("displacement_m", FieldValues::Vectors(&fields.displacement)),
                field("velocity_m_s", FieldValues::Vectors(&fields.velocity)),
                field("copy", FieldValues::Integers(&fields.copy)),
            ],
            cell_fields: &[
                field("body", FieldValues::Integers(&body)),
                field("cut_tag", FieldValues::Integers(&tag)),
                field("element", FieldValues::Integers(&element)),
                field("piece", FieldValues::Integers(&piece)),
                field("volume_fraction", FieldValues::Scalars(&fraction)),
                field("von_mises_pa", FieldValues::Scalars(&von_mises)),
                field("cauchy_xx_yy_zz_pa", FieldValues::Vectors(&normal)),
                field("cauchy_yz_zx_xy_pa", FieldValues::Vectors(&shear)),
            ],
            time_s: Some(simulation.time_s()),
        },
    )
}

impl Fields {
    fn add(&mut self, number: i32, sim: &SimBody) {
        let body = &sim.body;
        let solid = body.cut_mesh().solid();
        let stresses = body.cauchy_stresses();
        let first = self.add_points(body, &solid.vertices);
        for (tet, &p) in solid.tets.iter().zip(&solid.piece) {
            let (piece, stress) = (&body.cut_mesh().pieces()[p as usize], &stresses[p as usize]);
            self.tets.push(tet.map(|vertex| first + vertex));
            self.cell_body[0].push(number);
            self.cut_tag[0].push(NONE);
            self.element.push(piece.element as i32);
            self.piece.push(p as i32);
            self.fraction.push(piece.fraction);
            self.von_mises.push(von_mises(stress));
            self.normal_stress.push(stress.diagonal());
            self.shear_stress.push(Vector3::new(stress[(1, 2)], stress[(2, 0)], stress[(0, 1)]));
        }
        let first = self.add_points(body, &body.surface().vertices);
        for (triangle, tag) in body.surface().triangles.iter().zip(&body.surface().tags) {
            self.triangles.push(triangle.map(|vertex| first + vertex));
            self.cell_body[1].push(number);
            self.cut_tag[1].push(*tag as i32);
        }
    }

    /// Points bound to copies; the number of the first.
    fn add_points(&mut self, body: &Body, vertices: &[SurfaceVertex]) -> u32 {
        let first = self.points.len() as u32;
        for vertex in vertices {
            let x = vertex.position(body.positions());
            self.points.push(x);
            self.displacement.push(x - vertex.position(body.rest_positions()));
            self.velocity.push(vertex.position(body.velocities()));
            let whole = vertex.weights.iter().position(|&weight| weight == 1.0);
            self.copy.push(whole.map_or(NONE, |slot| vertex.copies[slot] as i32));
        }
        first
    }
}

/// √(3/2 s:s) of the deviator s [Pa].
fn von_mises(stress: &Matrix3<f64>) -> f64 {
    let deviator = stress - Matrix3::from_diagonal_element(stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}
