//! Pairs of triangles that are near each other: of one surface with itself, and of two surfaces.
//!
//! The boxes of the triangles decide, and these cover the motion of the last refit. A pair that meets anywhere
//! along straight paths between the two states is therefore always among the pairs, also with margin zero.

use crate::broad::BroadPhase;
use crate::broad::aabb::{Aabb, round_up};
use crate::broad::probe::NearBox;
use crate::surface_bvh::SurfaceBvh;

impl SurfaceBvh {
    /// Pairs of triangles of this surface whose boxes are no farther apart than `margin` [m] along every axis.
    ///
    /// Triangles that share a vertex make no pair: they always touch. `pairs` is emptied first and holds every
    /// pair once, the lower index first, in ascending order. Its memory is reused.
    ///
    /// ```
    /// use scindo_collision::SurfaceBvh;
    ///
    /// // Two sheets of one triangle each, 1 mm apart.
    /// let at = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    /// let positions = [at(0.0), at(0.001)].concat();
    /// let surface = SurfaceBvh::new(&positions, &[[0, 1, 2], [3, 5, 4]])?;
    /// let mut pairs = Vec::new();
    /// surface.self_pairs(0.002, &mut pairs);
    /// assert_eq!(pairs, [[0, 1]]);
    /// surface.self_pairs(0.0005, &mut pairs);
    /// assert!(pairs.is_empty());
    /// # Ok::<(), scindo_collision::SurfaceError>(())
    /// ```
    pub fn self_pairs(&self, margin: f64, pairs: &mut Vec<[u32; 2]>) {
        pairs.clear();
        let boxes = self.boxes();
        self.index().pairs(boxes, round_up(margin), |a, b| {
            if !self.share_vertex(a, b) && boxes[a as usize].within_exactly(&boxes[b as usize], margin) {
                pairs.push([a.min(b), a.max(b)]);
            }
        });
        pairs.sort_unstable();
    }

    /// Like [`self_pairs`](Self::self_pairs), but only pairs with at least one triangle of `active`, at a cost
    /// that is proportional to their number. It serves the lips of a cut on a surface that is otherwise far
    /// from itself. Every index of `active` must be less than [`triangle_count`](Self::triangle_count).
    pub fn self_pairs_of(&self, active: &[u32], margin: f64, pairs: &mut Vec<[u32; 2]>) {
        pairs.clear();
        for &first in active {
            self.near_box(&self.boxes()[first as usize], margin, |second| {
                if first != second && !self.share_vertex(first, second) {
                    pairs.push([first.min(second), first.max(second)]);
                }
            });
        }
        pairs.sort_unstable();
        pairs.dedup();
    }

    /// Pairs of a triangle of this surface and one of `other` whose boxes are no farther apart than `margin`
    /// [m] along every axis.
    ///
    /// `pairs` is emptied first and holds `[triangle of this, triangle of other]` in ascending order. Its
    /// memory is reused.
    pub fn pairs_with(&self, other: &Self, margin: f64, pairs: &mut Vec<[u32; 2]>) {
        pairs.clear();
        if self.triangle_count() == 0 || other.triangle_count() == 0 {
            return;
        }
        // The search runs in the larger surface, once per triangle of the smaller one that can reach it.
        let swap = self.triangle_count() > other.triangle_count();
        let (few, many) = if swap { (other, self) } else { (self, other) };
        few.near_box(many.bounding_box(), margin, |a| {
            many.near_box(&few.boxes()[a as usize], margin, |b| {
                pairs.push(if swap { [b, a] } else { [a, b] });
            });
        });
        pairs.sort_unstable();
    }

    /// Visits every triangle whose box is no farther than `margin` [m] from `aabb` along every axis.
    fn near_box(&self, aabb: &Aabb, margin: f64, mut visit: impl FnMut(u32)) {
        let boxes = self.boxes();
        self.index().search(boxes, &NearBox(*aabb, round_up(margin)), 0.0, |triangle, _| {
            if aabb.within_exactly(&boxes[triangle as usize], margin) {
                visit(triangle);
            }
        });
    }

    fn share_vertex(&self, first: u32, second: u32) -> bool {
        let other = self.corners(second);
        self.corners(first).iter().any(|v| other.contains(v))
    }
}
