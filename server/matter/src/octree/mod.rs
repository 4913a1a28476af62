//! Cubical cells on an adaptive octree, cut along the links between them.
//!
//! # Source
//! Dick, Georgii, Westermann 2011: A hexahedral multigrid approach for simulating cuts in deformable objects.

mod adapt;
mod blade;
mod build;
mod cells;
mod change;
mod coarsen;
mod cubes;
mod lattice;
mod link_map;
mod measures;
pub mod near;
mod restriction;
mod shape;
mod solid;
mod surface;
mod vertices;

pub use adapt::{Activity, AdaptError, AdaptSettings, Plan};
pub use blade::swept_box;
pub use build::Bits;
pub use cells::{Cell, Octree, OctreeError};
pub use change::{Leaf, OctreeChange};
pub use coarsen::{Coarsening, Family};
pub use lattice::{At, DIRECTIONS, Lattice, LeafMap, OUTSIDE, OctreeSettings, morton_code};
pub use link_map::{CutLink, LinkHasher, LinkKey, LinkMap};
pub use measures::FACES;
pub use measures::Leaves;
pub use restriction::Restriction;
pub use shape::{BoxShape, Shape};
pub use surface::{OctreeSurface, OwnSkin};
pub use vertices::{Octants, corner_shares, corner_weights, parent_corner};

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::iter_over_hash_type)] // links are checked one by one, in any order
mod tests;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod adapt_tests;
