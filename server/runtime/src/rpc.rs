//! Questions and orders under `rpc/`. One thread answers them in turn.

pub mod catalogue;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, SystemTime};

use bytes::Bytes;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use prost::Message as _;
use scindo_proto::messages::{
    Error, LoadRequest, PauseRequest, RecordRequest, ResetRequest, RestoreRequest, RpcReply, SchemaReply,
    SessionInfo, SetRequest, SnapshotRequest, StateReply, StepRequest, TextureReply, TextureRequest,
    UndoRequest,
};
use scindo_proto::{FILE_DESCRIPTOR_SET, KeySpace, Topic, Verb, WireMessage, decode, encode, encoding};
use scindo_world::inputs::{ToolInput, ToolShape};
use zenoh::Wait as _;
use zenoh::query::Query;

use crate::exchange::Exchange;
use crate::record::on_demand::stem;
use crate::sim::{Answer, Command, Order};
use catalogue::Catalogue;

/// Most questions that may wait. Further ones are refused at once.
pub const WAITING: usize = 32;

/// A client waits two seconds. An order that takes longer than this is answered "accepted" beforehand.
const PATIENCE: Duration = Duration::from_millis(1700);

/// How often the thread checks whether the server ends.
const IDLE: Duration = Duration::from_millis(100);

/// State of the rpc thread.
pub struct RpcThread {
    /// Key space of the session.
    pub keys: KeySpace,
    /// State shared with the other threads.
    pub exchange: Arc<Exchange>,
    /// Queue of questions that zenoh's threads fill.
    pub queries: Receiver<Query>,
    /// Queue of orders to the simulation.
    pub commands: Sender<Command>,
    /// The constant part of the answer to `info`.
    pub info: SessionInfo,
    /// The images on the skins of bodies.
    pub textures: Vec<TextureReply>,
    /// Scenes that may be loaded.
    pub catalogue: Arc<Catalogue>,
    /// Whether orders are taken at all.
    pub takes_orders: bool,
}

