//! The thread that exchanges messages with the service.

use std::net::{TcpStream, ToSocketAddrs as _};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use triple_buffer::{Input, Output};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

use super::service::{self, ForceField, Status, Update};
use super::{Commanded, FORCE_VALID, HaplyAddress, Measured};

/// Longest wait for a connection.
const CONNECT: Duration = Duration::from_secs(1);

/// Longest wait for an answer. Haply's service takes less than a millisecond.
const ANSWER: Duration = Duration::from_millis(200);

/// First and longest pause before the next attempt to connect.
const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(4)];

/// Longest sleep until the next force; the tick wakes the thread before.
const NEXT_FORCE: Duration = Duration::from_millis(2);

/// Pause between two questions for a device that is not there.
const NEXT_QUESTION: Duration = Duration::from_millis(100);

/// Longest message [bytes]: an inventory of a hundred devices.
const MAX_MESSAGE: usize = 1 << 20;

/// Why a session with the service ends.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Lost {
    /// Nothing listens at the address, or the network is down.
    #[error("no service at {address}: {source}")]
    Unreachable {
        address: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The connection broke, the answer took too long, or it is no WebSocket.
    #[error("the connection broke: {0}")]
    Socket(#[from] Box<tungstenite::Error>),
    /// What came is no update.
    #[error("the service sent what is no update: {0}")]
    Update(#[from] serde_json::Error),
}

impl From<tungstenite::Error> for Lost {
    fn from(error: tungstenite::Error) -> Self {
        Self::Socket(Box::new(error))
    }
}

/// A connection to a service.
pub(crate) struct Session {
    socket: WebSocket<TcpStream>,
}

impl Session {
    /// Connects, and returns the inventory.
    ///
    /// # Errors
    /// Nothing listens, or it is no Haply service.
    pub(crate) fn open(address: &str) -> Result<(Self, Update), Lost> {
        let unreachable = |source| Lost::Unreachable { address: address.to_owned(), source };
        let stream = connect(address).map_err(unreachable)?;
        let config =
            WebSocketConfig::default().max_message_size(Some(MAX_MESSAGE)).max_frame_size(Some(MAX_MESSAGE));
        let url = format!("ws://{address}/");
        let (socket, _) =
            tungstenite::client::client_with_config(url, stream, Some(config)).map_err(|e| match e {
                tungstenite::HandshakeError::Failure(error) => Lost::from(error),
                tungstenite::HandshakeError::Interrupted(_) => unreachable(std::io::Error::new(
                    std::io::ErrorKind::TimedOut,
                    "it does not answer as a WebSocket",
                )),
            })?;
        let mut session = Self { socket };
        let inventory = session.update()?;
        Ok((session, inventory))
    }

    /// Sends a message and returns the update that answers it.
    fn exchange(&mut self, message: String) -> Result<Update, Lost> {
        self.socket.send(Message::text(message))?;
        self.update()
    }

    fn update(&mut self) -> Result<Update, Lost> {
        loop {
            if let Message::Text(text) = self.socket.read()? {
                return Ok(Update::read(&text)?);
            }
        }
    }
}

fn connect(address: &str) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::new(std::io::ErrorKind::NotFound, "the name has no address");
    for one in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&one, CONNECT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(ANSWER))?;
                stream.set_write_timeout(Some(ANSWER))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Exchanges until `stop` is raised, and connects again whenever the service was away.
pub(super) fn run(
    address: &HaplyAddress,
    mut commanded: Output<Commanded>,
    mut measured: Input<Measured>,
    stop: &AtomicBool,
) {
    let mut pause = PAUSES[0];
    while !stop.load(Ordering::Relaxed) {
        match session(address, &mut commanded, &mut measured, stop, &mut pause) {
            Ok(()) => return,
            Err(error) => tracing::warn!(%error, retry = ?pause, "no Haply device"),
        }
        measured.write(Measured::default());
        sleep(pause, stop);
        pause = (2 * pause).min(PAUSES[1]);
    }
}

fn session(
    address: &HaplyAddress,
    commanded: &mut Output<Commanded>,
    measured: &mut Input<Measured>,
    stop: &AtomicBool,
    pause: &mut Duration,
) -> Result<(), Lost> {
    let (mut session, mut update) = Session::open(&address.address)?;
    tracing::info!(address = address.address, devices = update.inverse3.len(), "the Haply service answers");
    let mut field = None;
    let mut is_first = true;
    let mut told = None;
    while !stop.load(Ordering::Relaxed) {
        let device = update.device(address.id.as_deref());
        let hand = device.filter(|device| device.status.ready).and_then(|device| update.hand(device));
        measured.write(Measured { hand: hand.map(|hand| (hand, Instant::now())) });
        tell(&mut told, device.map(|device| device.status));
        field = device.and_then(service::Inverse3::force_field).or(field);
        match device.map(|device| &device.device_id) {
            Some(id) => {
                *pause = PAUSES[0];
                std::thread::park_timeout(NEXT_FORCE);
                let field = field.unwrap_or(ForceField::Values);
                let message = service::force(id, field, &present(commanded.read(), Instant::now()), is_first);
                is_first = false;
                update = session.exchange(message)?;
            }
            None => {
                sleep(NEXT_QUESTION, stop);
                update = session.exchange(service::inventory())?;
            }
        }
    }
    if let Some(device) = update.device(address.id.as_deref()) {
        let field = field.unwrap_or(ForceField::Values);
        session.exchange(service::force(&device.device_id, field, &Vector3::zeros(), is_first))?;
    }
    session.socket.close(None)?;
    Ok(())
}

/// The force that still holds at `now`: zero if the tick has stopped to renew it.
pub(super) fn present(commanded: &Commanded, now: Instant) -> Vector3<f64> {
    let is_fresh = commanded.at.is_some_and(|at| now.saturating_duration_since(at) < FORCE_VALID);
    let is_finite = commanded.force_n.iter().all(|f| f.is_finite());
    if is_fresh && is_finite { commanded.force_n } else { Vector3::zeros() }
}

/// Tells of a device that comes, goes or changes.
fn tell(told: &mut Option<Option<Status>>, now: Option<Status>) {
    if *told == Some(now) {
        return;
    }
    match now {
        None => tracing::warn!("the Haply service has no such device: plug it in"),
        Some(status) if !status.ready => tracing::warn!("the Haply device is not ready"),
        Some(status) if !status.calibrated => {
            tracing::warn!("the Haply device is not calibrated; see Haply Hub")
        }
        Some(status) if !status.power_supply => {
            tracing::warn!("the Haply device has no power supply: no force")
        }
        Some(_) => tracing::info!("the Haply device is ready"),
    }
    *told = Some(now);
}

/// Sleeps in spite of wake-ups, until `stop` is raised.
fn sleep(duration: Duration, stop: &AtomicBool) {
    let end = Instant::now() + duration;
    while !stop.load(Ordering::Relaxed) {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return;
        }
        std::thread::sleep(left.min(Duration::from_millis(50)));
    }
}
