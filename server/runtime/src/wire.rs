//! The network: sessions, permissions for orders, and conversion of messages.

pub mod session;

pub mod orders;

pub mod convert;

pub mod obstacle;

pub mod forces;
