//! Keyframes on query: whole surfaces for clients that join.
//!
//! An answer is as long as a surface, and its client may not read. A few threads therefore send the answers.
//! Neither the publisher nor the other clients wait for one client. zenoh closes the link to a client that
//! has read nothing for a second ([`crate::wire::session`]).

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

/// Most queries that wait for a snapshot, and most answers that wait for a thread.
pub const WAITING_KEYFRAMES: usize = 64;

/// A client waits two seconds for a keyframe, then it asks again. Later answers are pointless.
const PATIENCE: Duration = Duration::from_millis(1900);

/// Clients that read nothing may block this many threads before others wait.
const THREADS: usize = 4;

/// A client's query for the keyframe of one body.
pub struct KeyframeQuery {
    /// Index of the body in the scene.
    pub body: usize,
    /// The zenoh query, which takes the answer.
    pub query: Query,
    /// When the query arrived.
    pub since: Instant,
}

/// An answer on its way. It is empty if the query has waited too long and only ends.
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
    /// Starts the threads. They end when this is dropped.
    ///
    /// # Errors
    /// The system cannot start another thread.
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

    /// The callback for queries of body `body`, which runs on zenoh's threads. A full queue drops the query,
    /// and its client asks again.
    pub fn entrance(&self, exchange: &Arc<Exchange>, body: usize) -> impl Fn(Query) + Send + Sync + 'static {
        let (to_zenoh, exchange) = (self.to_zenoh.clone(), exchange.clone());
        move |query| {
            let _ = to_zenoh.try_send(KeyframeQuery { body, query, since: Instant::now() });
            exchange.want_keyframe(true);
        }
    }

    /// Answers every query whose body `keyframe_of` has now. It asks for each body once; the other queries
    /// wait for the next snapshot. False when no query waits any more.
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
                tracing::debug!("keyframe not sent: {WAITING_KEYFRAMES} are waiting already");
            }
        }
        !self.waiting.is_empty() || !self.from_zenoh.is_empty()
    }
}

/// Sends one answer and ends its query.
fn send(answer: Answer) {
    let Answer { query, keyframe: Some(keyframe) } = answer else { return };
    let reply = query.reply(query.key_expr().clone(), keyframe);
    if let Err(error) = reply.encoding(encoding::<SurfaceKeyframe>()).wait() {
        tracing::debug!(%error, "keyframe not sent");
    }
}
