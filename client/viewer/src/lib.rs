//! Browser viewer of scindo: serves the page in `web/` and relays the stream to it.
//!
//! # How data flows
//! server → `scindo-client` → [`hub`] → [`outbox`] of every browser → [`socket`] → page, and back:
//! page → [`socket`] → [`hub`] → `scindo-client` → server.
//!
//! # Invariants
//! * A slow browser delays nobody: it gets the newest frame when it is ready, and misses the others.
//! * A browser never acts for another: the ids of client and tool are set here.
//! * The page decides nothing about the mesh. It sends poses and calls; the server acts.

pub mod outbox;

pub mod hub;

mod page;

mod origin;

mod listen;

mod door;

pub mod socket;

pub mod server;

pub mod coarse;

mod upstream;

use std::hash::{BuildHasher, Hasher, RandomState};
use std::net::SocketAddr;
use std::sync::Arc;

use scindo_client::{LinkConfig, Role};
use thiserror::Error;
use tokio::sync::mpsc;

use crate::hub::{Hub, Up};

pub use door::Door;
pub use listen::listen_address;
pub use server::{Operators, WebConfig, WebServer};

/// Reason why the viewer cannot start.
#[derive(Debug, Error)]
pub enum ViewError {
    /// The address is taken, or does not belong to this machine.
    #[error("cannot serve the page on {address}: {source}; choose another address")]
    Listen {
        /// The requested address.
        address: SocketAddr,
        /// The error of the system.
        source: std::io::Error,
    },
}

/// Settings of a viewer: the server to reach, and the address for browsers.
#[derive(Debug, Clone)]
pub struct ViewConfig {
    /// Settings of the link to the server.
    pub link: LinkConfig,
    /// Settings of the web server.
    pub web: WebConfig,
}

impl ViewConfig {
    /// Settings for the default session on this machine, with a random id.
    pub fn new(listen: SocketAddr) -> Self {
        let random = RandomState::new().build_hasher().finish() & 0xff_ffff;
        Self {
            link: LinkConfig::new(Role::Viewer, &format!("view-{random:06x}")),
            web: WebConfig { listen, ..WebConfig::default() },
        }
    }
}

/// A viewer whose port is bound.
pub struct Viewer {
    web: WebServer,
    hub: Arc<Hub>,
    up: mpsc::Receiver<Up>,
    link: LinkConfig,
}

impl Viewer {
    /// Binds the port for browsers. [`Viewer::run`] looks for the server, which may come later.
    pub async fn bind(config: ViewConfig) -> Result<Self, ViewError> {
        let (hub, up) = Hub::new(&config.link.id);
        let web = WebServer::bind(config.web, Arc::clone(&hub), config.link.connect.join(", ")).await?;
        Ok(Self { web, hub, up, link: config.link })
    }

    /// Address at which browsers reach the page.
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

/// Calls [`Viewer::bind`], then [`Viewer::run`].
pub async fn serve(config: ViewConfig) -> Result<(), ViewError> {
    Viewer::bind(config).await?.run().await
}

/// Whether npm built the page embedded in this program.
pub fn page_is_built() -> bool {
    page::is_built()
}
