//! A tool that this client holds: poses up, contacts down, cuts acknowledged.
//!
//! [`ToolLink::open`] gives three parts for different threads: a [`PoseSender`] for the thread that sends at
//! up to 1 kHz, a [`ContactReader`] for the loop beside the device (reading never waits), and a [`Cutter`]
//! for async code.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use scindo_proto::messages::{BladeSegment, CutAck, CutCommand, DeviceCapability, HapticContact, ToolSample};
use scindo_proto::{Chunk, Topic, WireMessage as _, encode, encoding};
use tokio::sync::oneshot;
use tokio::time::timeout;
use triple_buffer::{Output, triple_buffer};
use zenoh::Wait as _;
use zenoh::bytes::Encoding;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};

use crate::error::LinkError;
use crate::link::Link;

/// Time after which an unanswered cut is sent again.
pub const RESEND: Duration = Duration::from_millis(100);

/// How long [`Cutter::cut`] waits for its acknowledgement.
pub const CUT_TIMEOUT: Duration = Duration::from_secs(5);

/// A tool of the session, held by this client. The server grants it to the first client that sends a pose. A
/// client that loses its link loses the tool.
pub struct ToolLink {
    /// Sends poses.
    pub poses: PoseSender,
    /// Reads the newest contact model.
    pub contacts: ContactReader,
    /// Sends cuts and the device's capability.
    pub cutter: Cutter,
}

impl Link {
    /// Takes hold of tool `id`, one of the scene or a new one (then samples must state a shape).
    pub async fn tool(&self, id: &str) -> Result<ToolLink, LinkError> {
        let tool = Chunk::new("tool id", id)?;
        Ok(ToolLink {
            poses: self.pose_sender(&tool).await?,
            contacts: self.contact_reader(&tool).await?,
            cutter: self.cutter(&tool).await?,
        })
    }

    /// Takes hold of tool `id` without asking for its contacts, which the server then need not compute: for trackers
    /// and other devices that give no force.
    pub async fn poses(&self, id: &str) -> Result<PoseSender, LinkError> {
        self.pose_sender(&Chunk::new("tool id", id)?).await
    }

    /// Calls `on_contact` for every contact message of tool `id`, on zenoh's receiving thread: it must not
    /// block. It serves loops that count, order and time messages themselves.
    pub async fn each_contact(
        &self,
        id: &str,
        on_contact: impl Fn(HapticContact) + Send + Sync + 'static,
    ) -> Result<ContactStream, LinkError> {
        let key = self.keys().key(&Topic::ToolContact(Chunk::new("tool id", id)?));
        Ok(ContactStream { _subscriber: self.subscribe(self.haptic(), key, on_contact).await? })
    }

    async fn pose_sender(&self, tool: &Chunk) -> Result<PoseSender, LinkError> {
        let publisher = self
            .haptic()
            .declare_publisher(self.keys().key(&Topic::ToolPose(self.chunk(), tool.clone())))
            .encoding(Encoding::from(encoding::<ToolSample>()))
            .priority(Priority::RealTime)
            .express(true)
            .congestion_control(CongestionControl::Drop)
            .reliability(Reliability::BestEffort)
            .await
            .map_err(LinkError::zenoh("declare pose publisher"))?;
        Ok(PoseSender {
            publisher,
            client_id: self.id().to_owned(),
            tool_id: tool.as_str().to_owned(),
            person: self.person().to_owned(),
            seq: 0,
            _link: self.clone(),
        })
    }

    async fn contact_reader(&self, tool: &Chunk) -> Result<ContactReader, LinkError> {
        let (input, output) = triple_buffer(&ReceivedContact::default());
        let input = Mutex::new(input);
        let counters = Arc::new(Counters::default());
        let shared = counters.clone();
        let on_contact = move |message: HapticContact| {
            shared.received(message.seq);
            // Only this callback locks it. The reader uses the triple buffer.
            let mut input = input.lock().unwrap_or_else(PoisonError::into_inner);
            input.write(ReceivedContact { message, at: Some(Instant::now()) });
        };
        let key = self.keys().key(&Topic::ToolContact(tool.clone()));
        let subscriber = self.subscribe(self.haptic(), key, on_contact).await?;
        Ok(ContactReader { output, counters, _subscriber: subscriber })
    }

    async fn cutter(&self, tool: &Chunk) -> Result<Cutter, LinkError> {
        let waiting: Arc<Waiting> = Arc::default();
        let shared = waiting.clone();
        let client_id = self.id().to_owned();
        let on_ack = move |ack: CutAck| {
            // A cut can overtake the token of its client. It is then sent again.
            let too_early = ack.error.as_ref().is_some_and(|error| error.code == "no-token");
            if ack.client_id == client_id
                && !too_early
                && let Some(answer) = shared.take(ack.seq)
            {
                // The caller may have stopped waiting.
                let _ = answer.send(ack);
            }
        };
        let key = self.keys().key(&Topic::ToolCutAck(tool.clone()));
        let subscriber = self.subscribe(self.haptic(), key, on_ack).await?;
        Ok(Cutter {
            link: self.clone(),
            tool: tool.clone(),
            // A restarted client with its old id must not repeat old numbers.
            seq: AtomicU64::new(unix_ns() / 1_000_000),
            waiting,
            _subscriber: subscriber,
        })
    }
}

/// Sends poses of one tool. Use it from one thread, plain or async.
pub struct PoseSender {
    publisher: Publisher<'static>,
    client_id: String,
    tool_id: String,
    person: String,
    seq: u64,
    _link: Link,
}

