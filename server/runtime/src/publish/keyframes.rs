//! Keyframes on query: whole surfaces for those who join.
//!
//! An answer is as long as a surface, and its client may not read. A few threads send answers, so that neither
//! the publisher nor the answers to others wait for one client; zenoh closes the link to a client that has
//! taken nothing for a second ([`crate::wire::session`]).

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use scindo_proto::encoding;
use scindo_proto::messages::SurfaceKeyframe;
use zenoh::Wait as _;
use zenoh::query::Query;

use crate::error::RuntimeError;
use crate::exchange::Exchange;

/// Keyframe queries that may wait for a snapshot, and answers that may wait for a thread.
pub const WAITING_KEYFRAMES: usize = 64;

/// A client waits two seconds for a keyframe; afterwards it asks again.
const PATIENCE: Duration = Duration::from_millis(1900);

/// Clients that read nothing for which others do not have to wait.
const THREADS: usize = 4;

/// A query for the keyframe of body `body`.
pub struct KeyframeQuery {
    /// Index of the body.
    pub body: usize,
    /// Where the answer goes.
    pub query: Query,
    /// When it came.
    pub since: Instant,
}

/// An answer on its way: none where the query has waited for too long and only ends.
struct Answer {
    query: Query,
    keyframe: Option<Bytes>,
}

/// Queries that wait for a snapshot, and the threads that send the answers.
pub struct Keyframes {
    from_zenoh: Receiver<KeyframeQuery>,
    to_zenoh: Sender<KeyframeQuery>,
    waiting: Vec<KeyframeQuery>,
    answers: Sender<Answer>,
}

impl Keyframes {
    /// Starts the threads; they end when this is dropped.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start() -> Result<Self, RuntimeError> {
        let (answers, receiver) = bounded::<Answer>(WAITING_KEYFRAMES);
        for number in 0..THREADS {
            let receiver = receiver.clone();
            let thread = std::thread::Builder::new().name(format!("keyframe-{number}"));
            thread.spawn(move || receiver.iter().for_each(send)).map_err(|e| RuntimeError::System {
                what: "starting a thread for keyframes".to_owned(),
                reason: e.to_string(),
            })?;
        }
        let (to_zenoh, from_zenoh) = bounded(WAITING_KEYFRAMES);
        Ok(Self { from_zenoh, to_zenoh, waiting: Vec::new(), answers })
    }

    /// What puts queries for body `body` here, on zenoh's threads. A full queue drops the query: its client
    /// asks again.
    pub fn entrance(&self, exchange: &Arc<Exchange>, body: usize) -> impl Fn(Query) + Send + Sync + 'static {
        let (to_zenoh, exchange) = (self.to_zenoh.clone(), exchange.clone());
        move |query| {
            let _ = to_zenoh.try_send(KeyframeQuery { body, query, since: Instant::now() });
            exchange.want_keyframe(true);
        }
    }

    /// Answers those whose body `keyframe_of` has now, each body once; the others wait for the next snapshot.
    /// False when nobody waits any more.
    pub fn answer(&mut self, mut keyframe_of: impl FnMut(usize) -> Option<Bytes>) -> bool {
        self.waiting.extend(self.from_zenoh.try_iter());
        if self.waiting.is_empty() {
            return false;
        }
        let mut made: Vec<(usize, Option<Bytes>)> = Vec::new();
        for waiting in std::mem::take(&mut self.waiting) {
            let known = made.iter().find(|(body, _)| *body == waiting.body).map(|(_, bytes)| bytes.clone());
            let keyframe = known.unwrap_or_else(|| {
                let keyframe = keyframe_of(waiting.body);
                made.push((waiting.body, keyframe.clone()));
                keyframe
            });
            if keyframe.is_none() && waiting.since.elapsed() < PATIENCE {
                self.waiting.push(waiting);
                continue;
            }
            if let Err(TrySendError::Full(_)) =
                self.answers.try_send(Answer { query: waiting.query, keyframe })
            {
                tracing::debug!("keyframe not sent: {WAITING_KEYFRAMES} wait already");
            }
        }
        !self.waiting.is_empty() || !self.from_zenoh.is_empty()
    }
}

/// Sends one answer; the query ends with it.
fn send(answer: Answer) {
    let Answer { query, keyframe: Some(keyframe) } = answer else { return };
    let reply = query.reply(query.key_expr().clone(), keyframe);
    if let Err(error) = reply.encoding(encoding::<SurfaceKeyframe>()).wait() {
        tracing::debug!(%error, "keyframe not sent");
    }
}
