//! The two zenoh sessions of a server: *haptic* for poses, contacts and cuts, *bulk* for surfaces,
//! reports and rpc, so that a mesh never delays a force.
//!
//! The haptic session listens at the endpoints that were asked for and relays for clients that
//! connect nowhere else; the bulk session listens one port above each of them
//! ([`scindo_proto::endpoint::{DEFAULT_ENDPOINT, bulk_endpoint}`]), which spares those who know of it the relay.

use std::path::{Path, PathBuf};

use scindo_proto::endpoint::{DEFAULT_ENDPOINT, bulk_endpoint};
use zenoh::{Session, Wait as _};

use crate::error::{RuntimeError, words};

/// Where and how a server meets its clients.
#[derive(Debug, Clone, Default)]
pub struct NetworkConfig {
    /// Endpoints at which clients connect.
    pub listen: Vec<String>,
    /// Routers to connect to.
    pub connect: Vec<String>,
    /// A zenoh configuration (JSON5) to start from: TLS, users, access control.
    pub zenoh_file: Option<PathBuf>,
}

impl NetworkConfig {
    /// Settles where to listen: where it was said, else where the zenoh file says, else, without
    /// file or router, at the default endpoint.
    pub fn settled(mut self) -> Result<Self, RuntimeError> {
        if self.listen.is_empty() {
            self.listen = match &self.zenoh_file {
                Some(path) => endpoints_of(&load(path)?),
                None if self.connect.is_empty() => vec![DEFAULT_ENDPOINT.to_owned()],
                None => Vec::new(),
            };
        }
        Ok(self)
    }
}

/// The endpoints at which a configuration says to listen, if it lists them plainly.
fn endpoints_of(config: &zenoh::Config) -> Vec<String> {
    let endpoints = config.get_json("listen/endpoints").unwrap_or_default();
    serde_json::from_str(&endpoints).unwrap_or_default()
}

fn load(path: &Path) -> Result<zenoh::Config, RuntimeError> {
    zenoh::Config::from_file(path).map_err(|e| RuntimeError::Option {
        option: "--zenoh",
        value: path.display().to_string(),
        reason: words(&e),
        next: "An example stands in deploy/open-lab.json5".to_owned(),
    })
}

/// The sessions, haptic and bulk.
pub struct Sessions {
    /// Poses, contacts, cuts, liveliness.
    pub haptic: Session,
    /// Surfaces, tool states, reports, rpc.
    pub bulk: Session,
}

impl Sessions {
    /// Opens both. Fails if an endpoint is taken.
    pub fn open(network: &NetworkConfig) -> Result<Self, RuntimeError> {
        network.listen.iter().try_for_each(|endpoint| check("--listen", endpoint))?;
        network.connect.iter().try_for_each(|endpoint| check("--connect", endpoint))?;
        let bulk_listen: Vec<String> = network.listen.iter().filter_map(|e| bulk_endpoint(e)).collect();
        let relay: Vec<String> = network.listen.iter().filter_map(|e| local(e)).take(1).collect();
        let mode = if network.listen.is_empty() { "peer" } else { "router" };
        let haptic = open(network, mode, &network.listen, &network.connect)?;
        let bulk_connect = if relay.is_empty() { &network.connect } else { &relay };
        let bulk = open(network, "peer", &bulk_listen, bulk_connect)?;
        Ok(Self { haptic, bulk })
    }
}

/// A typing mistake should not be reported as a network failure.
fn check(option: &'static str, endpoint: &str) -> Result<(), RuntimeError> {
    let wrong = |reason: &str| RuntimeError::Option {
        option,
        value: endpoint.to_owned(),
        reason: reason.to_owned(),
        next: "Write it like tcp/0.0.0.0:7447, with two free ports from 1 to 65535".to_owned(),
    };
    let (protocol, address) = endpoint.split_once('/').ok_or_else(|| wrong("no protocol"))?;
    if !matches!(protocol, "tcp" | "tls") {
        return Ok(());
    }
    let address = address.split(['?', '#']).next().unwrap_or(address);
    let port = address.rsplit_once(':').ok_or_else(|| wrong("no port"))?.1;
    match port.parse::<u16>() {
        Ok(1..=65534) => Ok(()),
        _ => Err(wrong("no such port, or no port above it for surfaces")),
    }
}

fn open(
    network: &NetworkConfig,
    mode: &str,
    listen: &[String],
    connect: &[String],
) -> Result<Session, RuntimeError> {
    let invalid = |what: String| move |e: zenoh::Error| RuntimeError::Zenoh { what, reason: words(&e) };
    let mut config = match &network.zenoh_file {
        Some(path) => load(path)?,
        None => zenoh::Config::default(),
    };
    let mut settings = vec![("mode", format!("{mode:?}"))];
    let from_file = network.zenoh_file.is_some();
    if !from_file || !listen.is_empty() {
        settings.push(("listen/endpoints", list(listen)));
    }
    if !from_file || !connect.is_empty() {
        settings.push(("connect/endpoints", list(connect)));
    }
    if !from_file {
        // Deterministic: only what was named, no discovery.
        settings.extend(
            [
                ("scouting/multicast/enabled", "false"),
                ("scouting/gossip/enabled", "false"),
                ("scouting/delay", "50"),
                ("connect/retry", "{period_init_ms:50,period_max_ms:1000,period_increase_factor:2}"),
            ]
            .map(|(key, value)| (key, value.to_owned())),
        );
    }
    for (key, value) in settings {
        config.insert_json5(key, &value).map_err(invalid(format!("{key} = {value}")))?;
    }
    zenoh::open(config).wait().map_err(|e| {
        let reason = words(&e);
        if listen.is_empty() {
            RuntimeError::Zenoh { what: format!("connecting to {}", connect.join(", ")), reason }
        } else {
            RuntimeError::Listen { endpoints: listen.join(", "), reason }
        }
    })
}

fn list(endpoints: &[String]) -> String {
    let quoted: Vec<String> = endpoints.iter().map(|e| format!("{e:?}")).collect();
    format!("[{}]", quoted.join(","))
}

/// How this process reaches its own endpoint; only plain TCP needs no certificate.
pub fn local(endpoint: &str) -> Option<String> {
    let address = endpoint.strip_prefix("tcp/")?;
    let (host, port) = address.rsplit_once(':')?;
    let host = match host {
        "0.0.0.0" => "127.0.0.1",
        "[::]" => "[::1]",
        host => host,
    };
    Some(format!("tcp/{host}:{port}"))
}
