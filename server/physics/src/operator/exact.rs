//! Linear tetrahedra in double precision, for energies, reactions and the residuals of equilibria, where
//! the single precision of the kernels would show.

use nalgebra::{Matrix3, Vector3};

use crate::cut::{CutMesh, Piece};
use crate::element::{deformation_gradient, piece_energy, piece_forces};
use crate::material::{Lame, Law};

/// A piece in a configuration of the body.
#[derive(Clone, Copy, Debug)]
pub struct Deformed<'a> {
    /// The piece: its element, fraction and copies.
    pub piece: &'a Piece,
    /// Its deformation gradient F.
    pub F: Matrix3<f64>,
    /// Gradients of the shape functions of its element [1/m].
    pub g: [Vector3<f64>; 4],
    /// w V [m³] at rest.
    pub volume: f64,
}

/// All pieces of `mesh` with their copies at `x` [m].
pub fn deformed_pieces<'a>(mesh: &'a CutMesh, x: &'a [Vector3<f64>]) -> impl Iterator<Item = Deformed<'a>> {
    let rest = mesh.mesh();
    mesh.pieces().iter().map(move |piece| {
        let e = piece.element as usize;
        let g = rest.gradients(e);
        let F = deformation_gradient(&piece.copies.map(|c| x[c as usize]), &g);
        Deformed { piece, F, g, volume: piece.fraction * rest.volume(e) }
    })
}

/// Returns the elastic energy [J] at `x` [m] and writes the internal force on every copy [N] to `f_int`.
pub fn internal_forces(
    mesh: &CutMesh,
    (law, lame): (Law, Lame),
    x: &[Vector3<f64>],
    f_int: &mut [Vector3<f64>],
) -> f64 {
    f_int.fill(Vector3::zeros());
    let mut energy = 0.0;
    for d in deformed_pieces(mesh, x) {
        energy += piece_energy(law, lame, &d.F, d.volume);
        let P = law.stress(&d.F, lame);
        for (&copy, force) in d.piece.copies.iter().zip(piece_forces(&P, &d.g, d.volume)) {
            f_int[copy as usize] += force;
        }
    }
    energy
}
