//! Connections to peers: those that connect to this program, or the one that it connects to.
//!
//! Each peer has a link of its own to the server. When the peer goes, the link goes, and the server releases its
//! tools. What a peer does to its connection concerns no other peer.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use scindo_client::{Link, LinkConfig};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;

use crate::ended::Ended;
use crate::hands::{HandSettings, Hands};
use crate::receive::receive;
use crate::send::{SendSettings, Sender};

/// Questions of a peer that may wait for an answer.
const ORDERS: usize = 16;

/// First and longest pause before the next attempt to reach a peer.
const PAUSES: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(8)];

/// How peers are served.
#[derive(Debug, Clone)]
pub struct BridgeSettings {
    /// Server, and identity of the first peer; the others have a number behind it.
    pub link: LinkConfig,
    /// How transforms become poses; `None`: peers move nothing.
    pub hands: Option<HandSettings>,
    /// What is sent.
    pub send: SendSettings,
    /// Most peers at a time.
    pub max_peers: usize,
}

/// Which of the places for peers are taken.
#[derive(Debug, Clone)]
struct Places(Arc<Mutex<Vec<bool>>>);

/// A place that is free again when this is dropped.
struct Place {
    places: Places,
    number: usize,
}

impl Places {
    fn take(&self) -> Option<Place> {
        let mut taken = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let number = taken.iter().position(|taken| !taken)?;
        taken[number] = true;
        Some(Place { places: self.clone(), number })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.0.lock().unwrap_or_else(PoisonError::into_inner)[self.number] = false;
    }
}

/// Serves every peer that connects, until dropped.
///
/// # Errors
/// The address cannot be listened at any more.
pub async fn listen(listener: TcpListener, settings: BridgeSettings) -> std::io::Result<()> {
    let places = Places(Arc::new(Mutex::new(vec![false; settings.max_peers])));
    loop {
        let (stream, peer) = match listener.accept().await {
            Ok(accepted) => accepted,
            // A connection that is gone again, or no more file descriptors for a while.
            Err(error) => {
                tracing::warn!(%error, "a peer could not be accepted");
                tokio::time::sleep(PAUSES[0]).await;
                continue;
            }
        };
        let Some(place) = places.take() else {
            tracing::warn!(%peer, max = settings.max_peers, "no place for another peer; see --max-peers");
            continue;
        };
        let settings = settings.clone();
        tokio::spawn(async move {
            tracing::info!(%peer, "a peer has come");
            let reason = serve(stream, &settings, place.number).await;
            tracing::info!(%peer, %reason, "the peer is gone");
        });
    }
}

/// Serves the peer at `address`, and connects again whenever the connection is lost.
pub async fn connect(address: String, settings: BridgeSettings) {
    let mut pause = PAUSES[0];
    loop {
        match TcpStream::connect(&address).await {
            Ok(stream) => {
                tracing::info!(address, "connected to the peer");
                let started = tokio::time::Instant::now();
                let reason = serve(stream, &settings, 0).await;
                tracing::info!(address, %reason, "the peer is gone");
                if started.elapsed() > PAUSES[1] {
                    pause = PAUSES[0];
                }
            }
            Err(error) => {
                tracing::warn!(address, %error, "the peer does not answer; the next attempt follows")
            }
        }
        tokio::time::sleep(pause).await;
        pause = (2 * pause).min(PAUSES[1]);
    }
}

/// Serves one peer; returns why the connection has ended.
async fn serve(stream: TcpStream, settings: &BridgeSettings, number: usize) -> Ended {
    match exchange(stream, settings, number).await {
        Ok(never) => match never {},
        Err(ended) => ended,
    }
}

async fn exchange(
    stream: TcpStream,
    settings: &BridgeSettings,
    number: usize,
) -> Result<std::convert::Infallible, Ended> {
    stream.set_nodelay(true)?;
    let mut config = settings.link.clone();
    if number > 0 {
        config.id = format!("{}-{}", config.id, number + 1);
    }
    let link = Link::connect(config).await?;
    let (from, to) = stream.into_split();
    let (orders, asked) = mpsc::channel(ORDERS);
    let hands = settings.hands.clone().map(|settings| Hands::new(link.clone(), settings));
    tokio::select! {
        ended = receive(from, hands, orders) => ended,
        ended = Sender::new(to, link, settings.send).run(asked) => ended,
    }
}

/// Opens the port for peers.
///
/// # Errors
/// The address is taken, or not one of this machine.
pub async fn open(address: SocketAddr) -> std::io::Result<TcpListener> {
    TcpListener::bind(address).await
}
