//! A tree of bounding volumes over triangles: boxes or spheres, split in two or in eight.
//!
//! Nodes lie in one array. The children of a node are neighbours in it and stand behind their parent, so a
//! refit is one pass backwards through the array. Leaves hold a few triangles each.
//!
//! No leaf is deeper than [`MAX_DEPTH`], whatever the triangles look like; a tree that would grow deeper is
//! built anew. Queries may therefore recurse.

use super::BroadPhase;
use super::aabb::Aabb;
use super::ball::Ball;
use super::probe::Probe;
use super::split::Split;
use std::marker::PhantomData;

/// Most levels of a tree.
pub(crate) const MAX_DEPTH: u32 = 64;

/// Most triangles of a leaf.
pub(crate) const LEAF: usize = 4;

/// No triangle or node.
pub(crate) const NONE: u32 = u32::MAX;

/// A bounding volume.
pub(crate) trait Bound: Copy + PartialEq {
    /// The volume without a point.
    const EMPTY: Self;
    /// The volume around some boxes.
    fn around<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone) -> Self;
    /// The volume around two.
    fn joined(&self, other: &Self) -> Self;
    /// Whether boxes in both can be as near as `margin` [m] along every axis.
    fn near(&self, other: &Self, margin: f32) -> bool;
    /// Lower bound of the cost of everything inside; infinite where it is empty.
    fn cost<P: Probe>(&self, probe: &P) -> f64;
    /// Half the surface area [m²], up to a factor.
    fn area(&self) -> f32;
    /// What decides between volumes that would grow equally when they take in `other`; the least wins.
    fn tie_break(&self, other: &Self) -> f32;
}

impl Bound for Aabb {
    const EMPTY: Self = Self::EMPTY;

    #[inline(always)]
    fn around<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone) -> Self {
        boxes.fold(Self::EMPTY, |sum, aabb| sum.merged(aabb))
    }

    #[inline(always)]
    fn joined(&self, other: &Self) -> Self {
        self.merged(other)
    }

    #[inline(always)]
    fn near(&self, other: &Self, margin: f32) -> bool {
        self.within(other, margin)
    }

    fn cost<P: Probe>(&self, probe: &P) -> f64 {
        if self.min[0] > self.max[0] { f64::INFINITY } else { probe.to_box(self) }
    }

    #[inline(always)]
    fn area(&self) -> f32 {
        self.half_area()
    }

    fn tie_break(&self, other: &Self) -> f32 {
        self.joined(other).area()
    }
}

impl Bound for Ball {
    const EMPTY: Self = Self::EMPTY;

    #[inline(always)]
    fn around<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone) -> Self {
        Self::around(boxes)
    }

    #[inline(always)]
    fn joined(&self, other: &Self) -> Self {
        self.merged(other)
    }

    fn near(&self, other: &Self, margin: f32) -> bool {
        self.within(other, margin)
    }

    fn cost<P: Probe>(&self, probe: &P) -> f64 {
        if self.radius < 0.0 { f64::INFINITY } else { probe.to_ball(self) }
    }

    #[inline(always)]
    fn area(&self) -> f32 {
        self.half_area()
    }

    /// Spheres overlap so much that a small one is in several: then the nearest centre counts.
    fn tie_break(&self, other: &Self) -> f32 {
        self.distance(other) as f32
    }
}

/// A node: its volume, and where its children or triangles begin.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct Node<B> {
    /// Around everything below.
    pub bound: B,
    /// First child among the nodes, or first triangle among the slots.
    pub first: u32,
    /// Number of children or triangles.
    pub len: u16,
    /// Whether it holds triangles.
    pub is_leaf: bool,
}

/// A tree of bounding volumes `B`, split by `S`. Node 0 is the root.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Tree<B, S> {
    pub(super) nodes: Vec<Node<B>>,
    pub(super) parents: Vec<u32>,
    /// Triangles of the leaves, [`LEAF`] places for each.
    pub(super) slots: Vec<u32>,
    /// Leaf of each triangle, or [`NONE`].
    pub(super) home: Vec<u32>,
    /// Triangles in the order of the leaves, and their centres; memory for building.
    pub(super) items: Vec<u32>,
    pub(super) centres: Vec<[f32; 3]>,
    /// Areas of all volumes over those of the triangles' boxes, now and after the last build.
    spread: f64,
    built_spread: f64,
    /// Number of nodes after the last build.
    built_nodes: usize,
    #[serde(skip)]
    split: PhantomData<S>,
}

impl<B, S> Default for Tree<B, S> {
    fn default() -> Self {
        Self {
            nodes: Vec::new(),
            parents: Vec::new(),
            slots: Vec::new(),
            home: Vec::new(),
            items: Vec::new(),
            centres: Vec::new(),
            spread: 1.0,
            built_spread: 1.0,
            built_nodes: 0,
            split: PhantomData,
        }
    }
}

impl<B: Bound, S: Split> Tree<B, S> {
    /// Triangles of a leaf.
    #[inline(always)]
    pub(super) fn triangles(&self, leaf: &Node<B>) -> &[u32] {
        &self.slots[leaf.first as usize..][..usize::from(leaf.len)]
    }

    /// Children of a node that is no leaf.
    #[inline(always)]
    pub(super) fn children(&self, node: &Node<B>) -> &[Node<B>] {
        &self.nodes[node.first as usize..][..usize::from(node.len)]
    }

