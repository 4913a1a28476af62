//! What can be asked for, and what cannot work.

use std::path::PathBuf;

use clap::{Args, Parser, ValueEnum};
use nalgebra::Vector3;
use scindo_client::messages::{ToolShape, tool_shape};
use scindo_program::Manual;

use super::error::CommandError;
use crate::constants::{DEFAULT_MAX_FORCE_N, DEFAULT_SLEW_N_S, RAMP_DOWN_NS};
use crate::device::Capability;
use crate::tick::Limits;

/// Touch soft tissue on a server with a haptic device, or with a simulated hand.
#[derive(Debug, Parser)]
#[command(
    name = "scindo-haptic",
    version,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true
)]
pub struct Cli {
    /// What describes the program instead of running it.
    #[command(subcommand)]
    pub manual: Option<Manual>,
    /// What to run.
    #[command(flatten)]
    pub arguments: Option<Arguments>,
}

/// How the client runs.
#[derive(Debug, Args)]
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
    /// Draw force and age of the contact over time into this SVG file when the run ends.
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
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
    /// No figures while it runs: neither the line on a terminal nor a line per second elsewhere.
    #[arg(long, short)]
    pub quiet: bool,
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

/// Refuses what cannot work, before anything is opened.
pub fn check(arguments: &Arguments, device: &Capability) -> Result<Limits, CommandError> {
    let fail =
        |what, found: f64, next: String| Err(CommandError::Argument { what, found: found.to_string(), next });
    let Arguments { max_force, slew, pose_hz, depth, clearance, .. } = arguments;
    if !(*max_force > 0.0 && *max_force <= device.max_force_n) {
        return fail("--max-force", *max_force, format!("allowed is above 0 to {} N", device.max_force_n));
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
    if let Some(file) = arguments.plot.as_ref().filter(|file| file.extension().is_none_or(|e| e != "svg")) {
        let next = "the plot is an SVG file: give a name that ends in .svg".to_owned();
        return Err(CommandError::Argument { what: "--plot", found: file.display().to_string(), next });
    }
    Ok(Limits { max_force_n: *max_force, slew_n_s: *slew })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::simulated::CAPABILITY;

    fn parse(more: &[&str]) -> Arguments {
        let words = ["scindo-haptic", "--tool", "probe"];
        Cli::try_parse_from(words.iter().chain(more)).unwrap().arguments.unwrap()
    }

    #[test]
    fn defaults_are_usable() {
        let arguments = parse(&[]);
        assert_eq!(check(&arguments, &CAPABILITY).unwrap(), Limits { max_force_n: 2.5, slew_n_s: 50.0 });
        assert_eq!(arguments.direction, -Vector3::z());
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
            ["--plot", "force.png"],
        ];
        for pair in bad {
            let pair = format!("{}={}", pair[0], pair[1]);
            let error = check(&parse(&[&pair]), &CAPABILITY).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{pair}");
        }
        for text in ["box:1", "sphere", "sphere:-1", "blade:0.04"] {
            assert!(parse_shape(text).is_err(), "{text}");
        }
        assert!(parse_vector("1,2").is_err() && parse_vector("1,2,nan").is_err());
    }

    #[test]
    fn the_limit_of_force_is_that_of_the_device() {
        let weak = Capability { max_force_n: 1.5, ..CAPABILITY };
        assert!(check(&parse(&["--max-force=1.5"]), &weak).is_ok());
        let error = check(&parse(&["--max-force=2"]), &weak).unwrap_err().to_string();
        assert!(error.contains("1.5 N"), "{error}");
    }

    #[test]
    fn the_tool_is_required_unless_the_program_describes_itself() {
        for words in [&["scindo-haptic"][..], &["scindo-haptic", "--device", "sim"]] {
            assert!(Cli::try_parse_from(words).unwrap_err().to_string().contains("--tool"), "{words:?}");
        }
        let cli = Cli::try_parse_from(["scindo-haptic", "completions", "bash"]).unwrap();
        assert!(cli.manual.is_some() && cli.arguments.is_none());
    }
}
