//! The command line, what it builds, and the summary at the end.

use crate::clock::LoopClock;
use crate::constants::{DEFAULT_MAX_FORCE_N, DEFAULT_SLEW_N_S, RAMP_DOWN_NS};
use crate::device::HapticDevice;
use crate::device::path::{Path, PathError, Touch};
use crate::device::simulated::{CAPABILITY, Hand, SimulatedDevice};
use crate::haptic_loop;
use crate::link::{self, HeldTool, ToolRequest};
use crate::recorder::Recorder;
use crate::statistics::{LinkReport, LoopReport};
use crate::tick::{HapticTick, Limits, Ports};
use clap::{Parser, ValueEnum};
use nalgebra::Vector3;
use scindo_client::messages::{ToolShape, tool_shape};
use scindo_client::{Link, LinkConfig, LinkError, Role};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Touch soft tissue on a server with a haptic device, or with a simulated hand.
#[derive(Debug, Parser)]
#[command(name = "scindo-haptic", version)]
pub struct Arguments {
    /// The device.
    #[arg(long, value_enum, default_value_t = DeviceKind::Sim)]
    pub device: DeviceKind,
    /// Tool to hold: one of the scene, or a new one with --shape.
    #[arg(long)]
    pub tool: String,
    /// Endpoint of the server, for example tcp/192.168.1.10:7447; may be repeated. This machine by default.
    #[arg(long, value_name = "EP")]
    pub connect: Vec<String>,
    /// First chunk of every key; one per laboratory.
    #[arg(long, default_value = "scindo")]
    pub realm: String,
    /// Session to join.
    #[arg(long, default_value = "main")]
    pub session: String,
    /// Name of this client in the session; made up by default.
    #[arg(long)]
    pub id: Option<String>,
    /// zenoh configuration (JSON5) to start from.
    #[arg(long, value_name = "FILE")]
    pub zenoh: Option<PathBuf>,
    /// How long to run [s]; until Ctrl-C by default.
    #[arg(long, value_name = "T")]
    pub seconds: Option<f64>,
    /// Write every tick to this CSV file.
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// What the simulated hand does: `press`, `circle`, or a .toml or .csv file of keyframes.
    #[arg(long, default_value = "press")]
    pub path: String,
    /// Play a path file again and again.
    #[arg(long)]
    pub repeat: bool,
    /// Body that `press` and `circle` touch; the first by default.
    #[arg(long)]
    pub body: Option<String>,
    /// Point x,y,z that `press` and `circle` touch [m]; the top of the body by default.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub target: Option<Vector3<f64>>,
    /// Direction x,y,z into the tissue.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, default_value = "0,0,-1", allow_hyphen_values = true)]
    pub direction: Vector3<f64>,
    /// How deep the hand presses [m].
    #[arg(long, default_value_t = 0.008)]
    pub depth: f64,
    /// How far above the surface the hand rests [m].
    #[arg(long, default_value_t = 0.02)]
    pub clearance: f64,
    /// Shape of a tool that the scene does not declare: sphere:RADIUS, capsule:RADIUS:LENGTH or
    /// blade:LENGTH:THICKNESS [m].
    #[arg(long, default_value = "sphere:0.005", value_parser = parse_shape)]
    pub shape: ToolShape,
    /// Hard clamp of the force [N].
    #[arg(long, value_name = "N", default_value_t = DEFAULT_MAX_FORCE_N)]
    pub max_force: f64,
    /// Largest change of force [N/s].
    #[arg(long, value_name = "N_S", default_value_t = DEFAULT_SLEW_N_S)]
    pub slew: f64,
    /// Poses sent per second [Hz].
    #[arg(long, value_name = "HZ", default_value_t = 500.0)]
    pub pose_hz: f64,
    /// Print the summary as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Devices this program can drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DeviceKind {
    /// A simulated hand that follows a path and feels the force.
    Sim,
}

