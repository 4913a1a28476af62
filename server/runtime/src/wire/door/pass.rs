//! One connection on its way through the door.

use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, BufReader};
use tokio::net::{TcpStream, UnixStream};

use super::Inside;
use super::pace::{Pace, Turnstiles, greeting, load};

/// A client that has not greeted by then is shown out.
const GREETS_WITHIN: Duration = Duration::from_secs(1);
/// A client that has declared too much is not heard for this time, and then shown out.
const IGNORED_FOR: Duration = Duration::from_secs(2);
/// Longest greeting [bytes].
const LONGEST_GREETING: usize = 1024;
/// Buffer of each direction [bytes]: the longest batch of zenoh.
const BUFFER: usize = 1 << 16;
/// Bytes before a batch, which tell its length.
const LENGTH: usize = 2;

/// Takes a client through, until one of the sides goes.
///
/// # Errors
/// If one of the sides goes without a word, or the client does not speak zenoh or declares too much.
pub(super) async fn through(
    client: TcpStream,
    from: SocketAddr,
    inside: &Inside,
    turnstiles: &Turnstiles,
) -> io::Result<()> {
    client.set_nodelay(true)?;
    let (up, down) = client.into_split();
    let (mut up, mut batch) = (BufReader::with_capacity(BUFFER, up), Vec::new());
    let read = read_batch(&mut up, &mut batch, LONGEST_GREETING);
    tokio::time::timeout(GREETS_WITHIN, read).await??;
    let who = greeting(&batch[LENGTH..]).ok_or(io::ErrorKind::InvalidData)?;
    turnstiles.greet().await;
    let pace = Pace::of(who, Instant::now());
    if from.ip().to_canonical().is_loopback() {
        let (from_zenoh, to_zenoh) = UnixStream::connect(&inside.near).await?.into_split();
        both((up, down), (from_zenoh, to_zenoh), batch, pace, turnstiles).await
    } else {
        let zenoh = TcpStream::connect(inside.far).await?;
        zenoh.set_nodelay(true)?;
        let (from_zenoh, to_zenoh) = zenoh.into_split();
        both((up, down), (from_zenoh, to_zenoh), batch, pace, turnstiles).await
    }
}

async fn both(
    (up, mut down): (impl AsyncRead + Unpin, impl AsyncWrite + Unpin),
    (from_zenoh, to_zenoh): (impl AsyncRead + Unpin, impl AsyncWrite + Unpin),
    first: Vec<u8>,
    pace: Pace,
    turnstiles: &Turnstiles,
) -> io::Result<()> {
    let mut from_zenoh = BufReader::with_capacity(BUFFER, from_zenoh);
    let to_client = tokio::io::copy_buf(&mut from_zenoh, &mut down);
    tokio::select! {
        sent = paced(up, to_zenoh, first, pace, turnstiles) => sent,
        told = to_client => told.map(drop),
    }
}

/// Passes the batches of a client on, beginning with one that has been read. Each waits until it is due.
async fn paced(
    mut up: impl AsyncRead + Unpin,
    mut to_zenoh: impl AsyncWrite + Unpin,
    mut batch: Vec<u8>,
    mut pace: Pace,
    turnstiles: &Turnstiles,
) -> io::Result<()> {
    loop {
        let load = load(&batch[LENGTH..]).ok_or(io::ErrorKind::InvalidData)?;
        let Some(wait) = pace.wait(&load, Instant::now()) else {
            tokio::time::sleep(IGNORED_FOR).await;
            return Err(io::ErrorKind::QuotaExceeded.into());
        };
        if !wait.is_zero() {
            tokio::time::sleep(wait).await;
        }
        turnstiles.declare(load.declarations).await;
        to_zenoh.write_all(&batch).await?;
        read_batch(&mut up, &mut batch, usize::from(u16::MAX)).await?;
    }
}

/// Reads a batch of at most `longest` bytes with its length before it.
async fn read_batch(
    from: &mut (impl AsyncRead + Unpin),
    batch: &mut Vec<u8>,
    longest: usize,
) -> io::Result<()> {
    batch.resize(LENGTH, 0);
    from.read_exact(batch).await?;
    let length = usize::from(u16::from_le_bytes([batch[0], batch[1]]));
    if length == 0 || length > longest {
        return Err(io::ErrorKind::InvalidData.into());
    }
    batch.resize(LENGTH + length, 0);
    from.read_exact(&mut batch[LENGTH..]).await?;
    Ok(())
}
