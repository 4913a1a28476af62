//! Lines that a blade has drawn on the surface without cutting the material apart: where it has entered
//! elements but not left them, or only scratched. They are displayed from the
//! [`traces`](super::drawn::traces), which follow the blade at once, while the cut lags by at most one
//! element.

use nalgebra::Vector3;

use super::cut_mesh::CutMesh;
use super::drawn::traces::TraceLine;
use super::shell::surface::bind;
use crate::element::MaterialPoint;

/// A point on the surface: Σ weights · vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkPoint {
    /// Surface vertices around the point, or three times the point itself.
    pub vertices: [MaterialPoint; 3],
    /// Weight of each, Σ = 1.
    pub weights: [f64; 3],
}

/// A straight line on the surface, along an incision that has not opened there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IncisionMark {
    /// Number of the incision that it belongs to.
    pub incision: u32,
    /// Start and end of the line.
    pub ends: [MarkPoint; 2],
}

impl MarkPoint {
    /// A mark point at a surface vertex.
    pub fn at(vertex: MaterialPoint) -> Self {
        Self { vertices: [vertex; 3], weights: [1.0, 0.0, 0.0] }
    }

    /// Position [m] at the positions `x` of the copies.
    pub fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        let held = self.vertices.iter().zip(&self.weights).filter(|(_, w)| **w != 0.0);
        held.map(|(vertex, &w)| vertex.position(x) * w).sum()
    }
}

impl CutMesh {
    /// Marks on the [`surface`](Self::surface) where a blade went and its incision has not opened, ordered by
    /// incision, fragment and face.
    pub fn incision_marks(&self) -> Vec<IncisionMark> {
        self.trace_lines().iter().map(|line| self.mark(line)).collect()
    }

    /// Binds a line on the boundary of a fragment to its piece.
    pub(crate) fn mark(&self, line: &TraceLine) -> IncisionMark {
        let piece = self.fragments.piece[line.fragment as usize];
        let ends = line.ends.map(|end| MarkPoint::at(bind(self.mesh(), &self.pieces, piece, &end)));
        IncisionMark { incision: line.incision, ends }
    }
}