/// Why the program ends early.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// An argument that cannot be used.
    #[error("{what} = {found}: {next}")]
    Argument {
        /// Which.
        what: &'static str,
        /// What stood there.
        found: String,
        /// What to do.
        next: String,
    },
    /// The path of the hand.
    #[error(transparent)]
    Path(#[from] PathError),
    /// The network.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A file or thread.
    #[error("{what}: {source}")]
    Io {
        /// What was tried.
        what: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The whole run passed without one contact message.
    #[error("no contact message arrived for tool '{tool}' in {seconds:.1} s; {hint}")]
    NoContact {
        /// The tool.
        tool: String,
        /// How long.
        seconds: f64,
        /// What to look at.
        hint: &'static str,
    },
}

impl CommandError {
    /// 2: bad input; 1: the thing asked for failed.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Argument { .. }
            | Self::Path(_)
            | Self::Link(LinkError::Config { .. } | LinkError::Key(_)) => 2,
            Self::Link(_) | Self::Io { .. } | Self::NoContact { .. } => 1,
        }
    }
}

/// All figures of a run.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// The tool that was held.
    pub tool: String,
    /// The device that held it.
    pub device: &'static str,
    /// Clamp in force [N].
    pub force_limit_n: f64,
    /// Slew limit in force [N/s].
    pub slew_limit_n_s: f64,
    /// What the loop saw.
    #[serde(rename = "loop")]
    pub loop_: LoopReport,
    /// What the link saw.
    pub link: LinkReport,
    /// Rows in the log file.
    pub log_rows: Option<u64>,
}

/// Runs the client until its time is over, Ctrl-C or SIGTERM.
pub fn run(arguments: &Arguments) -> Result<Summary, CommandError> {
    let limits = check(arguments)?;
    let file_path = path_of_file(arguments)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .thread_name("haptic-net")
        .enable_all()
        .build()
        .map_err(|source| CommandError::Io { what: "start the network threads".into(), source })?;
    let clock = LoopClock::default();
    let (link, held, ports, path) = runtime.block_on(async {
        let link = link::connect(link_config(arguments)).await?;
        let path = match file_path {
            Some(path) => path,
            None => built_in_path(arguments, &link).await?,
        };
        let request = ToolRequest {
            id: arguments.tool.clone(),
            shape: arguments.shape,
            pose_hz: arguments.pose_hz,
            capability: CAPABILITY,
        };
        let (held, ports) = HeldTool::hold(&link, &request, clock).await?;
        Ok::<_, CommandError>((link, held, ports, path))
    })?;
    let log_error = |source| CommandError::Io { what: "write the log".into(), source };
    let (log, recorder) = match &arguments.log {
        Some(file) => Recorder::create(file)
            .map(|(queue, recorder)| (Some(queue), Some(recorder)))
            .map_err(log_error)?,
        None => (None, None),
    };
    let device: Box<dyn HapticDevice> = match arguments.device {
        DeviceKind::Sim => Box::new(SimulatedDevice::new(path, Hand::default())),
    };
    let ports =
        Ports { contacts: ports.contacts, server_alive: ports.server_alive, poses: Some(ports.poses), log };
    let tick = HapticTick::new(device, limits, ports);
    let loop_ = run_loop(tick, clock, stop_on_signal(&runtime), arguments.seconds)?;
    let log_rows = recorder.map(Recorder::finish).transpose().map_err(log_error)?;
    let report = held.finish();
    drop(link);
    if report.contacts == 0 {
        let hint = match report.contacts_refused {
            0 => {
                "is the tool id right, does another client or a script hold it, does the scene switch contact off?"
            }
            _ => "messages came but could not be used: are both programs of the same version?",
        };
        return Err(CommandError::NoContact { tool: arguments.tool.clone(), seconds: loop_.seconds, hint });
    }
    Ok(Summary {
        tool: arguments.tool.clone(),
        device: CAPABILITY.model,
        force_limit_n: limits.max_force_n,
        slew_limit_n_s: limits.slew_n_s,
        loop_,
        link: report,
        log_rows,
    })
}

fn run_loop(
    tick: HapticTick,
    clock: LoopClock,
    stop: Arc<AtomicBool>,
    seconds: Option<f64>,
) -> Result<LoopReport, CommandError> {
    let run = move || haptic_loop::run(tick, clock, &stop, seconds.map(Duration::from_secs_f64));
    std::thread::Builder::new()
        .name("haptic-loop".into())
        .spawn(run)
        .and_then(|thread| thread.join().map_err(|_| std::io::Error::other("the loop panicked")))
        .map_err(|source| CommandError::Io { what: "run the haptic loop".into(), source })
}

