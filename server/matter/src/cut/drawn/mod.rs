//! Traces of blades that have opened nothing yet: lines on the surface, faces inside elements.

pub(crate) mod traces;
pub(crate) mod pending;
