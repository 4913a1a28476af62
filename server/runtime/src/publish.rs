//! The publication thread sends surfaces and tool states of the newest snapshot at the rate of each topic. It
//! also sends keyframes on query, answers, events, the plan and statistics. The simulation never waits for
//! it.

pub mod on_demand;

pub mod keyframes;

pub mod stats;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use bytes::Bytes;
use crossbeam_channel::{Receiver, select};
use scindo_proto::messages::{
    CutAck, Event, Plan, StageTime, Stats, SurfaceFrame, SurfaceKeyframe, SurfaceTopology, ToolState,
};
use scindo_proto::{Chunk, KeySpace, Topic, WireMessage, encode, encoding};
use scindo_world::snapshot::{BodySnapshot, Snapshot, ToolSnapshot};
use scindo_world::tool::SCRIPT;
use triple_buffer::Output;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::query::Queryable;
use zenoh::{Session, Wait as _};

use crate::error::{RuntimeError, words};
use crate::exchange::{Exchange, OUTGOING, Outgoing};
use crate::wire::convert::{ProbeName, to_frame, to_tool_state, to_topology, unix_ns};
use crate::wire::session::Sessions;
use keyframes::Keyframes;
use on_demand::OnDemand;
use stats::{Told, body_stats};

/// The thread checks for keyframe queries and for its end at least this often.
const LOOK: Duration = Duration::from_millis(20);

/// Longest time between two messages of a topic, however low its rate.
const LONGEST_PERIOD: Duration = Duration::from_secs(60);

/// The plan is repeated this often for late joiners.
const PLAN_PERIOD: Duration = Duration::from_secs(2);

/// Without a new snapshot, tools are repeated this often: late joiners to a paused simulation see them as
/// well. Surfaces are repeated only once, because the last frame may have been lost on its way.
const STILL_PERIOD: Duration = Duration::from_millis(500);

/// Publishers of the surface of one body.
struct BodyChannel {
    frame: Publisher<'static>,
    topology: Publisher<'static>,
    frames: u64,
    topologies: u64,
    sent_epoch: Option<u32>,
    _keyframe: Queryable<()>,
}

/// Inputs of the publisher.
pub struct Sources {
    /// Newest state of the simulation.
    pub snapshots: Output<Snapshot>,
    /// Events and plans.
    pub outgoing: Receiver<Outgoing>,
    /// Answers to cuts of clients.
    pub answers: Receiver<CutAck>,
}

/// Fixed settings: what is published, and how often.
pub struct Published {
    /// Ids of the bodies, in scene order.
    pub bodies: Vec<String>,
    /// Probes, in scene order.
    pub probes: Vec<ProbeName>,
    /// Ids of the obstacles, in scene order.
    pub obstacles: Vec<String>,
    /// Simulated time per step [s].
    pub step_s: f64,
    /// The first plan; later ones arrive through [`Sources::outgoing`].
    pub plan: Plan,
    /// Surfaces per second, and statistics per second [Hz].
    pub rates: (f64, f64),
}

/// State of the publication thread.
pub struct PublishThread {
    keys: KeySpace,
    exchange: Arc<Exchange>,
    sources: Sources,
    period: Duration,
    stats_period: Duration,
    step_s: f64,
    bulk: Session,
    haptic: Session,
    bodies: Vec<BodyChannel>,
    tools: BTreeMap<Arc<str>, Publisher<'static>>,
    on_demand: OnDemand,
    stats: Publisher<'static>,
    events: Publisher<'static>,
    plan: Publisher<'static>,
    newest_plan: Plan,
    /// A new snapshot arrived and is not published yet.
    fresh: bool,
    /// Surfaces of the newest snapshot were sent only once.
    told_once: bool,
    keyframes: Keyframes,
    tool_states: u64,
    reports: u64,
    told: Told,
    next_stats: Instant,
    next_plan: Instant,
    next_still: Instant,
}

