//! Questions and orders to the server. Each waits at most [`TIMEOUT`], that for a state or an image [`STATE_TIMEOUT`].

use std::time::Duration;

use bytes::Bytes;
use scindo_proto::messages::{
    Error, LoadRequest, ParamsReply, PauseRequest, RecordRequest, ResetRequest, RestoreRequest, RpcReply,
    ScenesReply, SchemaReply, SessionInfo, SetRequest, SnapshotRequest, StateReply, StepRequest,
    TextureReply, TextureRequest, UndoRequest,
};
use scindo_proto::{Topic, Verb, WireMessage, encode, encoding};
use zenoh::query::ConsolidationMode;

use crate::error::LinkError;
use crate::link::{Link, decode_sample};

/// Longest wait for an answer.
pub const TIMEOUT: Duration = Duration::from_secs(2);

/// Longest wait for a state, which may have 64 MiB, or an image.
pub const STATE_TIMEOUT: Duration = Duration::from_secs(30);

/// Pause before a question that reached nobody is repeated.
const PAUSE: Duration = Duration::from_millis(50);

impl Link {
    /// Scene, bodies and tools of the running session.
    pub async fn info(&self) -> Result<SessionInfo, LinkError> {
        self.question(Verb::Info).await
    }

    /// Descriptors of the wire messages.
    pub async fn schema(&self) -> Result<SchemaReply, LinkError> {
        self.question(Verb::Schema).await
    }

    /// Pauses (`true`) or continues the simulation.
    pub async fn pause(&self, paused: bool) -> Result<RpcReply, LinkError> {
        self.order(Verb::Pause, &PauseRequest { paused }).await
    }

    /// Advances a paused simulation by `count` steps (1 to 10,000).
    pub async fn step(&self, count: u32) -> Result<RpcReply, LinkError> {
        self.order(Verb::Step, &StepRequest { count }).await
    }

    /// Goes back to the start of the scene.
    pub async fn reset(&self) -> Result<RpcReply, LinkError> {
        self.order(Verb::Reset, &ResetRequest {}).await
    }

    /// Changes one parameter; key and value as in a scene file.
    pub async fn set(&self, key: &str, value: &str) -> Result<RpcReply, LinkError> {
        self.order(Verb::Set, &SetRequest { key: key.to_owned(), value: value.to_owned() }).await
    }

    /// Parameters that [`Self::set`] may change while the scene runs, with values and ranges.
    pub async fn params(&self) -> Result<ParamsReply, LinkError> {
        self.question(Verb::Params).await
    }

    /// Takes the last cut back.
    pub async fn undo(&self) -> Result<RpcReply, LinkError> {
        self.order(Verb::Undo, &UndoRequest {}).await
    }

    /// Lets the server keep the present state under a name: 1 to 64 of a-z, 0-9, - and _.
    pub async fn snapshot(&self, name: &str) -> Result<RpcReply, LinkError> {
        self.order(Verb::Snapshot, &SnapshotRequest { name: name.to_owned() }).await
    }

    /// Goes back to a state that [`Self::snapshot`] kept, with its cuts.
    pub async fn restore(&self, name: &str) -> Result<RpcReply, LinkError> {
        self.order(Verb::Restore, &RestoreRequest { name: name.to_owned() }).await
    }

    /// Begins (`true`) or ends a recording in the folder of the server. The reply's message is the name of the file.
    pub async fn record(&self, on: bool) -> Result<RpcReply, LinkError> {
        self.order(Verb::Record, &RecordRequest { on }).await
    }

    /// The present state as a recording without steps, at most 64 MiB. Waits at most [`STATE_TIMEOUT`].
    pub async fn state(&self) -> Result<StateReply, LinkError> {
        let key = self.keys().key(&Topic::Rpc(Verb::State));
        self.ask_for(STATE_TIMEOUT, key, Bytes::new(), None).await
    }

    /// The image on the skin of a body that has one. Waits at most [`STATE_TIMEOUT`].
    pub async fn texture(&self, body: &str) -> Result<TextureReply, LinkError> {
        let request = TextureRequest { body_id: body.to_owned() };
        let key = self.keys().key(&Topic::Rpc(Verb::Texture));
        self.ask_for(STATE_TIMEOUT, key, encode(&request), Some(encoding::<TextureRequest>())).await
    }

    /// The scenes that [`Self::load`] accepts.
    pub async fn scenes(&self) -> Result<ScenesReply, LinkError> {
        self.question(Verb::Scenes).await
    }

    /// Changes to another scene of [`Self::scenes`].
    pub async fn load(&self, name: &str) -> Result<RpcReply, LinkError> {
        self.order(Verb::Load, &LoadRequest { name: name.to_owned() }).await
    }

    /// Repeats a question while nobody answers. A starting server listens before it can answer, and a new
    /// link does not know of it yet. Orders are not repeated: one whose answer was lost may have been carried
    /// out.
    async fn question<R: WireMessage>(&self, verb: Verb) -> Result<R, LinkError> {
        let started = std::time::Instant::now();
        loop {
            match self.call(verb, Bytes::new(), None).await {
                Err(LinkError::NoServer { .. }) if started.elapsed() < TIMEOUT => {
                    tokio::time::sleep(PAUSE).await;
                }
                answer => return answer,
            }
        }
    }

    async fn order<M: WireMessage>(&self, verb: Verb, request: &M) -> Result<RpcReply, LinkError> {
        let reply: RpcReply = self.call(verb, encode(request), Some(encoding::<M>())).await?;
        match reply.error {
            Some(error) if !reply.ok => Err(refusal(error)),
            _ => Ok(reply),
        }
    }

    async fn call<R: WireMessage>(
        &self,
        verb: Verb,
        payload: Bytes,
        encoding: Option<String>,
    ) -> Result<R, LinkError> {
        self.ask(self.keys().key(&Topic::Rpc(verb)), payload, encoding).await
    }

    /// Sends one query on the bulk session and waits for one answer.
    pub(crate) async fn ask<R: WireMessage>(
        &self,
        key: String,
        payload: Bytes,
        encoding: Option<String>,
    ) -> Result<R, LinkError> {
        self.ask_for(TIMEOUT, key, payload, encoding).await
    }

    async fn ask_for<R: WireMessage>(
        &self,
        patience: Duration,
        key: String,
        payload: Bytes,
        encoding: Option<String>,
    ) -> Result<R, LinkError> {
        let started = std::time::Instant::now();
        let mut query =
            self.bulk().get(&key).payload(payload).consolidation(ConsolidationMode::None).timeout(patience);
        if let Some(encoding) = encoding {
            query = query.encoding(encoding);
        }
        let replies = query.await.map_err(LinkError::zenoh("query"))?;
        let Ok(reply) = replies.recv_async().await else {
            return Err(LinkError::NoServer { key });
        };
        match reply.result() {
            Ok(sample) => decode_sample(sample),
            Err(_) if started.elapsed() >= patience => Err(LinkError::Timeout { key, waited: patience }),
            Err(error) => {
                let bytes = Bytes::from(error.payload().to_bytes().into_owned());
                match prost::Message::decode(bytes) {
                    Ok(error) => Err(refusal(error)),
                    Err(_) => Err(LinkError::NoServer { key }),
                }
            }
        }
    }
}

fn refusal(error: Error) -> LinkError {
    LinkError::Refused { code: error.code, message: error.message, hint: error.hint }
}
