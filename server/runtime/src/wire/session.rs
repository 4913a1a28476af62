//! The two zenoh sessions of a server. *Haptic* carries poses, contacts and cuts; *bulk* carries surfaces,
//! reports and rpc. A mesh therefore never delays a force.
//!
//! The haptic session listens at the requested endpoints and relays for clients that connect nowhere else.
//! The bulk session listens one port above each of them ([`scindo_proto::endpoint::{DEFAULT_ENDPOINT,
//! bulk_endpoint}`]). Clients that connect there as well need no relay. Plain TCP endpoints have a door in front of them
//! ([`crate::wire::door`]), unless a zenoh file has rules of its own or lets the server be discovered.

use std::path::{Path, PathBuf};

use scindo_proto::endpoint::{DEFAULT_ENDPOINT, bulk_endpoint};
use zenoh::config::ZenohId;
use zenoh::{Session, Wait as _};

use super::orders;
use crate::error::{RuntimeError, words};
use crate::wire::door::Doors;

/// Network settings of a server.
#[derive(Debug, Clone, Default)]
pub struct NetworkConfig {
    /// Endpoints at which the haptic session listens.
    pub listen: Vec<String>,
    /// Routers to connect to.
    pub connect: Vec<String>,
    /// A zenoh configuration (JSON5) to start from: certificates, users, access control.
    pub zenoh_file: Option<PathBuf>,
    /// Access control of zenoh, used if the file has none of its own.
    pub access_control: Option<serde_json::Value>,
    /// Longest surface message that is relayed to clients of the haptic endpoint [bytes].
    pub longest_surface: usize,
}

/// Largest message that a session of the server reassembles from fragments [bytes]. Orders, poses and cuts
/// take at most [`scindo_proto::limits::MAX_CUT_BYTES`]. zenoh's own limit is a gigabyte per client, priority
/// and reliability.
const LONGEST_MESSAGE: usize = 256 * 1024;

/// Most connections of a server.
const CONNECTIONS: u32 = 256;

/// Surfaces grow when they are cut. A message longer than this multiple of the longest present one is not
/// relayed.
const SURFACES_GROW: usize = 8;

/// Limits that hold unless the zenoh file sets others.
const LIMITS: [(&str, &str); 5] = [
    // A connection that stays silent is closed after this time [ms]. At most so many may be pending.
    ("transport/unicast/accept_timeout", "1000"),
    ("transport/unicast/accept_pending", "256"),
    // The link to a client that reads nothing is closed when a message that must not be lost has waited this
    // long [µs]. A frame for a slow client is dropped when it has waited this long [µs].
    ("transport/link/tx/queue/congestion_control/block/wait_before_close", "1000000"),
    ("transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments", "20000"),
    // So many contacts may wait while the thread that sends them waits for a processor. With zenoh's two, one is lost
    // when that takes a few milliseconds.
    ("transport/link/tx/queue/size/real_time", "16"),
];

impl NetworkConfig {
    /// Decides where to listen: at the given endpoints, otherwise where the zenoh file says. With neither
    /// file nor router it is the default endpoint.
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

/// Endpoints at which a configuration says to listen. Only plain lists are recognised.
fn endpoints_of(config: &zenoh::Config) -> Vec<String> {
    let endpoints = config.get_json("listen/endpoints").unwrap_or_default();
    serde_json::from_str(&endpoints).unwrap_or_default()
}

/// Reads a zenoh configuration file.
pub(crate) fn load(path: &Path) -> Result<zenoh::Config, RuntimeError> {
    zenoh::Config::from_file(path).map_err(|e| RuntimeError::Option {
        option: "--zenoh",
        value: path.display().to_string(),
        reason: words(&e),
        next: "See the example deploy/open-lab.json5".to_owned(),
    })
}

/// What a session takes from others.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    /// Longest message that it reassembles [bytes].
    longest_message: usize,
    /// Most connections.
    connections: u32,
}

impl Bounds {
    /// Those of a server.
    fn of_server(longest_message: usize) -> Self {
        Self { longest_message, connections: CONNECTIONS }
    }
}

/// The open sessions of a server.
pub struct Sessions {
    /// Carries poses, contacts, cuts and liveliness.
    pub haptic: Session,
    /// Carries surfaces, tool states, reports and rpc.
    pub bulk: Session,
    /// Who connects over plain TCP comes in here. They close after the sessions.
    pub doors: Doors,
}

