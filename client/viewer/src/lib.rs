//! Browser viewer of scindo: serves the page in `web/` and relays the stream to it.
//!
//! # The way of the data
//! server → `scindo-client` → [`hub`] → [`outbox`] of every browser → [`socket`] → page, and back:
//! page → [`socket`] → [`hub`] → `scindo-client` → server.
//!
//! # Invariants
//! * A slow browser delays nobody: it gets the newest frame when it is ready, and misses the rest.
//! * A browser never speaks for another: identity of client and tool is set here.
//! * The page decides nothing about the mesh; it sends poses and calls, the server acts.

pub mod outbox;

pub mod hub;

mod page;

mod origin;

mod listen;

pub mod socket;

mod door;

pub mod server;

mod upstream;

use std::hash::{BuildHasher, Hasher, RandomState};
use std::net::SocketAddr;
use std::sync::Arc;

use scindo_client::{LinkConfig, Role};
use thiserror::Error;
use tokio::sync::mpsc;

use crate::hub::{Hub, Up};

pub use listen::listen_address;
pub use server::{Operators, WebConfig, WebServer};

/// Why the viewer cannot work.
#[derive(Debug, Error)]
pub enum ViewError {
    /// The address is taken or not ours.
    #[error("cannot serve the page on {address}: {source}; choose another address")]
    Listen {
        /// The address asked for.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
}

/// What a viewer needs to know: where the server is, and where browsers come.
#[derive(Debug, Clone)]
pub struct ViewConfig {
    /// The link to the server.
    pub link: LinkConfig,
    /// The web server.
    pub web: WebConfig,
}

impl ViewConfig {
    /// A viewer of the default session on this machine, with an id of its own.
    pub fn new(listen: SocketAddr) -> Self {
        let random = RandomState::new().build_hasher().finish() & 0xff_ffff;
        Self {
            link: LinkConfig::new(Role::Viewer, &format!("view-{random:06x}")),
            web: WebConfig { listen, ..WebConfig::default() },
        }
    }
}

/// A viewer that has its port.
pub struct Viewer {
    web: WebServer,
    hub: Arc<Hub>,
    up: mpsc::Receiver<Up>,
    link: LinkConfig,
}

impl Viewer {
    /// Takes the port for browsers; the server is looked for by [`Viewer::run`], and may come later.
    pub async fn bind(config: ViewConfig) -> Result<Self, ViewError> {
        let (hub, up) = Hub::new(&config.link.id);
        let web = WebServer::bind(config.web, Arc::clone(&hub), config.link.connect.join(", ")).await?;
        Ok(Self { web, hub, up, link: config.link })
    }

    /// Where browsers find it.
    pub fn address(&self) -> SocketAddr {
        self.web.address()
    }

    /// Serves browsers and follows the server until the future is dropped.
    pub async fn run(self) -> Result<(), ViewError> {
        tokio::select! {
            ended = self.web.run() => ended,
            () = upstream::run(self.hub, self.up, self.link) => Ok(()),
        }
    }
}

/// [`Viewer::bind`] and [`Viewer::run`] in one.
pub async fn serve(config: ViewConfig) -> Result<(), ViewError> {
    Viewer::bind(config).await?.run().await
}

/// Whether npm built the page that this program holds.
pub fn page_is_built() -> bool {
    page::is_built()
}
