//! The coarse space of a body, and its matrix as the body moves.

use nalgebra::{UnitQuaternion, Vector3};
use scindo_matter::element::Held;
use scindo_matter::element::Points;
use scindo_matter::material::{Lame, Material};
use scindo_matter::team::Team;

use super::coarse_matrix::CoarseMatrix;
use super::interpolation::Interpolation;
use super::lattice::Lattice;
use super::parts::Parts;
use super::system::CoarseSystem;
use crate::operator::{Padded, Spring};

/// Edge of a lattice cell over the mean distance of nodes. With 3 a converged step of 12 800 to 492 000 tetrahedra
/// takes three quarters of the iterations, each with several times the coarse work; with 5 it takes 5/4 of them.
const RATIO: f64 = 4.0;
/// Number of coarse unknowns (of three components) above which cells become larger: factors would be too expensive.
const MOST_UNKNOWNS: f64 = 4000.0;
/// A_c is factorised anew when the material of a cell has turned by more than this [rad].
const TURN: f32 = 0.1;

/// Interpolation, coarse matrix and its factors.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct CoarseSpace {
    pub(super) interpolation: Interpolation,
    parts: Parts,
    matrix: CoarseMatrix,
    /// Lamé constants of the body [Pa] that the parts were made for.
    lame: Lame,
    /// What the factors were made for: factors of stiffness and mass, rotations, prescribed directions, springs.
    made_for: Option<[f64; 2]>,
    turned: Vec<UnitQuaternion<f32>>,
    held: Vec<(u32, Held)>,
    springs: Vec<Spring>,
    /// Pᵀr and A_c⁻¹Pᵀr.
    b: Vec<Padded>,
    u: Vec<Padded>,
    /// Number of factorisations so far.
    updates: u64,
}

impl CoarseSpace {
    /// The space for a body with these quadrature `points`, copies at `rest` [m] with masses `mass` [kg]. Copies for
    /// which `left_out` holds keep out of it. `None` without volume, or without memory for the factors.
    pub fn new(
        (points, material): (&dyn Points, &Material),
        (rest, mass): (&[Vector3<f64>], &[f64]),
        left_out: &dyn Fn(u32) -> bool,
    ) -> Option<Self> {
        let mut volume = 0.0;
        points.for_points(rest, &mut |point| volume += point.weight);
        let n = rest.len() as f64;
        let edge = RATIO.max((n / MOST_UNKNOWNS).cbrt()) * (volume / n).cbrt();
        if !(edge > 0.0 && edge.is_finite()) {
            return None;
        }
        let for_groups = |visit: &mut dyn FnMut(&[u32])| {
            points.for_points(rest, &mut |point| visit(point.nodes));
        };
        let interpolation = Interpolation::new(&Lattice::over(rest, edge), rest, (&for_groups, left_out));
        let (parts, blocks) = Parts::new(&interpolation, (points, material), rest);
        let matrix = CoarseMatrix::new(blocks, &interpolation, mass)?;
        let n = interpolation.n_coarse();
        Some(Self {
            interpolation,
            parts,
            matrix,
            lame: material.lame(),
            made_for: None,
            turned: Vec::new(),
            held: Vec::new(),
            springs: Vec::new(),
            b: vec![[0.0; 4]; n],
            u: vec![[0.0; 4]; n],
            updates: 0,
        })
    }

    /// Whether it was made for a material with these constants.
    pub fn is_made_for(&self, material: &Material) -> bool {
        self.lame == material.lame()
    }

    /// Number of coarse unknowns, of three components each.
    pub fn n_coarse(&self) -> usize {
        self.interpolation.n_coarse()
    }

    /// Number of factorisations so far.
    pub fn n_updates(&self) -> u64 {
        self.updates
    }

    /// Whether there are factors; without them the preconditioner is block-Jacobi.
    pub fn is_factored(&self) -> bool {
        self.matrix.is_factored()
    }

    /// Brings the factors up to date with `system`, if it differs notably from the one they were made for.
    pub fn follow(&mut self, system: &CoarseSystem<'_>) {
        let Self { parts, turned, held, springs, .. } = self;
        match system.rotates {
            true => parts.rotate(system.x),
            false => parts.rotations.fill(UnitQuaternion::identity()),
        }
        let turn = |(a, b): (&UnitQuaternion<f32>, &UnitQuaternion<f32>)| a.angle_to(b) > TURN;
        let fixed = system.fixed.iter().map(|f| (f.copy, f.held));
        let made_for = Some([system.scale, system.mass_factor]);
        if self.made_for == made_for
            && !parts.rotations.iter().zip(&*turned).any(turn)
            && fixed.clone().eq(held.iter().copied())
            && springs[..] == *system.springs
        {
            return;
        }
        self.made_for = made_for;
        turned.clone_from(&parts.rotations);
        held.clear();
        held.extend(fixed);
        springs.clear();
        springs.extend_from_slice(system.springs);
        self.updates += 1;
        self.matrix.begin(system.mass_factor);
        self.parts.add_to(system.scale, self.matrix.blocks_mut());
        self.matrix.add_springs(&self.interpolation, system);
        self.matrix.factorise();
    }

    /// b = Pᵀr and u = A_c⁻¹b; returns bᵀu. Displacements P u are then those of the interpolation.
    pub(super) fn solve(&mut self, team: &mut Team, r: &[Padded]) -> f64 {
        self.interpolation.restrict(team, r, &mut self.b);
        self.matrix.solve(&self.b, &mut self.u);
        self.interpolation.set(&self.u);
        crate::operator::rows::dot(&self.b, &self.u)
    }
}
