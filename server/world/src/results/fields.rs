//! `final.vtu`: every piece as a tetrahedron on its copies, every surface triangle with its cut tag.
//!
//! A piece of a cut element is drawn as its whole tetrahedron, because its displacement is that of
//! all four copies; `volume_fraction` says how much of it is material. The triangles are the true
//! surface, lips included.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use super::vtu::{CellBlock, Field, FieldValues, Grid, VtuError, save_vtu};
use crate::simulation::{SimBody, Simulation};

/// Cut tag of a tetrahedron, which is no surface.
const INTERIOR: i32 = -1;

#[derive(Default)]
struct Fields {
    points: Vec<Vector3<f64>>,
    displacement: Vec<Vector3<f64>>,
    velocity: Vec<Vector3<f64>>,
    tets: Vec<[u32; 4]>,
    triangles: Vec<[u32; 3]>,
    cell_body: [Vec<i32>; 2],
    cut_tag: [Vec<i32>; 2],
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
            ],
            cell_fields: &[
                field("body", FieldValues::Integers(&body)),
                field("cut_tag", FieldValues::Integers(&tag)),
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
        let mesh = body.cut_mesh();
        let first_copy = self.points.len() as u32;
        let rest = body.rest_positions();
        for (x, start) in body.positions().iter().zip(rest) {
            self.points.push(*x);
            self.displacement.push(x - start);
        }
        self.velocity.extend_from_slice(body.velocities());
        for (piece, stress) in mesh.pieces().iter().zip(body.cauchy_stresses()) {
            self.tets.push(piece.copies.map(|copy| first_copy + copy));
            self.cell_body[0].push(number);
            self.cut_tag[0].push(INTERIOR);
            self.fraction.push(piece.fraction);
            self.von_mises.push(von_mises(&stress));
            self.normal_stress.push(stress.diagonal());
            self.shear_stress.push(Vector3::new(stress[(1, 2)], stress[(2, 0)], stress[(0, 1)]));
        }
        let first_vertex = self.points.len() as u32;
        for vertex in &body.surface().vertices {
            let x = vertex.position(body.positions());
            self.points.push(x);
            self.displacement.push(x - vertex.position(rest));
            self.velocity.push(vertex.position(body.velocities()));
        }
        for (triangle, tag) in body.surface().triangles.iter().zip(&body.surface().tags) {
            self.triangles.push(triangle.map(|vertex| first_vertex + vertex));
            self.cell_body[1].push(number);
            self.cut_tag[1].push(*tag as i32);
        }
    }
}

/// √(3/2 s:s) of the deviator s [Pa].
fn von_mises(stress: &Matrix3<f64>) -> f64 {
    let deviator = stress - Matrix3::from_diagonal_element(stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}
