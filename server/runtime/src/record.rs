//! Recordings: what a simulation was asked and what became of it, as an MCAP file that can be computed again.
//!
//! * [`inputs`]: inputs of a step ↔ messages.
//! * [`writer`]: the thread that writes.
//! * [`recorder`]: what the simulation hands to it.
//! * [`on_demand`]: recordings that an operator begins and ends.
//! * [`reader`]: a recording as a stream of messages, also if its end is missing.
//! * [`replay`]: the same simulation again, step by step, held against the recorded hashes.
//! * [`gltf`]: surfaces as key frames of a picture that moves.
//!
//! Messages are protobuf with their descriptors (`scindo/v1/record.proto`), so Foxglove and every MCAP reader open
//! them. The file is flushed every second; a killed server loses at most that second.

pub mod inputs;

pub mod writer;

pub mod recorder;

pub mod on_demand;

pub mod reader;

pub mod replay;

pub mod gltf;