/// A flag that Ctrl-C and SIGTERM raise.
fn stop_on_signal(runtime: &tokio::runtime::Runtime) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let shared = stop.clone();
    runtime.spawn(async move {
        let terminate = async {
            match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
                Ok(mut signal) => drop(signal.recv().await),
                Err(_) => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = tokio::signal::ctrl_c() => {}
            () = terminate => {}
        }
        shared.store(true, Ordering::Relaxed);
    });
    stop
}

/// Refuses what cannot work, before anything is opened.
fn check(arguments: &Arguments) -> Result<Limits, CommandError> {
    let fail =
        |what, found: f64, next: String| Err(CommandError::Argument { what, found: found.to_string(), next });
    let Arguments { max_force, slew, pose_hz, depth, clearance, .. } = arguments;
    if !(*max_force > 0.0 && *max_force <= CAPABILITY.max_force_n) {
        return fail(
            "--max-force",
            *max_force,
            format!("allowed is above 0 to {} N", CAPABILITY.max_force_n),
        );
    }
    let least_slew = max_force / (RAMP_DOWN_NS[0] as f64 * 1e-9);
    if !(*slew >= least_slew && *slew <= 1e4) {
        let next = format!("allowed is {least_slew} to 10000 N/s: --max-force must be gone within 0.1 s");
        return fail("--slew", *slew, next);
    }
    if !(1.0..=1000.0).contains(pose_hz) {
        return fail("--pose-hz", *pose_hz, "allowed is 1 to 1000".into());
    }
    for (what, value) in [("--depth", *depth), ("--clearance", *clearance)] {
        if !(value > 0.0 && value < 10.0) {
            return fail(what, value, "give metres, above 0 and below 10".into());
        }
    }
    if let Some(seconds) = arguments.seconds.filter(|s| !(*s > 0.0 && *s <= 1e7)) {
        return fail("--seconds", seconds, "give seconds, above 0".into());
    }
    if arguments.direction.norm() < 1e-9 {
        return fail("--direction", 0.0, "give a direction into the tissue, such as 0,0,-1".into());
    }
    Ok(Limits { max_force_n: *max_force, slew_n_s: *slew })
}

fn link_config(arguments: &Arguments) -> LinkConfig {
    let made_up = || {
        format!("haptic-{}-{:x}", std::process::id(), scindo_client::tool::unix_ns() / 1_000_000 % 0xff_ffff)
    };
    let id = arguments.id.clone().unwrap_or_else(made_up);
    let mut config = LinkConfig::new(Role::Haptic, &id);
    config.realm.clone_from(&arguments.realm);
    config.session.clone_from(&arguments.session);
    config.zenoh_file.clone_from(&arguments.zenoh);
    if !arguments.connect.is_empty() || arguments.zenoh.is_some() {
        config.connect.clone_from(&arguments.connect);
    }
    config
}

/// The path of a file; `None` for a built-in one.
fn path_of_file(arguments: &Arguments) -> Result<Option<Path>, CommandError> {
    match arguments.path.as_str() {
        "press" | "circle" => Ok(None),
        file => Ok(Some(Path::from_file(std::path::Path::new(file), arguments.repeat)?)),
    }
}

async fn built_in_path(arguments: &Arguments, link: &Link) -> Result<Path, CommandError> {
    let direction = arguments.direction.normalize();
    let point_m = match arguments.target {
        Some(point) => point,
        None => {
            let found = link::nearest_surface(link, arguments.body.as_deref(), &direction).await?;
            let missing = || CommandError::Argument {
                what: "--body",
                found: arguments.body.clone().unwrap_or_default(),
                next: "the server has no such body; name another or give --target".into(),
            };
            found.ok_or_else(missing)?.1
        }
    };
    let touch = Touch { point_m, direction, depth_m: arguments.depth, clearance_m: arguments.clearance };
    Ok(if arguments.path == "circle" { Path::circle(&touch) } else { Path::press(&touch) })
}

fn parse_vector(text: &str) -> Result<Vector3<f64>, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, z] if [x, y, z].iter().all(|v| v.is_finite()) => Ok(Vector3::new(x, y, z)),
        _ => Err("expected three numbers: x,y,z".into()),
    }
}

