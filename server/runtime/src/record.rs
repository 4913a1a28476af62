//! Recordings: what a simulation was asked and what became of it, as an MCAP file that can be computed again.
//!
//! * [`inputs`]: inputs of a step ↔ messages.
//! * [`mcap_writer`]: an MCAP file that grows without its index filling the memory.
//! * [`writer`]: the thread that writes.
//! * [`recorder`]: what the simulation hands to it.
//! * [`on_demand`]: recordings that an operator begins and ends.
//! * [`chunk`]: a packed part of a recording, message by message.
//! * [`reader`]: a recording as a stream of messages, also if its end is missing.
//! * [`replay`]: the same simulation again, step by step, held against the recorded hashes.
//! * [`gltf`]: surfaces as key frames of a picture that moves.
//!
//! Messages are protobuf with their descriptors (`scindo/v1/record.proto`), so Foxglove and every MCAP reader open
//! them. The file is flushed twice a second; a killed server loses at most a second.

pub mod inputs;

pub mod mcap_writer;

pub mod writer;

pub mod recorder;

pub mod on_demand;

mod chunk;

pub mod reader;

pub mod replay;

pub mod gltf;
