//! The choice among the methods.

use super::BroadPhase;
use super::aabb::Aabb;
use super::ball::Ball;
use super::hash::SpatialHash;
use super::parry::ParryBvh;
use super::probe::Probe;
use super::split::{Halves, Octants};
use super::tree::Tree;

/// A method of broad phase. All give the same results; they differ in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Method {
    /// Binary tree of axis-aligned boxes.
    #[default]
    AabbTree,
    /// Octree: cubes divided into eight, each with the box of the triangles whose centres it holds.
    Octree,
    /// Binary tree of spheres.
    SphereTree,
    /// Hashed grids, one per size of triangle.
    SpatialHash,
    /// Bounding volume hierarchy of parry3d, for comparison.
    ParryBvh,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 5] =
        [Self::AabbTree, Self::Octree, Self::SphereTree, Self::SpatialHash, Self::ParryBvh];

    /// Its name in scenes and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::AabbTree => "aabb-tree",
            Self::Octree => "octree",
            Self::SphereTree => "sphere-tree",
            Self::SpatialHash => "spatial-hash",
            Self::ParryBvh => "parry-bvh",
        }
    }
}

/// The arrangement of one surface by the method that was chosen.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) enum Index {
    AabbTree(Tree<Aabb, Halves>),
    Octree(Tree<Aabb, Octants>),
    SphereTree(Tree<Ball, Halves>),
    SpatialHash(SpatialHash),
    ParryBvh(ParryBvh),
}

macro_rules! each {
    ($index:expr, $method:ident => $call:expr) => {
        match $index {
            Index::AabbTree($method) => $call,
            Index::Octree($method) => $call,
            Index::SphereTree($method) => $call,
            Index::SpatialHash($method) => $call,
            Index::ParryBvh($method) => $call,
        }
    };
}

impl Index {
    /// Arranges boxes by `method`.
    pub(crate) fn new(method: Method, boxes: &[Aabb]) -> Self {
        let mut index = match method {
            Method::AabbTree => Self::AabbTree(Tree::default()),
            Method::Octree => Self::Octree(Tree::default()),
            Method::SphereTree => Self::SphereTree(Tree::default()),
            Method::SpatialHash => Self::SpatialHash(SpatialHash::default()),
            Method::ParryBvh => Self::ParryBvh(ParryBvh::default()),
        };
        index.rebuild(boxes);
        index
    }

    pub(crate) fn method(&self) -> Method {
        match self {
            Self::AabbTree(_) => Method::AabbTree,
            Self::Octree(_) => Method::Octree,
            Self::SphereTree(_) => Method::SphereTree,
            Self::SpatialHash(_) => Method::SpatialHash,
            Self::ParryBvh(_) => Method::ParryBvh,
        }
    }
}

impl BroadPhase for Index {
    fn rebuild(&mut self, boxes: &[Aabb]) {
        each!(self, method => method.rebuild(boxes));
    }

    fn refit(&mut self, boxes: &[Aabb]) {
        each!(self, method => method.refit(boxes));
    }

    fn replace(&mut self, removed: &[u32], inserted: &[u32], boxes: &[Aabb]) {
        each!(self, method => method.replace(removed, inserted, boxes));
    }

    fn search<P: Probe>(&self, boxes: &[Aabb], probe: &P, limit: f64, visit: impl FnMut(u32, &mut f64)) {
        each!(self, method => method.search(boxes, probe, limit, visit));
    }

    fn pairs(&self, boxes: &[Aabb], margin: f32, visit: impl FnMut(u32, u32)) {
        each!(self, method => method.pairs(boxes, margin, visit));
    }

    fn quality(&self) -> f64 {
        each!(self, method => method.quality())
    }
}
