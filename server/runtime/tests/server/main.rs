//! A server as its clients and its operator see it: wire, access, recording, diagnosis.

#![allow(clippy::unwrap_used)]

mod access;
mod doctor;
mod house;
mod mcap_writer;
mod recording;
mod textured;
mod two_hands;
mod wire;

#[global_allocator]
static ALLOCATOR: scindo_allocations::Counting = scindo_allocations::Counting;
