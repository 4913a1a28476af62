//! The contact that the server sends: the newest message, and the resulting force at the present tip.

pub mod model;

pub mod history;

pub mod relaxation;

pub mod load;

pub mod friction;

pub mod law;
