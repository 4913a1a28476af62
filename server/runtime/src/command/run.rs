//! `scindo run`, and `scindo` alone: simulates and serves a scene until it is done or told to stop.

use std::net::SocketAddr;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use scindo_program::say;
use scindo_proto::KeySpace;
use scindo_proto::endpoint::bulk_endpoint;
use scindo_view::{ViewConfig, Viewer};
use scindo_world::assemble::{BuildOptions, doubts};
use scindo_world::results::Results;
use scindo_world::scene::{SHIPPED, Scene, ShippedScene};
use scindo_world::simulation::{Level, Simulation};
use serde_json::{Map, Value, json};
use tokio::runtime::Runtime;
use tokio::task::JoinHandle;

use super::cli::{DemoArgs, RunArgs, ServeArgs};
use super::progress::{Progress, Share};
use super::signals::Signals;
use crate::error::RuntimeError;
use crate::monitor::metrics::{self, Metrics};
use crate::record::on_demand::{RecordFolder, prepare};
use crate::record::recorder::RecordSettings;
use crate::record::replay::newest;
use crate::rpc::catalogue::Catalogue;
use crate::server::{Server, ServerConfig};
use crate::sim::Pace;
use crate::sim::engine::Engine;
use crate::wire::orders::Operators;
use crate::wire::session::{NetworkConfig, Sessions};

/// Default address of the demonstration's page.
const DEMONSTRATION_VIEWER: &str = "127.0.0.1:8080";

/// How often the foreground checks whether the simulation has ended.
const LOOK: Duration = Duration::from_millis(20);

/// Runs the built-in demonstration.
pub fn demonstration(args: &ServeArgs) -> Result<ExitCode, RuntimeError> {
    shipped(SHIPPED[0], args)
}

/// Runs a scene that ships with the program, or lists them all.
pub fn demo(args: &DemoArgs) -> Result<ExitCode, RuntimeError> {
    if args.list {
        if args.serve.json {
            let list = SHIPPED.map(|scene| json!({ "name": scene.name, "description": scene.description() }));
            say!("{:#}", json!({ "scenes": list }));
        } else {
            let width = SHIPPED.iter().map(|scene| scene.name.len()).max().unwrap_or(0);
            SHIPPED.iter().for_each(|scene| say!("{:width$}  {}", scene.name, scene.description()));
        }
        return Ok(ExitCode::SUCCESS);
    }
    let scene = ShippedScene::of_name(&args.name).ok_or_else(|| RuntimeError::Option {
        option: "NAME",
        value: args.name.clone(),
        reason: match ShippedScene::nearest(&args.name) {
            Some(name) => format!("no such scene; did you mean {name}?"),
            None => "no such scene".to_owned(),
        },
        next: "List them with `scindo demo --list`".to_owned(),
    })?;
    shipped(scene, &args.serve)
}

fn shipped(shipped: ShippedScene, args: &ServeArgs) -> Result<ExitCode, RuntimeError> {
    let scene = shipped.read(&args.set)?;
    let viewer = args.viewer.or_else(|| DEMONSTRATION_VIEWER.parse().ok());
    serve((shipped.name, &scene), args, viewer, None)
}

/// Runs a scene file.
pub fn scene(args: &RunArgs) -> Result<ExitCode, RuntimeError> {
    let (scene, state) = match (&args.scene, &args.resume) {
        (_, Some(recording)) => {
            let (scene, step, state) = newest(recording)?;
            tracing::info!("goes on after step {step} of {}", recording.display());
            (scene, Some(state))
        }
        (Some(scene), None) => (Scene::load_with(scene, &args.serve.set)?, None),
        // The command line asks for one of the two.
        (None, None) => return demonstration(&args.serve),
    };
    serve((scene.name(), &scene), &args.serve, args.serve.viewer, state.as_deref())
}

