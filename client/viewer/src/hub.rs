//! Between one server and many browsers: keeps the newest state for late joiners, hands every
//! message to every outbox, and collects what the browsers send.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytes::Bytes;
use prost::Message as _;
use scindo_proto::limits::{MAX_BODIES, MAX_TOOLS};
use scindo_proto::messages::viewer_down::Message as Down;
use scindo_proto::messages::{RpcReply, ToolSample, ViewerDown, ViewerLink, ViewerRpc, ViewerRpcReply};
use tokio::sync::{mpsc, watch};

use crate::outbox::{Outbox, Slot};

/// Messages from browsers that may wait for the link to the server.
const MAX_WAITING: usize = 256;

/// Events a late joiner still sees.
const MAX_EVENTS: usize = 7;

/// State slots beside bodies and tools: link, info, plan, stats.
const MAX_SLOTS: usize = 4 + 2 * MAX_BODIES + 2 * MAX_TOOLS;

/// What a browser wants of the server, under the identity the viewer gave it.
#[derive(Debug)]
pub enum Up {
    /// Newest pose of a mouse tool.
    Tool(Box<ToolSample>),
    /// A call, to be answered through [`Hub::answer`].
    Rpc {
        /// The browser that called.
        browser: u64,
        /// The call.
        call: ViewerRpc,
    },
    /// The mouse tool was put away, or its browser left.
    Release {
        /// The tool.
        tool_id: String,
    },
}

/// The meeting point.
#[derive(Debug)]
pub struct Hub {
    shared: Mutex<Shared>,
    next_browser: AtomicU64,
    up: mpsc::Sender<Up>,
    client_id: String,
    watched: watch::Sender<bool>,
}

#[derive(Debug, Default)]
struct Shared {
    slots: BTreeMap<Slot, Bytes>,
    events: VecDeque<Bytes>,
    browsers: BTreeMap<u64, Arc<Outbox>>,
    connected: bool,
}

/// A browser's place at the hub; leaving it drops the place.
#[derive(Debug)]
pub struct Seat {
    hub: Arc<Hub>,
    /// Number of the browser, unique in this process.
    pub browser: u64,
    /// What it has to be sent.
    pub outbox: Arc<Outbox>,
    /// Identity of its mouse tool.
    pub tool_id: String,
}

impl Hub {
    /// A hub, and the end where the link to the server takes what browsers send. `client_id` is
    /// the viewer's id on the server; the mouse tools are named after it.
    pub fn new(client_id: &str) -> (Arc<Self>, mpsc::Receiver<Up>) {
        let (up, taken) = mpsc::channel(MAX_WAITING);
        let hub = Self {
            shared: Mutex::default(),
            next_browser: AtomicU64::new(1),
            up,
            client_id: client_id.to_owned(),
            watched: watch::Sender::new(false),
        };
        (Arc::new(hub), taken)
    }

    /// The viewer's id on the server.
    pub fn client_id(&self) -> &str {
        &self.client_id
    }

    /// Whether any browser watches; without one, nothing needs to be asked of the server.
    pub fn watched(&self) -> watch::Receiver<bool> {
        self.watched.subscribe()
    }

    /// Forgets surfaces and tools: they will be told anew.
    pub fn forget_scene(&self) {
        let is_scene = |slot: &Slot| matches!(slot, Slot::Tool(_) | Slot::Topology(_) | Slot::Frame(_));
        self.lock().slots.retain(|slot, _| !is_scene(slot));
    }

    /// Gives a message to every browser and keeps it for those who come later.
    pub fn publish(&self, message: Down) {
        let bytes = encode(&message);
        let mut shared = self.lock();
        match &message {
            Down::Event(_) => {
                if shared.events.len() == MAX_EVENTS {
                    shared.events.pop_front();
                }
                shared.events.push_back(bytes.clone());
            }
            Down::ToolGone(gone) => {
                let slot = Slot::Tool(gone.tool_id.clone());
                shared.slots.remove(&slot);
                shared.browsers.values().for_each(|outbox| outbox.forget(&slot));
            }
            Down::Topology(topology) => {
                // Positions of the epoch before have no triangles any more.
                let slot = Slot::Frame(topology.body_id.clone());
                shared.slots.remove(&slot);
                shared.browsers.values().for_each(|outbox| outbox.forget(&slot));
            }
            _ => {}
        }
        let Some(slot) = slot_of(&message) else {
            shared.browsers.values().for_each(|outbox| outbox.push(bytes.clone()));
            return;
        };
        if shared.slots.len() >= MAX_SLOTS && !shared.slots.contains_key(&slot) {
            tracing::warn!(?slot, "more bodies and tools than a session may have; not shown");
            return;
        }
        shared.slots.insert(slot.clone(), bytes.clone());
        shared.browsers.values().for_each(|outbox| outbox.put(slot.clone(), bytes.clone()));
    }

