//! How fast a client may speak: bytes, messages and declarations per connection, and declarations of all together.

use std::time::{Duration, Instant};

use tokio::sync::Mutex;
use zenoh_codec::{RCodec as _, Zenoh080};
use zenoh_protocol::core::WhatAmI;
use zenoh_protocol::network::{DeclareBody, NetworkBody};
use zenoh_protocol::transport::{TransportBody, TransportMessage};

/// Bytes of a connection per second, and at once after a pause. Only long cuts come near.
const BYTES_PER_S: f64 = 4.0 * 1024.0 * 1024.0;
/// Messages of a connection per second, and at once. A hand sends a pose a thousand times per second.
const MESSAGES_PER_S: f64 = 2500.0;
/// As many messages as this counts one whose key is spelled out, so that zenoh compares it with all names that it knows,
/// and a question.
const COUNT_OF_SPELLING: usize = 8;
const COUNT_OF_QUESTION: usize = 4;
/// Declarations of a connection per second, and at once. A client makes some twenty of them when it joins, and few later.
const DECLARATIONS_PER_S: f64 = 16.0;
const DECLARATIONS_AT_ONCE: f64 = 256.0;
/// Declarations of all connections together, which wait for each other in the order of their arrival.
const ALL_DECLARATIONS_PER_S: f64 = 1000.0;
/// Connections per second that begin, and at once; they wait for each other too.
const GREETINGS_PER_S: f64 = 50.0;
const GREETINGS_AT_ONCE: f64 = 100.0;
/// Most names that a connection may have declared at a time, and most tokens of presence, of which a client needs one.
/// zenoh compares what is spelled out with all of them.
const MOST_DECLARED: i64 = 1024;
const MOST_TOKENS: i64 = 8;
/// A router speaks for many clients: as much as this many of them.
const CLIENTS_OF_ROUTER: f64 = 32.0;

/// What a batch of zenoh's messages asks for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Load {
    /// Bytes of the batch.
    pub bytes: usize,
    /// Messages in the batch.
    pub messages: usize,
    /// Declarations in the batch.
    pub declarations: usize,
    /// Names that are declared afterwards beside those before.
    pub declared: i64,
    /// Tokens that are there afterwards beside those before.
    pub tokens: i64,
}

/// Reads a batch. `None` if it is not one of zenoh.
pub fn load(batch: &[u8]) -> Option<Load> {
    let (mut rest, mut load) = (batch, Load { bytes: batch.len(), ..Load::default() });
    while !rest.is_empty() {
        let message: TransportMessage = Zenoh080::new().read(&mut rest).ok()?;
        match message.body {
            TransportBody::Frame(frame) => {
                load.messages += usize::from(frame.payload.is_empty());
                frame.payload.iter().for_each(|message| load.count(&message.body));
            }
            // The last piece of a message that may be anything.
            TransportBody::Fragment(fragment) if !fragment.more => {
                (load.messages, load.declarations) = (load.messages + 1, load.declarations + 1);
            }
            _ => load.messages += 1,
        }
    }
    Some(load)
}

impl Load {
    fn count(&mut self, message: &NetworkBody) {
        self.messages += match message {
            NetworkBody::Push(push) if !push.wire_expr.suffix.is_empty() => COUNT_OF_SPELLING,
            NetworkBody::Request(_) => COUNT_OF_QUESTION,
            _ => 1,
        };
        match message {
            NetworkBody::Declare(declare) => {
                self.declarations += 1;
                self.tokens += match declare.body {
                    DeclareBody::DeclareToken(_) => 1,
                    DeclareBody::UndeclareToken(_) => -1,
                    _ => 0,
                };
                self.declared += match declare.body {
                    DeclareBody::DeclareKeyExpr(_)
                    | DeclareBody::DeclareSubscriber(_)
                    | DeclareBody::DeclareQueryable(_)
                    | DeclareBody::DeclareToken(_) => 1,
                    DeclareBody::UndeclareKeyExpr(_)
                    | DeclareBody::UndeclareSubscriber(_)
                    | DeclareBody::UndeclareQueryable(_)
                    | DeclareBody::UndeclareToken(_) => -1,
                    DeclareBody::DeclareFinal(_) => 0,
                };
            }
            NetworkBody::Interest(_) => self.declarations += 1,
            _ => {}
        }
    }
}

