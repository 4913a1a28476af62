//! From zenoh into the inbox. This code runs on zenoh's receiving threads: decode, check, store, return.

use std::sync::Arc;
use std::time::Instant;

use bytes::Bytes;
use scindo_proto::messages::{CutCommand, DeviceCapability, ToolSample};
use scindo_proto::{DecodeError, KeySpace, Topic, WireMessage, decode_as};
use scindo_world::simulation::Level;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait as _};

use crate::error::{RuntimeError, words};
use crate::exchange::Exchange;
use crate::inbox::{Change, Cut, Sender};

/// Subscriptions of the server. Dropping them ends the input.
pub struct Receivers {
    _subscribers: Vec<Subscriber<()>>,
    _token: LivelinessToken,
}

impl Receivers {
    /// Subscribes to poses, cuts, capabilities and liveliness, then announces the server.
    pub fn declare(
        session: &Session,
        keys: &KeySpace,
        exchange: &Arc<Exchange>,
        server: &Topic,
    ) -> Result<Self, RuntimeError> {
        let failed = |e: zenoh::Error| RuntimeError::Zenoh { what: "subscribing".into(), reason: words(&e) };
        let tokens = session
            .liveliness()
            .declare_subscriber(keys.every_client())
            .history(true)
            .callback(with(keys, exchange, on_token))
            .wait()
            .map_err(failed)?;
        let subscribe = |key: String, on_sample: OnSample| {
            let callback = with(keys, exchange, on_sample);
            session.declare_subscriber(key).callback(callback).wait().map_err(failed)
        };
        let subscribers = vec![
            tokens,
            subscribe(keys.every_tool_pose(), pose)?,
            subscribe(keys.every_tool_cut(), cut)?,
            subscribe(keys.every_tool_capability(), capability)?,
        ];
        let token = session.liveliness().declare_token(keys.key(server)).wait().map_err(failed)?;
        Ok(Self { _subscribers: subscribers, _token: token })
    }
}

/// A message from the network, before it is copied or decoded.
pub trait Arrival {
    /// Key to which it was published.
    fn key(&self) -> &str;
    /// What the sender says its content is.
    fn encoding(&self) -> String;
    /// Length of the content [bytes].
    fn length(&self) -> usize;
    /// A copy of the content.
    fn content(&self) -> Bytes;
}

impl Arrival for Sample {
    fn key(&self) -> &str {
        self.key_expr().as_str()
    }

    fn encoding(&self) -> String {
        Sample::encoding(self).to_string()
    }

    fn length(&self) -> usize {
        self.payload().len()
    }

    fn content(&self) -> Bytes {
        Bytes::from(self.payload().to_bytes().into_owned())
    }
}

type OnSample = fn(&KeySpace, &Exchange, &Sample, Instant);

fn with(
    keys: &KeySpace,
    exchange: &Arc<Exchange>,
    on_sample: OnSample,
) -> impl Fn(Sample) + Send + Sync + 'static {
    let (keys, exchange) = (keys.clone(), exchange.clone());
    move |sample| on_sample(&keys, &exchange, &sample, Instant::now())
}

fn on_token(keys: &KeySpace, exchange: &Exchange, sample: &Sample, now: Instant) {
    token(keys, exchange, sample.key_expr().as_str(), sample.kind() == SampleKind::Put, now);
}

/// A liveliness token came to be or ceased to be at `now`.
pub fn token(keys: &KeySpace, exchange: &Exchange, key: &str, is_there: bool, now: Instant) {
    let Ok(Topic::Live(client, role)) = keys.parse(key) else { return };
    let changes = if is_there {
        let mut inbox = exchange.inbox();
        let changes = inbox.client_came(client.as_str(), now);
        inbox.client_is(client.as_str(), role);
        changes
    } else {
        exchange.inbox().client_went(client.as_str(), now)
    };
    changes.into_iter().for_each(|change| announce(exchange, change));
}

