//! Where blades have gone without opening anything yet: lines on the surface, faces inside elements.

pub(crate) mod traces;
pub(crate) mod pending;
