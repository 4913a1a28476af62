//! The command line: what can be asked for.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use scindo_program::Manual;

use crate::wire::orders::Operators;

/// Deforms and cuts soft bodies in real time and serves them over the network.
///
/// Without a command, it runs the built-in demonstration at http://127.0.0.1:8080. Exit codes: 0 success, 1
/// failure, 2 bad input.
#[derive(Debug, Parser)]
#[command(name = "scindo", version = scindo_program::VERSION, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// Command to run. Without one, the demonstration runs.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// How the demonstration is served.
    #[command(flatten)]
    pub demonstration: ServeArgs,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a scene and serve it to viewers and haptic clients.
    Run(Box<RunArgs>),
    /// Run a scene that comes with the program and serve the page at http://127.0.0.1:8080.
    Demo(Box<DemoArgs>),
    /// Compute a recording again, and compare it bit for bit.
    Replay(ReplayArgs),
    /// Write a recording as VTK series, glTF or CSV.
    Export(ExportArgs),
    /// Check a scene for errors and doubtful values, and forecast convergence, motion and time per step.
    Check(CheckArgs),
    /// Make a tetrahedral mesh from a surface or volume file.
    Mesh(MeshArgs),
    /// The commands of `scindo-papers`.
    #[command(flatten)]
    Papers(Papers),
    /// Measure what each effect of a scene costs by stepping the scene with it and without it.
    Effects(EffectsArgs),
    /// Set up a laboratory with certificates, and admit clients to it.
    Certs(CertsArgs),
    /// Pass messages on between servers and clients: one door for several laboratories, or for many viewers.
    Router(RouterArgs),
    /// Say what works on this machine and what does not: network, certificates, devices, limits, room.
    Doctor(DoctorArgs),
    /// Show what a running server does: time of a step, bodies, tools, clients, refused messages.
    Top(TopArgs),
    /// Completions and man pages.
    #[command(flatten)]
    Manual(Manual),
}

/// The commands that the program `scindo-papers` runs. Of `accuracy`, it runs what has a name.
#[derive(Debug, Subcommand)]
pub enum Papers {
    /// Measure accuracy against time over laws, elements, meshes, steps and solvers, for reference cases or a
    /// scene.
    Accuracy(AccuracyArgs),
    /// Run hard cases for deformation and cutting, and write a page of their results.
    Stress(StressArgs),
    /// Measure what a hand feels over a link, against the same tissue solved at 1 kHz, and write a page.
    Haptics(HapticsArgs),
    /// Try to break the promises of server and haptic client in a simulated network, and print the promises.
    Reliability(ReliabilityArgs),
    /// Run all studies and write one site: every number that the papers print beside the one measured here, hard
    /// cases, what a hand feels, what effects cost.
    Book(BookArgs),
}

impl Papers {
    /// Whether the report is for programs.
    pub fn is_json(&self) -> bool {
        match self {
            Self::Accuracy(args) => args.json,
            Self::Stress(args) => args.json,
            Self::Haptics(args) => args.json,
            Self::Reliability(args) => args.json,
            Self::Book(args) => args.json,
        }
    }

    /// The name of the command.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Accuracy(_) => "accuracy",
            Self::Stress(_) => "stress",
            Self::Haptics(_) => "haptics",
            Self::Reliability(_) => "reliability",
            Self::Book(_) => "book",
        }
    }
}

/// `scindo run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Scene file, TOML or JSON.
    #[arg(required_unless_present = "resume")]
    pub scene: Option<PathBuf>,
    /// Go on from the last checkpoint of a recording instead, with its scene.
    #[arg(long, value_name = "FILE.mcap", conflicts_with_all = ["scene", "set"])]
    pub resume: Option<PathBuf>,
    #[command(flatten)]
    /// How it is served.
    pub serve: ServeArgs,
}