impl PublishThread {
    /// Declares all topics.
    pub fn declare(
        keys: &KeySpace,
        sessions: &Sessions,
        exchange: &Arc<Exchange>,
        sources: Sources,
        what: Published,
    ) -> Result<Self, RuntimeError> {
        let bulk = &sessions.bulk;
        let report = |topic: Topic, encoding: String| {
            declare(bulk, keys.key(&topic), encoding, Priority::Background, CongestionControl::Drop)
        };
        let bodies = what.bodies.iter().enumerate();
        let keyframes = Keyframes::start()?;
        let bodies = bodies.map(|(index, id)| body_channel(keys, bulk, exchange, &keyframes, (index, id)));
        Ok(Self {
            keys: keys.clone(),
            exchange: exchange.clone(),
            period: period(what.rates.0),
            stats_period: period(what.rates.1),
            step_s: what.step_s,
            bulk: bulk.clone(),
            haptic: sessions.haptic.clone(),
            bodies: bodies.collect::<Result<_, _>>()?,
            tools: BTreeMap::new(),
            on_demand: OnDemand::declare(keys, bulk, exchange, &what.bodies, (what.probes, what.obstacles))?,
            stats: report(Topic::Stats, encoding::<Stats>())?,
            events: report(Topic::Event, encoding::<Event>())?,
            plan: report(Topic::Plan, encoding::<Plan>())?,
            newest_plan: what.plan,
            fresh: false,
            told_once: false,
            keyframes,
            tool_states: 0,
            reports: 0,
            told: Told::default(),
            next_stats: Instant::now(),
            next_plan: Instant::now(),
            next_still: Instant::now(),
            sources,
        })
    }

    /// Publishes until the server ends, including the simulation's last messages.
    pub fn run(mut self) {
        let mut next_frame = Instant::now();
        while !(self.exchange.stopping() && self.exchange.simulated()) {
            self.send_until(next_frame.min(Instant::now() + LOOK));
            self.fresh |= self.sources.snapshots.update();
            if Instant::now() >= next_frame {
                next_frame = (next_frame + self.period).max(Instant::now());
                self.publish_frame();
            }
            self.answer_keyframe_queries();
            self.publish_stats();
            self.publish_plan();
        }
        self.send_until(Instant::now());
    }

    /// Sends answers and events as they arrive, until `deadline`.
    fn send_until(&mut self, deadline: Instant) {
        for _ in 0..OUTGOING {
            let left = deadline.saturating_duration_since(Instant::now());
            select! {
                recv(self.sources.answers) -> answer => {
                    let Ok(answer) = answer else { return };
                    self.send_ack(&answer);
                }
                recv(self.sources.outgoing) -> outgoing => {
                    let Ok(outgoing) = outgoing else { return };
                    self.send_out(outgoing);
                }
                default(left) => return,
            }
        }
    }

    fn publish_frame(&mut self) {
        let fresh = std::mem::take(&mut self.fresh);
        if !fresh && Instant::now() < self.next_still {
            return;
        }
        self.next_still = Instant::now() + STILL_PERIOD;
        if fresh || self.told_once {
            self.told_once = fresh;
            self.publish_surfaces();
        }
        self.publish_tools();
    }

    fn send_out(&mut self, outgoing: Outgoing) {
        match outgoing {
            Outgoing::Event(event) => put(&self.events, &event),
            Outgoing::Plan(plan) => {
                self.newest_plan = plan;
                self.next_plan = Instant::now();
            }
        }
    }

