//! Runs the client from its command line to its summary.

mod arguments;

mod error;

mod summary;

use crate::clock::LoopClock;
use crate::device::HapticDevice;
use crate::device::haply::HaplyDevice;
use crate::device::path::{Path, Touch};
use crate::device::simulated::{self, Hand, SimulatedDevice};
use crate::haptic_loop;
use crate::link::{self, HeldTool, ToolRequest};
use crate::live::{Live, Meter};
use crate::log::force_plot::{self, Trace};
use crate::log::recorder::{LogQueue, Recorder};
use crate::statistics::LoopReport;
use crate::tick::{HapticTick, Ports};
use nalgebra::Vector3;
use scindo_client::{Link, LinkConfig, Role};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub use arguments::{Arguments, Cli, DeviceKind};
pub use error::CommandError;
pub use summary::Summary;

use arguments::check;

/// Runs the client until its time is over, or until Ctrl-C or SIGTERM.
pub fn run(arguments: &Arguments) -> Result<Summary, CommandError> {
    let capability = arguments.device.capability().unwrap_or(simulated::CAPABILITY);
    let limits = check(arguments, &capability)?;
    let file_path = path_of_file(arguments)?;
    let (log, recorder) = recorder(arguments)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .thread_name("haptic-net")
        .enable_all()
        .build()
        .map_err(|source| CommandError::Io { what: "start the network threads".into(), source })?;
    let clock = LoopClock::default();
    let (link, held, ports, device) = runtime.block_on(async {
        let link = link::connect(link_config(arguments)).await?;
        link::tell_of_script(&link, arguments.tool()).await?;
        let device = device(arguments, &link, file_path).await?;
        let request = ToolRequest {
            id: arguments.tool().to_owned(),
            shape: arguments.shape,
            pose_hz: arguments.pose_hz,
            deadband: arguments.deadband(),
            capability,
        };
        let (held, ports) = HeldTool::hold(&link, &request, clock).await?;
        Ok::<_, CommandError>((link, held, ports, device))
    })?;
    let meter = Arc::new(Meter::default());
    let ports = Ports {
        contacts: ports.contacts,
        server_alive: ports.server_alive,
        poses: Some(ports.poses),
        log,
        meter: Some(meter.clone()),
    };
    let tick = HapticTick::new(device, limits, ports);
    let live = (!arguments.quiet).then(|| Live::start(meter, held.contact_count())).transpose();
    let live = live.map_err(|source| CommandError::Io { what: "start the live figures".into(), source })?;
    let loop_ = run_loop(tick, clock, stop_on_signal(&runtime), arguments.seconds);
    live.into_iter().for_each(Live::end);
    let loop_ = loop_?;
    let log_rows = conclude_recording(arguments, recorder, limits.max_force_n)?;
    let report = held.finish();
    drop(link);
    if report.contacts == 0 {
        return Err(no_contact(arguments, loop_.seconds, report.contacts_refused));
    }
    Ok(Summary {
        tool: arguments.tool().to_owned(),
        device: capability.model,
        force_limit_n: limits.max_force_n,
        slew_limit_n_s: limits.slew_n_s,
        loop_,
        link: report,
        log_rows,
    })
}

/// Opens the device of the command line.
async fn device(
    arguments: &Arguments,
    link: &Link,
    file_path: Option<Path>,
) -> Result<Box<dyn HapticDevice>, CommandError> {
    if let DeviceKind::Haply(address) = &arguments.device {
        let Touch { point_m, direction, clearance_m, .. } = touch(arguments, link).await?;
        let up = link.info().await?.up.map_or(Vector3::z(), |up| Vector3::new(up.x, up.y, up.z));
        let start_m = point_m - clearance_m * direction;
        let device = HaplyDevice::start(address.clone(), start_m, &up)
            .map_err(|source| CommandError::Io { what: "start the exchange with Haply".into(), source })?;
        return Ok(Box::new(device));
    }
    let path = match file_path {
        Some(path) => path,
        None => {
            let touch = touch(arguments, link).await?;
            if arguments.path == "circle" { Path::circle(&touch) } else { Path::press(&touch) }
        }
    };
    Ok(Box::new(SimulatedDevice::new(path, Hand::default())))
}

/// Creates the output files. A file that cannot be written is refused before the tool is held.
fn recorder(arguments: &Arguments) -> Result<(Option<LogQueue>, Option<Recorder>), CommandError> {
    if let Some(file) = &arguments.plot {
        std::fs::File::create(file).map_err(at(file))?;
    }
    if arguments.log.is_none() && arguments.plot.is_none() {
        return Ok((None, None));
    }
    let trace = arguments.plot.is_some().then(Trace::default);
    let (queue, recorder) = Recorder::create(arguments.log.as_deref(), trace)
        .map_err(at(arguments.log.as_deref().unwrap_or(std::path::Path::new("the log"))))?;
    Ok((Some(queue), Some(recorder)))
}

/// Waits for the last row, draws the plot and returns the number of rows in the log.
fn conclude_recording(
    arguments: &Arguments,
    recorder: Option<Recorder>,
    limit_n: f64,
) -> Result<Option<u64>, CommandError> {
    let Some(recorder) = recorder else { return Ok(None) };
    let log_error = |source| CommandError::Io { what: "write the log".into(), source };
    let (rows, trace) = recorder.finish().map_err(log_error)?;
    if let (Some(file), Some(trace)) = (&arguments.plot, trace) {
        force_plot::draw(file, &trace, limit_n).map_err(at(file))?;
    }
    Ok(arguments.log.is_some().then_some(rows))
}

fn at(file: &std::path::Path) -> impl Fn(std::io::Error) -> CommandError + use<> {
    let what = format!("write {}", file.display());
    move |source| CommandError::Io { what: what.clone(), source }
}

fn no_contact(arguments: &Arguments, seconds: f64, refused: u64) -> CommandError {
    let hint = match refused {
        0 => {
            "check the tool id, whether another client holds the tool, and whether the scene switches contact off"
        }
        _ => "messages arrived but could not be read; check that both programs have the same version",
    };
    CommandError::NoContact { tool: arguments.tool().to_owned(), seconds, hint }
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

fn link_config(arguments: &Arguments) -> LinkConfig {
    let made_up = || {
        format!("haptic-{}-{:x}", std::process::id(), scindo_client::tool::unix_ns() / 1_000_000 % 0xff_ffff)
    };
    let id = arguments.id.clone().unwrap_or_else(made_up);
    let mut config = LinkConfig::new(Role::Haptic, &id);
    config.realm.clone_from(&arguments.realm);
    config.session.clone_from(&arguments.session);
    config.person.clone_from(&arguments.name);
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

/// What `press` and `circle` touch, and above which a real hand starts.
async fn touch(arguments: &Arguments, link: &Link) -> Result<Touch, CommandError> {
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
    Ok(Touch { point_m, direction, depth_m: arguments.depth, clearance_m: arguments.clearance })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_built_in_path_needs_no_file_and_a_missing_file_is_named() {
        let parse = |more: &[&str]| {
            let words = ["scindo-haptic", "--tool", "probe"];
            Cli::read(words.iter().chain(more)).unwrap().arguments.unwrap()
        };
        assert!(path_of_file(&parse(&[])).unwrap().is_none());
        assert!(link_config(&parse(&[])).id.starts_with("haptic-"));
        let error = path_of_file(&parse(&["--path", "nowhere.csv"])).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("nowhere.csv"));
    }
}