impl Sessions {
    /// Opens both sessions. Fails if an endpoint is taken.
    pub fn open(network: &NetworkConfig) -> Result<Self, RuntimeError> {
        network.listen.iter().try_for_each(|endpoint| check("--listen", endpoint))?;
        network.connect.iter().try_for_each(|endpoint| check("--connect", endpoint))?;
        let bulk_listen: Vec<String> = network.listen.iter().filter_map(|e| bulk_endpoint(e)).collect();
        let doors = if has_doors(network)? { Doors::open(&network.listen)? } else { Doors::none() };
        let relay: Vec<String> = network.listen.iter().filter_map(|e| doors.inside(e)).take(1).collect();
        let behind =
            |listen: &[String]| -> Vec<String> { listen.iter().flat_map(|e| doors.behind(e)).collect() };
        let mut network = network.clone();
        let id = ZenohId::default().to_string();
        if let Some(rules) = &mut network.access_control {
            orders::admit_server(rules, &id);
            if !doors.is_empty() {
                orders::behind_doors(rules);
            }
        }
        let mode = if network.listen.is_empty() { "peer" } else { "router" };
        let relayed = LONGEST_MESSAGE.max(SURFACES_GROW * network.longest_surface);
        let at = behind(&network.listen);
        let haptic = open(&network, (mode, Bounds::of_server(relayed)), (&at, &network.connect), None)?;
        let bulk_connect = if relay.is_empty() { &network.connect } else { &relay };
        let at = behind(&bulk_listen);
        let bulk =
            open(&network, ("peer", Bounds::of_server(LONGEST_MESSAGE)), (&at, bulk_connect), Some(&id))?;
        Ok(Self { haptic, bulk, doors })
    }
}

/// A session that only passes messages on, of at most `longest_message` bytes, between at most `connections` others.
///
/// # Errors
/// If an endpoint is taken or the configuration is wrong.
pub fn router(
    network: &NetworkConfig,
    longest_message: usize,
    connections: u32,
) -> Result<Session, RuntimeError> {
    network.listen.iter().try_for_each(|endpoint| check("--listen", endpoint))?;
    network.connect.iter().try_for_each(|endpoint| check("--connect", endpoint))?;
    let bounds = Bounds { longest_message, connections };
    open(network, ("router", bounds), (&network.listen, &network.connect), None)
}

/// Checks the form of an endpoint, so that a typing mistake is not reported as a network failure.
fn check(option: &'static str, endpoint: &str) -> Result<(), RuntimeError> {
    let wrong = |reason: &str| RuntimeError::Option {
        option,
        value: endpoint.to_owned(),
        reason: reason.to_owned(),
        next: "Write it like tcp/0.0.0.0:7447, with a port from 1 to 65534 that is free, as is the next one"
            .to_owned(),
    };
    let (protocol, address) = endpoint.split_once('/').ok_or_else(|| wrong("no protocol"))?;
    if protocol == "tls" {
        return Err(RuntimeError::Option {
            option,
            value: endpoint.to_owned(),
            reason:
                "zenoh reads and writes a TLS link from two threads at once, which breaks it under two-way \
                     traffic (eclipse-zenoh/zenoh, issue 2557)"
                    .to_owned(),
            next: "Write quic/HOST:PORT: the same certificates and encryption, over UDP".to_owned(),
        });
    }
    if !matches!(protocol, "tcp" | "quic") {
        return Ok(());
    }
    let address = address.split(['?', '#']).next().unwrap_or(address);
    let port = address.rsplit_once(':').ok_or_else(|| wrong("no port"))?.1;
    match port.parse::<u16>() {
        Ok(1..=65534) => Ok(()),
        _ => Err(wrong("there is no such port, or no port above it for surfaces")),
    }
}

