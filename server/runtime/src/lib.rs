//! The scindo server.
//!
//! # Layout
//! Each module knows only those before it:
//! * [`error`]: failures and their exit codes.
//! * [`lab`]: laboratories with certificates, and what each role may do.
//! * [`monitor`]: what people see of a machine and of a server.
//! * [`wire`]: the two zenoh sessions (haptic and bulk), who may give orders through them, the
//!   [pace](wire::door) of clients before zenoh hears them, and conversion between messages and the types of the world.
//! * [`inbox`]: poses and cuts of clients; who holds which tool.
//! * [`exchange`]: state shared by the threads.
//! * [`receive`]: what arrives, from the wire into the inbox.
//! * [`record`]: recordings of all of this, and their replay.
//! * [`sim`]: the simulation thread.
//! * [`contact`]: the contact thread, 200 Hz or more beside the simulation.
//! * [`publish`]: the publication thread, and the threads that answer late joiners.
//! * [`rpc`]: questions and orders.
//! * [`server`]: starts and ends all of these, and watches over them.
//! * [`command`]: the commands and their outcome.
//!
//! Data flows through wire, receive, inbox, sim, exchange, publish, wire.
//!
//! | thread | does | waits for |
//! |---|---|---|
//! | `sim` | orders, step, snapshots | the next step's time |
//! | `contact` | local contact model per held tool | its period; sleeps while nobody holds a tool |
//! | `publish` | surfaces, tools, answers, events, statistics | its period, or something to send |
//! | `rpc` | one question after the other | the simulation, at most 1.7 s |
//! | `record` | writes the recording, if there is one | something to write |
//! | `door` | sets the pace of clients that connect over plain TCP ([`wire::door`]) | a batch of a client, or of zenoh |
//! | `watchdog` | breaks off steps that keep orders waiting; ends a process that does not end | its period |
//! | zenoh's own | decode, check, store in the inbox | nothing |

pub mod error;
pub mod lab;
pub mod monitor;
pub mod wire;
pub mod inbox;
pub mod exchange;
pub mod receive;
pub mod record;
pub mod sim;
pub mod contact;
pub mod publish;
pub mod rpc;
pub mod server;
pub mod command;