/// `scindo replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Recording.
    pub file: PathBuf,
    /// Compare the state after every step with the recorded one; exit code 1 if one differs.
    #[arg(long)]
    pub verify: bool,
    /// Begin at the newest checkpoint before this much simulated time of the recording [s].
    #[arg(long, value_name = "S")]
    pub from: Option<f64>,
    /// Threads per step; results do not depend on their number.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: u16,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo export`.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("to").required(true).multiple(true).args(["vtu", "gltf", "csv"])))]
pub struct ExportArgs {
    /// Recording.
    pub file: PathBuf,
    /// Write the material and the surface of all bodies as a ParaView series into this directory.
    #[arg(long, value_name = "DIR")]
    pub vtu: Option<PathBuf>,
    /// Write the surfaces as a glTF scene that moves, in at most 50 key frames.
    #[arg(long, value_name = "FILE.glb")]
    pub gltf: Option<PathBuf>,
    /// Write poses of tools and forces on them, one line per step and tool.
    #[arg(long, value_name = "FILE.csv")]
    pub csv: Option<PathBuf>,
    /// Simulated time from one frame of --vtu to the next [s].
    #[arg(long, value_name = "S", default_value_t = 0.1)]
    pub every: f64,
    /// Threads per step; results do not depend on their number.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: u16,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Name of the scene.
    #[arg(default_value = scindo_world::scene::DEMONSTRATION)]
    pub name: String,
    /// Print the scenes instead of running one.
    #[arg(long)]
    pub list: bool,
    #[command(flatten)]
    /// How it is served.
    pub serve: ServeArgs,
}

/// How a scene is run and served.
#[derive(Debug, Clone, Args)]
pub struct ServeArgs {
    /// Run as fast as possible instead of in real time.
    #[arg(long)]
    pub fast: bool,
    /// End after this many steps.
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    pub steps: Option<u64>,
    /// End after this much simulated time [s].
    #[arg(long, value_name = "T")]
    pub seconds: Option<f64>,
    /// Write summary.json, probes.csv and final.vtm into this directory.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Record inputs, events, forces, hashes and checkpoints into a new file, for `scindo replay` and `export`.
    #[arg(long, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,
    /// Let operators begin and end recordings into this folder, from the page or by rpc/record.
    #[arg(long, value_name = "FOLDER", conflicts_with = "record")]
    pub recordings: Option<PathBuf>,
    /// Time between two checkpoints of a recording [s]; large scenes take longer.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    pub checkpoint_s: f64,
    /// Record the surfaces of all bodies as well, in every step.
    #[arg(long)]
    pub record_surfaces: bool,
    /// First chunk of every network key; one per laboratory.
    #[arg(long, default_value = "scindo")]
    pub realm: String,
    /// Session within the realm.
    #[arg(long, default_value = "main")]
    pub session: String,
    /// Address for clients, such as tcp/0.0.0.0:7447; surfaces use the next port [default: that of --zenoh,
    /// nothing with --connect, else tcp/127.0.0.1:7447].
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Zenoh router to connect to.
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// Zenoh configuration file to start from, for certificates, users and access control.
    #[arg(long, value_name = "FILE.json5")]
    pub zenoh: Option<PathBuf>,
    /// Threads per step; results do not depend on their number.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: u16,
    /// Serve the browser page at this address: PORT, HOST or HOST:PORT. 8080 is 127.0.0.1:8080.
    #[arg(long, value_name = "ADDRESS", value_parser = scindo_view::listen_address)]
    pub viewer: Option<SocketAddr>,
    /// Serve figures for Prometheus at this address, below /metrics: PORT, HOST or HOST:PORT. 9464 is 127.0.0.1:9464.
    #[arg(long, value_name = "ADDRESS", value_parser = scindo_view::listen_address)]
    pub metrics: Option<SocketAddr>,
    /// Who may pause, step, reset and change parameters, over the network and in pages. All clients may watch
    /// and touch.
    #[arg(long, value_enum, value_name = "WHO", default_value = "loopback")]
    pub operators: Operators,
    /// Override a key of the scene, such as body.liver.young_pa=5e3. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Report as JSON, one object per line.
    #[arg(long)]
    pub json: bool,
}

