//! The closed surface of the fragments: skin, and the two lips of every cut.

pub(crate) mod surface;
pub(crate) mod doubled_edges;
pub(crate) mod joined;
pub(crate) mod surface_builder;