    /// Tells every browser whether a server is heard; a server that left takes its state along.
    pub fn set_link(&self, connected: bool, detail: &str) {
        {
            let mut shared = self.lock();
            shared.connected = connected;
            if !connected {
                // What was last seen stays in the browsers, under a notice; newcomers wait.
                shared.slots.clear();
            }
        }
        self.publish(Down::Link(ViewerLink { connected, detail: detail.to_owned() }));
    }

    /// Answers the call of one browser.
    pub fn answer(&self, browser: u64, call_id: u32, reply: RpcReply) {
        let bytes = encode(&Down::Rpc(ViewerRpcReply { call_id, reply: Some(reply) }));
        if let Some(outbox) = self.lock().browsers.get(&browser) {
            outbox.push(bytes);
        }
    }

    /// Whether a server is heard.
    pub fn connected(&self) -> bool {
        self.lock().connected
    }

    /// Browsers that are connected.
    pub fn browsers(&self) -> usize {
        self.lock().browsers.len()
    }

    /// Seats a browser, unless `most` already sit; it is sent all present state.
    pub fn join(self: &Arc<Self>, most: usize) -> Option<Seat> {
        let mut shared = self.lock();
        if shared.browsers.len() >= most {
            return None;
        }
        let browser = self.next_browser.fetch_add(1, Ordering::Relaxed);
        let outbox = Arc::new(Outbox::default());
        shared.slots.iter().for_each(|(slot, bytes)| outbox.put(slot.clone(), bytes.clone()));
        shared.events.iter().for_each(|bytes| outbox.push(bytes.clone()));
        shared.browsers.insert(browser, Arc::clone(&outbox));
        self.watched.send_replace(true);
        let name = self.client_id.strip_prefix("view-").unwrap_or(&self.client_id);
        Some(Seat { hub: Arc::clone(self), browser, outbox, tool_id: format!("mouse-{name}-{browser}") })
    }

    /// Passes on what a browser sent. Poses are dropped when the link is behind: a newer one follows.
    pub async fn send_up(&self, message: Up) {
        if matches!(message, Up::Tool(_)) {
            let _ = self.up.try_send(message);
        } else if self.up.send(message).await.is_err() {
            tracing::debug!("the link has ended; a command of a browser is lost");
        }
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.outbox.close();
        {
            let mut shared = self.hub.lock();
            shared.browsers.remove(&self.browser);
            self.hub.watched.send_replace(!shared.browsers.is_empty());
        }
        // Should the channel be full, the server's watch on poses ends the tool.
        if self.hub.up.try_send(Up::Release { tool_id: self.tool_id.clone() }).is_err() {
            tracing::warn!(tool = self.tool_id, "could not release the tool of a browser that left");
        }
    }
}

/// Bytes of one message to a browser.
pub fn encode(message: &Down) -> Bytes {
    ViewerDown { message: Some(message.clone()) }.encode_to_vec().into()
}

fn slot_of(message: &Down) -> Option<Slot> {
    Some(match message {
        Down::Link(_) => Slot::Link,
        Down::Info(_) => Slot::Info,
        Down::Plan(_) => Slot::Plan,
        Down::Stats(_) => Slot::Stats,
        Down::Tool(state) => Slot::Tool(state.tool_id.clone()),
        Down::Topology(topology) => Slot::Topology(topology.body_id.clone()),
        Down::Frame(frame) => Slot::Frame(frame.body_id.clone()),
        Down::Hello(_) | Down::Event(_) | Down::Pong(_) | Down::Rpc(_) | Down::ToolGone(_) => {
            return None;
        }
    })
}
