//! The two sessions of a client, its liveliness token, and the presence of a server.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use bytes::Bytes;
use scindo_proto::endpoint::bulk_endpoint;
use scindo_proto::{Chunk, KeySpace, Role, Topic, WireMessage, decode_as};
use tokio::sync::watch;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

use crate::config::LinkConfig;
use crate::error::{LinkError, words};

/// Presence of a server in our session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Presence {
    /// Number of servers: 0 or 1, more only if somebody started two in one session.
    pub servers: usize,
    /// Rises each time a server appears, which distinguishes a restarted server from the old one.
    pub generation: u64,
}

/// A connection to a session. Cheap to clone; the last clone closes it.
#[derive(Clone)]
pub struct Link {
    shared: Arc<Shared>,
}

struct Shared {
    keys: KeySpace,
    id: Chunk,
    person: String,
    role: Role,
    presence: watch::Receiver<Presence>,
    refused: Arc<AtomicU64>,
    _presence_subscriber: Subscriber<()>,
    _token: LivelinessToken,
    haptic: Session,
    bulk: Session,
}

impl Link {
    /// Opens both sessions and declares our liveliness token. Needs a multi-threaded tokio runtime.
    pub async fn connect(config: LinkConfig) -> Result<Self, LinkError> {
        let keys = KeySpace::new(&config.realm, &config.session)?;
        let id = Chunk::new("client id", &config.id)?;
        let (haptic, bulk) = open_both(&config).await?;
        let (presence, presence_subscriber) = watch_servers(&haptic, &keys).await?;
        let token = haptic
            .liveliness()
            .declare_token(keys.key(&Topic::Live(id.clone(), config.role)))
            .await
            .map_err(LinkError::zenoh("declare liveliness token"))?;
        let shared = Shared {
            keys,
            id,
            person: config.person,
            role: config.role,
            presence,
            refused: Arc::default(),
            _presence_subscriber: presence_subscriber,
            _token: token,
            haptic,
            bulk,
        };
        Ok(Self { shared: Arc::new(shared) })
    }

    /// Key space of the session.
    pub fn keys(&self) -> &KeySpace {
        &self.shared.keys
    }

    /// Id of this client.
    pub fn id(&self) -> &str {
        self.shared.id.as_str()
    }

    /// Name of the person at this client; empty if none was given.
    pub fn person(&self) -> &str {
        &self.shared.person
    }

    /// Id of this client, as part of a key.
    pub(crate) fn chunk(&self) -> Chunk {
        self.shared.id.clone()
    }

    /// Role of this client.
    pub fn role(&self) -> Role {
        self.shared.role
    }

    /// Presence of a server. Changes wake the receiver.
    pub fn presence(&self) -> watch::Receiver<Presence> {
        self.shared.presence.clone()
    }

    /// Number of invalid messages that were discarded.
    pub fn refused(&self) -> u64 {
        self.shared.refused.load(Ordering::Relaxed)
    }

    /// The session that carries poses, contacts and cuts.
    pub fn haptic(&self) -> &Session {
        &self.shared.haptic
    }

    /// The session that carries surfaces, reports and rpc.
    pub fn bulk(&self) -> &Session {
        &self.shared.bulk
    }

    /// Calls `on_message` for every valid message of `key`. It runs on zenoh's receiving thread and must not
    /// block. Invalid messages are counted in [`Self::refused`].
    pub(crate) async fn subscribe<M: WireMessage>(
        &self,
        session: &Session,
        key: String,
        on_message: impl Fn(M) + Send + Sync + 'static,
    ) -> Result<Subscriber<()>, LinkError> {
        let refused = self.shared.refused.clone();
        session
            .declare_subscriber(key)
            .callback(move |sample| match decode_sample::<M>(&sample) {
                Ok(message) => on_message(message),
                Err(error) => {
                    refused.fetch_add(1, Ordering::Relaxed);
                    tracing::debug!(key = %sample.key_expr(), %error, "message refused");
                }
            })
            .await
            .map_err(LinkError::zenoh("declare subscriber"))
    }
}

/// Decodes and checks the message of a sample.
pub(crate) fn decode_sample<M: WireMessage>(sample: &Sample) -> Result<M, LinkError> {
    let payload = Bytes::from(sample.payload().to_bytes().into_owned());
    Ok(decode_as(&sample.encoding().to_string(), payload)?)
}

/// Time that the bulk port may take to answer after the endpoint beside it has answered.
const BULK_PATIENCE: Duration = Duration::from_secs(1);

/// Opens the session of poses at the first endpoint that answers. The session of surfaces uses the bulk port
/// beside it. If that port is closed (a router), it uses the same endpoint, which relays.
async fn open_both(config: &LinkConfig) -> Result<(Session, Session), LinkError> {
    let Some((last, others)) = config.connect.split_last() else {
        let haptic = open(config, None, config.timeout).await?;
        return Ok((haptic, open(config, None, config.timeout).await?));
    };
    let share = config.timeout / u32::try_from(config.connect.len()).unwrap_or(1);
    for endpoint in others {
        if let Ok(haptic) = open(config, Some(endpoint), share).await {
            return Ok((haptic, open_bulk(config, endpoint).await?));
        }
    }
    let haptic = open(config, Some(last), share).await?;
    Ok((haptic, open_bulk(config, last).await?))
}

async fn open_bulk(config: &LinkConfig, endpoint: &str) -> Result<Session, LinkError> {
    if let Some(beside) = bulk_endpoint(endpoint)
        && let Ok(bulk) = open(config, Some(&beside), BULK_PATIENCE.min(config.timeout)).await
    {
        return Ok(bulk);
    }
    open(config, Some(endpoint), config.timeout).await
}

async fn open(config: &LinkConfig, endpoint: Option<&str>, timeout: Duration) -> Result<Session, LinkError> {
    let started = Instant::now();
    zenoh::open(config.session_config(endpoint, timeout)?).await.map_err(|e| LinkError::Unreachable {
        endpoints: config.connect.join(", "),
        first: config.connect.first().cloned().unwrap_or_default(),
        waited: started.elapsed(),
        reason: words(&e),
    })
}

async fn watch_servers(
    session: &Session,
    keys: &KeySpace,
) -> Result<(watch::Receiver<Presence>, Subscriber<()>), LinkError> {
    let (sender, receiver) = watch::channel(Presence { servers: 0, generation: 0 });
    let subscriber = session
        .liveliness()
        .declare_subscriber(keys.every_server())
        .history(true)
        .callback(move |sample| {
            sender.send_modify(|presence| match sample.kind() {
                SampleKind::Put => {
                    presence.servers += 1;
                    presence.generation += 1;
                }
                SampleKind::Delete => presence.servers = presence.servers.saturating_sub(1),
            });
        })
        .await
        .map_err(LinkError::zenoh("watch server"))?;
    Ok((receiver, subscriber))
}