/// Builds the scene, starts the server, waits and writes results. Repeats for every scene that a client
/// loads.
fn serve(
    (name, scene): (&str, &Scene),
    args: &ServeArgs,
    viewer: Option<SocketAddr>,
    state: Option<&[u8]>,
) -> Result<ExitCode, RuntimeError> {
    let keys = KeySpace::new(&args.realm, &args.session)?;
    let pace = pace(args, scene.checked().step_s)?;
    // Built before anything is opened, so that a scene with faults leaves nothing behind.
    let mut engine = build(scene, args, state)?;
    if args.record.is_some() {
        engine.record(record_settings(args)?)?;
    }
    let foreground = foreground()?;
    let network = network(args, &keys, &engine)?;
    let mut sessions =
        open_sessions(&network, args.listen.is_empty() && viewer.is_none() && pace.steps.is_some())?;
    // The viewer is of this process and need not pass through the doors for those outside.
    let inside = |endpoint: &String| sessions.as_ref().and_then(|sessions| sessions.doors.inside(endpoint));
    let inside: Vec<String> = network.listen.iter().filter_map(inside).collect();
    let connect = if inside.is_empty() { network.connect.clone() } else { inside };
    let viewer = viewer.map(|address| start_viewer(&foreground, address, (args, connect))).transpose()?;
    let metrics = args.metrics.map(|address| start_metrics(&foreground, address)).transpose()?;
    let listen: &[String] = if sessions.is_some() { &network.listen } else { &[] };
    let rates = scene.checked().publish;
    let mut config = ServerConfig {
        realm: args.realm.clone(),
        session: args.session.clone(),
        pace,
        surface_hz: rates.surface_hz,
        contact_hz: rates.contact_hz,
        stats_hz: rates.stats_hz,
        catalogue: Arc::new(catalogue((name, scene), args)),
        scene: name.to_owned(),
        scene_seq: 0,
        metrics: metrics.clone().map(|(_, metrics)| metrics),
        takes_orders: args.operators != Operators::None,
        give_up,
    };
    // From here on an interrupt ends the run in order; up to here it ended the process.
    let mut signals = {
        let _entered = foreground.enter();
        Signals::listen()?
    };
    loop {
        let started = Instant::now();
        let server = Server::start(engine, sessions, &config)?;
        if config.scene_seq == 0 {
            // Callers may wait for these lines, so they are written once the server answers.
            announce(scene, args, listen, (viewer, metrics.as_ref().map(|&(address, _)| address)));
        }
        let ended = foreground.block_on(wait(&server, args, &config, &mut signals));
        let steps = server.steps();
        if let Ended::Next(next) = ended {
            // Sessions outlive the scene, so clients stay connected while the next one begins.
            sessions = server.release()?.1;
            let Next { name, engine: built } = *next;
            engine = built;
            let rates = engine.simulation().scene().publish;
            let scene_seq = config.scene_seq + 1;
            let (surface_hz, contact_hz, stats_hz) = (rates.surface_hz, rates.contact_hz, rates.stats_hz);
            config = ServerConfig { scene: name, scene_seq, surface_hz, contact_hz, stats_hz, ..config };
            continue;
        }
        let interrupted = matches!(ended, Ended::Interrupted);
        let engine = server.join()?;
        // Browsers may keep connections open; do not wait for them.
        foreground.shutdown_timeout(Duration::from_millis(200));
        // A run of some length that was interrupted has failed, while an endless one ends in no other way.
        let unfinished = interrupted && pace.steps.is_some();
        let failures = conclude(engine, args, interrupted, (steps, started.elapsed()))?;
        return Ok(if unfinished || !failures.is_empty() { ExitCode::from(1) } else { ExitCode::SUCCESS });
    }
}

/// Scenes that clients may change to. It is empty for a run that is asked for as a whole.
fn catalogue((name, scene): (&str, &Scene), args: &ServeArgs) -> Catalogue {
    let whole = args.record.is_some()
        || args.out.is_some()
        || args.steps.is_some()
        || args.seconds.is_some()
        || args.fast;
    if whole { Catalogue::default() } else { Catalogue::beside(name, scene) }
}

fn pace(args: &ServeArgs, step_s: f64) -> Result<Pace, RuntimeError> {
    let steps = match args.seconds {
        None => args.steps,
        Some(seconds) if seconds.is_finite() && seconds > 0.0 => Some((seconds / step_s).ceil() as u64),
        Some(seconds) => {
            return Err(RuntimeError::Option {
                option: "--seconds",
                value: seconds.to_string(),
                reason: "a simulated time must be positive".to_owned(),
                next: "Leave it out to run until Ctrl-C".to_owned(),
            });
        }
    };
    Ok(Pace { fast: args.fast, steps })
}

/// Settings of recordings into the file that was asked for, or into another one.
fn record_settings(args: &ServeArgs) -> Result<RecordSettings, RuntimeError> {
    let checkpoint = Duration::try_from_secs_f64(args.checkpoint_s).ok().filter(|s| !s.is_zero());
    let checkpoint = checkpoint.ok_or_else(|| RuntimeError::Option {
        option: "--checkpoint-s",
        value: args.checkpoint_s.to_string(),
        reason: "a time between two checkpoints must be positive".to_owned(),
        next: "Leave it out for one second".to_owned(),
    })?;
    let file = args.record.clone().unwrap_or_default();
    let (surfaces, threads) = (args.record_surfaces, u32::from(args.threads));
    Ok(RecordSettings { file, checkpoint, surfaces, patient: args.fast, threads })
}