impl RpcThread {
    /// Answers until the server ends.
    pub fn run(self) {
        while !self.exchange.stopping() {
            match self.queries.recv_timeout(IDLE) {
                Ok(query) => self.answer(&query),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn answer(&self, query: &Query) {
        let Ok(Topic::Rpc(verb)) = self.keys.parse(query.key_expr().as_str()) else {
            return refuse(query, error("bad-key", "rpc/* takes one verb".into(), "ask rpc/<verb>"));
        };
        let payload = query.payload().map(|p| Bytes::from(p.to_bytes().into_owned())).unwrap_or_default();
        if verb.is_order() && !self.takes_orders {
            let message = format!("rpc/{} needs an operator, and this server admits none", verb.as_str());
            return refuse(query, error("not-an-operator", message, "start the server with --operators"));
        }
        match verb {
            Verb::Info => reply(query, &self.info_now()),
            Verb::Params => reply(query, &self.exchange.params()),
            Verb::Scenes => reply(query, &self.catalogue.entries()),
            Verb::Schema => {
                let file_descriptor_set = Bytes::from_static(FILE_DESCRIPTOR_SET);
                reply(query, &SchemaReply { file_descriptor_set });
            }
            Verb::State => match self.state() {
                Ok(state) => reply(query, &state),
                Err(error) => refuse(query, error),
            },
            Verb::Texture => match decode::<TextureRequest>(payload) {
                Ok(TextureRequest { body_id }) => match self.textures.iter().find(|of| of.body_id == body_id)
                {
                    Some(texture) => reply(query, texture),
                    None => {
                        let message = format!("no body `{body_id}` with an image on its skin");
                        refuse(
                            query,
                            error("no-texture", message, "rpc/info says which bodies are textured"),
                        );
                    }
                },
                Err(e) => refuse(query, error(e.code(), e.to_string(), "see rpc/schema")),
            },
            Verb::Load => match decode::<LoadRequest>(payload) {
                Ok(request) => reply(query, &self.load(&request.name)),
                Err(e) => refuse(query, error(e.code(), e.to_string(), "see rpc/schema")),
            },
            Verb::Pause
            | Verb::Step
            | Verb::Reset
            | Verb::Undo
            | Verb::Set
            | Verb::Snapshot
            | Verb::Restore
            | Verb::Record => match order(verb, payload) {
                Ok(order) => reply(query, &self.carry_out(order)),
                Err(error) => refuse(query, error),
            },
        }
    }

    /// Reads the state from the simulation, and packs it while that goes on.
    fn state(&self) -> Result<StateReply, Error> {
        let Answer { reply, state } = self.ask(Order::State);
        let state = match (state, reply.error) {
            (Some(state), _) => state,
            (None, Some(error)) => return Err(error),
            (None, None) => {
                let message = "the simulation makes a long step".to_owned();
                return Err(error("busy", message, "send it again later"));
            }
        };
        let words = |reason| error("cannot-send-state", reason, "see the log of the server");
        let name = format!("{}.mcap", stem(state.scene(), SystemTime::now()));
        Ok(StateReply { name, file: state.file().map_err(words)?.into() })
    }

    /// Accepts the scene; it is built while the present one goes on. If that fails, an event says why.
    fn load(&self, name: &str) -> RpcReply {
        let reply = match self.catalogue.ask(name) {
            Ok(()) => RpcReply { ok: true, message: format!("building {name}"), ..RpcReply::default() },
            Err(refusal) => RpcReply { error: Some(refusal.into()), ..RpcReply::default() },
        };
        RpcReply { sim_step: self.exchange.sim_step.load(Ordering::Relaxed), ..reply }
    }

    /// The answer to `info` with present owners and epochs.
    fn info_now(&self) -> SessionInfo {
        let mut info = self.info.clone();
        let held: Vec<ToolInput> = self.exchange.inbox().held().cloned().collect();
        for held in held {
            match info.tools.iter_mut().find(|tool| *tool.id == *held.id) {
                Some(tool) => tool.owner = held.owner.to_string(),
                None => info.tools.push(scindo_proto::messages::ToolInfo {
                    id: held.id.to_string(),
                    shape: held.shape.as_ref().map(crate::wire::convert::to_shape),
                    owner: held.owner.to_string(),
                    cuts: matches!(held.shape, Some(ToolShape::Blade { .. })),
                }),
            }
        }
        for (index, body) in info.bodies.iter_mut().enumerate() {
            body.epoch = self.exchange.epoch(index);
        }
        info
    }

    fn carry_out(&self, order: Order) -> RpcReply {
        self.ask(order).reply
    }

    fn ask(&self, order: Order) -> Answer {
        let (answer, answers) = bounded(1);
        self.exchange.order_given();
        if self.commands.try_send(Command { order, answer }).is_err() {
            let error = error(
                "busy",
                "too many commands are waiting for the simulation".into(),
                "send it again later",
            );
            return RpcReply { error: Some(error), ..RpcReply::default() }.into();
        }
        answers.recv_timeout(PATIENCE).unwrap_or_else(|_| {
            let sim_step = self.exchange.sim_step.load(Ordering::Relaxed);
            let message = "accepted; still running".to_owned();
            RpcReply { ok: true, sim_step, message, error: None }.into()
        })
    }
}

fn order(verb: Verb, payload: Bytes) -> Result<Order, Error> {
    let read = |e: scindo_proto::DecodeError| error(e.code(), e.to_string(), "see rpc/schema");
    Ok(match verb {
        Verb::Pause => Order::Pause(decode::<PauseRequest>(payload).map_err(read)?.paused),
        Verb::Step => Order::Step(decode::<StepRequest>(payload).map_err(read)?.count),
        Verb::Undo => {
            decode::<UndoRequest>(payload).map_err(read)?;
            Order::Undo
        }
        Verb::Set => {
            let SetRequest { key, value } = decode(payload).map_err(read)?;
            Order::Set { key, value }
        }
        Verb::Record => Order::Record(decode::<RecordRequest>(payload).map_err(read)?.on),
        Verb::Snapshot => Order::Snapshot(decode::<SnapshotRequest>(payload).map_err(read)?.name),
        Verb::Restore => Order::Restore(decode::<RestoreRequest>(payload).map_err(read)?.name),
        _ => {
            decode::<ResetRequest>(payload).map_err(read)?;
            Order::Reset
        }
    })
}

fn error(code: &str, message: String, hint: &str) -> Error {
    Error { code: code.to_owned(), message, hint: hint.to_owned() }
}

fn reply<M: WireMessage>(query: &Query, message: &M) {
    let sent = query.reply(query.key_expr().clone(), encode(message)).encoding(encoding::<M>()).wait();
    if let Err(error) = sent {
        tracing::debug!(%error, "rpc answer not sent");
    }
}

/// Answers a query with an error message.
pub fn refuse(query: &Query, error: Error) {
    let encoding = "application/protobuf;scindo.v1.Error";
    if let Err(error) = query.reply_err(error.encode_to_vec()).encoding(encoding).wait() {
        tracing::debug!(%error, "rpc refusal not sent");
    }
}