/// A pose arrived at `now`.
pub fn pose<A: Arrival>(keys: &KeySpace, exchange: &Exchange, sample: &A, now: Instant) {
    let Ok(Topic::ToolPose(client, tool)) = keys.parse(sample.key()) else {
        return refuse(exchange, "bad-key", "a pose arrived under a key that names no tool");
    };
    match decode::<ToolSample, A>(sample) {
        Ok(pose) => {
            let sender = Sender { client: client.as_str(), tool: tool.as_str() };
            let outcome = exchange.inbox().pose(sender, &pose, now);
            match outcome {
                Ok(None) => {}
                Ok(Some(change)) => announce(exchange, change),
                Err(refusal) => seldom(exchange, refusal.code, &refusal.message),
            }
        }
        Err(error) => refuse(exchange, error.code(), &error.to_string()),
    }
}

/// A cut arrived.
pub fn cut<A: Arrival>(keys: &KeySpace, exchange: &Exchange, sample: &A, _now: Instant) {
    let Ok(Topic::ToolCut(client, tool)) = keys.parse(sample.key()) else {
        return refuse(exchange, "bad-key", "a cut arrived under a key that names no tool");
    };
    match decode::<CutCommand, A>(sample) {
        Ok(command) => {
            let sender = Sender { client: client.as_str(), tool: tool.as_str() };
            let outcome = exchange.inbox().cut(sender, &command);
            match outcome {
                Cut::Answer(answer) => exchange.answer(answer),
                Cut::Stray(refusal) => seldom(exchange, refusal.code, &refusal.message),
                Cut::Queued | Cut::Waiting => {}
            }
        }
        Err(error) => refuse(exchange, error.code(), &error.to_string()),
    }
}

/// The capability of a device arrived.
pub fn capability<A: Arrival>(keys: &KeySpace, exchange: &Exchange, sample: &A, _now: Instant) {
    let Ok(Topic::ToolCapability(client, tool)) = keys.parse(sample.key()) else {
        return refuse(exchange, "bad-key", "a capability arrived under a key that names no tool");
    };
    match decode::<DeviceCapability, A>(sample) {
        Ok(capability) => {
            let sender = Sender { client: client.as_str(), tool: tool.as_str() };
            let outcome = exchange.inbox().capability(sender, capability);
            if let Err(refusal) = outcome {
                seldom(exchange, refusal.code, &refusal.message);
            }
        }
        Err(error) => refuse(exchange, error.code(), &error.to_string()),
    }
}

/// Decodes a message. An oversized one is refused before it is copied.
pub fn decode<M: WireMessage, A: Arrival>(sample: &A) -> Result<M, DecodeError> {
    let found = sample.length();
    if found > M::MAX_BYTES {
        let field = "payload bytes";
        return Err(DecodeError::TooLarge { message: M::NAME, field, found, allowed: M::MAX_BYTES });
    }
    decode_as(&sample.encoding(), sample.content())
}

fn announce(exchange: &Exchange, change: Change) {
    match change {
        // Guests, such as the mouse of a page, come and go with a tool of their own name.
        Change::Taken { tool, owner } if tool == owner => {
            exchange.event(Level::Info, "tool-taken", format!("'{tool}' joined"));
        }
        Change::Released { tool, owner } if tool == owner => {
            exchange.event(Level::Info, "tool-released", format!("'{tool}' left"));
        }
        Change::Taken { tool, owner } => {
            exchange.event(Level::Info, "tool-taken", format!("'{owner}' holds tool '{tool}'"));
        }
        Change::Released { tool, owner } => {
            let message = format!("'{owner}' left; tool '{tool}' is free");
            exchange.event(Level::Info, "tool-released", message);
        }
    }
}

fn refuse(exchange: &Exchange, code: &'static str, message: &str) {
    exchange.inbox().count(code);
    seldom(exchange, code, message);
}

/// Publishes an event for the 1st, 10th, 100th … refusal of a kind: a broken client sends thousands.
fn seldom(exchange: &Exchange, code: &'static str, message: &str) {
    let count = exchange.inbox().refused().get(code).copied().unwrap_or(0);
    if count > 0 && 10_u64.pow(count.ilog10()) == count {
        exchange.event(Level::Warning, "message-refused", format!("{message} ({code}, {count} so far)"));
    }
}
