//! The elastic energy of a body with the rotations that its stiffness holds, for the energy
//! balance of Newmark's method: cheap enough for every step, since no rotation has to be found.

use nalgebra::{Matrix3, Vector3};

use crate::element::piece_energy;
use crate::material::Material;
use crate::operator::{BLOCK, Place, Stiffness};
use crate::space::Space;
use crate::team::{Team, blocks};

/// What the energy of the pieces of a body is computed from; empty until it is needed.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct HeldEnergy {
    pieces: Vec<HeldPiece>,
    /// Sum of each block of pieces [J].
    partial: Vec<f64>,
}

#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct HeldPiece {
    copies: [u32; 4],
    place: Place,
    /// ∇N_1, ∇N_2, ∇N_3 at rest [1/m].
    gradients: [Vector3<f64>; 3],
    /// w V at rest [m³].
    volume: f64,
}

impl HeldEnergy {
    /// Takes over the present pieces, which `elastic` has arranged.
    pub fn follow(&mut self, space: &dyn Space, elastic: &dyn Stiffness) {
        self.pieces.clear();
        let Some(tets) = space.tets() else { return };
        self.pieces.extend(tets.pieces().iter().zip(elastic.places().iter()).map(|(piece, &place)| {
            let e = piece.element as usize;
            let [_, gradients @ ..] = tets.mesh().gradients(e);
            HeldPiece {
                copies: piece.copies,
                place,
                gradients,
                volume: piece.fraction * tets.mesh().volume(e),
            }
        }));
        self.partial.resize(self.pieces.len().div_ceil(BLOCK), 0.0);
    }

    /// Whether the elements are other than tetrahedra: their energy is then not known here.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// The energy [J] at `x` [m]. Where the rotations of the last update are not those of `x`, it is slightly
    /// too large.
    pub fn at(
        &mut self,
        team: &mut Team,
        elastic: &dyn Stiffness,
        x: &[Vector3<f64>],
        material: &Material,
    ) -> f64 {
        let (pieces, lame) = (&self.pieces, material.lame());
        let energy = |piece: &HeldPiece| {
            let [origin, others @ ..] = piece.copies.map(|copy| x[copy as usize]);
            let edges = others.iter().zip(&piece.gradients);
            let F: Matrix3<f64> = edges.map(|(x, g)| (x - origin) * g.transpose()).sum();
            if !material.law.rotates() {
                return piece_energy(material.law, lame, &F, piece.volume);
            }
            let R = elastic.rotation(piece.place).map(f64::from);
            let stretch = R.dot(&F) - 3.0; // tr(RᵀF − I)
            piece.volume * (lame.mu * (F - R).norm_squared() + 0.5 * lame.lambda * stretch * stretch)
        };
        team.for_blocks(blocks(&mut self.partial, 1), |block, partial| {
            let first = block * BLOCK;
            partial[0] = pieces[first..pieces.len().min(first + BLOCK)].iter().map(energy).sum();
        });
        self.partial.iter().sum()
    }
}