impl PoseSender {
    /// Sends `sample` after filling in ids, name, sequence number and client time, and returns the sequence number.
    /// Non-finite samples are refused before they are sent. A call takes about 15 µs. On a jammed network the
    /// sample is dropped after at most a millisecond.
    pub fn send(&mut self, mut sample: ToolSample) -> Result<u64, LinkError> {
        self.seq += 1;
        sample.seq = self.seq;
        sample.client_time_ns = unix_ns();
        sample.client_id.clone_from(&self.client_id);
        sample.tool_id.clone_from(&self.tool_id);
        sample.name.clone_from(&self.person);
        sample.check()?;
        self.publisher.put(encode(&sample)).wait().map_err(LinkError::zenoh("send pose"))?;
        Ok(self.seq)
    }
}

/// A contact message and its time of arrival.
#[derive(Debug, Clone, Default)]
pub struct ReceivedContact {
    /// The message; empty before the first one.
    pub message: HapticContact,
    /// When it arrived on this machine; `None` before the first one.
    pub at: Option<Instant>,
}

#[derive(Debug, Default)]
struct Counters {
    received: AtomicU64,
    lost: AtomicU64,
    last_seq: AtomicU64,
}

impl Counters {
    fn received(&self, seq: u64) {
        self.received.fetch_add(1, Ordering::Relaxed);
        let last = self.last_seq.swap(seq, Ordering::Relaxed);
        if last != 0 && seq > last + 1 {
            self.lost.fetch_add(seq - last - 1, Ordering::Relaxed);
        }
    }
}

/// Reads the newest contact model of one tool without waiting.
pub struct ContactReader {
    output: Output<ReceivedContact>,
    counters: Arc<Counters>,
    _subscriber: Subscriber<()>,
}

impl ContactReader {
    /// The newest message. This neither locks nor allocates.
    pub fn latest(&mut self) -> &ReceivedContact {
        self.output.read()
    }

    /// Number of messages received.
    pub fn received(&self) -> u64 {
        self.counters.received.load(Ordering::Relaxed)
    }

    /// Number of messages lost, by their sequence numbers.
    pub fn lost(&self) -> u64 {
        self.counters.lost.load(Ordering::Relaxed)
    }
}

/// A subscription made by [`Link::each_contact`]. Dropping it unsubscribes.
pub struct ContactStream {
    _subscriber: Subscriber<()>,
}

#[derive(Default)]
struct Waiting {
    answers: Mutex<BTreeMap<u64, oneshot::Sender<CutAck>>>,
}

impl Waiting {
    fn put(&self, seq: u64, answer: oneshot::Sender<CutAck>) {
        self.lock().insert(seq, answer);
    }

    fn take(&self, seq: u64) -> Option<oneshot::Sender<CutAck>> {
        self.lock().remove(&seq)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<u64, oneshot::Sender<CutAck>>> {
        self.answers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Sends cuts of one tool. Each is applied exactly once.
pub struct Cutter {
    link: Link,
    tool: Chunk,
    seq: AtomicU64,
    waiting: Arc<Waiting>,
    _subscriber: Subscriber<()>,
}

impl Cutter {
    /// Cuts along successive blade segments. An empty `body_id` means every body that may be cut. The command
    /// is repeated until it is answered, and the server applies it once.
    pub async fn cut(&self, body_id: &str, sweep: Vec<BladeSegment>) -> Result<CutAck, LinkError> {
        let command = CutCommand {
            client_id: self.link.id().to_owned(),
            tool_id: self.tool.as_str().to_owned(),
            seq: self.seq.fetch_add(1, Ordering::Relaxed) + 1,
            client_time_ns: unix_ns(),
            body_id: body_id.to_owned(),
            sweep,
        };
        self.send(command).await
    }

    /// Sends a finished command, for callers that number their cuts themselves.
    pub async fn send(&self, command: CutCommand) -> Result<CutAck, LinkError> {
        command.check()?;
        let key = self.link.keys().key(&Topic::ToolCut(self.link.chunk(), self.tool.clone()));
        let (sender, mut answer) = oneshot::channel();
        self.waiting.put(command.seq, sender);
        let started = Instant::now();
        while started.elapsed() < CUT_TIMEOUT {
            self.put(&key, encode(&command), encoding::<CutCommand>()).await?;
            if let Ok(answer) = timeout(RESEND, &mut answer).await {
                return answer.map_err(|_| LinkError::Closed);
            }
        }
        self.waiting.take(command.seq);
        Err(LinkError::Timeout { key, waited: CUT_TIMEOUT })
    }

    /// Sends the capability of the device to the server.
    pub async fn announce(&self, mut capability: DeviceCapability) -> Result<(), LinkError> {
        capability.client_id = self.link.id().to_owned();
        capability.tool_id = self.tool.as_str().to_owned();
        capability.check()?;
        let key = self.link.keys().key(&Topic::ToolCapability(self.link.chunk(), self.tool.clone()));
        self.put(&key, encode(&capability), encoding::<DeviceCapability>()).await
    }

    async fn put(&self, key: &str, payload: bytes::Bytes, encoding: String) -> Result<(), LinkError> {
        self.link
            .haptic()
            .put(key, payload)
            .encoding(Encoding::from(encoding))
            .priority(Priority::InteractiveHigh)
            .express(true)
            .congestion_control(CongestionControl::Block)
            .reliability(Reliability::Reliable)
            .await
            .map_err(LinkError::zenoh("send command"))
    }
}

/// Nanoseconds since 1970 on this machine's clock.
pub fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
