//! A running server: which threads it starts, in which order, and how it ends.

mod watchdog;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;

use crossbeam_channel::{TrySendError, bounded};
use scindo_proto::messages::SessionInfo;
use scindo_proto::{Chunk, KeySpace, Topic, WIRE_VERSION};
use scindo_world::body::Probe;
use scindo_world::snapshot::Snapshot;
use triple_buffer::{Output, triple_buffer};
use zenoh::Wait as _;
use zenoh::query::Queryable;

use crate::contact::{ContactConfig, ContactThread};
use crate::error::{RuntimeError, words};
use crate::exchange::{ANSWERS, Exchange, OUTGOING};
use crate::inbox::Inbox;
use crate::monitor::metrics::Metrics;
use crate::publish::{PublishThread, Published, Sources};
use crate::receive::Receivers;
use crate::rpc::catalogue::Catalogue;
use crate::rpc::{self, RpcThread};
use crate::sim::engine::Engine;
use crate::sim::{Command, Pace, SimThread};
use crate::wire::convert::ProbeName;
use crate::wire::session::Sessions;

/// Most orders that may wait for the simulation thread.
const WAITING_ORDERS: usize = 16;

/// Fixed settings of a server.
#[derive(Debug, Clone)]
pub struct ServerConfig {
    /// First chunk of every key.
    pub realm: String,
    /// Session within the realm; the second variable part of every key.
    pub session: String,
    /// How fast and how long the simulation runs.
    pub pace: Pace,
    /// Surfaces and tool states per second [Hz].
    pub surface_hz: f64,
    /// Contact models per second and held tool [Hz].
    pub contact_hz: f64,
    /// Statistics per second [Hz].
    pub stats_hz: f64,
    /// Scenes that clients may change to.
    pub catalogue: Arc<Catalogue>,
    /// Name of the present scene in the catalogue; empty if it is not listed.
    pub scene: String,
    /// Number of scenes that ran before this one.
    pub scene_seq: u32,
    /// Figures for a monitor, if somebody asked for them.
    pub metrics: Option<Arc<Metrics>>,
    /// Whether orders are taken at all. Who may send them is settled where the sessions are opened.
    pub takes_orders: bool,
    /// Called with the reason when threads do not end after they were told to. A program ends itself here.
    pub give_up: fn(&str),
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self {
            realm: "scindo".to_owned(),
            session: "main".to_owned(),
            pace: Pace::default(),
            surface_hz: 60.0,
            contact_hz: 500.0,
            stats_hz: 5.0,
            catalogue: Arc::default(),
            scene: String::new(),
            scene_seq: 0,
            metrics: None,
            takes_orders: true,
            give_up: |reason| tracing::error!("{reason}"),
        }
    }
}

/// A running server and its threads.
pub struct Server {
    exchange: Arc<Exchange>,
    sim: JoinHandle<Engine>,
    others: Vec<JoinHandle<()>>,
    watchdog: JoinHandle<()>,
    network: Option<Network>,
}

struct Network {
    _receivers: Receivers,
    _rpc: Queryable<()>,
    _foreign: Vec<Queryable<()>>,
    sessions: Sessions,
}

