//! A TCP relay that does to a connection what bad networks do: seeded, between real processes.
//!
//! TCP hides losses, so what remains of them is silence: chunks come late, stop for a while, or the connection ends in the
//! middle of a message. What was decided at a place follows from the seed; when it happens depends on the machine.

use std::io::{self, Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use fastrand::Rng;

/// Chunks between two faults, on average.
const BETWEEN: u32 = 12;

/// Longest silence that is not the end of a connection.
const LONGEST_SILENCE: Duration = Duration::from_millis(600);

/// How long a connection stays half open before it ends.
const HALF_OPEN: Duration = Duration::from_secs(1);

/// How often each kind of fault was made.
#[derive(Debug, Default)]
pub struct Faults {
    /// A chunk came late.
    pub delayed: AtomicU64,
    /// Nothing passed for a while.
    pub silent: AtomicU64,
    /// The connection ended in the middle of a chunk.
    pub cut_off: AtomicU64,
    /// One direction ended without a word; the other went on for a second.
    pub half_open: AtomicU64,
}

impl Faults {
    /// Counts by kind: delayed, silent, cut off, half open.
    pub fn counts(&self) -> [u64; 4] {
        [&self.delayed, &self.silent, &self.cut_off, &self.half_open]
            .map(|count| count.load(Ordering::Relaxed))
    }
}

/// A relay between two ports of this machine. Its threads end with the connections, and with the process.
pub struct Relay {
    faults: Arc<Faults>,
    calm: Arc<AtomicBool>,
}

impl Relay {
    /// Passes connections to `from` on to `to`, with faults that follow from `seed`.
    ///
    /// # Errors
    /// When the port is taken.
    pub fn start(from: u16, to: u16, seed: u64) -> io::Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", from))?;
        let relay = Self { faults: Arc::default(), calm: Arc::default() };
        let (faults, calm) = (relay.faults.clone(), relay.calm.clone());
        let accept = move || {
            for (number, client) in listener.incoming().enumerate() {
                let (Ok(client), Ok(server)) = (client, TcpStream::connect(("127.0.0.1", to))) else {
                    continue;
                };
                let there = Direction::new(&client, &server, (&faults, &calm), seed ^ (2 * number as u64));
                let back = Direction::new(&server, &client, (&faults, &calm), seed ^ (2 * number as u64 + 1));
                for direction in [there, back].into_iter().flatten() {
                    // Without a thread the connection ends, as on a machine that has none left.
                    let _ = named("relay", move || direction.run());
                }
            }
        };
        named("relay-door", accept)?;
        Ok(relay)
    }

    /// From now on everything passes.
    pub fn calm(&self) {
        self.calm.store(true, Ordering::Relaxed);
    }

    /// What was done so far.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }
}

fn named(name: &str, body: impl FnOnce() + Send + 'static) -> io::Result<()> {
    thread::Builder::new().name(name.to_owned()).spawn(body).map(drop)
}

/// One direction of a connection.
struct Direction {
    from: TcpStream,
    to: TcpStream,
    faults: Arc<Faults>,
    calm: Arc<AtomicBool>,
    rng: Rng,
}

impl Direction {
    fn new(
        from: &TcpStream,
        to: &TcpStream,
        (faults, calm): (&Arc<Faults>, &Arc<AtomicBool>),
        seed: u64,
    ) -> io::Result<Self> {
        let (from, to) = (from.try_clone()?, to.try_clone()?);
        to.set_nodelay(true)?;
        Ok(Self { from, to, faults: faults.clone(), calm: calm.clone(), rng: Rng::with_seed(seed) })
    }

    fn run(mut self) {
        let mut buffer = vec![0; 16 << 10];
        while let Ok(length @ 1..) = self.from.read(&mut buffer) {
            if self.pass(&buffer[..length]).is_err() {
                break;
            }
        }
        let _ = self.from.shutdown(Shutdown::Both);
        let _ = self.to.shutdown(Shutdown::Both);
    }

    /// Passes a chunk on. An error ends the connection.
    fn pass(&mut self, chunk: &[u8]) -> io::Result<()> {
        let count = |kind: &AtomicU64| {
            kind.fetch_add(1, Ordering::Relaxed);
        };
        if !self.calm.load(Ordering::Relaxed) && self.rng.u32(0..BETWEEN) == 0 {
            match self.rng.u32(0..20) {
                0..12 => {
                    count(&self.faults.delayed);
                    thread::sleep(Duration::from_millis(self.rng.u64(1..40)));
                }
                12..17 => {
                    count(&self.faults.silent);
                    thread::sleep(LONGEST_SILENCE.mul_f64(self.rng.f64()));
                }
                17..19 => {
                    count(&self.faults.cut_off);
                    self.to.write_all(&chunk[..self.rng.usize(0..chunk.len())])?;
                    return Err(io::ErrorKind::ConnectionReset.into());
                }
                _ => {
                    count(&self.faults.half_open);
                    thread::sleep(HALF_OPEN);
                    return Err(io::ErrorKind::TimedOut.into());
                }
            }
        }
        self.to.write_all(chunk)
    }
}
