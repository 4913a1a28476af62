//! State shared by the threads: newest inputs, who waits for what, and queues to the publisher.

pub mod meter;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use crossbeam_channel::Sender;
use scindo_proto::messages::{CutAck, Event, ParamsReply, Plan, RecordingStats, event};
use scindo_world::inputs::Wants;
use scindo_world::simulation::Level;

use crate::inbox::Inbox;
use crate::monitor::metrics::Metrics;
use crate::wire::convert::unix_ns;
use meter::Meter;

/// Capacity of the queue to the publisher. When it is full, events are dropped and counted.
pub const OUTGOING: usize = 1024;

/// Capacity of the queue of answers to cuts. An answer that finds it full is counted as lost. The client
/// repeats its cut until it is answered, and the inbox remembers the answer.
pub const ANSWERS: usize = 4096;

/// Repeated events of one name are logged once in this time.
const LOG_EVERY: Duration = Duration::from_secs(1);

/// Events of one name that are published per [`LOG_EVERY`].
const EVENTS_PER_NAME: u64 = 32;

/// Messages for the publisher other than surfaces and answers.
#[derive(Debug)]
pub enum Outgoing {
    /// Something happened.
    Event(Event),
    /// The plan changed.
    Plan(Plan),
}

/// State shared by all threads of one server.
pub struct Exchange {
    inbox: Mutex<Inbox>,
    /// Rates and costs since the last report.
    pub meter: Meter,
    /// Figures for a monitor, if the server has one.
    pub metrics: OnceLock<Arc<Metrics>>,
    /// Per body: whether somebody subscribes to its surface.
    surface_wanted: Vec<AtomicBool>,
    /// Per body: whether somebody subscribes to its stress.
    stress_wanted: Vec<AtomicBool>,
    /// Whether somebody subscribes to probes and energies.
    measures_wanted: AtomicBool,
    /// Whether somebody subscribes to forces of contact.
    forces_wanted: AtomicBool,
    /// Per body: epoch of its newest snapshot.
    epochs: Vec<AtomicU32>,
    /// Whether a keyframe query waits for an answer.
    keyframe_wanted: AtomicBool,
    /// Whether somebody subscribes to the contact of a held tool.
    contact_wanted: AtomicBool,
    /// Set once, when all threads must end.
    stop: AtomicBool,
    /// The simulation thread has ended: it sends nothing more.
    simulated: AtomicBool,
    /// Every thread has ended.
    closed: AtomicBool,
    /// Raised to break off the current step.
    break_off: Arc<AtomicBool>,
    /// When the oldest order arrived that the simulation thread has not looked at.
    order_since: Mutex<Option<Instant>>,
    /// Whether the simulation is paused.
    pub paused: AtomicBool,
    /// Steps done, including those that panicked.
    pub sim_step: AtomicU64,
    /// Steps that panicked.
    panicked_steps: AtomicU64,
    /// Events lost because the publisher was behind or one name had too many.
    events_dropped: AtomicU64,
    /// Answers to cuts lost because the publisher was behind or could not send. Their clients ask again.
    answers_lost: AtomicU64,
    event_seq: AtomicU64,
    /// Parameters that `rpc/set` may change, after the last change.
    params: Mutex<ParamsReply>,
    /// The recording under way.
    recording: Mutex<Option<RecordingStats>>,
    /// By name of event: start of the current interval, and events since then.
    told: Mutex<BTreeMap<String, (Instant, u64)>>,
    outgoing: Sender<Outgoing>,
    answers: Sender<CutAck>,
}

/// Whether an event is logged and published.
struct News {
    /// It is the first of its name in this [`LOG_EVERY`].
    logged: bool,
    published: bool,
    /// Earlier events of this name that were not logged.
    untold: u64,
}

