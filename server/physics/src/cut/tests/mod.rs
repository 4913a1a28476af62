//! Cuts of every kind, each held against [`check::everything`].

mod check;
mod planes;
mod kinds;
mod growth;
mod random;
mod refusals;

use nalgebra::Vector3;

use super::{BladeSweep, CutMesh, CutReport};
use crate::mesh::{BoxPattern, box_mesh};

/// A body under test with the position of every copy.
struct Body {
    cut: CutMesh,
    x: Vec<Vector3<f64>>,
}

fn v(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
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
        let n = normal.normalize();
        let helper = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let u = n.cross(&helper).normalize() * reach;
        let w = n.cross(&u);
        self.sweep(&[[point - u - w, point - u + w], [point + u - w, point + u + w]], incision)
    }

    /// Numbers of parts, pieces and copies.
    fn topology(&self) -> [usize; 3] {
        [self.cut.components().len(), self.cut.pieces().len(), self.cut.n_copies()]
    }
}

/// SplitMix64: small, seeded, the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in the cube of half width `r` around the origin.
    fn vector(&mut self, r: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| (2.0 * self.next() - 1.0) * r)
    }
}
