//! What the threads share: newest inputs, who waits for what, and the way out.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crossbeam_channel::{Sender, TrySendError};
use scindo_proto::messages::{CutAck, Event, Plan, event};
use scindo_world::inputs::Wants;
use scindo_world::simulation::Level;

use crate::convert::unix_ns;
use crate::inbox::Inbox;
use crate::stats::Meter;

/// Messages that may wait for the publisher; beyond it events are dropped and counted.
pub const OUTGOING: usize = 1024;

/// Information of one name is logged this often.
const LOG_EVERY: Duration = Duration::from_secs(1);

/// What the publisher sends besides surfaces.
#[derive(Debug)]
pub enum Outgoing {
    /// Answer to a cut.
    Ack(CutAck),
    /// Something happened.
    Event(Event),
    /// The plan changed.
    Plan(Plan),
}

/// One per server.
pub struct Exchange {
    inbox: Mutex<Inbox>,
    /// Rates and costs.
    pub meter: Meter,
    /// Per body: somebody subscribes to its surface.
    surface_wanted: Vec<AtomicBool>,
    /// Per body: epoch of the newest snapshot.
    epochs: Vec<AtomicU32>,
    /// Somebody asked for a keyframe.
    keyframe_wanted: AtomicBool,
    /// Somebody subscribes to the contact of a held tool.
    contact_wanted: AtomicBool,
    /// The server ends.
    stop: AtomicBool,
    /// Simulation holds still.
    pub paused: AtomicBool,
    /// Steps done.
    pub sim_step: AtomicU64,
    /// Events lost because the publisher was behind.
    pub events_dropped: AtomicU64,
    event_seq: AtomicU64,
    /// Name and time of the last information in the log.
    logged: Mutex<Option<(String, Instant)>>,
    outgoing: Sender<Outgoing>,
}

impl Exchange {
    /// For `bodies` bodies; `outgoing` leads to the publisher.
    pub fn new(inbox: Inbox, bodies: usize, outgoing: Sender<Outgoing>) -> Arc<Self> {
        Arc::new(Self {
            inbox: Mutex::new(inbox),
            meter: Meter::default(),
            surface_wanted: (0..bodies).map(|_| AtomicBool::new(false)).collect(),
            epochs: (0..bodies).map(|_| AtomicU32::new(0)).collect(),
            keyframe_wanted: AtomicBool::new(false),
            contact_wanted: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            paused: AtomicBool::new(false),
            sim_step: AtomicU64::new(0),
            events_dropped: AtomicU64::new(0),
            event_seq: AtomicU64::new(0),
            logged: Mutex::new(None),
            outgoing,
        })
    }

    /// The inbox; held for microseconds only.
    pub fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes whether somebody subscribes to the surface of body `index`.
    pub fn want_surface(&self, index: usize, wanted: bool) {
        if let Some(flag) = self.surface_wanted.get(index) {
            flag.store(wanted, Ordering::Relaxed);
        }
    }

    /// True if somebody subscribes to the surface of body `index`.
    pub fn surface_wanted(&self, index: usize) -> bool {
        self.surface_wanted.get(index).is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Notes the epoch of body `index`.
    pub fn set_epoch(&self, index: usize, epoch: u32) {
        if let Some(held) = self.epochs.get(index) {
            held.store(epoch, Ordering::Relaxed);
        }
    }

    /// Epoch of body `index` in the newest snapshot.
    pub fn epoch(&self, index: usize) -> u32 {
        self.epochs.get(index).map_or(0, |epoch| epoch.load(Ordering::Relaxed))
    }

    /// Notes whether keyframes are waited for.
    pub fn want_keyframe(&self, wanted: bool) {
        self.keyframe_wanted.store(wanted, Ordering::Relaxed);
    }

    /// True while a keyframe is waited for.
    pub fn keyframe_wanted(&self) -> bool {
        self.keyframe_wanted.load(Ordering::Relaxed)
    }

    /// Notes whether contact models are waited for.
    pub fn want_contact(&self, wanted: bool) {
        self.contact_wanted.store(wanted, Ordering::Relaxed);
    }

    /// What the next step and snapshot must provide.
    pub fn wants_into(&self, wants: &mut Wants) {
        let keyframe = self.keyframe_wanted();
        wants.surface.clear();
        let flags = self.surface_wanted.iter();
        wants.surface.extend(flags.map(|flag| keyframe || flag.load(Ordering::Relaxed)));
        wants.contact = self.contact_wanted.load(Ordering::Relaxed);
    }

    /// Asks every thread to end.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// True when threads should end.
    pub fn stopping(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Hands something to the publisher; never waits.
    pub fn send(&self, outgoing: Outgoing) {
        if let Err(TrySendError::Full(_)) = self.outgoing.try_send(outgoing) {
            self.events_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// False for what follows its like within [`LOG_EVERY`].
    fn is_news(&self, name: &str) -> bool {
        let mut logged = self.logged.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((last, at)) = &*logged
            && last == name
            && at.elapsed() < LOG_EVERY
        {
            return false;
        }
        *logged = Some((name.to_owned(), Instant::now()));
        true
    }

    /// Publishes and logs an event; the log has one line per [`LOG_EVERY`] of what goes on and on, as a cut
    /// does while the blade moves.
    pub fn event(&self, level: Level, name: &str, message: String) {
        let level = match level {
            Level::Info => {
                if self.is_news(name) {
                    tracing::info!(name, "{message}");
                } else {
                    tracing::debug!(name, "{message}");
                }
                event::Level::Info
            }
            Level::Warning => {
                tracing::warn!(name, "{message}");
                event::Level::Warning
            }
            Level::Error => {
                tracing::error!(name, "{message}");
                event::Level::Error
            }
        };
        self.send(Outgoing::Event(Event {
            seq: self.event_seq.fetch_add(1, Ordering::Relaxed) + 1,
            sim_step: self.sim_step.load(Ordering::Relaxed),
            publish_unix_ns: unix_ns(),
            level: level.into(),
            name: name.to_owned(),
            message: message.chars().take(1000).collect(),
        }));
    }
}
