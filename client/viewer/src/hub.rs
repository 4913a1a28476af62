//! Connects one server with many browsers. It keeps the newest state for late joiners, hands every message to
//! every outbox, and collects what the browsers send.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use prost::Message as _;
use scindo_proto::MOUSE;
use scindo_proto::limits::{MAX_BODIES, MAX_TOOLS};
use scindo_proto::messages::viewer_down::Message as Down;
use scindo_proto::messages::{
    ToolSample, ViewerDown, ViewerLink, ViewerPeople, ViewerPerson, ViewerRpc, ViewerRpcReply, ViewerWatch,
};
use tokio::sync::{mpsc, watch};

use crate::outbox::{Outbox, Slot};

/// Most messages from browsers that wait for the link to the server.
const MAX_WAITING: usize = 256;

/// Number of past events that late joiners receive.
const MAX_EVENTS: usize = 7;

/// Most state slots: link, people, info, plan, stats, measures and forces, and those of bodies and tools.
const MAX_SLOTS: usize = 7 + 4 * MAX_BODIES + 2 * MAX_TOOLS;

/// Topics that browsers watch. The viewer subscribes to nothing else.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Watched {
    /// Surfaces and tools: at least one browser is present.
    pub scene: bool,
    /// Stress on surfaces.
    pub stress: bool,
    /// Probes and energies.
    pub measures: bool,
    /// Forces of contact.
    pub forces: bool,
}

/// When all seats are taken, a browser that has been silent for this long loses its seat to a new one.
const SILENT: Duration = Duration::from_secs(2);

/// A message from a browser to the server, under the identity that the viewer assigned.
#[derive(Debug)]
pub enum Up {
    /// Newest pose of a mouse tool.
    Tool(Box<ToolSample>),
    /// A call, answered through [`Hub::answer`].
    Rpc {
        /// Number of the calling browser.
        browser: u64,
        /// What the page asks the server for.
        call: ViewerRpc,
    },
    /// The mouse tool was put away, or its browser has left.
    Release {
        /// Id of the tool.
        tool_id: String,
    },
}

/// State shared by the link to the server and all browsers.
#[derive(Debug)]
pub struct Hub {
    shared: Mutex<Shared>,
    next_browser: AtomicU64,
    up: mpsc::Sender<Up>,
    client_id: String,
    watched: watch::Sender<Watched>,
}

#[derive(Debug, Default)]
struct Shared {
    slots: BTreeMap<Slot, Bytes>,
    events: VecDeque<Bytes>,
    browsers: BTreeMap<u64, Browser>,
    connected: bool,
}

/// A browser at the hub: its outbox, and the topics it asked for beside surfaces.
#[derive(Debug)]
struct Browser {
    outbox: Arc<Outbox>,
    asks: ViewerWatch,
    /// Who looks at it, once it was introduced.
    person: Option<ViewerPerson>,
}

impl Shared {
    /// Ends the browser that has been silent for the longest time. False if none is silent.
    fn unseat_silent(&mut self) -> bool {
        let longest = self.browsers.iter().map(|(&number, browser)| (browser.outbox.silence(), number)).max();
        let Some((_, browser)) = longest.filter(|(silence, _)| *silence >= SILENT) else { return false };
        if let Some(browser) = self.browsers.remove(&browser) {
            browser.outbox.close();
        }
        true
    }
}

/// A browser's place at the hub. Dropping it removes the browser.
#[derive(Debug)]
pub struct Seat {
    hub: Arc<Hub>,
    /// Number of the browser, unique in this process.
    pub browser: u64,
    /// Messages to be sent to the browser.
    pub outbox: Arc<Outbox>,
    /// Id of its mouse tool on the server.
    pub tool_id: String,
    /// Id of its second tool, for the left hand of somebody in a headset.
    pub left_id: String,
}

impl Hub {
    /// Creates a hub, and the receiver from which the link to the server takes the messages of browsers.
    /// `client_id` is the viewer's id on the server; mouse tools are named after it.
    pub fn new(client_id: &str) -> (Arc<Self>, mpsc::Receiver<Up>) {
        let (up, taken) = mpsc::channel(MAX_WAITING);
        let hub = Self {
            shared: Mutex::default(),
            next_browser: AtomicU64::new(1),
            up,
            client_id: client_id.to_owned(),
            watched: watch::Sender::new(Watched::default()),
        };
        (Arc::new(hub), taken)
    }

