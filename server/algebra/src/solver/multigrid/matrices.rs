//! The matrices of one level, and those of single cells.

use nalgebra::UnitQuaternion;
use scindo_matter::element::Lanes;
use scindo_matter::octree::{Cell, corner_weights};

use super::dense::{Dense, Packed, Weights};
use super::hierarchy::Hierarchy;
use super::level::{Level, NONE};
use super::thin::{Inner, Passed};

/// Rotations that differ by less [rad] are the same; single precision tells them apart no better.
pub(super) const SAME: f32 = 2e-6;

/// Rotation of a cell.
pub(super) type Rotation = UnitQuaternion<f32>;

/// The largest angle between rotations that count as the same.
#[derive(Clone, Copy, Debug)]
pub(super) struct Within {
    /// tan² of half the angle.
    limit: f32,
}

impl Within {
    /// At most `angle` [rad], below π.
    pub(super) fn new(angle: f32) -> Self {
        Self { limit: (0.5 * angle).tan().powi(2) }
    }

    /// Whether the angle between `a` and `b` is at most this.
    #[inline(always)]
    pub(super) fn holds(self, a: &Rotation, b: &Rotation) -> bool {
        let between = a.inverse() * b;
        between.imag().norm_squared() <= self.limit * between.w * between.w
    }
}

/// Number of the first entry of `inclined` among the bits of prescribed directions: bits of axes are below it.
pub(super) const INCLINED: u8 = 8;

/// The matrix of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum CellMatrix {
    /// That of its kind.
    Shared(u32),
    /// Its number among the stored ones of the level.
    Stored(u32),
}

/// A matrix that belongs to one cell.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Stored {
    /// The cell, or [`NONE`] if the place is free.
    pub cell: u32,
    /// Whether it has to be computed again.
    pub(super) stale: bool,
    /// Rotations of the children in the frame of the cell when it was computed. Where cells at one place are
    /// duplicates, there may be more than eight.
    pub(super) relative: Vec<Rotation>,
    /// Over the vertices that carry the cell, in its frame.
    #[serde(with = "scindo_matter::storage::saved::array")]
    pub matrix: Packed,
    /// Of a thin cell.
    pub(super) inner: Inner,
}

/// The matrices of one level.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct LevelMatrices {
    /// Frame of every cell: its rotation, or the mean one of its children; I where vertices are prescribed in
    /// some directions only.
    pub frame: Vec<Rotation>,
    pub matrix: Vec<CellMatrix>,
    pub stored: Vec<Stored>,
    pub(super) free: Vec<u32>,
    /// Lumped mass of the leaves with shared matrices times its factor, by vertex [kg]. Empty on the finest level,
    /// unless its slots are listed.
    pub mass: Vec<f32>,
    /// Whether prescribed vertices are below the cell, and whether some of them in some directions only.
    pub(super) holds: Vec<[bool; 2]>,
    /// Whether the matrix in the frame of the cell changed in this update.
    pub changed: Vec<bool>,
    /// Cells that a cut or other prescribed directions changed since the last update.
    pub(super) touched: Vec<u32>,
    /// Places of thin cells among the stored ones.
    pub(super) thin: Vec<u32>,
    pub(super) passed: Vec<Passed>,
}

impl LevelMatrices {
    /// Marks the cells that were touched since the last update as changed.
    pub(super) fn mark_touched(&mut self) {
        self.touched.drain(..).for_each(|id| self.changed[id as usize] = true);
    }
}

impl Stored {
    pub(super) fn empty() -> Self {
        let matrix = [0.0; super::dense::PACKED];
        Self { cell: NONE, stale: true, relative: Vec::new(), matrix, inner: Inner::default() }
    }
}

#[inline(always)]
pub(super) fn cell_matrix(
    hierarchy: &Hierarchy,
    (l, id): (usize, usize),
    of: &LevelMatrices,
    shared: &[Dense],
    eighth: &[f32],
) -> Dense {
    match of.matrix[id] {
        CellMatrix::Stored(place) => Dense::unpacked(&of.stored[place as usize].matrix),
        CellMatrix::Shared(kind) => {
            let kind = kind as usize;
            shared_matrix(&hierarchy.levels[l], id, &shared[kind], eighth[kind])
        }
    }
}

/// The matrix of a cell of a kind over the vertices that carry it, with an `eighth` of the mass of a leaf at every
/// corner.
pub(super) fn shared_matrix(level: &Level, id: usize, of_kind: &Dense, eighth: f32) -> Dense {
    let mut A = *of_kind;
    if !level.leaf[id] {
        return A;
    }
    if level.hanging[id] == 0 {
        (0..8).for_each(|c| A.add_mass(c, eighth));
        return A;
    }
    let W = weights(&level.cells[id], level.hanging[id]);
    A = A.carried::<Lanes>(&W);
    for row in W {
        row.iter().enumerate().for_each(|(c, w)| A.add_mass(c, w * eighth));
    }
    A
}

/// Weights of the vertices of a cell in its corners.
pub(super) fn weights(cell: &Cell, hanging: u8) -> Weights {
    corner_weights(cell, hanging).map(|row| row.map(|w| w as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn angles_are_told_apart_at_any_size() {
        let a = Rotation::from_scaled_axis(Vector3::new(0.4, -1.3, 2.0));
        for angle in [1e-5, 1e-3, 0.1, 1.0, 3.0] {
            let b = a * Rotation::from_scaled_axis(Vector3::new(0.0, 0.6, 0.8) * angle);
            for b in [b, Rotation::new_unchecked(-b.into_inner())] {
                assert!(Within::new(1.02 * angle).holds(&a, &b), "{angle}");
                assert!(!Within::new(0.98 * angle).holds(&a, &b), "{angle}");
            }
        }
    }
}
