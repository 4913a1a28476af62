//! From a peer to its tools: bytes in, transforms to hands, questions to the sender.

use std::time::Duration;

use tokio::io::AsyncReadExt as _;
use tokio::net::tcp::OwnedReadHalf;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};

use crate::ended::Ended;
use crate::hands::{Hands, Moved};
use crate::wire::content::{Content, Message};
use crate::wire::stream::{Deframer, Read};

/// Bytes that are read at a time.
const BUFFER: usize = 64 << 10;

/// Shortest time in which [`BUFFER`] bytes are read: 16 MB/s, twenty times what a tracker with 256 tools at 50 Hz sends.
const BUFFER_TIME: Duration = Duration::from_millis(4);

/// What the peer wants to be sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Order {
    /// The newest message of a type, about a device.
    Get {
        /// The type.
        what: String,
        /// Name of the device that is asked for.
        device: String,
    },
    /// A stream of messages.
    Start {
        /// The type.
        what: String,
        /// Name of the device that is asked for.
        device: String,
        /// Shortest time between two messages.
        period: Duration,
    },
    /// The end of a stream.
    Stop {
        /// The type.
        what: String,
        /// Name of the device that is asked for.
        device: String,
    },
}

/// Reads until the peer ends. Without hands the peer may watch and ask, but moves nothing.
///
/// # Errors
/// Always: why the connection ends.
pub async fn receive(
    mut from: OwnedReadHalf,
    mut hands: Option<Hands>,
    orders: mpsc::Sender<Order>,
) -> Result<std::convert::Infallible, Ended> {
    let mut stream = Deframer::default();
    let mut buffer = vec![0; BUFFER];
    let mut read = Vec::new();
    let mut may_read = Instant::now();
    let mut turn = tokio::time::interval(Duration::from_millis(2));
    turn.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        let next = async {
            sleep_until(may_read).await;
            from.read(&mut buffer).await
        };
        tokio::select! {
            count = next => match count? {
                0 => return Err(Ended::Closed),
                count => {
                    let now = Instant::now();
                    may_read = now + BUFFER_TIME.mul_f64(count as f64 / BUFFER as f64);
                    let result = stream.push(&buffer[..count], &mut |message| read.push(message));
                    for message in read.drain(..) {
                        take(message, hands.as_mut(), &orders, now).await?;
                    }
                    result?;
                }
            },
            _ = turn.tick(), if hands.is_some() => {}
        }
        if let Some(hands) = &mut hands {
            hands.flush(Instant::now());
        }
    }
}

async fn take(
    read: Read,
    hands: Option<&mut Hands>,
    orders: &mpsc::Sender<Order>,
    now: Instant,
) -> Result<(), Ended> {
    let Message { device, content, .. } = match read {
        Ok(message) => message,
        Err(error) => {
            tracing::warn!(%error, "a message is left out");
            return Ok(());
        }
    };
    let order = match (content, hands) {
        (Content::Transform(to), Some(hands)) => {
            tell(&device, hands.moved(&device, &to, now).await?);
            return Ok(());
        }
        (Content::Tracking(tools), Some(hands)) => {
            for tool in tools {
                tell(&tool.name, hands.moved(&tool.name, &tool.transform, now).await?);
            }
            return Ok(());
        }
        (Content::Text(text), Some(hands)) => {
            tell(&device, hands.told(&device, &text, now));
            return Ok(());
        }
        (Content::Status { code, error, message, .. }, _) => {
            tracing::debug!(device, code, error, message, "status of the peer");
            return Ok(());
        }
        (Content::Other { kind }, _) => {
            tracing::debug!(device, kind, "a message of this type is skipped");
            return Ok(());
        }
        (Content::Get { what }, _) => Order::Get { what, device },
        (Content::Start { what, resolution_ms }, _) => {
            Order::Start { what, device, period: Duration::from_millis(resolution_ms.into()) }
        }
        (Content::Stop { what }, _) => Order::Stop { what, device },
        (Content::Transform(_) | Content::Tracking(_) | Content::Text(_), None) => {
            tracing::debug!(device, "--read-only: the peer moves nothing");
            return Ok(());
        }
    };
    if let Err(error) = orders.try_send(order) {
        tracing::warn!(%error, "a question is left out");
    }
    Ok(())
}

fn tell(device: &str, moved: Moved) {
    match moved {
        Moved::Taken => {}
        Moved::Ignored => tracing::debug!(device, "no tool goes with this device"),
        Moved::Refused(reason) => tracing::warn!(device, reason, "a message is left out"),
    }
}
