//! The bounding volume hierarchy of parry3d, as a method of broad phase.

use super::BroadPhase;
use super::aabb::{Aabb, round_down, round_up};
use super::probe::{NearBox, Probe};
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhLeafCost, BvhNode, TraversalAction};
use std::cell::RefCell;

/// Binary tree of boxes of parry3d. Its leaf `i` is triangle `i`.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct ParryBvh {
    tree: Bvh,
    /// Leaves in the order of the tree's memory. Refitting in this order is fast, since it walks the memory
    /// forward.
    order: Vec<u32>,
}

/// The limit of a search after a leaf, as the tree's cost.
struct Limit(f32);

impl BvhLeafCost for Limit {
    fn cost(&self) -> f32 {
        self.0
    }
}

impl BroadPhase for ParryBvh {
    fn rebuild(&mut self, boxes: &[Aabb]) {
        let leaves: Vec<_> = boxes.iter().map(to_parry).collect();
        self.tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves);
        self.note_order();
    }

    fn refit(&mut self, boxes: &[Aabb]) {
        for &leaf in &self.order {
            // No margin: the leaf takes the box as it is.
            let _ = self.tree.update_partially_if_present(to_parry(&boxes[leaf as usize]), leaf, 0.0);
        }
        self.tree.refit_without_opt();
    }

    fn replace(&mut self, removed: &[u32], inserted: &[u32], boxes: &[Aabb]) {
        for &leaf in removed {
            self.tree.remove(leaf);
        }
        for &leaf in inserted {
            self.tree.insert(to_parry(&boxes[leaf as usize]), leaf);
        }
        self.note_order();
    }

    fn search<P: Probe>(&self, _: &[Aabb], probe: &P, limit: f64, mut visit: impl FnMut(u32, &mut f64)) {
        if P::NEAREST {
            let state = RefCell::new((limit, visit));
            // Costs are in single precision: those of boxes are rounded down and the limit is rounded up beyond
            // the next number, so that triangles at equal distance are visited too.
            self.tree.find_best(
                round_up(limit).next_up(),
                |node, _| round_down(probe.to_box(&from_parry(node)).min(f64::from(f32::MAX))),
                |leaf, _| {
                    let (limit, visit) = &mut *state.borrow_mut();
                    visit(leaf, limit);
                    Some(Limit(round_up(*limit).next_up()))
                },
            );
            return;
        }
        let mut limit = limit;
        self.tree.traverse(|node| {
            if probe.to_box(&from_parry(node)) > limit {
                return TraversalAction::Prune;
            }
            if let Some(triangle) = node.leaf_data() {
                visit(triangle, &mut limit);
            }
            TraversalAction::Continue
        });
    }

    fn pairs(&self, boxes: &[Aabb], margin: f32, mut visit: impl FnMut(u32, u32)) {
        for &first in &self.order {
            self.search(boxes, &NearBox(boxes[first as usize], margin), 0.0, |second, _| {
                if first < second {
                    visit(first, second);
                }
            });
        }
    }

    fn quality(&self) -> f64 {
        1.0
    }
}

impl ParryBvh {
    fn note_order(&mut self) {
        self.order.clear();
        self.order.extend(self.tree.leaves(|_| true));
    }
}

fn to_parry(aabb: &Aabb) -> parry3d::bounding_volume::Aabb {
    let vector = |[x, y, z]: [f32; 3]| Vector::new(x, y, z);
    parry3d::bounding_volume::Aabb::new(vector(aabb.min), vector(aabb.max))
}

fn from_parry(node: &BvhNode) -> Aabb {
    let (min, max) = (node.mins(), node.maxs());
    Aabb { min: [min.x, min.y, min.z], max: [max.x, max.y, max.z] }
}
