//! What a step asks of the stiffness of a discretisation.

use std::any::Any;
use std::borrow::Cow;
use std::fmt::Debug;

use nalgebra::{Matrix3, Vector3};
use scindo_matter::material::{Lame, Law};
use scindo_matter::team::{Team, blocks};

use super::tet_batch::Block6;
use super::{BLOCK, Padded, block_of, rows};

/// How K̂ is applied.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum OperatorChoice {
    /// Assembled if the stiffness stays the same from step to step (the linear law), by the tets if it
    /// rotates with the material.
    #[default]
    Auto,
    /// By the tets, as far as possible three in a row: 44 bytes and 130 operations per tet, nothing to assemble.
    MatrixFree,
    /// Assembled: 40 bytes and 36 operations per pair of neighbours (1.2 to 1.6 per tet).
    Assembled,
}

/// Parameters of an update.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct ElasticUpdate {
    /// Lamé parameters [Pa].
    pub lame: Lame,
    /// The law, which decides whether pieces rotate.
    pub law: Law,
    /// s, the factor of K̂ [s²].
    pub scale: f64,
}

/// Where a step starts, see [`Stiffness::update`]: the state whose tension stiffens the material, and damping.
#[derive(Clone, Copy, Debug)]
pub struct Tension<'a> {
    /// Positions [m] whose tension counts, one per copy: those at the start of a step, or those that a solve before led to.
    pub at: &'a [Vector3<f64>],
    /// Positions [m] at the start of the step.
    pub start: &'a [Vector3<f64>],
    /// s [s²], the factor of forces in a step: that of K̂ without damping.
    pub s: f64,
    /// Density [kg/m³] of the body's own material; 0 without inertia.
    pub density_kg_m3: f64,
    /// β/h, if the forces are to contain those of damping, β times the rate of strain (ε − ε_start)/h; 0 if they come from
    /// [`Stiffness::multiply_damping`]. Strains know rotations of any size: spinning material is not damped at all, while
    /// the product of K̂ with velocities takes the arc of a turn for an expansion.
    pub damping: f64,
    /// Whether the tangent of a law that is nonlinear in the stretch is made positive semidefinite.
    pub definite: bool,
}

/// Positions [m] of an update, one per copy, and what counts beside them.
#[derive(Clone, Copy)]
pub(super) struct UpdateAt<'a> {
    pub positions: &'a [Vector3<f64>],
    pub tension: Option<&'a Tension<'a>>,
}

/// Where a stiffness keeps a piece; valid until the next cut. Only the stiffness that gave a place interprets
/// its numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Place {
    /// Chunk: the unit of work of one thread.
    pub chunk: u32,
    /// Batch within the chunk: the pieces computed at once.
    pub batch: u32,
    /// Lane within the batch.
    pub lane: u32,
}

/// Vectors and factors of a product with A = `factor` M + s K̂.
#[derive(Clone, Copy, Debug)]
pub struct Direction<'a> {
    /// z, from which the direction p ← z + β p is made.
    pub z: &'a [Padded],
    /// β.
    pub beta: f32,
    /// Mass of every copy [kg].
    pub mass: &'a [f32],
    /// The factor of the mass.
    pub factor: f32,
}

/// s K̂ of a body in single precision; also its internal forces and the diagonal blocks of s K̂.
///
/// Everything is computed in two halves, each a pass over all threads: first sums of the elements, then what
/// the copies gather of them, in blocks of [`BLOCK`] copies.
pub trait Stiffness: Any + Debug + Send + Sync {
    /// First half of an update at `positions` [m], one per copy: rotations, forces and diagonal blocks. Under `tension`,
    /// K̂ contains the twists of the law where they matter to a step.
    /// Returns the number of inverted elements.
    fn update(
        &mut self,
        team: &mut Team,
        with: &ElasticUpdate,
        positions: &[Vector3<f64>],
        tension: Option<&Tension<'_>>,
    ) -> usize;

    /// Elastic energy [J] at `positions` [m] with the rotations of the last update, to single precision; `None` if
    /// this stiffness does not compute it. Where the rotations are not those of `positions`, it is slightly too
    /// large. The factor of `with` has no influence.
    fn energy(
        &mut self,
        _team: &mut Team,
        _with: &ElasticUpdate,
        _positions: &[Vector3<f64>],
    ) -> Option<f64> {
        None
    }

    /// Second half: internal forces [N] on the copies of block number `block`.
    fn forces(&self, block: usize, f: &mut [Padded]);

    /// Second half: diagonal blocks of s K̂ of the copies of block number `block`.
    fn diagonals(&self, block: usize, diagonal: &mut [Block6]);

    /// Whether K̂ contains twists anywhere.
    fn is_twisted(&self) -> bool {
        false
    }

    /// Rises with every change of the stiffness. Updates with the same version have the same diagonal blocks.
    fn version(&self) -> u64;

    /// First half of a product with `x`.
    fn multiply(&mut self, team: &mut Team, x: &[Padded]);

    /// The same with K̂ as it damps, without twists: these would slow turning material.
    fn multiply_damping(&mut self, team: &mut Team, x: &[Padded]) {
        self.multiply(team, x);
    }

    /// The same with x ← z + β x, where x is that of the last product, which had a direction too (nothing if β = 0).
    fn multiply_direction(&mut self, team: &mut Team, z: &[Padded], beta: f32);

    /// Second half: s K̂ x of the copies of block number `block`, added to `y`.
    fn add_products(&self, block: usize, y: &mut [Padded]);

    /// Second half after [`multiply_direction`](Self::multiply_direction): p ← z + β p and q = A p of the
    /// copies of block number `block`; returns their share of pᵀq. A stiffness may fuse these passes.
    fn advance(&self, block: usize, with: &Direction<'_>, p: &mut [Padded], q: &mut [Padded]) -> f64 {
        let (z, mass) = (block_of(with.z, block), block_of(with.mass, block));
        for ((p, q), (z, m)) in p.iter_mut().zip(q.iter_mut()).zip(z.iter().zip(mass)) {
            rows::direction(p, z, with.beta);
            *q = p.map(|p| with.factor * m * p);
        }
        self.add_products(block, q);
        rows::dot(p, q)
    }

    /// Chooses how K̂ is applied from the next update on. The choices differ in the last bits.
    fn set_choice(&mut self, choice: OperatorChoice);

    /// How K̂ is to be applied.
    fn choice(&self) -> OperatorChoice;

    /// Where every piece is kept, until the next cut.
    fn places(&self) -> Cow<'_, [Place]>;

    /// Rotation of one piece at the last update.
    fn rotation(&self, place: Place) -> Matrix3<f32>;
}

/// y = s K̂ x.
pub fn apply(stiffness: &mut dyn Stiffness, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
    stiffness.multiply(team, x);
    finish(stiffness, team, y);
}

/// y = s K̂ x with K̂ as it damps.
pub fn apply_damping(stiffness: &mut dyn Stiffness, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
    stiffness.multiply_damping(team, x);
    finish(stiffness, team, y);
}

fn finish(stiffness: &dyn Stiffness, team: &mut Team, y: &mut [Padded]) {
    team.for_blocks(blocks(y, BLOCK), |block, y| {
        y.fill([0.0; 4]);
        stiffness.add_products(block, y);
    });
}
