//! The contact that the server sends: the newest message, and the force that it means at the current tip.

pub mod model;

pub mod law;
