//! Messages to be sent to one browser: the newest value of every state, never a backlog.
//!
//! Every state has one slot. A newer value replaces an older one that was not sent in time. Only events
//! and answers queue, up to a limit. Frames wait until the browser has acknowledged earlier ones, so that a
//! slow link never fills with outdated frames.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use tokio::sync::Notify;

/// A part of the session state. Slots are sent in this order: small messages first, and a topology before the
/// frame that needs it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Slot {
    /// Whether a server is connected.
    Link,
    /// Who looks at pages of this relay.
    People,
    /// Scene, bodies and tools of the session.
    Info,
    /// Active and inactive effects.
    Plan,
    /// Rates and costs.
    Stats,
    /// State of one tool.
    Tool(String),
    /// Probes and energies.
    Measures,
    /// Forces of contact.
    Forces,
    /// Triangles of one body.
    Topology(String),
    /// Stress on the surface of one body.
    Field(String),
    /// Image on the skin of one body.
    Texture(String),
    /// Positions of one body.
    Frame(String),
}

/// Most frames that were sent but not acknowledged. At 60 Hz this sustains the full rate over a round trip of
/// 130 ms.
const MAX_FRAMES_IN_FLIGHT: u64 = 8;

/// Most events and answers that wait. When there are more, the oldest are dropped.
const MAX_QUEUED: usize = 64;

/// The outgoing messages of one browser.
#[derive(Debug, Default)]
pub struct Outbox {
    queue: Mutex<Queue>,
    wake: Notify,
}

#[derive(Debug)]
struct Queue {
    slots: BTreeMap<Slot, Bytes>,
    ordered: VecDeque<Bytes>,
    frames_sent: u64,
    frames_acked: u64,
    frames_dropped: u64,
    closed: bool,
    /// When the browser last sent something.
    heard: Instant,
}

impl Default for Queue {
    fn default() -> Self {
        Self {
            slots: BTreeMap::new(),
            ordered: VecDeque::new(),
            frames_sent: 0,
            frames_acked: 0,
            frames_dropped: 0,
            closed: false,
            heard: Instant::now(),
        }
    }
}

impl Outbox {
    /// Sets a state. It replaces an older value that still waits.
    pub fn put(&self, slot: Slot, message: Bytes) {
        let mut queue = self.lock();
        let is_frame = matches!(slot, Slot::Frame(_));
        if queue.slots.insert(slot, message).is_some() && is_frame {
            queue.frames_dropped += 1;
        }
        drop(queue);
        self.wake.notify_one();
    }

    /// Queues a message that must keep its order.
    pub fn push(&self, message: Bytes) {
        let mut queue = self.lock();
        if queue.ordered.len() == MAX_QUEUED {
            queue.ordered.pop_front();
        }
        queue.ordered.push_back(message);
        drop(queue);
        self.wake.notify_one();
    }

    /// Drops a state that no longer holds.
    pub fn forget(&self, slot: &Slot) {
        self.lock().slots.remove(slot);
    }

    /// Records that the browser has received this many frames since it connected.
    pub fn acknowledge(&self, frames: u64) {
        let mut queue = self.lock();
        queue.frames_acked = frames.min(queue.frames_sent).max(queue.frames_acked);
        drop(queue);
        self.wake.notify_one();
    }

    /// Records that the browser sent something.
    pub fn heard(&self) {
        self.lock().heard = Instant::now();
    }

    /// How long the browser has been silent.
    pub fn silence(&self) -> Duration {
        self.lock().heard.elapsed()
    }

    /// Number of frames that were replaced before this browser could receive them.
    pub fn frames_dropped(&self) -> u64 {
        self.lock().frames_dropped
    }

    /// Closes the outbox: [`Outbox::next`] returns `None` from now on.
    pub fn close(&self) {
        self.lock().closed = true;
        self.wake.notify_one();
    }

    /// Waits for the next message to send; `None` after [`Outbox::close`].
    pub async fn next(&self) -> Option<Bytes> {
        loop {
            {
                let mut queue = self.lock();
                if queue.closed {
                    return None;
                }
                if let Some(message) = queue.take() {
                    return Some(message);
                }
            }
            self.wake.notified().await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        // No code holding this lock can panic halfway through a change, so a poisoned queue is still
        // consistent.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Queue {
    fn take(&mut self) -> Option<Bytes> {
        if let Some(message) = self.ordered.pop_front() {
            return Some(message);
        }
        let (slot, _) = self.slots.first_key_value()?;
        if matches!(slot, Slot::Frame(_)) {
            // Frames come last in the order. If the first slot is a frame, only frames wait.
            if self.frames_sent - self.frames_acked >= MAX_FRAMES_IN_FLIGHT {
                return None;
            }
            self.frames_sent += 1;
        }
        self.slots.pop_first().map(|(_, message)| message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(n: u8) -> (Slot, Bytes) {
        (Slot::Frame("liver".into()), Bytes::from(vec![n]))
    }

    fn taken(outbox: &Outbox) -> Option<u8> {
        outbox.lock().take().map(|message| message[0])
    }

    #[test]
    fn newest_frame_replaces_and_topology_goes_first() {
        let outbox = Outbox::default();
        for n in 0..5 {
            let (slot, message) = frame(n);
            outbox.put(slot, message);
        }
        outbox.put(Slot::Topology("liver".into()), Bytes::from_static(&[100]));
        assert_eq!(taken(&outbox), Some(100));
        assert_eq!(taken(&outbox), Some(4));
        assert_eq!(taken(&outbox), None);
        assert_eq!(outbox.frames_dropped(), 4);
    }

    #[test]
    fn frames_wait_for_acknowledgement_and_small_messages_do_not() {
        let outbox = Outbox::default();
        for n in 0..20 {
            let (slot, message) = frame(n);
            outbox.put(slot, message);
            let expected = if u64::from(n) < MAX_FRAMES_IN_FLIGHT { Some(n) } else { None };
            assert_eq!(taken(&outbox), expected);
        }
        outbox.put(Slot::Stats, Bytes::from_static(&[200]));
        assert_eq!(taken(&outbox), Some(200));
        outbox.acknowledge(1);
        assert_eq!(taken(&outbox), Some(19));
        outbox.acknowledge(u64::MAX); // a page that claims too much gains no more than it was sent
        let (slot, message) = frame(50);
        outbox.put(slot, message);
        assert_eq!(taken(&outbox), Some(50));
    }

    #[test]
    fn ordered_messages_are_bounded() {
        let outbox = Outbox::default();
        for n in 0..=MAX_QUEUED {
            outbox.push(Bytes::from(vec![n as u8]));
        }
        assert_eq!(taken(&outbox), Some(1));
    }
}
