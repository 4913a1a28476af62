//! Settings of a link: the server to reach and the identity of this client.

use std::path::PathBuf;
use std::time::Duration;

use scindo_proto::Role;
use scindo_proto::endpoint::DEFAULT_ENDPOINT;

use crate::error::{LinkError, words};

/// Settings for [`crate::Link::connect`].
#[derive(Debug, Clone)]
pub struct LinkConfig {
    /// First chunk of every key; one per laboratory.
    pub realm: String,
    /// The session to join within the realm.
    pub session: String,
    /// Zenoh endpoints of the server (or of a router before it), tried in this order.
    pub connect: Vec<String>,
    /// Kind of participant.
    pub role: Role,
    /// Id of this client, unique in the session: `[a-z0-9_-]{1,64}`. It owns the client's tools.
    pub id: String,
    /// Name of the person, which others see beside the tool: at most 32 characters; empty: none.
    pub person: String,
    /// Time after which [`crate::Link::connect`] gives up.
    pub timeout: Duration,
    /// A zenoh configuration (JSON5) to start from, for certificates, users and routers. If [`Self::connect`] is
    /// empty, its connect endpoints serve both sessions.
    pub zenoh_file: Option<PathBuf>,
}

impl LinkConfig {
    /// Settings for the default session on this machine.
    pub fn new(role: Role, id: &str) -> Self {
        Self {
            realm: "scindo".to_owned(),
            session: "main".to_owned(),
            connect: vec![DEFAULT_ENDPOINT.to_owned()],
            role,
            id: id.to_owned(),
            person: String::new(),
            timeout: Duration::from_secs(5),
            zenoh_file: None,
        }
    }

    /// The same settings with other endpoints.
    pub fn with_connect(mut self, endpoints: impl IntoIterator<Item = String>) -> Self {
        self.connect = endpoints.into_iter().collect();
        self
    }

    /// Zenoh configuration of a session at one endpoint, or at those of the file.
    ///
    /// There is no discovery: only the named endpoint is used. Endpoints are tried one at a time, because a
    /// client-mode session with several waits for the first and never tries the others. The session
    /// reconnects by itself after the server was away.
    pub(crate) fn session_config(
        &self,
        endpoint: Option<&str>,
        timeout: Duration,
    ) -> Result<zenoh::Config, LinkError> {
        let mut config = match &self.zenoh_file {
            Some(path) => zenoh::Config::from_file(path).map_err(|e| LinkError::Config {
                what: format!("zenoh file {}", path.display()),
                reason: words(&e),
            })?,
            None => zenoh::Config::default(),
        };
        let endpoints = endpoint.map(|one| format!("[{one:?}]"));
        let timeout_ms = timeout.as_millis().to_string();
        let mut settings = vec![("mode", r#""client""#), ("connect/timeout_ms", &timeout_ms)];
        if let Some(endpoints) = &endpoints {
            settings.push(("connect/endpoints", endpoints));
        }
        if self.zenoh_file.is_none() {
            settings.extend([
                // The server has none, and a client would need a /dev/shm that it may write to.
                ("transport/shared_memory/enabled", "false"),
                ("scouting/multicast/enabled", "false"),
                ("scouting/gossip/enabled", "false"),
                ("scouting/delay", "50"),
                ("connect/retry", "{period_init_ms:100,period_max_ms:1000,period_increase_factor:2}"),
            ]);
        }
        for (key, value) in settings {
            config
                .insert_json5(key, value)
                .map_err(|e| LinkError::Config { what: format!("{key} = {value}"), reason: words(&e) })?;
        }
        Ok(config)
    }
}
