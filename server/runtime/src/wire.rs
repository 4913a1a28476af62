//! The network: its sessions, who may give orders through them, and what the messages mean.

pub mod session;

pub mod orders;

pub mod convert;
