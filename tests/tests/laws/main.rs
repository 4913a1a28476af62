//! Laws of the house: who may know whom, how files and rooms depend on each other, and where links lead.

#![allow(clippy::unwrap_used)]

mod architecture;
mod circles;
mod imports;
mod links;
mod ratchets;
mod stairs;