    /// The viewer's id on the server.
    pub fn client_id(&self) -> &str {
        &self.client_id
    }

    /// Topics that browsers watch. Changes wake the receiver.
    pub fn watched(&self) -> watch::Receiver<Watched> {
        self.watched.subscribe()
    }

    /// Drops the stored surfaces and tools. The server will send them again.
    pub fn forget_scene(&self) {
        let is_scene = |slot: &Slot| {
            matches!(
                slot,
                Slot::Tool(_)
                    | Slot::Texture(_)
                    | Slot::Topology(_)
                    | Slot::Frame(_)
                    | Slot::Field(_)
                    | Slot::Measures
                    | Slot::Forces
            )
        };
        self.lock().slots.retain(|slot, _| !is_scene(slot));
    }

    /// Sends a message to every browser and stores it for late joiners.
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
                shared.browsers.values().for_each(|browser| browser.outbox.forget(&slot));
            }
            Down::Topology(topology) => {
                // Positions of the previous epoch have no triangles any more.
                let slot = Slot::Frame(topology.body_id.clone());
                shared.slots.remove(&slot);
                shared.browsers.values().for_each(|browser| browser.outbox.forget(&slot));
            }
            _ => {}
        }
        let Some(slot) = slot_of(&message) else {
            shared.browsers.values().for_each(|browser| browser.outbox.push(bytes.clone()));
            return;
        };
        if shared.slots.len() >= MAX_SLOTS && !shared.slots.contains_key(&slot) {
            tracing::warn!(?slot, "the session has too many bodies and tools; some are not shown");
            return;
        }
        shared.slots.insert(slot.clone(), bytes.clone());
        let asked = shared.browsers.values().filter(|browser| browser.takes(&slot));
        asked.for_each(|browser| browser.outbox.put(slot.clone(), bytes.clone()));
    }

    /// Tells every browser whether the server is connected. If it has left, its stored state is dropped.
    pub fn set_link(&self, connected: bool, detail: &str) {
        {
            let mut shared = self.lock();
            shared.connected = connected;
            if !connected {
                // Browsers keep showing the last state under a notice. New browsers wait.
                shared.slots.retain(|slot, _| *slot == Slot::People);
            }
        }
        self.publish(Down::Link(ViewerLink { connected, detail: detail.to_owned() }));
    }

    /// Sends the answer of a call to the browser that made it.
    pub fn answer(&self, browser: u64, answer: ViewerRpcReply) {
        let bytes = encode(&Down::Rpc(answer));
        if let Some(browser) = self.lock().browsers.get(&browser) {
            browser.outbox.push(bytes);
        }
    }

    /// Whether a server is connected.
    pub fn connected(&self) -> bool {
        self.lock().connected
    }

    /// Number of connected browsers.
    pub fn browsers(&self) -> usize {
        self.lock().browsers.len()
    }

    /// Seats a browser and sends it all present state. If `most` are seated already, it takes the seat of the
    /// one that has been silent for the longest time. It gets none if no browser is silent.
    pub fn join(self: &Arc<Self>, most: usize) -> Option<Seat> {
        let mut shared = self.lock();
        if shared.browsers.len() >= most && !shared.unseat_silent() {
            return None;
        }
        let browser = self.next_browser.fetch_add(1, Ordering::Relaxed);
        let outbox = Arc::new(Outbox::default());
        let newcomer = Browser { outbox: Arc::clone(&outbox), asks: ViewerWatch::default(), person: None };
        let slots = shared.slots.iter().filter(|(slot, _)| newcomer.takes(slot));
        slots.for_each(|(slot, bytes)| outbox.put(slot.clone(), bytes.clone()));
        shared.events.iter().for_each(|bytes| outbox.push(bytes.clone()));
        shared.browsers.insert(browser, newcomer);
        self.tell_watched(&shared);
        let tool_id = format!("{}{MOUSE}{browser}", self.client_id);
        let left_id = format!("{tool_id}-left");
        Some(Seat { hub: Arc::clone(self), browser, outbox, tool_id, left_id })
    }

    /// Records which topics a browser shows beside the surfaces.
    pub fn ask(&self, browser: u64, asks: ViewerWatch) {
        let mut shared = self.lock();
        let Shared { slots, browsers, .. } = &mut *shared;
        let Some(browser) = browsers.get_mut(&browser) else { return };
        let asked_before = std::mem::replace(&mut browser.asks, asks);
        if asked_before == asks {
            return;
        }
        // State that others already asked for is available at once.
        let on_demand = |slot: &Slot| matches!(slot, Slot::Field(_) | Slot::Measures | Slot::Forces);
        for (slot, bytes) in slots.iter().filter(|(slot, _)| on_demand(slot) && browser.takes(slot)) {
            browser.outbox.put(slot.clone(), bytes.clone());
        }
        self.tell_watched(&shared);
    }

    /// Tells every browser who looks at browser number `browser`.
    pub fn introduce(&self, browser: u64, person: ViewerPerson) {
        {
            let mut shared = self.lock();
            let Some(known) = shared.browsers.get_mut(&browser) else { return };
            if known.person.as_ref() == Some(&person) {
                return;
            }
            known.person = Some(person);
        }
        self.tell_people();
    }

    fn tell_people(&self) {
        let people = self.lock().browsers.values().filter_map(|browser| browser.person.clone()).collect();
        self.publish(Down::People(ViewerPeople { people }));
    }

    fn tell_watched(&self, shared: &Shared) {
        let asks = |of: fn(&ViewerWatch) -> bool| shared.browsers.values().any(|browser| of(&browser.asks));
        let watched = Watched {
            scene: !shared.browsers.is_empty(),
            stress: asks(|asks| asks.stress),
            measures: asks(|asks| asks.measures),
            forces: asks(|asks| asks.forces),
        };
        self.watched.send_if_modified(|held| std::mem::replace(held, watched) != watched);
    }

    /// Forwards a message of a browser. Poses are dropped when the link is behind, because newer ones follow.
    pub async fn send_up(&self, message: Up) {
        if matches!(message, Up::Tool(_)) {
            let _ = self.up.try_send(message);
        } else if self.up.send(message).await.is_err() {
            tracing::debug!("the link was closed; a command from a browser was lost");
        }
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Browser {
    /// Whether the browser receives this state. Fields, measures and forces are sent only on request.
    fn takes(&self, slot: &Slot) -> bool {
        match slot {
            Slot::Field(_) => self.asks.stress,
            Slot::Measures => self.asks.measures,
            Slot::Forces => self.asks.forces,
            _ => true,
        }
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.outbox.close();
        {
            let mut shared = self.hub.lock();
            shared.browsers.remove(&self.browser);
            self.hub.tell_watched(&shared);
        }
        self.hub.tell_people();
        // If the channel is full, the server's watch on poses ends the tool.
        for tool_id in [&self.tool_id, &self.left_id] {
            if self.hub.up.try_send(Up::Release { tool_id: tool_id.clone() }).is_err() {
                tracing::warn!(tool = tool_id, "could not release the tool of a browser that left");
            }
        }
    }
}

/// Encodes one message for a browser.
pub fn encode(message: &Down) -> Bytes {
    ViewerDown { message: Some(message.clone()) }.encode_to_vec().into()
}

fn slot_of(message: &Down) -> Option<Slot> {
    Some(match message {
        Down::Link(_) => Slot::Link,
        Down::People(_) => Slot::People,
        Down::Info(_) => Slot::Info,
        Down::Plan(_) => Slot::Plan,
        Down::Stats(_) => Slot::Stats,
        Down::Tool(state) => Slot::Tool(state.tool_id.clone()),
        Down::Texture(texture) => Slot::Texture(texture.body_id.clone()),
        Down::Topology(topology) => Slot::Topology(topology.body_id.clone()),
        Down::Frame(frame) => Slot::Frame(frame.body_id.clone()),
        Down::CoarseFrame(coarse) => Slot::Frame(coarse.frame.as_ref()?.body_id.clone()),
        Down::Field(field) => Slot::Field(field.body_id.clone()),
        Down::Measures(_) => Slot::Measures,
        Down::Forces(_) => Slot::Forces,
        Down::Hello(_) | Down::Event(_) | Down::Pong(_) | Down::Rpc(_) | Down::ToolGone(_) => {
            return None;
        }
    })
}
