//! What is connected to what: fragments inside the elements, pieces of them, copies of the nodes.
//!
//! Each is a pure function of the one before; a cut opens faces between fragments and nothing else.

pub(crate) mod slot;
pub(crate) mod incision_sets;
pub(crate) mod crossings;
pub(crate) mod runs;
pub(crate) mod fragments;
pub(crate) mod pieces;
pub(crate) mod copies;
pub(crate) mod components;
pub(crate) mod locate;
