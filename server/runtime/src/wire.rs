//! The network: sessions, permissions for orders, the door before them, and conversion of messages.

pub mod session;

pub mod door;

pub mod orders;

pub mod convert;

pub mod obstacle;

pub mod forces;