impl Exchange {
    /// State for `bodies` bodies; `outgoing` and `answers` lead to the publisher.
    pub fn new(
        inbox: Inbox,
        bodies: usize,
        (outgoing, answers): (Sender<Outgoing>, Sender<CutAck>),
    ) -> Arc<Self> {
        Arc::new(Self {
            inbox: Mutex::new(inbox),
            meter: Meter::default(),
            metrics: OnceLock::new(),
            surface_wanted: (0..bodies).map(|_| AtomicBool::new(false)).collect(),
            stress_wanted: (0..bodies).map(|_| AtomicBool::new(false)).collect(),
            measures_wanted: AtomicBool::new(false),
            forces_wanted: AtomicBool::new(false),
            epochs: (0..bodies).map(|_| AtomicU32::new(0)).collect(),
            keyframe_wanted: AtomicBool::new(false),
            contact_wanted: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            simulated: AtomicBool::new(false),
            closed: AtomicBool::new(false),
            break_off: Arc::default(),
            order_since: Mutex::new(None),
            paused: AtomicBool::new(false),
            sim_step: AtomicU64::new(0),
            panicked_steps: AtomicU64::new(0),
            events_dropped: AtomicU64::new(0),
            answers_lost: AtomicU64::new(0),
            event_seq: AtomicU64::new(0),
            params: Mutex::default(),
            recording: Mutex::default(),
            told: Mutex::default(),
            outgoing,
            answers,
        })
    }

