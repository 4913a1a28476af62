//! What a cell asks of the kernel.

use nalgebra::Matrix3;
use scindo_matter::octree::Octree;

/// Slots that may hang, in the order of their weights: three edges, three faces of the parent.
pub(super) const HANGING_SLOTS: [usize; 6] = [1, 2, 4, 3, 5, 6];

/// The matrix of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub enum CellMatrix {
    /// c R S Rᵀ with S the table of this number, c the factor and R the rotation of the cell.
    Table(u16),
    /// A stored symmetric matrix of the cell's own, as
    /// [`CellOperator::set_stored`](super::CellOperator::set_stored) gives it; without factor.
    Stored,
    /// The same rounded to half precision: for preconditioners, whose products wait for memory.
    Half,
}

/// A cell to be given a lane. Its matrix A enters the operator as Wᵀ A W with the weights W of hanging corners.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CellLane {
    /// The vertices that carry the cell, by slot: slot j is corner j ⊕ octant.
    pub vertices: [u32; 8],
    /// Which child of its parent the cell is; bit k is the half along axis k.
    pub octant: u8,
    /// Bit j is set if slot j hangs. Slots 0 and 7 never do.
    pub hanging: u8,
    /// Where its stiffness comes from.
    pub matrix: CellMatrix,
    /// c, not negative: side · μ · s for a table of stiffness with μ = 1.
    pub factor: f32,
}

impl CellLane {
    /// Leaf `id` of an octree with factor 0.
    pub fn of_leaf(octree: &Octree, id: usize, matrix: CellMatrix) -> Self {
        let octant = octree.cells()[id].octant() as u8;
        Self {
            vertices: slot_corners(octree.vertices()[id], octant),
            octant,
            hanging: slot_hanging(octree.hanging()[id], octant),
            matrix,
            factor: 0.0,
        }
    }
}

/// Entries of the corners of a cell, by slot; it is its own inverse.
pub fn slot_corners<T: Copy>(corners: [T; 8], octant: u8) -> [T; 8] {
    std::array::from_fn(|j| corners[j ^ usize::from(octant)])
}

/// One bit per corner, by slot.
pub fn slot_hanging(hanging: u8, octant: u8) -> u8 {
    (0..8).fold(0, |slots, j| slots | (hanging >> (j ^ octant) & 1) << j)
}

/// The diagonal of δD, the reflection of an octant with the sign that makes it a rotation.
pub(super) fn frame(octant: u8) -> [f32; 3] {
    let delta = handedness(octant);
    [0, 1, 2].map(|k| if octant >> k & 1 == 1 { -delta } else { delta })
}

/// δ = det D of an octant, 1 or −1.
pub(super) fn handedness(octant: u8) -> f32 {
    if octant.count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// R δD, which also takes R̂ = R δD back to R.
pub(super) fn turned(R: &Matrix3<f32>, octant: u8) -> Matrix3<f32> {
    let frame = frame(octant);
    Matrix3::from_fn(|i, j| R[(i, j)] * frame[j])
}
