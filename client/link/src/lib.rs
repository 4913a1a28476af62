//! Client library of scindo: connect, mirror bodies, hold tools, ask the server.
//!
//! ```no_run
//! # async fn demo() -> Result<(), scindo_client::LinkError> {
//! use scindo_client::{Link, LinkConfig, Role};
//! let link = Link::connect(LinkConfig::new(Role::Viewer, "desk-1")).await?;
//! for body in link.info().await?.bodies {
//!     let mut mirror = link.mirror(&body.id).await?;
//!     let surface = mirror.next().await?;
//!     println!("{}: {} triangles", body.id, surface.topology.triangle_count);
//! }
//! # Ok(()) }
//! ```
//!
//! # Layout
//! * [`config`]: the server to reach, and our identity.
//! * [`link`]: the two zenoh sessions, our liveliness token, presence of the server.
//! * [`mirror`]: a body's surface, kept complete across cuts and lost messages.
//! * [`watch`]: tool states, statistics, events, the plan.
//! * [`tool`]: poses up, contacts down, cuts acknowledged.
//! * [`shape`]: shapes of tools as words.
//! * [`guest`]: tools held for others, such as browsers behind a viewer.
//! * [`rpc`]: questions and orders with an answer.
//!
//! Nothing here blocks zenoh's receiving thread. New state overwrites older state. Queues of messages that
//! must not be lost are bounded and count what they drop.

pub mod error;

pub mod config;

pub mod link;

pub mod mirror;

pub mod watch;

pub mod tool;

pub mod shape;

pub mod guest;

pub mod rpc;

pub use config::LinkConfig;
pub use error::LinkError;
pub use guest::GuestTool;
pub use link::{Link, Presence};
pub use mirror::{BodyMirror, Surface};
pub use scindo_proto::{Role, messages, name};
pub use shape::parse_shape;
pub use tool::{ContactReader, ContactStream, Cutter, PoseSender, ReceivedContact, ToolLink};
pub use watch::{EventStream, Latest, ToolStates};
