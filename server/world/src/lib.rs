//! The world: what stands between a scene file and a running simulation.
//!
//! The modules stand in the order in which the data goes through them, and each knows only those before it: a
//! scene is parsed and checked ([`scene`]), bodies are made of it ([`assemble`]), tools touch them
//! ([`contact`]), [`simulation`] steps them, and snapshots and results leave for other threads and the disk.
//!
//! Units are SI everywhere and stand in the names: metres, seconds, newtons, pascals, kilograms.

// numbers in the words that people read
pub mod quantity;

// what comes from outside into a step
pub mod inputs;

// bytes of mesh files → points and cells, and back
pub mod format;

// points and cells, or a shape of our own → checked tetrahedra
pub mod mesh_in;

// text of a scene → checked objects
pub mod scene;

// what a step says about itself
pub mod report;

// a body as the world knows it, and its recorded points
pub mod body;

// rigid things: tools where hands and scripts hold them, and obstacles that stand still
pub mod tool;

// checked objects → bodies, and doubts about them
pub mod assemble;

// what other threads see of a step
pub mod snapshot;

// tools on bodies: proxies, springs, reactions, and touch at the pace of a hand
pub mod contact;

// the step, and the plan of what it costs
pub mod simulation;

// what a scene will do, from its first steps
pub mod forecast;

// what stays on disk
pub mod results;
