//! Incisions that go on ahead of a blade that advances through a body under load.

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, FrontRule, StaticSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::SOFT;

type V = Vector3<f64>;

/// Cells along the edge of a block of 1 m, and the height of the cut.
const CELLS: usize = 6;
const HEIGHT_M: f64 = 0.47;

/// A block that is held below and above and drawn apart by `apart_m` [m], with a blade in it.
struct Cut {
    body: Body,
    apart_m: f64,
}

impl Cut {
    fn new(apart_m: f64) -> Self {
        let mesh = box_mesh(V::zeros(), V::repeat(1.0), [CELLS; 3], BoxPattern::Tet5 { parity: false });
        let settings = BodySettings { front: FrontRule::Calibrated, ..BodySettings::default() };
        let mut body = Body::new(mesh, SOFT, settings).unwrap();
        for (height, by) in [(0.0, 0.0), (1.0, apart_m)] {
            let at = (0..).zip(body.rest_positions()).filter(|(_, X)| (X.z - height).abs() < 1e-9);
            let nodes: Vec<u32> = at.map(|(n, _)| n).collect();
            body.fix(&nodes, [true; 3], V::new(0.0, 0.0, by)).unwrap();
        }
        let mut cut = Self { body, apart_m };
        cut.solve();
        cut
    }

    fn solve(&mut self) {
        let report = self.body.solve_static(V::zeros(), &StaticSettings::default()).unwrap();
        assert!(report.converged, "{report:?}");
    }

    /// Lets the blade advance to `to` [m] in `n` steps, with an equilibrium after each.
    fn advance(mut self, to: f64, n: usize) -> Self {
        let height = HEIGHT_M * (1.0 + self.apart_m);
        let blade = |k: usize| {
            let x = -0.1 + (to + 0.1) * k as f64 / n as f64;
            [V::new(x, -0.1, height), V::new(x, 1.1, height)]
        };
        for k in 0..n {
            self.body.cut(&BladeSweep { segments: vec![blade(k), blade(k + 1)] }, 1).unwrap();
            self.solve();
        }
        self
    }

    /// Area of a lip seen from above, over that of a row of cells, and the largest distance of a lip from the plane of
    /// the cut in cells; both at rest.
    fn lips(&self) -> [f64; 2] {
        let (surface, X) = (self.body.surface(), self.body.rest_positions());
        let (mut area, mut off) = (0.0, 0.0f64);
        for (triangle, _) in surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag == 1) {
            let [a, b, c] = triangle.map(|v| surface.vertices[v as usize].position(X));
            area += 0.25 * (b - a).cross(&(c - a)).z.abs();
            off = [a, b, c].iter().map(|x| (x.z - HEIGHT_M).abs()).fold(off, f64::max);
        }
        [area, off].map(|value| value * CELLS as f64)
    }
}

/// The lips come apart ahead of the blade. It passes between them, goes on ahead as far as one long stroke does, and
/// leaves them smooth.
#[test]
fn a_blade_that_advances_through_an_open_wound_ends_where_one_stroke_does() {
    let n = 8;
    for apart_m in [0.02, 0.1] {
        let (mut off, mut roughest) = (0.0, 0.0f64);
        for k in 0..n {
            let to = 0.4 + 2.0 / CELLS as f64 * (f64::from(k) + 0.5) / f64::from(n);
            let whole = Cut::new(apart_m).advance(to, 1).lips();
            let grown = Cut::new(apart_m).advance(to, 30).lips();
            off += (grown[0] - whole[0]).abs() / f64::from(n);
            roughest = roughest.max(grown[1]);
        }
        assert!(off < 0.12, "drawn apart by {apart_m} m, it ends {off} cells off on average");
        assert!(roughest < 0.05, "drawn apart by {apart_m} m, its lips are {roughest} cells off the plane");
    }
}