    /// Sends an answer. A client that does not read loses it and repeats its cut, so that nobody else waits.
    /// Answers to many simultaneous cuts share a batch; most of them would be dropped as express messages.
    fn send_ack(&self, answer: &CutAck) {
        let Ok(tool) = Chunk::new("tool id", &answer.tool_id) else { return self.exchange.answer_lost() };
        let sent = self
            .haptic
            .put(self.keys.key(&Topic::ToolCutAck(tool)), encode(answer))
            .encoding(encoding::<CutAck>())
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Drop)
            .wait();
        if let Err(error) = sent {
            tracing::warn!(%error, "answer to a cut not sent");
            self.exchange.answer_lost();
        }
    }

    fn publish_surfaces(&mut self) {
        let snapshot = self.sources.snapshots.output_buffer();
        for (index, (channel, body)) in self.bodies.iter_mut().zip(&snapshot.bodies).enumerate() {
            if !self.exchange.surface_wanted(index) || body.positions.is_empty() {
                continue;
            }
            if channel.sent_epoch != Some(body.topology.epoch) {
                channel.sent_epoch = Some(body.topology.epoch);
                channel.topologies += 1;
                put(&channel.topology, &to_topology(snapshot, body, channel.topologies));
            }
            channel.frames += 1;
            put(&channel.frame, &to_frame(snapshot, body, channel.frames));
        }
        self.on_demand.publish(snapshot);
    }

    /// Publishes the tools of the newest snapshot, except those that a client has put away since.
    fn publish_tools(&mut self) {
        self.tool_states += 1;
        let snapshot = self.sources.snapshots.output_buffer();
        let put_away = |tool: &ToolSnapshot| {
            let by_client = !tool.owner.is_empty() && *tool.owner != *SCRIPT;
            by_client && !self.exchange.inbox().held().any(|held| held.id == tool.id)
        };
        for tool in &snapshot.tools {
            if put_away(tool) {
                continue;
            }
            let state = to_tool_state(snapshot, tool, self.tool_states);
            if !self.tools.contains_key(&tool.id) {
                let Ok(id) = Chunk::new("tool id", &tool.id) else { continue };
                let key = self.keys.key(&Topic::ToolState(id));
                let encoding = encoding::<ToolState>();
                let Ok(publisher) =
                    declare(&self.bulk, key, encoding, Priority::DataHigh, CongestionControl::Drop)
                else {
                    continue;
                };
                self.tools.insert(tool.id.clone(), publisher);
            }
            if let Some(publisher) = self.tools.get(&tool.id) {
                put(publisher, &state);
            }
        }
        self.tools.retain(|id, _| snapshot.tools.iter().any(|tool| tool.id == *id));
    }

    /// Answers queries whose body is in the snapshot. The others wait for the next snapshot.
    fn answer_keyframe_queries(&mut self) {
        let Self { sources, bodies, keyframes, .. } = self;
        let snapshot = sources.snapshots.output_buffer();
        let wanted = keyframes.answer(|index| {
            let (body, channel) = (snapshot.bodies.get(index)?, bodies.get(index)?);
            keyframe(snapshot, body, channel)
        });
        if !wanted {
            self.exchange.want_keyframe(false);
        }
    }

    fn publish_stats(&mut self) {
        if Instant::now() < self.next_stats {
            return;
        }
        self.next_stats = Instant::now() + self.stats_period;
        let stats = self.gather_stats();
        if let Some(metrics) = self.exchange.metrics.get() {
            metrics.report(&stats);
        }
        put(&self.stats, &stats);
    }

    fn gather_stats(&mut self) -> Stats {
        self.reports += 1;
        let rates = self.exchange.meter.read();
        self.told.read(&self.exchange, rates.seconds);
        let (told, snapshot) = (&self.told, self.sources.snapshots.output_buffer());
        let (clients, client_count) = told.clients();
        Stats {
            seq: self.reports,
            sim_step: snapshot.step,
            sim_time_s: snapshot.time_s,
            publish_unix_ns: unix_ns(),
            step_rate_hz: rates.step_hz as f32,
            real_time_factor: (rates.step_hz * self.step_s) as f32,
            stages: rates
                .stages_ms
                .iter()
                .map(|&(name, ms)| StageTime { name: name.to_owned(), milliseconds: ms as f32 })
                .collect(),
            bodies: snapshot.bodies.iter().map(body_stats).collect(),
            tools: snapshot.tools.iter().map(|tool| told.tool_stats(tool, &rates)).collect(),
            refused: told.refused(&self.exchange),
            cuts_applied: told.cuts_applied(),
            surface_subscribers: (0..self.bodies.len()).filter(|&i| self.exchange.surface_wanted(i)).count()
                as u32,
            haptic_clients: told.held(),
            paused: self.exchange.paused.load(Ordering::Relaxed),
            clients,
            client_count,
            recording: self.exchange.recording(),
        }
    }

    fn publish_plan(&mut self) {
        if Instant::now() >= self.next_plan {
            self.next_plan = Instant::now() + PLAN_PERIOD;
            put(&self.plan, &self.newest_plan);
        }
    }
}

