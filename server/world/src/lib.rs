//! The world: what stands between a scene file and a running simulation.
//!
//! The modules read in the direction the data flows: a scene file is parsed and checked
//! ([`scene`]), its meshes are read, made or lifted from a surface, tools touch the bodies,
//! [`simulation`] steps them, a local contact model and a snapshot leave for other threads,
//! and results are written.
//!
//! Units are SI everywhere and stand in the names: metres, seconds, newtons, pascals, kilograms.

// Each module is announced on its own line, in data-flow order.

pub mod scene;

// what comes from outside into a step
pub mod inputs;

// bytes of mesh files
pub mod format;

// mesh files → checked tetrahedra
pub mod mesh_in;

// rigid tools: where hands and scripts hold them
pub mod tool;

// tools on bodies: proxies, springs, reactions
pub mod contact;

// scene to bodies: regions, loads, meshes
pub mod assemble;

// what a step says about itself
pub mod report;

// bodies as the world knows them, and recorded material points
pub mod body;

pub mod simulation;

// what a scene will do, from its first steps
pub mod forecast;

pub mod quantity;

pub mod snapshot;

pub mod results;