impl Server {
    /// Starts every thread: publication, orders, contact, input, simulation. Without sessions it starts only
    /// the simulation.
    pub fn start(
        engine: Engine,
        sessions: Option<Sessions>,
        config: &ServerConfig,
    ) -> Result<Self, RuntimeError> {
        let keys = KeySpace::new(&config.realm, &config.session)?;
        let textures = engine.textures();
        let info = SessionInfo { scene: config.scene.clone(), scene_seq: config.scene_seq, ..engine.info() };
        let plan = engine.plan();
        let (outgoing, outgoing_rx) = bounded(OUTGOING);
        let (answers, answers_rx) = bounded(ANSWERS);
        let exchange = Exchange::new(inbox(&info), info.bodies.len(), (outgoing, answers));
        if let Some(metrics) = &config.metrics {
            // Nobody else has this exchange yet.
            let _ = exchange.metrics.set(metrics.clone());
        }
        // Readers get the newest snapshot and may miss others, so none of them holds up a step.
        let (to_publish, published) = triple_buffer(&Snapshot::default());
        let (to_contact, contact) = triple_buffer(&Snapshot::default());
        let (commands, commands_rx) = bounded::<Command>(WAITING_ORDERS);
        let mut others = Vec::new();
        let mut network = None;
        if let Some(sessions) = sessions {
            let contact = contact_thread(&keys, &sessions, &exchange, contact, (&engine, config.contact_hz));
            let sources = Sources { snapshots: published, outgoing: outgoing_rx, answers: answers_rx };
            let ids: Vec<String> = info.bodies.iter().map(|body| body.id.clone()).collect();
            let what = Published {
                bodies: ids,
                probes: probe_names(&engine),
                obstacles: info.obstacles.iter().map(|obstacle| obstacle.id.clone()).collect(),
                step_s: info.step_s,
                plan,
                rates: (config.surface_hz, config.stats_hz),
            };
            // The publisher comes first, because events and answers of the other threads go through it.
            let publish = PublishThread::declare(&keys, &sessions, &exchange, sources, what)?;
            others.push(spawn("publish", move || publish.run())?);
            let (queries, rpc) = declare_rpc(&keys, &sessions)?;
            let takes_orders = config.takes_orders;
            let rpc_thread = RpcThread {
                keys: keys.clone(),
                exchange: exchange.clone(),
                queries,
                commands,
                info,
                textures,
                catalogue: config.catalogue.clone(),
                takes_orders,
            };
            others.push(spawn("rpc", move || rpc_thread.run())?);
            others.push(spawn("contact", move || contact.run())?);
            // Input comes after all that answers, because it announces the server to clients.
            let server = Chunk::new("server id", &format!("server-{}", std::process::id()))?;
            let token = Topic::Server(server);
            let receivers = Receivers::declare(&sessions.haptic, &keys, &exchange, &token)?;
            let foreign = refuse_foreign(&keys, &sessions)?;
            network = Some(Network { _receivers: receivers, _rpc: rpc, _foreign: foreign, sessions });
        }
        // The threads above have taken what they need from the engine; now it moves to its own.
        let sim =
            SimThread::new(engine, exchange.clone(), commands_rx, (to_publish, to_contact), config.pace);
        let sim = spawn("sim", move || sim.run())?;
        let (watched, give_up) = (exchange.clone(), config.give_up);
        let watchdog = spawn("watchdog", move || watchdog::run(&watched, give_up))?;
        Ok(Self { exchange, sim, others, watchdog, network })
    }

    /// State shared by the threads, for progress and tests.
    pub fn exchange(&self) -> &Arc<Exchange> {
        &self.exchange
    }

    /// Steps done since the start.
    pub fn steps(&self) -> u64 {
        self.exchange.sim_step.load(Ordering::Relaxed)
    }

    /// True when the simulation thread has ended, because all steps are done or it was told to stop.
    pub fn finished(&self) -> bool {
        self.sim.is_finished()
    }

    /// Asks every thread to end.
    pub fn stop(&self) {
        self.exchange.stop();
    }

    /// Waits for the simulation to end, then ends the other threads. Returns the engine for its results.
    pub fn join(self) -> Result<Engine, RuntimeError> {
        let (engine, sessions) = self.release()?;
        if let Some(Sessions { haptic, bulk, doors }) = sessions {
            for session in [bulk, haptic] {
                if let Err(error) = session.close().wait() {
                    tracing::debug!(%error, "session not closed cleanly");
                }
            }
            drop(doors);
        }
        Ok(engine)
    }