fn parse_shape(text: &str) -> Result<ToolShape, String> {
    let mut parts = text.split(':');
    let kind = parts.next().unwrap_or_default();
    let numbers: Vec<f64> =
        parts.filter_map(|n| n.parse().ok()).filter(|n: &f64| *n > 0.0 && *n <= 10.0).collect();
    let kind = match (kind, &numbers[..]) {
        ("sphere", [radius_m]) => tool_shape::Kind::Sphere(tool_shape::Sphere { radius_m: *radius_m }),
        ("capsule", [radius_m, length_m]) => {
            tool_shape::Kind::Capsule(tool_shape::Capsule { radius_m: *radius_m, length_m: *length_m })
        }
        ("blade", [length_m, thickness_m]) => {
            tool_shape::Kind::Blade(tool_shape::Blade { length_m: *length_m, thickness_m: *thickness_m })
        }
        _ => {
            return Err(
                "expected sphere:RADIUS, capsule:RADIUS:LENGTH or blade:LENGTH:THICKNESS in metres".into()
            );
        }
    };
    Ok(ToolShape { kind: Some(kind) })
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (l, n) = (&self.loop_, &self.link);
        writeln!(f, "tool {} on device {}, {:.1} s", self.tool, self.device, l.seconds)?;
        writeln!(
            f,
            "loop      {:7.1} Hz   late p50 {:.3} ms, p99 {:.3} ms, max {:.1} ms   missed {} of {}",
            l.rate_hz,
            l.lateness_ms.p50,
            l.lateness_ms.p99,
            l.lateness_ms.max,
            l.missed_ticks,
            l.ticks + l.missed_ticks
        )?;
        writeln!(
            f,
            "contact   {:7.1} Hz   lost {}, late {}, refused {}, longest gap {:.0} ms",
            n.contact_rate_hz, n.contacts_lost, n.contacts_late, n.contacts_refused, n.longest_contact_gap_ms
        )?;
        writeln!(
            f,
            "pose to contact      p50 {:.2} ms, p99 {:.2} ms, max {:.0} ms   ({} poses sent)",
            n.round_trip_ms.p50, n.round_trip_ms.p99, n.round_trip_ms.max, n.poses_sent
        )?;
        write!(
            f,
            "force     max {:.2} N (limit {} N), largest step {:.4} N = {:.1} N/s (limit {} N/s), touched {:.1} s, device faults {}",
            l.max_force_n,
            self.force_limit_n,
            l.max_force_step_n,
            l.max_slew_n_s,
            self.slew_limit_n_s,
            l.touch_ticks as f64 * 1e-3,
            l.device_faults
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(more: &[&str]) -> Arguments {
        Arguments::try_parse_from(["scindo-haptic", "--tool", "probe"].iter().chain(more)).unwrap()
    }

    #[test]
    fn defaults_are_usable() {
        let arguments = parse(&[]);
        assert_eq!(check(&arguments).unwrap(), Limits { max_force_n: 2.5, slew_n_s: 50.0 });
        assert_eq!(arguments.direction, -Vector3::z());
        assert!(path_of_file(&arguments).unwrap().is_none());
        assert!(link_config(&arguments).id.starts_with("haptic-"));
    }

    #[test]
    fn bad_arguments_are_refused_with_exit_code_two() {
        let bad = [
            ["--max-force", "0"],
            ["--max-force", "50"],
            ["--slew", "1"],
            ["--pose-hz", "5000"],
            ["--seconds", "-1"],
            ["--depth", "0"],
            ["--direction", "0,0,0"],
        ];
        for pair in bad {
            let pair = [format!("{}={}", pair[0], pair[1])];
            let error = check(&parse(&[&pair[0]])).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{pair:?}");
        }
        let error = path_of_file(&parse(&["--path", "nowhere.csv"])).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("nowhere.csv"));
        for text in ["box:1", "sphere", "sphere:-1", "blade:0.04"] {
            assert!(parse_shape(text).is_err(), "{text}");
        }
        assert!(parse_vector("1,2").is_err() && parse_vector("1,2,nan").is_err());
    }
}
