//! Cuts of every kind, each held against [`check::everything`].

mod check;
mod planes;
mod kinds;
mod branches;
mod growth;
mod fronts;
mod adjoining;
mod parts;
mod random;
mod refusals;

use fastrand::Rng;
use nalgebra::Vector3;

use super::{BladeSweep, CutMesh, CutReport};
use crate::mesh::{BoxPattern, box_mesh};
use crate::testing::{Vectors as _, square, surface_is_closed_and_manifold, v};

/// A body under test with the position of every copy.
struct Body {
    cut: CutMesh,
    x: Vec<Vector3<f64>>,
}

impl Body {
    /// The box from the origin to `size` [m].
    fn new(size: [f64; 3], cells: [usize; 3], pattern: BoxPattern) -> Self {
        let cut = CutMesh::new(box_mesh(Vector3::zeros(), size.into(), cells, pattern)).unwrap();
        let x = cut.rest_positions();
        Self { cut, x }
    }

    fn unit(cells: usize) -> Self {
        Self::new([1.0; 3], [cells; 3], BoxPattern::Tet6)
    }

    /// Sweeps the blade over the segments and lets new copies inherit the position of their parent.
    fn sweep(&mut self, segments: &[[Vector3<f64>; 2]], incision: u32) -> CutReport {
        let blade = BladeSweep { segments: segments.to_vec() };
        let report = self.cut.sweep(&self.x, &blade, incision).unwrap();
        for new in &report.new_copies {
            assert_eq!(new.copy as usize, self.x.len());
            self.x.push(self.x[new.parent as usize]);
        }
        report
    }

    /// Sweeps a square of half width `reach` [m] in the plane through `point` with the normal.
    fn cut_plane(
        &mut self,
        point: Vector3<f64>,
        normal: Vector3<f64>,
        reach: f64,
        incision: u32,
    ) -> CutReport {
        self.sweep(&square(point, normal, reach), incision)
    }

    /// Numbers of parts, pieces and copies.
    fn topology(&self) -> [usize; 3] {
        [self.cut.components().len(), self.cut.pieces().len(), self.cut.n_copies()]
    }
}
