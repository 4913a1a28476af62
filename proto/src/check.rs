//! Checks that a decoded message must pass before it is used.
//!
//! * [`field`]: checks of single fields, naming message and field in the error.
//! * [`tool`]: poses, cuts, contacts.
//! * [`surface`]: frames, topologies, keyframes.
//! * [`force`]: forces of contact.
//! * [`server`]: reports, rpc requests and replies.

mod field;
mod force;
mod server;
mod surface;
mod tool;
