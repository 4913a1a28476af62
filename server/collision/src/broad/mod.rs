//! Methods of broad phase behind one trait: four of our own, and the hierarchy of parry3d beside them.
//!
//! A method arranges the boxes of a surface's triangles. It answers a [search](BroadPhase::search) and lists
//! the [pairs](BroadPhase::pairs) of near boxes. What it visits is a superset of what is wanted: the exact
//! tests follow in the surface's queries, so all methods give the same results. A method is refitted when the
//! boxes moved, and after a cut only the changed triangles are [replaced](BroadPhase::replace).
//!
//! # Source
//! Jeřábková 2007, 4.2 (the four methods of VistaCD); Ericson, Real-Time Collision Detection (2005), chapters 6
//! and 7; Teschner et al. 2003 (hash function).

pub(crate) mod aabb;
pub(crate) mod ball;
pub(crate) mod probe;
mod tree;
mod split;
mod pairs;
mod replace;
mod hash;
mod parry;
mod method;

pub(crate) use method::Index;
pub use method::Method;

use aabb::Aabb;
use probe::Probe;

/// Growth of [`BroadPhase::quality`] from which a method is arranged anew.
pub(crate) const WORN: f64 = 1.5;

/// A method of broad phase over boxes that are numbered from 0. It does not keep the boxes: every call passes
/// those of the present state.
pub(crate) trait BroadPhase {
    /// Arranges all boxes anew, in the memory that it has.
    fn rebuild(&mut self, boxes: &[Aabb]);

    /// Adapts to boxes that moved. Linear in their number, without allocation.
    fn refit(&mut self, boxes: &[Aabb]);

    /// Takes out the triangles of `removed` and takes in those of `inserted`, at a cost proportional to their
    /// number. A [`refit`](Self::refit) must follow.
    fn replace(&mut self, removed: &[u32], inserted: &[u32], boxes: &[Aabb]);

    /// Visits every triangle whose box costs at most `limit`. The visitor may lower the limit.
    fn search<P: Probe>(&self, boxes: &[Aabb], probe: &P, limit: f64, visit: impl FnMut(u32, &mut f64));

    /// Visits every pair of different triangles whose boxes are no farther apart than `margin` [m] along every
    /// axis, once, in any order.
    fn pairs(&self, boxes: &[Aabb], margin: f32, visit: impl FnMut(u32, u32));

    /// Work of a search compared to a fresh arrangement; 1 after [`rebuild`](Self::rebuild).
    fn quality(&self) -> f64;
}
