//! A simulator of the network: real server code and real haptic clients on a virtual clock, with a link between them
//! that loses, repeats, delays, reorders and spoils messages, and with partners that freeze, vanish and lie.
//!
//! # What is real
//! Messages are encoded to bytes and decoded by the functions that zenoh's threads call ([`scindo::receive`]); inbox,
//! simulation, contact models and the haptic tick are those of the programs. Simulated are sockets, threads and time: a
//! seed decides everything, so that a failure can be repeated.
//!
//! # What is checked, by the way ([`checker`])
//! * A cut is applied once or refused, and its sender is told which.
//! * A tool has one owner at a time, and stands where that owner has put it.
//! * The force on a hand is finite, never larger than its limit, never changes faster than its limit, and is zero
//!   soon after silence.
//! * When the faults end, everybody can work again ([`episode`]).
//!
//! The rules of the force are also held against contacts that are made up ([`drill`]). [`device`] is the simulated device in
//! a hand, which the haptic truth table of `scindo-papers` uses too; chance comes from a seed ([`chance`]).
//!
//! # Sources
//! The method is that of FoundationDB's simulation and TigerBeetle's VOPR.

pub mod chance;

pub mod device;

pub mod network;

pub mod hand;

pub mod rogue;

pub mod checker;

pub mod table;

pub mod episode;

pub mod drill;

pub mod campaign;

pub mod guarantees;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
