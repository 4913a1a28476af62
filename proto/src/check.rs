//! Checks that a decoded message must pass before it is used.
//!
//! * [`field`]: checks of single fields, naming message and field in the error.
//! * [`tool`]: poses, cuts, contacts.
//! * [`surface`]: frames, topologies, keyframes.
//! * [`server`]: reports, rpc requests and replies.

mod field;
mod server;
mod surface;
mod tool;
