//! Bounds the connections of the web server: how many may stay open, and for how long.
//!
//! A silent connection is closed. One address may hold a limited number of connections that are not browsers
//! yet; a new one closes the oldest of them. A thousand silent connections therefore keep nobody out.

use std::collections::BTreeMap;
use std::future::Future;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use futures_util::task::AtomicWaker;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Instant, Sleep};

/// A request must continue within this time.
const REQUEST_SILENCE: Duration = Duration::from_secs(10);

/// A connection that asks for files ends after this time; a browser then opens another.
const LONGEST_VISIT: Duration = Duration::from_secs(60);

/// A browser answers pings, which are sent every [`PING`]. After this long a silence it counts as gone.
const BROWSER_SILENCE: Duration = Duration::from_secs(30);

/// How often a browser is pinged.
pub(crate) const PING: Duration = Duration::from_secs(10);

/// Most connections of one address that are not browsers yet. A page opens six at a time.
const PER_ADDRESS: usize = 64;

/// Most such connections of all addresses together.
const IN_ALL: usize = 512;

/// Pause after the system refused a connection, for example for lack of file descriptors.
const REFUSED: Duration = Duration::from_millis(100);

/// A listener that bounds the number of connections.
#[derive(Debug)]
pub struct Door {
    listener: TcpListener,
    visits: Arc<Mutex<Visits>>,
}

/// Connections that are not browsers yet, oldest first.
#[derive(Debug, Default)]
struct Visits {
    next: u64,
    open: BTreeMap<u64, Arc<Visitor>>,
}

/// The peer of a connection.
#[derive(Debug)]
pub(crate) struct Visitor {
    /// Address of the peer.
    pub address: SocketAddr,
    number: u64,
    visits: Arc<Mutex<Visits>>,
    is_browser: AtomicBool,
    sent_away: AtomicBool,
    waker: AtomicWaker,
}

/// The peer of a request, as handlers receive it.
#[derive(Debug, Clone)]
pub(crate) struct From(pub Arc<Visitor>);

/// A connection that ends when its peer is silent for too long.
#[derive(Debug)]
pub struct Visit {
    stream: TcpStream,
    visitor: Arc<Visitor>,
    began: Instant,
    heard: Instant,
    deadline: Pin<Box<Sleep>>,
}

impl Door {
    /// Wraps a listener whose port is already bound.
    pub fn new(listener: TcpListener) -> Self {
        Self { listener, visits: Arc::default() }
    }

    fn admit(&self, stream: TcpStream, address: SocketAddr) -> Visit {
        let visitor = {
            let mut visits = lock(&self.visits);
            visits.make_room(address.ip());
            visits.next += 1;
            let visitor = Arc::new(Visitor {
                address,
                number: visits.next,
                visits: self.visits.clone(),
                is_browser: AtomicBool::new(false),
                sent_away: AtomicBool::new(false),
                waker: AtomicWaker::new(),
            });
            visits.open.insert(visitor.number, visitor.clone());
            visitor
        };
        let now = Instant::now();
        let deadline = Box::pin(tokio::time::sleep_until(now + REQUEST_SILENCE));
        Visit { stream, visitor, began: now, heard: now, deadline }
    }
}

impl Listener for Door {
    type Io = Visit;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Visit, SocketAddr) {
        loop {
            match self.listener.accept().await {
                Ok((stream, address)) => {
                    // Small messages must not wait to be sent together.
                    let _ = stream.set_nodelay(true);
                    return (self.admit(stream, address), address);
                }
                Err(error) => {
                    tracing::debug!(%error, "connection not accepted");
                    tokio::time::sleep(REFUSED).await;
                }
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

impl Connected<IncomingStream<'_, Door>> for From {
    fn connect_info(stream: IncomingStream<'_, Door>) -> Self {
        Self(stream.io().visitor.clone())
    }
}

impl Visits {
    /// Closes the oldest connections until `address` may open one more.
    fn make_room(&mut self, address: IpAddr) {
        let its = |visitor: &&Arc<Visitor>| visitor.address.ip() == address;
        while self.open.values().filter(its).count() >= PER_ADDRESS {
            let oldest = self.open.values().find(its).map(|visitor| visitor.number);
            self.send_away(oldest);
        }
        while self.open.len() >= IN_ALL {
            let oldest = self.open.keys().next().copied();
            self.send_away(oldest);
        }
    }

    fn send_away(&mut self, number: Option<u64>) {
        if let Some(visitor) = number.and_then(|number| self.open.remove(&number)) {
            visitor.sent_away.store(true, Ordering::Relaxed);
            visitor.waker.wake();
        }
    }
}

impl Visitor {
    /// Marks the peer as a seated browser, which no longer counts as a visit.
    pub(crate) fn becomes_browser(&self) {
        self.is_browser.store(true, Ordering::Relaxed);
        lock(&self.visits).open.remove(&self.number);
    }
}

impl Visit {
    /// When the connection ends if nothing more is received.
    fn ends_at(&self) -> Instant {
        if self.visitor.is_browser.load(Ordering::Relaxed) {
            self.heard + BROWSER_SILENCE
        } else {
            (self.heard + REQUEST_SILENCE).min(self.began + LONGEST_VISIT)
        }
    }

    /// Ready when the connection must end.
    fn poll_end(&mut self, context: &mut Context<'_>) -> Poll<io::Error> {
        self.visitor.waker.register(context.waker());
        if self.visitor.sent_away.load(Ordering::Relaxed) {
            return Poll::Ready(io::Error::new(
                io::ErrorKind::ConnectionAborted,
                "closed in favour of waiting connections",
            ));
        }
        while self.deadline.as_mut().poll(context).is_ready() {
            let ends_at = self.ends_at();
            if ends_at <= Instant::now() {
                return Poll::Ready(io::Error::new(io::ErrorKind::TimedOut, "no message for too long"));
            }
            self.deadline.as_mut().reset(ends_at);
        }
        Poll::Pending
    }
}

impl AsyncRead for Visit {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match Pin::new(&mut self.stream).poll_read(context, buffer) {
            Poll::Pending => self.poll_end(context).map(Err),
            ready => {
                self.heard = Instant::now();
                ready
            }
        }
    }
}

impl AsyncWrite for Visit {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        lock(&self.visitor.visits).open.remove(&self.visitor.number);
    }
}

fn lock(visits: &Mutex<Visits>) -> std::sync::MutexGuard<'_, Visits> {
    visits.lock().unwrap_or_else(PoisonError::into_inner)
}
