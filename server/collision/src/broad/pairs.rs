//! Pairs of near triangles from a tree traversed against itself.

use super::aabb::Aabb;
use super::split::Split;
use super::tree::{Bound, Node, Tree};

impl<B: Bound, S: Split> Tree<B, S> {
    /// Pairs of triangles that are both below `node`.
    pub(super) fn pairs_below(
        &self,
        node: &Node<B>,
        boxes: &[Aabb],
        margin: f32,
        visit: &mut impl FnMut(u32, u32),
    ) {
        if node.is_leaf {
            let triangles = self.triangles(node);
            for (i, &a) in triangles.iter().enumerate() {
                for &b in &triangles[i + 1..] {
                    if boxes[a as usize].within(&boxes[b as usize], margin) {
                        visit(a, b);
                    }
                }
            }
            return;
        }
        let children = self.children(node);
        for (i, a) in children.iter().enumerate() {
            self.pairs_below(a, boxes, margin, visit);
            for b in &children[i + 1..] {
                if a.bound.near(&b.bound, margin) {
                    self.pairs_between(a, b, boxes, margin, visit);
                }
            }
        }
    }

    /// Pairs of a triangle below `a` and one below `b`, whose volumes are near.
    fn pairs_between(
        &self,
        a: &Node<B>,
        b: &Node<B>,
        boxes: &[Aabb],
        margin: f32,
        visit: &mut impl FnMut(u32, u32),
    ) {
        if a.is_leaf && b.is_leaf {
            for &i in self.triangles(a) {
                for &j in self.triangles(b) {
                    if boxes[i as usize].within(&boxes[j as usize], margin) {
                        visit(i, j);
                    }
                }
            }
            return;
        }
        // The larger volume is opened first.
        let (open, keep) =
            if b.is_leaf || (!a.is_leaf && a.bound.area() > b.bound.area()) { (a, b) } else { (b, a) };
        for child in self.children(open) {
            if child.bound.near(&keep.bound, margin) {
                self.pairs_between(child, keep, boxes, margin, visit);
            }
        }
    }
}