/// Who greets with the first batch of a connection. `None` if it is not a greeting of zenoh.
pub fn greeting(batch: &[u8]) -> Option<WhatAmI> {
    let message: TransportMessage = Zenoh080::new().read(&mut &*batch).ok()?;
    match message.body {
        TransportBody::InitSyn(greeting) => Some(greeting.whatami),
        _ => None,
    }
}

/// An allowance that fills up at a constant rate, and may be overdrawn once.
#[derive(Debug)]
struct Allowance {
    left: f64,
    at: Instant,
    per_s: f64,
    most: f64,
}

impl Allowance {
    fn new(per_s: f64, most: f64, now: Instant) -> Self {
        Self { left: most, at: now, per_s, most }
    }

    /// Takes some of it; how long to wait before the next [s].
    fn take(&mut self, some: f64, now: Instant) -> Duration {
        let fresh = now.saturating_duration_since(self.at).as_secs_f64() * self.per_s;
        (self.left, self.at) = ((self.left + fresh).min(self.most) - some, now);
        Duration::from_secs_f64((-self.left).max(0.0) / self.per_s)
    }
}

/// What all connections share: a turnstile for greetings, and one for declarations.
#[derive(Debug)]
pub struct Turnstiles {
    greetings: Mutex<Allowance>,
    declarations: Mutex<Allowance>,
}

impl Default for Turnstiles {
    fn default() -> Self {
        let turnstile = |per_s, most| Mutex::new(Allowance::new(per_s, most, Instant::now()));
        Self {
            greetings: turnstile(GREETINGS_PER_S, GREETINGS_AT_ONCE),
            declarations: turnstile(ALL_DECLARATIONS_PER_S, ALL_DECLARATIONS_PER_S),
        }
    }
}

impl Turnstiles {
    /// Waits for the turn of a greeting.
    pub async fn greet(&self) {
        Self::turn(&self.greetings, 1).await;
    }

    /// Waits for the turn of `count` declarations.
    pub async fn declare(&self, count: usize) {
        if count > 0 {
            Self::turn(&self.declarations, count).await;
        }
    }

    /// Who waits stands in a queue.
    async fn turn(turnstile: &Mutex<Allowance>, count: usize) {
        let mut allowance = turnstile.lock().await;
        let wait = allowance.take(count as f64, Instant::now());
        if !wait.is_zero() {
            tokio::time::sleep(wait).await;
        }
    }
}

/// The pace of one connection.
#[derive(Debug)]
pub struct Pace {
    bytes: Allowance,
    messages: Allowance,
    declarations: Allowance,
    declared: i64,
    tokens: i64,
    clients: f64,
}

impl Pace {
    /// That of a connection of a client, a peer or a router.
    pub fn of(who: WhatAmI, now: Instant) -> Self {
        let clients = if who == WhatAmI::Router { CLIENTS_OF_ROUTER } else { 1.0 };
        let allowance = |per_s: f64, most: f64| Allowance::new(clients * per_s, clients * most, now);
        Self {
            bytes: allowance(BYTES_PER_S, BYTES_PER_S),
            messages: allowance(MESSAGES_PER_S, MESSAGES_PER_S),
            declarations: allowance(DECLARATIONS_PER_S, DECLARATIONS_AT_ONCE),
            declared: 0,
            tokens: 0,
            clients,
        }
    }

