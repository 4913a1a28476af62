//! Eight pieces side by side: what one application streams, and what only an update needs.

use nalgebra::Matrix3;
use scindo_matter::element::{Ids, LANES, Lanes, Mat3};
use scindo_matter::mesh::TetMesh;

use super::Padded;
use super::law_coefficients::LawCoefficients;
use super::shared_lanes::Merged;
use super::strips::Corners;
use super::twist::TwistCoefficients;

/// Pairs of corners of a tet.
pub(super) const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Symmetric 3×3 block (xx, xy, xz, 0, yy, yz, zz, 0): the sum of s K̂ over the pieces around a copy.
pub type Block6 = [f32; 8];

/// Data that one application streams, per batch of eight pieces.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub(super) struct Batch {
    /// Rotated gradients √(2μ w V s) R g_k, k = 1, 2, 3, with s the factor of K̂ in the operator;
    /// the one of corner 0 is minus their sum.
    pub g: [[Lanes; 3]; 3],
    /// Local numbers of the four copies.
    pub nodes: [Ids; 4],
}

/// Data that only an update needs, per batch.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub(super) struct RestBatch {
    /// Rest gradients g_1, g_2, g_3 [1/m].
    pub g: [[Lanes; 3]; 3],
    /// w V [m³]; 0 in unused lanes.
    pub volume: Lanes,
    /// Largest |g|² of the four corners [1/m²].
    pub sharp: Lanes,
    /// Rotation R of the last update, also the warm start of the next.
    pub rotation: Mat3<Lanes>,
    /// Strain ε where a step starts (xx, xy, xz, yy, yz, zz), for damping.
    pub start: [Lanes; 6],
    /// Number of pieces that each lane integrates.
    pub pieces: [u32; LANES],
}

impl RestBatch {
    /// A batch without pieces: zero volume, R = I.
    pub(super) fn empty() -> Self {
        let mut rotation: Mat3<Lanes> = Default::default();
        for i in 0..3 {
            rotation[4 * i] = Lanes([1.0; LANES]);
        }
        Self {
            g: Default::default(),
            volume: Lanes::default(),
            sharp: Lanes::default(),
            rotation,
            start: Default::default(),
            pieces: [0; LANES],
        }
    }

    /// Fills a lane: gradients in the order `corners`, volume, and the rotation if that is known.
    pub(super) fn set(
        &mut self,
        lane: usize,
        mesh: &TetMesh,
        (merged, corners): (&Merged, Corners),
        rotation: Option<&Matrix3<f32>>,
    ) {
        let g = mesh.gradients(merged.piece.element as usize);
        for k in 0..3 {
            for i in 0..3 {
                self.g[k][i].0[lane] = g[corners[k + 1] as usize][i] as f32;
            }
        }
        self.sharp.0[lane] = g.iter().map(|g| g.norm_squared()).fold(0.0, f64::max) as f32;
        self.set_volume(lane, mesh, merged);
        if let Some(R) = rotation {
            for i in 0..9 {
                self.rotation[i].0[lane] = R[(i / 3, i % 3)];
            }
        }
    }

    /// Changes how much material a lane integrates.
    pub(super) fn set_volume(&mut self, lane: usize, mesh: &TetMesh, merged: &Merged) {
        let Merged { piece, count } = merged;
        self.volume.0[lane] = (piece.fraction * mesh.volume(piece.element as usize)) as f32;
        self.pieces[lane] = *count;
    }
}

/// Constants of one update.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Coefficients {
    /// μ [Pa].
    pub mu: f32,
    /// λ [Pa].
    pub lambda: f32,
    /// s, the factor of K̂ in the operator (h² + hβ in a step) [s²].
    pub scale: f32,
    /// Whether pieces rotate (corotational) or keep R = I (linear).
    pub rotates: bool,
    /// Constants of a law that is nonlinear in the stretch.
    pub law: Option<LawCoefficients>,
    /// Constants of twists, where these may be needed.
    pub twists: Option<TwistCoefficients>,
    /// β/h, if forces contain those of damping: β times the change of strain since the start of the step, over h.
    pub damping: f32,
}

/// Constants of an energy.
#[derive(Clone, Copy, Debug)]
pub(super) struct EnergyCoefficients {
    /// μ [Pa].
    pub mu: f32,
    /// λ [Pa].
    pub lambda: f32,
    /// Whether pieces rotate (corotational) or keep R = I (linear).
    pub rotates: bool,
}

/// Vectors of one chunk, one entry per local number and one for the waste bin.
pub(super) struct Locals<'a> {
    /// Current positions [m] in double precision.
    pub x: &'a [[f64; 4]],
    /// Out: internal forces f_int [N], added to.
    pub f: &'a mut [Padded],
    /// Out: diagonal blocks of s K̂, added to.
    pub blocks: &'a mut [Block6],
}
