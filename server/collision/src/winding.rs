//! Inside or outside, from the signed crossings along a ray.

use crate::broad::BroadPhase;
use crate::broad::probe::RayAlongX;
use crate::surface_bvh::SurfaceBvh;
use nalgebra::Vector3;

type V = Vector3<f64>;

impl SurfaceBvh {
    /// Whether `p` [m] lies inside the body enclosed by the surface.
    ///
    /// Counts how often a ray from `p` leaves, minus how often it enters. Overlapping and coinciding sheets
    /// count separately, so the lips of a closed or pressed-shut cut do not falsify the result. The side of
    /// an edge is computed from its lower to its higher vertex, so a ray through a shared edge meets exactly
    /// one of its two triangles.
    pub fn contains(&self, p: V) -> bool {
        let mut winding = 0i32;
        // The ray runs along +x, so the plane across it is (y, z) without any rotation.
        self.index().search(self.boxes(), &RayAlongX(p), 0.0, |triangle, _| {
            winding += self.crossing(p, triangle);
        });
        winding > 0
    }

    /// +1 if the ray leaves through the triangle, -1 if it enters, 0 if it misses.
    fn crossing(&self, p: V, triangle: u32) -> i32 {
        let corners = self.corners(triangle);
        let q = self.triangle(triangle).map(|v| v - p);
        let side = |i: usize, j: usize| {
            let flip = corners[i] > corners[j];
            let (a, b) = if flip { (q[j], q[i]) } else { (q[i], q[j]) };
            let area = a.y * b.z - a.z * b.y;
            (if flip { -area } else { area }, (area >= 0.0) != flip)
        };
        let sides = [side(1, 2), side(2, 0), side(0, 1)];
        let turns = sides.map(|(_, positive)| positive);
        if turns != [true; 3] && turns != [false; 3] {
            return 0;
        }
        let total: f64 = sides.iter().map(|(area, _)| area).sum();
        if total == 0.0 {
            return 0;
        }
        let ahead: f64 = (0..3).map(|i| sides[i].0 / total * q[i].x).sum();
        match (ahead > 0.0, total > 0.0) {
            (false, _) => 0,
            (true, true) => 1,
            (true, false) => -1,
        }
    }
}
