//! OpenIGTLink bridge of scindo: 3D Slicer, PLUS and trackers see bodies and move tools.
//!
//! # Layout, in the order of the data
//! * [`wire`]: OpenIGTLink messages as bytes, with limits.
//! * [`names`]: device names and ids.
//! * [`axes`]: millimetres and metres, RAS and LPS.
//! * [`hands`]: transforms of a peer become poses of tools.
//! * [`receive`]: from a peer to its hands.
//! * [`surface`]: surfaces of bodies as messages.
//! * [`send`]: from the server to a peer.
//! * [`bridge`]: peers come and go.
//! * [`command`]: the command line.
//!
//! A peer harms neither the server nor another peer: it has its own link, its memory and rates are bounded, and a peer
//! that reads nothing is closed.

pub mod wire;

pub mod names;

pub mod axes;

pub mod hands;

pub mod ended;

pub mod receive;

pub mod surface;

pub mod send;

pub mod bridge;

pub mod command;
