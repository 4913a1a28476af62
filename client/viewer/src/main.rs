//! `scindo-view`: the browser viewer as a separate program, for any machine that reaches a server.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use scindo_program::Manual;
use scindo_view::{Operators, ViewConfig, Viewer, page_is_built};

/// Shows a running scindo session in a browser.
#[derive(Debug, Parser)]
#[command(name = "scindo-view", version = scindo_program::VERSION, args_conflicts_with_subcommands = true)]
struct Args {
    #[command(subcommand)]
    manual: Option<Manual>,
    /// Zenoh endpoint of the server, for example tcp/192.168.1.10:7447; may be given several times
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// Address for browsers: PORT, HOST or HOST:PORT; 8080 is 127.0.0.1:8080, and port 0 chooses a free one
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", value_parser = scindo_view::listen_address)]
    listen: SocketAddr,
    /// First chunk of every network key; one per laboratory
    #[arg(long, default_value = "scindo")]
    realm: String,
    /// Session within the realm
    #[arg(long, default_value = "main")]
    session: String,
    /// Id of this viewer on the network; the tools of its pages are named after it. By default a random one
    #[arg(long)]
    id: Option<String>,
    /// Zenoh configuration to start from (certificates, users, routers)
    #[arg(long, value_name = "FILE")]
    zenoh: Option<PathBuf>,
    /// Pages of another origin that may connect, for example http://lab:8080; may be given several times
    #[arg(long, value_name = "ORIGIN")]
    allow_origin: Vec<String>,
    /// Maximum number of connected browsers
    #[arg(long, default_value_t = 32)]
    max_browsers: usize,
    /// Let pages watch, but not touch, cut or pause
    #[arg(long)]
    read_only: bool,
    /// Which pages may pause, step, reset and change parameters; the server has an option of the same name
    #[arg(long, value_enum, default_value = "loopback")]
    operators: Operators,
    /// Serve the page from this folder, for work on the page itself
    #[arg(long, value_name = "DIR", hide = true)]
    page: Option<PathBuf>,
    /// Print the address as one JSON line instead of text
    #[arg(long)]
    json: bool,
}

#[tokio::main]
async fn main() -> ExitCode {
    scindo_program::start_log("scindo=info,scindo_view=info,warn");
    let args = Args::parse();
    if let Some(manual) = &args.manual {
        return match manual.run::<Args>() {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("scindo-view: {error}");
                ExitCode::FAILURE
            }
        };
    }
    match run(args).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("scindo-view: {error:#}");
            ExitCode::FAILURE
        }
    }
}

async fn run(args: Args) -> anyhow::Result<()> {
    let json = args.json;
    let config = config(args);
    let upstream = config.link.connect.join(", ");
    let viewer = Viewer::bind(config).await?;
    let url = format!("http://{}", viewer.address());
    if json {
        println!("{}", serde_json::json!({ "url": url, "upstream": upstream, "page": page_is_built() }));
    } else {
        println!("{url}  (server: {upstream})");
        if !page_is_built() {
            println!("The page was not built; open the address to see what to install.");
        }
    }
    tokio::select! {
        ended = viewer.run() => Ok(ended?),
        stopped = tokio::signal::ctrl_c() => Ok(stopped?),
    }
}

fn config(args: Args) -> ViewConfig {
    let mut config = ViewConfig::new(args.listen);
    if !args.connect.is_empty() {
        config.link.connect = args.connect;
    }
    config.link.realm = args.realm;
    config.link.session = args.session;
    config.link.zenoh_file = args.zenoh;
    if let Some(id) = args.id {
        config.link.id = id;
    }
    config.web.allow_origins = args.allow_origin;
    config.web.max_browsers = args.max_browsers;
    config.web.operators = args.operators;
    config.web.read_only = args.read_only;
    config.web.page_folder = args.page;
    config
}
