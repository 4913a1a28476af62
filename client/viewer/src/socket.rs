//! The WebSocket of one browser, from the hello to the end.

use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use axum::extract::ws::{Message, WebSocket};
use bytes::Bytes;
use futures_util::{SinkExt, StreamExt};
use prost::Message as _;
use scindo_proto::codec::WireMessage;
use scindo_proto::messages::viewer_down::Message as Down;
use scindo_proto::messages::viewer_up::Message as FromPage;
use scindo_proto::messages::{
    Error, RpcReply, ViewerHello, ViewerPerson, ViewerPing, ViewerPong, ViewerRpcReply, ViewerUp,
};
use scindo_proto::name::{NAMES, check_name};
use tokio::time::{Instant, interval_at};

use crate::door::PING;
use crate::hub::{Hub, Seat, Up, encode};

/// Largest message that a page may send [bytes]. A pose takes about 300.
pub const MAX_UP_BYTES: usize = 64 * 1024;

/// What a page calls its second tool.
const LEFT: &str = "left";

/// After this many malformed messages in a row the page is disconnected.
const MAX_MALFORMED: u32 = 16;

/// Permissions of a page.
#[derive(Debug, Clone, Copy)]
pub struct Rights {
    /// The page may only watch.
    pub read_only: bool,
    /// The page may pause, step, reset and set.
    pub operator: bool,
}

/// Serves one browser until it disconnects.
pub async fn serve(socket: WebSocket, hub: Arc<Hub>, seat: Seat, upstream: String, rights: Rights) {
    let (mut sink, mut stream) = socket.split();
    let hello = encode(&Down::Hello(ViewerHello {
        viewer_version: env!("CARGO_PKG_VERSION").to_owned(),
        client_id: hub.client_id().to_owned(),
        tool_id: seat.tool_id.clone(),
        upstream,
        read_only: rights.read_only,
        operator: rights.operator,
    }));
    let outbox = Arc::clone(&seat.outbox);
    let send = async {
        if sink.send(Message::Binary(hello)).await.is_err() {
            return;
        }
        let mut ping = interval_at(Instant::now() + PING, PING);
        loop {
            let message = tokio::select! {
                message = outbox.next() => match message {
                    Some(message) => Message::Binary(message),
                    None => return,
                },
                // The browser's answer keeps the connection open; without one it ends.
                _ = ping.tick() => Message::Ping(Bytes::new()),
            };
            if sink.send(message).await.is_err() {
                return;
            }
        }
    };
    hub.introduce(seat.browser, person(&seat, rights, ""));
    let receive = async {
        let mut malformed = 0;
        let mut name = String::new();
        while let Some(Ok(message)) = stream.next().await {
            match message {
                Message::Binary(bytes) => match take(bytes, &hub, &seat, rights, &mut name).await {
                    Ok(()) => malformed = 0,
                    Err(reason) => {
                        malformed += 1;
                        tracing::debug!(browser = seat.browser, reason, "message of a page refused");
                        if malformed > MAX_MALFORMED {
                            return;
                        }
                    }
                },
                Message::Close(_) => return,
                Message::Text(_) | Message::Ping(_) | Message::Pong(_) => {}
            }
        }
    };
    tokio::select! { () = send => {}, () = receive => {} }
}

/// Handles one message of the page. The ids are those of the seat, whatever the page claims.
async fn take(bytes: Bytes, hub: &Hub, seat: &Seat, rights: Rights, name: &mut String) -> Result<(), String> {
    let up = ViewerUp::decode(bytes).map_err(|error| error.to_string())?;
    let message = up.message.ok_or("empty message")?;
    seat.outbox.heard();
    match message {
        FromPage::Ping(ping) => seat.outbox.push(encode(&Down::Pong(pong(ping, hub, seat)))),
        FromPage::FrameAck(ack) => seat.outbox.acknowledge(ack.frames),
        FromPage::Watch(asks) => hub.ask(seat.browser, asks),
        FromPage::Name(chosen) => {
            let chosen = chosen.name.trim();
            check_name(chosen).map_err(|found| format!("the name '{found}' is not allowed, only {NAMES}"))?;
            chosen.clone_into(name);
            hub.introduce(seat.browser, person(seat, rights, name));
        }
        _ if rights.read_only => return Err("this viewer only watches".to_owned()),
        FromPage::Tool(mut sample) => {
            let id = if sample.tool_id == LEFT { &seat.left_id } else { &seat.tool_id };
            sample.client_id.clone_from(id);
            sample.tool_id.clone_from(id);
            sample.name.clone_from(name);
            sample.check().map_err(|error| error.to_string())?;
            hub.send_up(Up::Tool(Box::new(sample))).await;
        }
        FromPage::Rpc(call) if !rights.operator => {
            let (call_id, reply) = (call.call_id, Some(not_an_operator()));
            hub.answer(seat.browser, ViewerRpcReply { call_id, reply, ..ViewerRpcReply::default() });
        }
        FromPage::Rpc(call) => hub.send_up(Up::Rpc { browser: seat.browser, call }).await,
        FromPage::Release(of) => {
            let tool_id = if of.left { &seat.left_id } else { &seat.tool_id };
            hub.send_up(Up::Release { tool_id: tool_id.clone() }).await;
        }
    }
    Ok(())
}

fn person(seat: &Seat, rights: Rights, name: &str) -> ViewerPerson {
    let (tool_id, name) = (seat.tool_id.clone(), name.to_owned());
    ViewerPerson { tool_id, name, read_only: rights.read_only, operator: rights.operator }
}

fn not_an_operator() -> RpcReply {
    let error = Error {
        code: "not-an-operator".to_owned(),
        message: "this page may not pause, step, reset or change parameters".to_owned(),
        hint: "open it on the viewer's own machine, or start the viewer with --operators all".to_owned(),
    };
    RpcReply { ok: false, error: Some(error), ..RpcReply::default() }
}

fn pong(ping: ViewerPing, hub: &Hub, seat: &Seat) -> ViewerPong {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    ViewerPong {
        page_time_ms: ping.page_time_ms,
        relay_unix_ns: u64::try_from(since.as_nanos()).unwrap_or(u64::MAX),
        browsers: u32::try_from(hub.browsers()).unwrap_or(u32::MAX),
        frames_dropped: seat.outbox.frames_dropped(),
    }
}