fn build(scene: &Scene, args: &ServeArgs, state: Option<&[u8]>) -> Result<Engine, RuntimeError> {
    let options = BuildOptions { threads: usize::from(args.threads), ..BuildOptions::default() };
    let progress = Share::begin(args.json);
    let mut simulation = Simulation::observed(scene, scene.base_dir(), options, &|at| progress.meshing(at))?;
    progress.end();
    if let Some(state) = state {
        simulation.restore(state).map_err(|error| RuntimeError::Replay { reason: error.to_string() })?;
    }
    if args.json || args.out.is_some() {
        simulation.measure_phases(true);
    }
    let late = pace(args, scene.checked().step_s)?.steps.map(|steps| steps as f64 * simulation.step_s());
    let late = late.map_or(Vec::new(), |end_s| doubts::after_the_end(scene.checked(), end_s));
    for warning in simulation.warnings().iter().chain(&late) {
        tracing::warn!("{warning}");
    }
    let results = args.out.as_deref().map(|directory| Results::begin(directory, scene, &simulation));
    let mut engine = Engine::new(simulation, results.transpose()?)?;
    engine.note_threads(u32::from(args.threads));
    if let Some(folder) = &args.recordings {
        prepare(folder)?;
        engine.let_record(RecordFolder { folder: folder.clone(), settings: record_settings(args)? });
    }
    Ok(engine)
}

fn network(args: &ServeArgs, keys: &KeySpace, engine: &Engine) -> Result<NetworkConfig, RuntimeError> {
    let asked = NetworkConfig {
        listen: args.listen.clone(),
        connect: args.connect.clone(),
        zenoh_file: args.zenoh.clone(),
        access_control: Some(args.operators.access_control(keys)),
        longest_surface: engine.longest_surface(),
    };
    asked.settled()
}