/// `scindo check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Scene file, TOML or JSON.
    #[arg(required_unless_present = "schema")]
    pub scene: Option<PathBuf>,
    /// Print the JSON Schema of scene files instead.
    #[arg(long, conflicts_with = "scene")]
    pub schema: bool,
    /// Check only the scene file and its meshes; make no steps and no forecast.
    #[arg(long)]
    pub no_solve: bool,
    /// Forecast a run of this many steps. By default, the forecast ends when the scene comes to rest.
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    pub steps: Option<u64>,
    /// Forecast a run of this much simulated time [s].
    #[arg(long, value_name = "T")]
    pub seconds: Option<f64>,
    /// Override a key of the scene, such as body.liver.young_pa=5e3. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo mesh`.
#[derive(Debug, Args)]
pub struct MeshArgs {
    /// Input file: a surface (.obj, .stl, .ply) or a volume mesh (.msh, .vtk, .vtu).
    pub input: PathBuf,
    /// Output file for the tetrahedra: .vtu, .vtk or .msh.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Lattice cells along the longest side of a surface.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(2..=256))]
    pub cells: u32,
    /// Factor from the file's length unit to metres: 0.001 for millimetres.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    pub scale: f64,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo accuracy`.
#[derive(Debug, Args)]
pub struct AccuracyArgs {
    /// Cases (r1, r2-tc1, bar-rest, bar-motion; bar is both; cut-tc1, cut-tc2force and cut-tc2strip compare
    /// methods of cutting; cutting is all three), experiments on octree cells and multigrid (dick-tables,
    /// dick-convergence, dick-solvers, dick-layer, dick-sizes; dick is all of them; cells-cube,
    /// cells-elements, cells-levels, cells-skin; cells is all of these), on methods of collision detection (collision), on
    /// relaxation (nienhuys), on cuts along faces (nienhuys-cut), on the convergence of cut meshes (schoch), on ways to cut
    /// (slits), on fronts of cuts (front), on what enriched elements cost (enriched), on a falling slice (slice), on
    /// masses and springs (springs), on other simulators (peers), on threads (threads), and scene files.
    #[arg(value_name = "CASE|SCENE", default_values = ["r1", "r2-tc1", "bar"])]
    pub cases: Vec<String>,
    /// Recommend a configuration that fits into this time, per static solution or per frame of a motion.
    #[arg(long, value_name = "X")]
    pub budget_ms: Option<f64>,
    /// Directory for index.html, points.csv and study.json. An interrupted study resumes there.
    #[arg(long, value_name = "DIR", default_value = "accuracy")]
    pub out: PathBuf,
    /// Use only coarse meshes and short motions; takes less than a minute.
    #[arg(long)]
    pub quick: bool,
    /// Time limit of the whole study, its reference included, such as 90s, 2m or 1h30m [default: 5m for a
    /// scene, 40s with --quick, none for built-in cases].
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub within: Option<Duration>,
    /// Simulated time for scenes in motion [s].
    #[arg(long, value_name = "T")]
    pub seconds: Option<f64>,
    /// Only these laws, such as linear,corotational.
    #[arg(long, value_name = "LAW", value_delimiter = ',')]
    pub law: Vec<String>,
    /// Only these elements, such as tet4,hex8.
    #[arg(long, value_name = "ELEMENT", value_delimiter = ',')]
    pub element: Vec<String>,
    /// Only these integrators.
    #[arg(long, value_name = "INTEGRATOR", value_delimiter = ',')]
    pub integrator: Vec<String>,
    /// Only these solvers.
    #[arg(long, value_name = "METHOD", value_delimiter = ',')]
    pub solver: Vec<String>,
    /// Only these numbers of threads.
    #[arg(long, value_name = "N", value_delimiter = ',')]
    pub threads: Vec<String>,
    /// Meshes of a block, given as cells along its longest side.
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub cells: Vec<u32>,
    /// Surface of a solid for dick-tables, in place of the built-in one.
    #[arg(long, value_name = "FILE")]
    pub surface: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// A duration of at least a second.
fn duration(text: &str) -> Result<Duration, String> {
    let least = Duration::from_secs(1);
    match humantime::parse_duration(text) {
        Ok(duration) if duration >= least => Ok(duration),
        Ok(_) => Err("must be at least 1s".to_owned()),
        Err(error) => Err(format!("{error}; write for example 90s, 2m or 1h30m")),
    }
}

/// `scindo stress`.
#[derive(Debug, Args)]
pub struct StressArgs {
    /// Run only this case, given by name or number. May be repeated.
    #[arg(long = "case", value_name = "NAME")]
    pub cases: Vec<String>,
    /// Print the cases instead of running them.
    #[arg(long)]
    pub list: bool,
    /// Run the long form of cases that have one, such as 1000 cycles in place of 12.
    #[arg(long)]
    pub long: bool,
    /// Disable parts of the method in turn and check that the cases fail. Takes about five times as long.
    #[arg(long)]
    pub mutations: bool,
    /// Directory for index.html and stress.json.
    #[arg(long, value_name = "DIR", default_value = "stress")]
    pub out: PathBuf,
    /// Number of cases that run in parallel; 0 is one per hardware thread. Results do not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: u16,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo book`.
#[derive(Debug, Args)]
pub struct BookArgs {
    /// Use small bodies and short runs; takes about ten minutes on two cores, the whole book hours.
    #[arg(long)]
    pub quick: bool,
    /// Directory of the site, whose first page is index.html. Parts that are finished in it are taken over.
    #[arg(long, value_name = "DIR", default_value = "book")]
    pub out: PathBuf,
    /// Run only these parts, and write the pages with what is there. May be repeated; `--list` names all.
    #[arg(long = "part", value_name = "NAME")]
    pub parts: Vec<String>,
    /// Print the parts instead of running them.
    #[arg(long)]
    pub list: bool,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo haptics`.
#[derive(Debug, Args)]
pub struct HapticsArgs {
    /// Use only one hand and three delays; takes seconds.
    #[arg(long)]
    pub quick: bool,
    /// Directory for index.html, haptics.json and ticks.csv.
    #[arg(long, value_name = "DIR", default_value = "haptics")]
    pub out: PathBuf,
    /// Number of cells that run in parallel. Results do not depend on it.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: u16,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo reliability`.
#[derive(Debug, Args)]
pub struct ReliabilityArgs {
    /// Number of seeds; each is four simulated seconds of two hands, a liar and a server. By default 1000, or as many
    /// as fit into --minutes.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    pub seeds: Option<u64>,
    /// Time after which no seed begins any more [minutes].
    #[arg(long, value_name = "T", value_parser = minutes)]
    pub minutes: Option<f64>,
    /// First seed. A seed repeats itself on every machine of one kind, on any number of threads.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub first: u64,
    /// Also this many ticks of hands under made-up contacts, rounded up to whole seeds of 20000.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000_000))]
    pub drill_ticks: u64,
    /// Also take out one safeguard after the other, and show that the rules notice it.
    #[arg(long)]
    pub mutants: bool,
    /// Also write the promises and the figures as a page in Markdown.
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
    /// Number of seeds that run in parallel.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub threads: u16,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

fn minutes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(minutes) if minutes > 0.0 && minutes <= 1e5 => Ok(minutes),
        _ => Err("expected minutes above 0 and at most 100000, such as 0.5".to_owned()),
    }
}

/// `scindo router`.
#[derive(Debug, Args)]
pub struct RouterArgs {
    /// Zenoh configuration file, such as the `router.json5` that `scindo certs` makes for a house.
    #[arg(long, value_name = "FILE.json5")]
    pub zenoh: Option<PathBuf>,
    /// Address at which servers, clients and other routers connect. May be repeated.
    #[arg(long, value_name = "ENDPOINT", required = true)]
    pub listen: Vec<String>,
    /// Server or router to connect to. May be repeated.
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// Longest message that is passed on [MiB]; surfaces are the longest.
    #[arg(long, value_name = "MIB", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub longest_message: u32,
    /// Most connections at a time.
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub connections: u32,
}

/// `scindo certs`.
#[derive(Debug, Args)]
pub struct CertsArgs {
    /// Folder of the laboratory. In the folder of a house, the laboratory belongs to the house.
    pub dir: PathBuf,
    /// Set up a house instead, which joins laboratories by a router: its name.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["lab", "server", "client"])]
    pub house: Option<String>,
    /// Host name or address at which the router of a new house is reached. May be repeated.
    #[arg(long, value_name = "HOST", requires = "house")]
    pub router: Vec<String>,
    /// Guest of a house, who watches several laboratories: its id and their realms. May be repeated.
    #[arg(long, value_name = "ID=REALM,…", value_parser = crate::lab::roles::parse_guest, conflicts_with_all = ["lab", "server", "client"])]
    pub guest: Vec<(String, std::collections::BTreeSet<String>)>,
    /// Name of a new laboratory.
    #[arg(long, value_name = "NAME")]
    pub lab: Option<String>,
    /// Host name or address at which clients reach the server of a new laboratory. May be repeated.
    #[arg(long, value_name = "HOST")]
    pub server: Vec<String>,
    /// Client to admit: its id and viewer, haptic, operator or teacher. May be repeated.
    #[arg(long, value_name = "ID=ROLE", value_parser = crate::lab::roles::parse_client)]
    pub client: Vec<(String, crate::lab::roles::LabRole)>,
    /// Days for which new certificates are valid.
    #[arg(long, value_name = "N", default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=3650))]
    pub days: u32,
    /// First chunk of every network key of a new laboratory [default: scindo; in a house the name of the laboratory].
    #[arg(long)]
    pub realm: Option<String>,
    /// Session within the realm.
    #[arg(long, default_value = "main")]
    pub session: String,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo doctor`.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// Zenoh configuration file of a server or client; its certificates and keys are looked at.
    #[arg(long, value_name = "FILE.json5")]
    pub zenoh: Option<PathBuf>,
    /// Address at which a server would listen. May be repeated [default: as `scindo run` has it].
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Router or server that should answer. May be repeated.
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// Address at which a page would be served: PORT, HOST or HOST:PORT.
    #[arg(long, value_name = "ADDRESS", value_parser = scindo_view::listen_address)]
    pub viewer: Option<SocketAddr>,
    /// Folder for recordings, whose free room is looked at.
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub record: PathBuf,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}

/// `scindo top`.
#[derive(Debug, Args)]
pub struct TopArgs {
    /// Server or router. May be repeated: they are tried in turn [default: tcp/127.0.0.1:7447].
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// First chunk of every network key; one per laboratory.
    #[arg(long, default_value = "scindo")]
    pub realm: String,
    /// Session within the realm.
    #[arg(long, default_value = "main")]
    pub session: String,
    /// Name of this client, as its certificate has it [default: top and a number].
    #[arg(long)]
    pub id: Option<String>,
    /// Zenoh configuration file to start from, with the certificate of this client.
    #[arg(long, value_name = "FILE.json5")]
    pub zenoh: Option<PathBuf>,
    /// Print one report and end; no terminal is needed.
    #[arg(long)]
    pub once: bool,
    /// Print every report as JSON, one object per line.
    #[arg(long)]
    pub json: bool,
}

/// `scindo effects`.
#[derive(Debug, Args)]
pub struct EffectsArgs {
    /// Scene file, TOML or JSON.
    pub scene: PathBuf,
    /// Steps from the start of the scene, made anew for each effect.
    #[arg(long, value_name = "N", default_value_t = 100,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(scindo_study::study::effects::MOST_STEPS)))]
    pub steps: u32,
    /// Override a key of the scene, such as body.liver.young_pa=5e3. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Report as JSON.
    #[arg(long)]
    pub json: bool,
}
