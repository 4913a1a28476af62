//! The regular lattice of cells that a coarse space is laid on.

use nalgebra::Vector3;

/// Equal cells that fill the bounding box of some points.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Lattice {
    low: Vector3<f64>,
    /// Edges of a cell [m].
    edge: Vector3<f64>,
    /// Number of cells along every axis.
    cells: [u32; 3],
}

/// Largest number of cells along an axis: far more than a factorisation can take.
const MOST_CELLS: f64 = 1024.0;

impl Lattice {
    /// Cells with edges near `edge` [m] over all `points` [m].
    pub(super) fn over(points: &[Vector3<f64>], edge: f64) -> Self {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for point in points {
            (low, high) = (low.inf(point), high.sup(point));
        }
        let size = if points.is_empty() { Vector3::repeat(1.0) } else { high - low };
        let count = size.map(|size| (size / edge).round().clamp(1.0, MOST_CELLS));
        let edge = size.component_div(&count).map(|edge| if edge > 0.0 { edge } else { 1.0 });
        Self { low, edge, cells: [count.x as u32, count.y as u32, count.z as u32] }
    }

    /// The cell with `point` [m], and where in the cell the point is, from 0 to 1 along every axis. A point between
    /// cells is in the last of them.
    pub(super) fn locate(&self, point: &Vector3<f64>) -> ([u32; 3], [f32; 3]) {
        let at = (point - self.low).component_div(&self.edge);
        let cell: [u32; 3] = std::array::from_fn(|k| (at[k].max(0.0) as u32).min(self.cells[k] - 1));
        (cell, std::array::from_fn(|k| (at[k] - f64::from(cell[k])).clamp(0.0, 1.0) as f32))
    }

    /// The corner of `cell` that is corner number `corner` of its neighbour `other`, if they share it. Corner number
    /// x + 2 y + 4 z is the one at (x, y, z).
    pub(super) fn shared(cell: [u32; 3], other: [u32; 3], corner: usize) -> Option<usize> {
        let mut own = 0;
        for k in 0..3 {
            let at = i64::from(other[k]) + (corner >> k & 1) as i64 - i64::from(cell[k]);
            if !(0..=1).contains(&at) {
                return None;
            }
            own |= (at as usize) << k;
        }
        Some(own)
    }
}

/// Trilinear weights of the eight corners of a cell at `place`.
#[inline(always)]
pub(super) fn weights([x, y, z]: [f32; 3]) -> [f32; 8] {
    let (x, y, z) = ([1.0 - x, x], [1.0 - y, y], [1.0 - z, z]);
    std::array::from_fn(|c| x[c & 1] * y[c >> 1 & 1] * z[c >> 2])
}
