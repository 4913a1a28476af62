//! The door in front of zenoh: whoever connects over plain TCP comes in through it, at the pace it sets.
//!
//! zenoh itself holds nobody back. A client that declares thousands of names makes its tables slow for everybody, and
//! one that sends as fast as it can takes the time of the threads that serve hands. Nothing that a client of scindo does
//! comes near the paces of [`pace`]; who exceeds them waits, and nobody else does.
//!
//! ```text
//!   client ──TCP──▶ greeting? ──▶ pace ──▶ zenoh:  a file of this process, for clients on this machine
//!          ◀───────────────────────────────        a port on loopback, for those of other machines
//! ```
//!
//! The two ways tell zenoh's access control whose orders it may pass on ([`crate::wire::orders`]): behind the door every
//! client would otherwise seem to be on this machine. Encrypted endpoints (QUIC), and endpoints with options of zenoh,
//! have no door.

use std::iter;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use scindo_proto::endpoint::bulk_endpoint;
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Runtime;
use tokio::sync::Semaphore;

use self::pace::Turnstiles;
use crate::error::RuntimeError;

pub mod pace;

mod pass;

/// Most connections of one door, with those that have not said yet who they are.
const CONNECTIONS: usize = 288;
/// Pause after a connection that could not be accepted.
const PAUSE: Duration = Duration::from_millis(50);
/// What endpoints of sockets in a folder begin with.
const FILE: &str = "unixsock-stream/";
/// Longest path of a socket in bytes, with what zenoh adds to it.
const LONGEST_PATH: usize = 100;

/// The doors of a server. Dropped, they close, and everybody inside is disconnected.
#[derive(Debug)]
pub struct Doors {
    /// Endpoints outside, and those at which zenoh has to listen instead.
    doors: Vec<Door>,
    runtime: Option<Runtime>,
    // Removed when the sockets in it are no longer used.
    _folder: Option<tempfile::TempDir>,
}

/// One door.
#[derive(Debug)]
struct Door {
    outside: String,
    /// A file, for clients on this machine.
    near: String,
    /// A port on loopback, for the others.
    far: String,
}

/// Where the door leads.
#[derive(Debug, Clone)]
struct Inside {
    near: PathBuf,
    far: SocketAddr,
}

impl Doors {
    /// Opens doors at those of the haptic `endpoints` that can have one, and at their bulk endpoints.
    ///
    /// # Errors
    /// If an address is taken.
    pub fn open(endpoints: &[String]) -> Result<Self, RuntimeError> {
        let failed = |what: &str, e: &std::io::Error| RuntimeError::System {
            what: what.to_owned(),
            reason: e.to_string(),
        };
        if !endpoints.iter().any(|endpoint| plain(endpoint).is_some()) {
            return Ok(Self::none());
        }
        let folder = match folder() {
            Ok(folder) => folder,
            Err(error) => {
                tracing::warn!(
                    "no folder for sockets: {error}; clients over TCP are not slowed down. Set XDG_RUNTIME_DIR or TMPDIR to \
                     a folder with a short path that this user can write"
                );
                return Ok(Self::none());
            }
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("door")
            .enable_all()
            .build()
            .map_err(|e| failed("starting threads", &e))?;
        let turnstiles = Arc::new(Turnstiles::default());
        let mut doors = Vec::new();
        for (number, haptic) in endpoints.iter().enumerate() {
            let file = format!("{FILE}{}", folder.path().join(number.to_string()).display());
            let bulk = bulk_endpoint(haptic).zip(bulk_endpoint(&file));
            for (outside, near) in iter::once((haptic.clone(), file)).chain(bulk) {
                let Some(address) = plain(&outside) else { continue };
                let taken = |e: std::io::Error| RuntimeError::Listen {
                    endpoints: outside.clone(),
                    reason: e.to_string(),
                };
                let listener = listen(&runtime, address).map_err(taken)?;
                let far = free_port().map_err(|e| failed("finding a port on loopback", &e))?;
                let inside = Inside { near: near.trim_start_matches(FILE).into(), far };
                runtime.spawn(serve(listener, inside, turnstiles.clone()));
                doors.push(Door { outside, near, far: format!("tcp/{far}") });
            }
        }
        Ok(Self { doors, runtime: Some(runtime), _folder: Some(folder) })
    }

    /// No door.
    pub fn none() -> Self {
        Self { doors: Vec::new(), runtime: None, _folder: None }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.doors.is_empty()
    }

    /// Where zenoh has to listen instead of at an endpoint: behind its door, or there.
    pub fn behind(&self, endpoint: &str) -> Vec<String> {
        match self.doors.iter().find(|door| door.outside == endpoint) {
            Some(door) => vec![door.near.clone(), door.far.clone()],
            None => vec![endpoint.to_owned()],
        }
    }

    /// How this process reaches what listens at an endpoint, without passing through its door. `None` where that needs a
    /// certificate.
    pub fn inside(&self, endpoint: &str) -> Option<String> {
        match self.doors.iter().find(|door| door.outside == endpoint) {
            Some(door) => Some(door.near.clone()),
            None => local(endpoint),
        }
    }
}

impl Drop for Doors {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// The endpoint by which this process reaches its own `endpoint`. Only plain TCP works without a certificate.
pub fn local(endpoint: &str) -> Option<String> {
    let address = endpoint.strip_prefix("tcp/")?;
    let (host, port) = address.rsplit_once(':')?;
    let host = match host {
        "0.0.0.0" => "127.0.0.1",
        "[::]" => "[::1]",
        host => host,
    };
    Some(format!("tcp/{host}:{port}"))
}

/// The address of an endpoint that can have a door: TCP without options.
fn plain(endpoint: &str) -> Option<&str> {
    endpoint.strip_prefix("tcp/").filter(|address| !address.contains(['?', '#']))
}

/// A folder that only this user can enter, with a short path.
fn folder() -> std::io::Result<tempfile::TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix("scindo-");
    let run = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let places = run.into_iter().chain([std::env::temp_dir(), PathBuf::from("/tmp")]);
    let mut last = std::io::Error::from(std::io::ErrorKind::NotFound);
    for place in places.filter(|place| place.as_os_str().len() < LONGEST_PATH - 20) {
        match builder.tempdir_in(place) {
            Ok(folder) => return Ok(folder),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Listens at an address. The caller may be a thread of another runtime, which may not wait for this one.
fn listen(runtime: &Runtime, address: &str) -> std::io::Result<TcpListener> {
    let listener = std::net::TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let _entered = runtime.enter();
    TcpListener::from_std(listener)
}

/// A port on loopback that nobody uses at present.
fn free_port() -> std::io::Result<SocketAddr> {
    std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()
}

/// Lets clients in until the runtime ends.
async fn serve(listener: TcpListener, inside: Inside, turnstiles: Arc<Turnstiles>) {
    let seats = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let (Ok(seat), client) = (seats.clone().acquire_owned().await, listener.accept().await) else {
            return;
        };
        let (client, from): (TcpStream, SocketAddr) = match client {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::debug!(%error, "connection not accepted");
                tokio::time::sleep(PAUSE).await;
                continue;
            }
        };
        let (inside, turnstiles) = (inside.clone(), turnstiles.clone());
        tokio::spawn(async move {
            if let Err(error) = pass::through(client, from, &inside, &turnstiles).await {
                tracing::debug!(%from, %error, "connection ended");
            }
            drop(seat);
        });
    }
}
