//! A server as its clients and its operator see it: wire, access, recording, diagnosis.

#![allow(clippy::unwrap_used)]

mod access;
mod doctor;
mod house;
mod mcap_writer;
mod recording;
mod sibling;
mod textured;
mod two_hands;
mod wire;

use scindo_tests::scene::{WORLD, ball, block, held};

#[global_allocator]
static ALLOCATOR: scindo_allocations::Counting = scindo_allocations::Counting;

/// A small block and a ball, for tests of who may do what.
fn lab_scene() -> String {
    let block = block("block", [[0.0; 3], [0.04, 0.04, 0.02]], [2, 2, 1], &held("z"));
    format!("{WORLD}{block}{}", ball("probe", 0.005, &[]))
}