    /// How long a batch has to wait. `None` if its connection has declared too much.
    pub fn wait(&mut self, load: &Load, now: Instant) -> Option<Duration> {
        self.declared = (self.declared + load.declared).max(0);
        self.tokens = (self.tokens + load.tokens).max(0);
        let too_many = |count: i64, most: i64| count as f64 > self.clients * most as f64;
        if too_many(self.declared, MOST_DECLARED) || too_many(self.tokens, MOST_TOKENS) {
            return None;
        }
        let waits = [
            self.bytes.take(load.bytes as f64, now),
            self.messages.take(load.messages as f64, now),
            self.declarations.take(load.declarations as f64, now),
        ];
        waits.into_iter().max()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use zenoh_codec::WCodec as _;
    use zenoh_protocol::core::Reliability;
    use zenoh_protocol::network::declare::{self, DeclareToken, UndeclareToken};
    use zenoh_protocol::network::{Declare, NetworkMessage};
    use zenoh_protocol::transport::{Frame, KeepAlive, frame};

    use super::*;

    fn batch(bodies: Vec<DeclareBody>) -> Vec<u8> {
        let declared = |body| NetworkMessage {
            body: NetworkBody::Declare(Declare {
                interest_id: None,
                ext_qos: declare::ext::QoSType::DEFAULT,
                ext_tstamp: None,
                ext_nodeid: declare::ext::NodeIdType::DEFAULT,
                body,
            }),
            reliability: Reliability::Reliable,
        };
        let frame = Frame {
            reliability: Reliability::Reliable,
            sn: 7,
            ext_qos: frame::ext::QoSType::DEFAULT,
            payload: bodies.into_iter().map(declared).collect(),
        };
        let mut bytes = Vec::new();
        let message = TransportMessage { body: TransportBody::Frame(frame) };
        Zenoh080::new().write(&mut &mut bytes, &message).unwrap();
        bytes
    }

    fn token(id: u32) -> DeclareBody {
        DeclareBody::DeclareToken(DeclareToken { id, wire_expr: "a/b".into() })
    }

    #[test]
    fn declarations_are_counted_and_nonsense_is_refused() {
        let gone = UndeclareToken { id: 1, ext_wire_expr: declare::common::ext::WireExprType::null() };
        let bytes = batch(vec![token(1), token(2), DeclareBody::UndeclareToken(gone)]);
        let found = load(&bytes).unwrap();
        assert_eq!((found.declarations, found.declared, found.tokens), (3, 1, 1));
        assert_eq!((found.bytes, found.messages), (bytes.len(), 3));
        assert_eq!(load(&[0xff; 20]), None);
        assert_eq!(greeting(&bytes), None);
        let mut silence = Vec::new();
        let message = TransportMessage { body: TransportBody::KeepAlive(KeepAlive) };
        Zenoh080::new().write(&mut &mut silence, &message).unwrap();
        assert_eq!(load(&silence), Some(Load { bytes: 1, messages: 1, ..Load::default() }));
    }

    #[test]
    fn a_hand_never_waits_and_a_flood_waits() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let pose = Load { bytes: 150, messages: 1, ..Load::default() };
        let mut hand = Pace::of(WhatAmI::Client, start);
        assert!((0..60_000).all(|ms| hand.wait(&pose, at(ms)) == Some(Duration::ZERO)));
        let mut flood = Pace::of(WhatAmI::Client, start);
        let (mut clock, mut passed) = (start, 0);
        while clock < at(10_000) {
            clock += flood.wait(&Load { bytes: 1 << 16, ..Load::default() }, clock).unwrap();
            passed += 1 << 16;
        }
        assert!((40_000_000..50_000_000).contains(&passed), "{passed} bytes in 10 s");
    }

    #[test]
    fn names_are_declared_slowly_and_not_without_end() {
        let start = Instant::now();
        let some = Load { bytes: 100, messages: 32, declarations: 32, declared: 32, tokens: 0 };
        let mut client = Pace::of(WhatAmI::Client, start);
        assert!((0..8).all(|_| client.wait(&some, start) == Some(Duration::ZERO)), "a client joins at once");
        assert_eq!(client.wait(&some, start), Some(Duration::from_secs(2)));
        let later = start + Duration::from_secs(3600);
        let refused = (0..40).find(|_| client.wait(&some, later).is_none());
        assert_eq!(refused, Some((MOST_DECLARED / 32 - 9) as usize));
        let presence = Load { tokens: 9, declarations: 9, declared: 9, messages: 9, bytes: 100 };
        assert_eq!(Pace::of(WhatAmI::Client, start).wait(&presence, start), None);
        let mut router = Pace::of(WhatAmI::Router, start);
        assert!((0..60).all(|_| router.wait(&some, start) == Some(Duration::ZERO)));
    }
}
