//! Taking triangles out of a tree and into it, one by one, without building it anew.

use super::BroadPhase;
use super::aabb::Aabb;
use super::split::Split;
use super::tree::{Bound, LEAF, MAX_DEPTH, NONE, Tree};

impl<B: Bound, S: Split> Tree<B, S> {
    pub(super) fn replace_triangles(&mut self, removed: &[u32], inserted: &[u32], boxes: &[Aabb]) {
        for &triangle in removed {
            self.remove(triangle);
        }
        self.home.resize(boxes.len(), NONE);
        self.centres.resize(boxes.len(), [0.0; 3]);
        for &triangle in inserted {
            self.centres[triangle as usize] = boxes[triangle as usize].centre();
            if !self.insert(triangle, boxes) {
                self.rebuild(boxes);
                return;
            }
        }
    }

    /// Takes a triangle out of its leaf. The leaf stays, even without triangles.
    fn remove(&mut self, triangle: u32) {
        let leaf = std::mem::replace(&mut self.home[triangle as usize], NONE);
        if leaf == NONE {
            return;
        }
        let node = &mut self.nodes[leaf as usize];
        let slots = &mut self.slots[node.first as usize..][..usize::from(node.len)];
        if let Some(at) = slots.iter().position(|&t| t == triangle) {
            slots.swap(at, usize::from(node.len) - 1);
            node.len -= 1;
        }
    }

    /// Puts a triangle into the leaf whose volume, and those above it, grow least. A full leaf is split.
    /// Returns whether there was room; there is none in a tree that is empty or too deep.
    fn insert(&mut self, triangle: u32, boxes: &[Aabb]) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let bound = B::around(std::iter::once(&boxes[triangle as usize]));
        let (mut at, mut depth) = (0, 0);
        loop {
            let node = &mut self.nodes[at];
            node.bound = node.bound.joined(&bound);
            if node.is_leaf {
                break;
            }
            let (first, len) = (node.first as usize, usize::from(node.len));
            let growth = |child: usize| {
                let child = &self.nodes[child].bound;
                (child.joined(&bound).area() - child.area(), child.tie_break(&bound))
            };
            at = (first..first + len)
                .min_by(|&a, &b| {
                    let ((a, tie_a), (b, tie_b)) = (growth(a), growth(b));
                    a.total_cmp(&b).then(tie_a.total_cmp(&tie_b))
                })
                .unwrap_or(first);
            depth += 1;
        }
        let node = &mut self.nodes[at];
        let (first, len) = (node.first as usize, usize::from(node.len));
        if len < LEAF {
            self.slots[first + len] = triangle;
            node.len += 1;
            self.home[triangle as usize] = at as u32;
            return true;
        }
        if depth + 1 >= MAX_DEPTH {
            return false;
        }
        self.items.clear();
        self.items.extend_from_slice(&self.slots[first..first + LEAF]);
        self.items.push(triangle);
        let begin = self.nodes.len();
        self.fill_with_items(at, depth, boxes);
        // The new nodes stand behind their parents, so they are bounded from the last to the first.
        for i in (begin..self.nodes.len()).rev() {
            let node = &self.nodes[i];
            let bound = if node.is_leaf {
                B::around(self.triangles(node).iter().map(|&t| &boxes[t as usize]))
            } else {
                self.children(node).iter().fold(B::EMPTY, |sum, child| sum.joined(&child.bound))
            };
            self.nodes[i].bound = bound;
        }
        true
    }
}
