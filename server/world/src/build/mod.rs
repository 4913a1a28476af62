//! From checked objects to bodies: meshes opened, nodes selected, forces shared.

pub mod region;