fn open(
    network: &NetworkConfig,
    (mode, bounds): (&str, Bounds),
    (listen, connect): (&[String], &[String]),
    id: Option<&str>,
) -> Result<Session, RuntimeError> {
    let invalid = |what: String| move |e: zenoh::Error| RuntimeError::Zenoh { what, reason: words(&e) };
    let mut config = match &network.zenoh_file {
        Some(path) => load(path)?,
        None => zenoh::Config::default(),
    };
    let mut settings = vec![("mode", format!("{mode:?}"))];
    let from_file = network.zenoh_file.is_some();
    // zenoh's own default listens at any port, over plain TCP.
    if !from_file || !listen.is_empty() || endpoints_of(&config).is_empty() {
        settings.push(("listen/endpoints", list(listen)));
    }
    if !from_file || !connect.is_empty() {
        settings.push(("connect/endpoints", list(connect)));
    }
    if let Some(id) = id {
        settings.push(("id", format!("{id:?}")));
    }
    if !from_file {
        // Deterministic: only named endpoints, no discovery. No shared memory: each local client would map 16
        // MB that stay mapped after it is gone.
        settings.extend(
            [
                ("transport/shared_memory/enabled", "false"),
                ("scouting/multicast/enabled", "false"),
                ("scouting/gossip/enabled", "false"),
                ("scouting/delay", "50"),
                ("connect/retry", "{period_init_ms:50,period_max_ms:1000,period_increase_factor:2}"),
            ]
            .map(|(key, value)| (key, value.to_owned())),
        );
    }
    settings.extend(limits(&config, bounds));
    if let Some(rules) = network.access_control.as_ref().filter(|_| !controls_access(&config)) {
        settings.push(("access_control", rules.to_string()));
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

/// Those of our limits that the configuration does not set itself.
fn limits(config: &zenoh::Config, bounds: Bounds) -> Vec<(&'static str, String)> {
    let plain = zenoh::Config::default();
    let ours = LIMITS.map(|(key, value)| (key, value.to_owned()));
    let Bounds { longest_message, connections } = bounds;
    let own = [
        ("transport/link/rx/max_message_size", longest_message.to_string()),
        ("transport/unicast/max_sessions", connections.to_string()),
    ];
    let all = ours.into_iter().chain(own);
    all.filter(|(key, _)| config.get_json(key).ok() == plain.get_json(key).ok()).collect()
}

/// Behind a door, rules of the file that name interfaces would mean something else, and who discovers the server would be
/// sent to the wrong side of the door.
fn has_doors(network: &NetworkConfig) -> Result<bool, RuntimeError> {
    let Some(path) = &network.zenoh_file else { return Ok(true) };
    let config = load(path)?;
    let is_off = |key: &str| config.get_json(key).is_ok_and(|value| value == "false");
    let is_found = !is_off("scouting/multicast/enabled") || !is_off("scouting/gossip/enabled");
    Ok(!controls_access(&config) && !is_found)
}

fn controls_access(config: &zenoh::Config) -> bool {
    let enabled = config.get_json("access_control/enabled").unwrap_or_default();
    enabled == "true"
}

fn list(endpoints: &[String]) -> String {
    let quoted: Vec<String> = endpoints.iter().map(|e| format!("{e:?}")).collect();
    format!("[{}]", quoted.join(","))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_are_checked() {
        for (endpoint, says) in [
            ("tls/localhost:7447", "quic/HOST:PORT"),
            ("quic/localhost", "no port"),
            ("tcp/localhost:65535", "no port above it"),
            ("localhost:7447", "no protocol"),
        ] {
            let error = check("--listen", endpoint).unwrap_err().to_string();
            assert!(error.contains(says), "{endpoint}: {error}");
        }
        assert!(check("--listen", "quic/[::1]:7447").is_ok());
    }

    #[test]
    fn a_zenoh_file_may_do_without_doors() {
        let folder = tempfile::tempdir().unwrap();
        let with = |text: &str| {
            let file = folder.path().join("zenoh.json5");
            std::fs::write(&file, text).unwrap();
            has_doors(&NetworkConfig { zenoh_file: Some(file), ..NetworkConfig::default() }).unwrap()
        };
        let open_lab = include_str!("../../../../deploy/open-lab.json5");
        assert!(with(open_lab));
        assert!(!with(&open_lab.replace("gossip: { enabled: false }", "gossip: { enabled: true }")));
        assert!(!with(&open_lab.replacen("mode:", "access_control: { enabled: true }, mode:", 1)));
        assert!(has_doors(&NetworkConfig::default()).unwrap());
    }

    #[test]
    fn limits_are_set_unless_the_file_sets_them() {
        let mut config = zenoh::Config::default();
        config.insert_json5("transport/unicast/max_sessions", "7").unwrap();
        let set = limits(&config, Bounds { longest_message: 1000, connections: 9 });
        assert!(!set.iter().any(|(key, _)| key.ends_with("max_sessions")), "{set:?}");
        assert_eq!(set.len(), LIMITS.len() + 1);
        for (key, value) in set {
            config.insert_json5(key, &value).unwrap();
            assert_eq!(config.get_json(key).unwrap(), value);
        }
    }
}