    /// Splits the triangles of `range` of the items among descendants of `node`.
    fn fill(
        &mut self,
        node: usize,
        range: std::ops::Range<usize>,
        cell: S::Cell,
        depth: u32,
        boxes: &[Aabb],
    ) {
        if range.len() <= LEAF {
            let first = self.slots.len();
            self.slots.resize(first + LEAF, NONE);
            for (slot, item) in range.clone().enumerate() {
                let triangle = self.items[item];
                self.slots[first + slot] = triangle;
                self.home[triangle as usize] = node as u32;
            }
            let at = &mut self.nodes[node];
            (at.first, at.len, at.is_leaf) = (first as u32, range.len() as u16, true);
            return;
        }
        let groups =
            S::split(cell, &mut self.items[range.clone()], &self.centres, boxes, depth > MAX_DEPTH / 2);
        let first = self.nodes.len();
        let len = groups.len();
        let empty = Node { bound: B::EMPTY, first: 0, len: 0, is_leaf: true };
        self.nodes.resize(first + len, empty);
        self.parents.resize(first + len, node as u32);
        let at = &mut self.nodes[node];
        (at.first, at.len, at.is_leaf) = (first as u32, len as u16, false);
        let mut begin = range.start;
        for (child, (size, cell)) in groups.iter().enumerate() {
            self.fill(first + child, begin..begin + size, cell, depth + 1, boxes);
            begin += size;
        }
    }

    /// Gives `node` the triangles of the items, whose centres are known.
    pub(super) fn fill_with_items(&mut self, node: usize, depth: u32, boxes: &[Aabb]) {
        let bounds = self.items.iter().fold(Aabb::EMPTY, |sum, &t| {
            let c = self.centres[t as usize];
            sum.merged(&Aabb { min: c, max: c })
        });
        self.fill(node, 0..self.items.len(), S::cell(&bounds), depth, boxes);
    }

    fn visit<P: Probe>(
        &self,
        node: &Node<B>,
        boxes: &[Aabb],
        probe: &P,
        limit: &mut f64,
        visit: &mut impl FnMut(u32, &mut f64),
    ) {
        if node.is_leaf {
            for &triangle in self.triangles(node) {
                if probe.to_box(&boxes[triangle as usize]) <= *limit {
                    visit(triangle, limit);
                }
            }
            return;
        }
        let children = self.children(node);
        if !P::NEAREST {
            for child in children {
                if child.bound.cost(probe) <= *limit {
                    self.visit(child, boxes, probe, limit, visit);
                }
            }
            return;
        }
        // The nearest first, for it lowers the limit most.
        let mut costs = [f64::INFINITY; 8];
        for (cost, child) in costs.iter_mut().zip(children) {
            *cost = child.bound.cost(probe);
        }
        for _ in children {
            let mut best = 0;
            for (i, cost) in costs.iter().enumerate().skip(1) {
                if *cost < costs[best] {
                    best = i;
                }
            }
            if costs[best].is_infinite() || costs[best] > *limit {
                return;
            }
            costs[best] = f64::INFINITY;
            self.visit(&children[best], boxes, probe, limit, visit);
        }
    }
}

impl<B: Bound, S: Split> BroadPhase for Tree<B, S> {
    fn rebuild(&mut self, boxes: &[Aabb]) {
        self.nodes.clear();
        self.parents.clear();
        self.slots.clear();
        self.home.clear();
        self.home.resize(boxes.len(), NONE);
        self.centres.clear();
        self.centres.extend(boxes.iter().map(Aabb::centre));
        self.items.clear();
        self.items.extend(0..boxes.len() as u32);
        if !boxes.is_empty() {
            self.nodes.push(Node { bound: B::EMPTY, first: 0, len: 0, is_leaf: true });
            self.parents.push(NONE);
            self.fill_with_items(0, 0, boxes);
        }
        self.refit(boxes);
        self.built_spread = self.spread;
        self.built_nodes = self.nodes.len();
    }

    fn refit(&mut self, boxes: &[Aabb]) {
        let (mut volumes, mut triangles) = (0.0f64, 0.0f64);
        for i in (0..self.nodes.len()).rev() {
            let node = &self.nodes[i];
            let bound = if node.is_leaf {
                let within = self.triangles(node).iter().map(|&t| &boxes[t as usize]);
                triangles += f64::from(within.clone().map(Aabb::half_area).sum::<f32>());
                B::around(within)
            } else {
                let [first, rest @ ..] = self.children(node) else { continue };
                rest.iter().fold(first.bound, |sum, child| sum.joined(&child.bound))
            };
            volumes += f64::from(bound.area());
            self.nodes[i].bound = bound;
        }
        self.spread = if triangles > 0.0 { volumes / triangles } else { 1.0 };
    }

    fn replace(&mut self, removed: &[u32], inserted: &[u32], boxes: &[Aabb]) {
        self.replace_triangles(removed, inserted, boxes);
    }

    fn search<P: Probe>(&self, boxes: &[Aabb], probe: &P, limit: f64, mut visit: impl FnMut(u32, &mut f64)) {
        let mut limit = limit;
        if let Some(root) = self.nodes.first()
            && root.bound.cost(probe) <= limit
        {
            self.visit(root, boxes, probe, &mut limit, &mut visit);
        }
    }

    fn pairs(&self, boxes: &[Aabb], margin: f32, mut visit: impl FnMut(u32, u32)) {
        if let Some(root) = self.nodes.first() {
            self.pairs_below(root, boxes, margin, &mut visit);
        }
    }

    fn quality(&self) -> f64 {
        // Cuts leave nodes without triangles behind, which cost a refit as much as full ones.
        let nodes = self.nodes.len() as f64 / (2 * self.built_nodes.max(64)) as f64;
        (self.spread / self.built_spread).max(if nodes > 1.0 { nodes * super::WORN } else { 0.0 })
    }
}