    /// Locks the inbox. Callers hold the lock for microseconds only.
    pub fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A copy of the parameters that `rpc/set` may change.
    pub fn params(&self) -> ParamsReply {
        self.params.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Replaces the parameters that `rpc/set` may change.
    pub fn set_params(&self, params: ParamsReply) {
        *self.params.lock().unwrap_or_else(PoisonError::into_inner) = params;
    }

    /// The recording under way.
    pub fn recording(&self) -> Option<RecordingStats> {
        self.recording.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Replaces what is known of the recording under way.
    pub fn set_recording(&self, recording: Option<RecordingStats>) {
        *self.recording.lock().unwrap_or_else(PoisonError::into_inner) = recording;
    }

    /// Records whether somebody subscribes to the surface of body `index`.
    pub fn want_surface(&self, index: usize, wanted: bool) {
        if let Some(flag) = self.surface_wanted.get(index) {
            flag.store(wanted, Ordering::Relaxed);
        }
    }

    /// True if somebody subscribes to the surface of body `index`.
    pub fn surface_wanted(&self, index: usize) -> bool {
        self.surface_wanted.get(index).is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Records whether somebody subscribes to the stress of body `index`.
    pub fn want_stress(&self, index: usize, wanted: bool) {
        if let Some(flag) = self.stress_wanted.get(index) {
            flag.store(wanted, Ordering::Relaxed);
        }
    }

    /// Records whether somebody subscribes to probes and energies.
    pub fn want_measures(&self, wanted: bool) {
        self.measures_wanted.store(wanted, Ordering::Relaxed);
    }

    /// Records whether somebody subscribes to forces of contact.
    pub fn want_forces(&self, wanted: bool) {
        self.forces_wanted.store(wanted, Ordering::Relaxed);
    }

    /// Records the epoch of body `index`.
    pub fn set_epoch(&self, index: usize, epoch: u32) {
        if let Some(held) = self.epochs.get(index) {
            held.store(epoch, Ordering::Relaxed);
        }
    }

    /// Epoch of body `index` in the newest snapshot.
    pub fn epoch(&self, index: usize) -> u32 {
        self.epochs.get(index).map_or(0, |epoch| epoch.load(Ordering::Relaxed))
    }

    /// Records whether a keyframe query waits for an answer.
    pub fn want_keyframe(&self, wanted: bool) {
        self.keyframe_wanted.store(wanted, Ordering::Relaxed);
    }

    /// True while a keyframe query waits for an answer.
    pub fn keyframe_wanted(&self) -> bool {
        self.keyframe_wanted.load(Ordering::Relaxed)
    }

    /// Records whether somebody waits for contact models.
    pub fn want_contact(&self, wanted: bool) {
        self.contact_wanted.store(wanted, Ordering::Relaxed);
    }

    /// Writes into `wants` what the next step and snapshot must provide.
    pub fn wants_into(&self, wants: &mut Wants) {
        let keyframe = self.keyframe_wanted();
        wants.surface.clear();
        let flags = self.surface_wanted.iter();
        wants.surface.extend(flags.map(|flag| keyframe || flag.load(Ordering::Relaxed)));
        wants.stress.clear();
        wants.stress.extend(self.stress_wanted.iter().map(|flag| flag.load(Ordering::Relaxed)));
        wants.measures = self.measures_wanted.load(Ordering::Relaxed);
        wants.forces = self.forces_wanted.load(Ordering::Relaxed);
        wants.contact = self.contact_wanted.load(Ordering::Relaxed);
    }

    /// Asks every thread to end.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// True once every thread has been asked to end.
    pub fn stopping(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// The flag that breaks off the current step, for code that checks it during a step.
    pub fn break_off_flag(&self) -> &Arc<AtomicBool> {
        &self.break_off
    }

    /// Records that the simulation thread was given an order.
    pub fn order_given(&self) {
        self.orders().get_or_insert_with(Instant::now);
    }

    /// Called when the simulation thread looks at its orders: no order has waited longer than since now.
    pub fn orders_taken(&self) {
        let mut since = self.orders();
        *since = None;
        self.break_off.store(self.stopping() && self.break_off.load(Ordering::Relaxed), Ordering::Relaxed);
    }

    /// Breaks off the current step if an order has waited for `patience`.
    pub fn break_off_after(&self, patience: Duration) {
        if self.orders().is_some_and(|since| since.elapsed() >= patience) {
            self.break_off.store(true, Ordering::Relaxed);
        }
    }

    /// Breaks off the current step.
    pub fn break_off(&self) {
        self.break_off.store(true, Ordering::Relaxed);
    }

    fn orders(&self) -> MutexGuard<'_, Option<Instant>> {
        self.order_since.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records that the simulation thread has ended.
    pub fn has_simulated(&self) {
        self.simulated.store(true, Ordering::Release);
    }

    /// True when the simulation thread has ended.
    pub fn simulated(&self) -> bool {
        self.simulated.load(Ordering::Acquire)
    }

    /// Records that every thread has ended.
    pub fn close(&self) {
        self.closed.store(true, Ordering::Release);
    }

    /// True when every thread has ended.
    pub fn closed(&self) -> bool {
        self.closed.load(Ordering::Acquire)
    }

    /// Counts a step that panicked. Its state is lost and the scene starts again.
    pub fn step_panicked(&self) {
        self.panicked_steps.fetch_add(1, Ordering::Relaxed);
    }

    /// Steps that panicked so far. A run with any of them has failed.
    pub fn panicked_steps(&self) -> u64 {
        self.panicked_steps.load(Ordering::Relaxed)
    }

    /// Counts of what was lost or went wrong so far, by name; zero counts are left out.
    pub fn losses(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let all = [
            ("events-dropped", &self.events_dropped),
            ("answers-lost", &self.answers_lost),
            ("steps-panicked", &self.panicked_steps),
        ];
        all.map(|(name, count)| (name, count.load(Ordering::Relaxed))).into_iter().filter(|(_, n)| *n > 0)
    }

    /// Queues a message for the publisher without waiting. Without a publisher it is discarded.
    pub fn send(&self, outgoing: Outgoing) {
        if self.outgoing.try_send(outgoing).is_err_and(|error| error.is_full()) {
            self.events_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Queues the answer to a cut for the publisher without waiting.
    pub fn answer(&self, answer: CutAck) {
        if self.answers.try_send(answer).is_err_and(|error| error.is_full()) {
            tracing::warn!("more answers to cuts wait than can be sent; their clients have to ask again");
            self.answer_lost();
        }
    }

    /// Counts an answer to a cut that does not reach the network.
    pub fn answer_lost(&self) {
        self.answers_lost.fetch_add(1, Ordering::Relaxed);
    }

    fn news(&self, name: &str) -> News {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((since, count)) = told.get_mut(name) else {
            told.insert(name.to_owned(), (Instant::now(), 1));
            return News { logged: true, published: true, untold: 0 };
        };
        if since.elapsed() >= LOG_EVERY {
            let untold = *count - 1;
            (*since, *count) = (Instant::now(), 1);
            return News { logged: true, published: true, untold };
        }
        *count += 1;
        News { logged: false, published: *count <= EVENTS_PER_NAME, untold: 0 }
    }

    /// Publishes and logs an event. Repeated events, such as those of a moving blade, are logged once per
    /// name and [`LOG_EVERY`]. The next line tells how many there were.
    pub fn event(&self, level: Level, name: &str, message: String) {
        let News { logged, published, untold } = self.news(name);
        if logged {
            log(level, name, &message, untold);
        } else {
            tracing::debug!(name, "{message}");
        }
        if !published {
            self.events_dropped.fetch_add(1, Ordering::Relaxed);
            return;
        }
        let level = match level {
            Level::Info => event::Level::Info,
            Level::Warning => event::Level::Warning,
            Level::Error => event::Level::Error,
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

fn log(level: Level, name: &str, message: &str, untold: u64) {
    let more = if untold > 0 { format!(" ({untold} more of these before)") } else { String::new() };
    match level {
        Level::Info => tracing::info!(name, "{message}{more}"),
        Level::Warning => tracing::warn!(name, "{message}{more}"),
        Level::Error => tracing::error!(name, "{message}{more}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossbeam_channel::bounded;

    #[test]
    fn a_flood_of_one_event_is_counted_and_leaves_room_for_others() {
        let (outgoing, events) = bounded(OUTGOING);
        let exchange = Exchange::new(Inbox::default(), 0, (outgoing, bounded(1).0));
        for _ in 0..OUTGOING {
            exchange.event(Level::Error, "step-refused", "again".to_owned());
        }
        exchange.event(Level::Info, "reset", "back".to_owned());
        let names: Vec<String> = events
            .try_iter()
            .filter_map(|o| match o {
                Outgoing::Event(event) => Some(event.name),
                Outgoing::Plan(_) => None,
            })
            .collect();
        assert_eq!(names.last().map(String::as_str), Some("reset"));
        let refused = names.iter().filter(|name| *name == "step-refused").count() as u64;
        // A machine that stalls for a second may let a second batch through.
        assert!(refused <= 4 * EVENTS_PER_NAME, "{refused}");
        let dropped: Vec<_> = exchange.losses().collect();
        assert_eq!(dropped, [("events-dropped", OUTGOING as u64 - refused)]);
    }

    #[test]
    fn answers_that_find_the_queue_full_are_counted() {
        let (answers, waiting) = bounded(2);
        let exchange = Exchange::new(Inbox::default(), 0, (bounded(1).0, answers));
        assert_eq!(exchange.losses().count(), 0);
        (1..=5).for_each(|seq| exchange.answer(CutAck { seq, ..CutAck::default() }));
        assert_eq!(waiting.try_iter().map(|answer| answer.seq).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(exchange.losses().collect::<Vec<_>>(), [("answers-lost", 3)]);
    }

    #[test]
    fn only_an_order_that_waited_breaks_off_a_step() {
        let exchange = Exchange::new(Inbox::default(), 0, (bounded(1).0, bounded(1).0));
        let flag = exchange.break_off_flag().clone();
        exchange.break_off_after(Duration::ZERO);
        assert!(!flag.load(Ordering::Relaxed));
        exchange.order_given();
        exchange.break_off_after(Duration::from_secs(3600));
        assert!(!flag.load(Ordering::Relaxed));
        exchange.break_off_after(Duration::ZERO);
        assert!(flag.load(Ordering::Relaxed));
        exchange.orders_taken();
        assert!(!flag.load(Ordering::Relaxed));
    }
}
