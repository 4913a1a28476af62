//! The network: sessions, permissions for orders, the door before them, what arrives, and conversion of messages.

pub mod session;

pub mod door;

pub mod receive;

pub mod orders;

pub mod convert;

pub mod obstacle;

pub mod forces;