/// The whole surface of a body. `None` if the snapshot does not hold it.
fn keyframe(snapshot: &Snapshot, body: &BodySnapshot, channel: &BodyChannel) -> Option<Bytes> {
    if body.positions.len() != body.topology.vertex_count as usize || body.positions.is_empty() {
        return None;
    }
    Some(encode(&SurfaceKeyframe {
        topology: Some(to_topology(snapshot, body, channel.topologies)),
        frame: Some(to_frame(snapshot, body, channel.frames)),
    }))
}

fn period(rate_hz: f64) -> Duration {
    Duration::try_from_secs_f64(1.0 / rate_hz).unwrap_or(LONGEST_PERIOD).min(LONGEST_PERIOD)
}

fn body_channel(
    keys: &KeySpace,
    bulk: &Session,
    exchange: &Arc<Exchange>,
    keyframes: &Keyframes,
    (index, id): (usize, &str),
) -> Result<BodyChannel, RuntimeError> {
    let id = Chunk::new("body id", id)?;
    let key = |topic: fn(Chunk) -> Topic| keys.key(&topic(id.clone()));
    let frame = bulk
        .declare_publisher(key(Topic::SurfaceFrame))
        .encoding(encoding::<SurfaceFrame>())
        .priority(Priority::DataLow)
        .congestion_control(CongestionControl::Drop)
        .reliability(Reliability::BestEffort)
        .wait()
        .map_err(failed)?;
    let topology_encoding = encoding::<SurfaceTopology>();
    let topology_key = key(Topic::SurfaceTopology);
    // Never `Block`: this thread serves all clients. A client that misses a topology asks for the keyframe,
    // and that answer has priority `Data`.
    let topology =
        declare(bulk, topology_key, topology_encoding, Priority::DataHigh, CongestionControl::Drop)?;
    let watcher = exchange.clone();
    frame
        .matching_listener()
        .callback(move |status| watcher.want_surface(index, status.matching()))
        .background()
        .wait()
        .map_err(failed)?;
    let keyframe = bulk
        .declare_queryable(key(Topic::SurfaceKeyframe))
        .callback(keyframes.entrance(exchange, index))
        .wait()
        .map_err(failed)?;
    Ok(BodyChannel { frame, topology, frames: 0, topologies: 0, sent_epoch: None, _keyframe: keyframe })
}

fn declare(
    session: &Session,
    key: String,
    encoding: String,
    priority: Priority,
    congestion: CongestionControl,
) -> Result<Publisher<'static>, RuntimeError> {
    let builder = session.declare_publisher(key).encoding(encoding).priority(priority);
    builder.congestion_control(congestion).wait().map_err(failed)
}

fn put<M: WireMessage>(publisher: &Publisher<'static>, message: &M) {
    if let Err(error) = publisher.put(encode(message)).wait() {
        tracing::debug!(key = %publisher.key_expr(), %error, "not published");
    }
}

fn failed(error: zenoh::Error) -> RuntimeError {
    RuntimeError::Zenoh { what: "declaring topics".to_owned(), reason: words(&error) }
}
