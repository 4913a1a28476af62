//! What a decoded message must satisfy before anybody may use it.
//!
//! * [`field`]: checks of single fields, naming message and field in the error.
//! * [`tool`]: poses, cuts, contacts.
//! * [`surface`]: frames, topologies, keyframes.
//! * [`server`]: reports, rpc requests and replies.

mod field;
mod server;
mod surface;
mod tool;