    /// Like [`join`](Self::join), but also returns the sessions for the next server: clients stay connected.
    pub fn release(self) -> Result<(Engine, Option<Sessions>), RuntimeError> {
        let engine = self.sim.join();
        self.exchange.stop();
        for thread in self.others {
            let name = thread.thread().name().unwrap_or("?").to_owned();
            thread
                .join()
                .map_err(|_| RuntimeError::Died { thread: name })
                .inspect_err(|_| self.exchange.close())?;
        }
        let sessions =
            self.network.map(|Network { _receivers: receivers, _rpc: rpc, _foreign: foreign, sessions }| {
                drop((receivers, rpc, foreign));
                sessions
            });
        self.exchange.close();
        // Its result no longer matters.
        let _ = self.watchdog.join();
        let engine = engine.map_err(|_| RuntimeError::Died { thread: "sim".to_owned() })?;
        Ok((engine, sessions))
    }
}

fn probe_names(engine: &Engine) -> Vec<ProbeName> {
    let bodies = engine.simulation().bodies();
    let name = |probe: &Probe| ProbeName {
        id: probe.id.clone(),
        body: bodies[probe.body].id.to_string(),
        rest_m: probe.rest_m,
    };
    engine.simulation().probes().iter().map(name).collect()
}

fn inbox(info: &SessionInfo) -> Inbox {
    let bodies = info.bodies.iter().map(|body| Arc::from(body.id.as_str()));
    let tools = info.tools.iter().map(|tool| Arc::from(tool.id.as_str()));
    Inbox::new(bodies, tools)
}

fn contact_thread(
    keys: &KeySpace,
    sessions: &Sessions,
    exchange: &Arc<Exchange>,
    snapshots: Output<Snapshot>,
    (engine, rate_hz): (&Engine, f64),
) -> ContactThread {
    let scene = engine.simulation().scene();
    let config = ContactConfig {
        keys: keys.clone(),
        haptic: sessions.haptic.clone(),
        rate_hz,
        shapes: scene.tools.iter().map(|tool| (tool.id.clone(), tool.shape)).collect(),
        bodies: scene.bodies.iter().map(|body| body.id.clone()).collect(),
    };
    ContactThread::new(config, exchange.clone(), snapshots)
}

fn declare_rpc(
    keys: &KeySpace,
    sessions: &Sessions,
) -> Result<(crossbeam_channel::Receiver<zenoh::query::Query>, Queryable<()>), RuntimeError> {
    let (queries, receiver) = bounded(rpc::WAITING);
    let queryable = sessions
        .bulk
        .declare_queryable(keys.every_rpc())
        .callback(move |query| {
            // Between two scenes nobody waits for queries. One without an answer is asked again.
            if let Err(TrySendError::Full(query)) = queries.try_send(query) {
                let error = scindo_proto::messages::Error {
                    code: "busy".to_owned(),
                    message: "too many requests are waiting".to_owned(),
                    hint: "send it again later".to_owned(),
                };
                rpc::refuse(&query, error);
            }
        })
        .wait()
        .map_err(|e| RuntimeError::Zenoh { what: "declaring rpc".to_owned(), reason: words(&e) })?;
    Ok((receiver, queryable))
}

/// Tells clients of another version of the wire that they are not understood, at whatever they ask first.
fn refuse_foreign(keys: &KeySpace, sessions: &Sessions) -> Result<Vec<Queryable<()>>, RuntimeError> {
    let refuse = |(version, key): (u32, String)| {
        let error = scindo_proto::messages::Error {
            code: "wire-version".to_owned(),
            message: format!(
                "this server is scindo {} and speaks version {WIRE_VERSION} of the wire, the client version {version}",
                env!("CARGO_PKG_VERSION")
            ),
            hint: "install the programs of one release on both sides".to_owned(),
        };
        sessions
            .bulk
            .declare_queryable(key)
            .callback(move |query| rpc::refuse(&query, error.clone()))
            .wait()
            .map_err(|e| RuntimeError::Zenoh { what: "declaring rpc".to_owned(), reason: words(&e) })
    };
    keys.every_foreign_rpc().into_iter().map(refuse).collect()
}

fn spawn<T: Send + 'static>(
    name: &str,
    body: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, RuntimeError> {
    std::thread::Builder::new().name(name.to_owned()).spawn(body).map_err(|e| RuntimeError::System {
        what: format!("starting thread '{name}'"),
        reason: e.to_string(),
    })
}
