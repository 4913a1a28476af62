//! The connectivity of the material: fragments inside the elements, pieces made of them, copies of the nodes.
//!
//! Each is a pure function of the one before. A cut only opens faces between fragments.

pub(crate) mod slot;
pub(crate) mod elements_around;
pub(crate) mod incision_sets;
pub(crate) mod crossings;
pub(crate) mod runs;
pub(crate) mod fragments;
pub(crate) mod pieces;
pub(crate) mod copies;
pub(crate) mod components;
pub(crate) mod locate;