/// Opens the sessions. A batch run without explicit endpoints goes on without network if the port is taken.
fn open_sessions(network: &NetworkConfig, may_do_without: bool) -> Result<Option<Sessions>, RuntimeError> {
    match Sessions::open(network) {
        Ok(sessions) => Ok(Some(sessions)),
        Err(RuntimeError::Listen { endpoints, .. }) if may_do_without => {
            tracing::warn!(
                "{endpoints} is in use, so no client can watch this run; choose another address with --listen"
            );
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

fn foreground() -> Result<Runtime, RuntimeError> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("view")
        .enable_all()
        .build()
        .map_err(|e| RuntimeError::System { what: "starting threads".to_owned(), reason: e.to_string() })
}

/// Starts the viewer, which connects to the server like any other client.
fn start_viewer(
    foreground: &Runtime,
    address: SocketAddr,
    (args, connect): (&ServeArgs, Vec<String>),
) -> Result<SocketAddr, RuntimeError> {
    let mut config = ViewConfig::new(address);
    config.link.realm.clone_from(&args.realm);
    config.link.session.clone_from(&args.session);
    config.link.zenoh_file.clone_from(&args.zenoh);
    config.web.operators = args.operators.of_pages();
    config.link.connect = connect;
    let failed = |e: scindo_view::ViewError| RuntimeError::Viewer {
        address: address.to_string(),
        reason: e.to_string(),
    };
    let viewer = foreground.block_on(Viewer::bind(config)).map_err(failed)?;
    let bound = viewer.address();
    foreground.spawn(async move {
        if let Err(error) = viewer.run().await {
            tracing::error!(%error, "the viewer ended");
        }
    });
    Ok(bound)
}

/// Starts the page of figures, where it was asked for.
fn start_metrics(
    foreground: &Runtime,
    address: SocketAddr,
) -> Result<(SocketAddr, Arc<Metrics>), RuntimeError> {
    let metrics = Arc::<Metrics>::default();
    Ok((metrics::serve::start(foreground, address, metrics.clone())?, metrics))
}

fn announce(
    scene: &Scene,
    args: &ServeArgs,
    listen: &[String],
    (viewer, metrics): (Option<SocketAddr>, Option<SocketAddr>),
) {
    let surfaces: Vec<String> = listen.iter().filter_map(|e| bulk_endpoint(e)).collect();
    let page = viewer.map(|address| format!("http://{address}"));
    let metrics = metrics.map(|address| format!("http://{address}/metrics"));
    if args.json {
        let report = json!({ "started": {
            "scene": scene.name(), "listen": listen, "surfaces": surfaces,
            "realm": args.realm, "session": args.session, "viewer": page,
            "metrics": metrics,
        }});
        say!("{report}");
        return;
    }
    say!("scindo {}: {}", env!("CARGO_PKG_VERSION"), scene.name());
    if !listen.is_empty() {
        say!("  clients  {} (surfaces at {})", listen.join(", "), surfaces.join(", "));
    }
    if let Some(page) = page {
        say!("  viewer   {page}");
    }
    if let Some(metrics) = metrics {
        say!("  metrics  {metrics}");
    }
}

/// How a server ends.
enum Ended {
    /// All steps are done.
    Done,
    /// A user or the system interrupted the run.
    Interrupted,
    /// Another scene takes its place.
    Next(Box<Next>),
}

/// A scene that a client asked for, already built.
struct Next {
    name: String,
    engine: Engine,
}

/// Waits until the simulation ends, is interrupted, or another scene is ready.
async fn wait(server: &Server, args: &ServeArgs, config: &ServerConfig, signals: &mut Signals) -> Ended {
    let progress = Progress::begin("steps", config.pace.steps, args.json);
    let mut look = tokio::time::interval(LOOK);
    let mut building: Option<JoinHandle<Result<Next, RuntimeError>>> = None;
    let ended = loop {
        tokio::select! {
            _ = look.tick() => {
                progress.at(server.steps());
                if server.finished() {
                    break Ended::Done;
                }
                if building.as_ref().is_some_and(JoinHandle::is_finished) && let Some(built) = building.take() {
                    config.catalogue.settled();
                    match built.await.map_err(|_| RuntimeError::Died { thread: "build".to_owned() }).flatten() {
                        Ok(next) => break Ended::Next(Box::new(next)),
                        Err(error) => server.exchange().event(Level::Warning, "scene-not-loaded", error.to_string()),
                    }
                }
                if building.is_none() && let Some((name, scene)) = config.catalogue.asked_for() {
                    let args = args.clone();
                    building = Some(tokio::task::spawn_blocking(move || {
                        Ok(Next { name, engine: build(&scene?, &args, None)? })
                    }));
                }
            }
            () = signals.either() => break Ended::Interrupted,
        }
    };
    progress.end();
    server.stop();
    ended
}

/// Ends a process whose threads do not end. Whatever they hold is lost.
fn give_up(reason: &str) {
    eprintln!("error: {reason}; the process exits without writing results");
    std::process::exit(1);
}

/// Writes results to disk and terminal. Reports why the run failed, if it did.
fn conclude(
    mut engine: Engine,
    args: &ServeArgs,
    interrupted: bool,
    (steps, wall): (u64, Duration),
) -> Result<Vec<String>, RuntimeError> {
    let failures = engine.failures();
    let status = match (interrupted, failures.is_empty()) {
        (true, _) => "interrupted",
        (false, true) => "done",
        (false, false) => "failed",
    };
    engine.finish(status)?;
    let simulation = engine.simulation();
    let troubles = simulation.troubles();
    for trouble in &troubles {
        tracing::warn!("{trouble}");
    }
    let warnings = [simulation.warnings(), &troubles].concat();
    let seconds = wall.as_secs_f64();
    let simulated = steps as f64 * simulation.step_s();
    if args.json {
        let report = json!({ "ended": {
            "status": status, "steps": steps, "simulated_s": simulated, "wall_s": seconds,
            "real_time_factor": simulated / seconds, "cuts_applied": simulation.cuts_applied(),
            "stages_ms": means_ms(simulation.total_seconds().iter(), simulation.steps()),
            "phases_ms": means_ms(simulation.total_phases().iter(), simulation.steps()),
            "warnings": warnings, "failures": failures, "out": args.out,
        }});
        say!("{report}");
        return Ok(failures);
    }
    say!("{status}: {steps} steps, {simulated:.3} s simulated in {seconds:.3} s");
    if let Some(directory) = args.out.as_deref().map(Path::display) {
        say!("  results  {directory}/summary.json, probes.csv, final.vtm");
    }
    for failure in &failures {
        say!("  unreliable: {failure}");
    }
    Ok(failures)
}

/// Mean duration of each part of a step [ms], by name.
fn means_ms(parts: impl Iterator<Item = (&'static str, f64)>, steps: u64) -> Map<String, Value> {
    let mean = |seconds: f64| Value::from(1e3 * seconds / steps.max(1) as f64);
    parts.map(|(name, seconds)| (name.to_owned(), mean(seconds))).collect()
}
