//! From the server to a peer: surfaces, tools, forces and events, at chosen rates.
//!
//! | message | device | when |
//! |---|---|---|
//! | `STATUS` | `scindo` | at the start, when the scene changes, when the server comes or goes |
//! | `POLYDATA` | id of the body | at most `surface_hz`, if the surface has moved |
//! | `TRANSFORM` | `scindo-` and the id of the tool | at most `tool_hz`, if the tool has moved: where the tissue lets it be |
//! | `STRING` | `force-` and the id of the tool | with it: the force of the tissue on the tool, x y z [N] |
//! | `STRING` | `scindo-event` | each event of the server, in words |
//! | `TDATA` | `scindo` | after `STT_TDATA`: all tools |
//!
//! A peer that reads slowly misses surfaces and poses, never an event in order; a peer that reads nothing is closed.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use scindo_client::messages::{Event, ToolState};
use scindo_client::{BodyMirror, Link, LinkError, Surface};
use tokio::io::{AsyncWrite, AsyncWriteExt as _};
use tokio::sync::mpsc;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, timeout};

use crate::axes::Axes;
use crate::ended::Ended;
use crate::names::device_of;
use crate::receive::Order;
use crate::surface::SurfaceWriter;
use crate::wire::content::Tracked;
use crate::wire::encode::Encoded;
use crate::wire::header::TimeStamp;

/// A peer that takes no byte for so long is closed.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// How often the scene is asked for.
const SCENE_PERIOD: Duration = Duration::from_secs(2);

/// Shortest time between two `TDATA` messages.
const MIN_TRACKING: Duration = Duration::from_millis(10);

/// Name under which the bridge speaks of itself.
const SELF: &str = "scindo";

/// Codes of `STATUS`: fine, and not ready.
const FINE: u16 = 1;
const NOT_READY: u16 = 13;

/// Types that this program sends or reads, for `GET_CAPABIL`.
const KINDS: [&str; 9] = [
    "TRANSFORM",
    "TDATA",
    "STRING",
    "STATUS",
    "POLYDATA",
    "GET_STATUS",
    "GET_POLYDATA",
    "STT_TDATA",
    "STP_TDATA",
];

/// What is sent, and how often.
#[derive(Debug, Clone, Copy)]
pub struct SendSettings {
    /// What the axes of the scene mean to the peer.
    pub axes: Axes,
    /// Shortest time between two surfaces of a body.
    pub surface_period: Duration,
    /// Shortest time between two poses of a tool.
    pub tool_period: Duration,
}

/// What is followed. Another server or scene has another one.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Followed {
    generation: u64,
    scene_seq: u32,
    bodies: Vec<String>,
}

/// A body that is followed.
struct Body {
    id: String,
    device: String,
    mirror: BodyMirror,
    sent: Option<Arc<Surface>>,
    writer: SurfaceWriter,
}

/// What the peer wants.
struct Wants {
    surfaces: bool,
    tools: bool,
    texts: bool,
    tracking: Option<Interval>,
}

/// Sends to one peer.
pub struct Sender<W> {
    to: W,
    link: Link,
    settings: SendSettings,
    wants: Wants,
    bodies: Vec<Body>,
    /// What is followed; `None` until the server was asked, and within it without a server.
    followed: Option<Option<Followed>>,
    /// Newest message of each tool that was sent, and its force.
    tools: BTreeMap<String, (u64, String)>,
}

impl<W: AsyncWrite + Unpin> Sender<W> {
    /// Sends to `to` what `link` brings.
    pub fn new(to: W, link: Link, settings: SendSettings) -> Self {
        let wants = Wants { surfaces: true, tools: true, texts: true, tracking: None };
        Self { to, link, settings, wants, bodies: Vec::new(), followed: None, tools: BTreeMap::new() }
    }

    /// Sends until the peer ends.
    ///
    /// # Errors
    /// Always: why the connection ends.
    pub async fn run(mut self, mut orders: mpsc::Receiver<Order>) -> Result<std::convert::Infallible, Ended> {
        let states = self.link.tool_states().await?;
        let mut events = self.link.events().await?;
        let mut scene = periodic(SCENE_PERIOD);
        let (mut surfaces, mut tools) =
            (periodic(self.settings.surface_period), periodic(self.settings.tool_period));
        loop {
            tokio::select! {
                order = orders.recv() => match order {
                    Some(order) => self.answer(order, &states.get()).await?,
                    None => return Err(Ended::Closed),
                },
                event = events.next() => self.event(&event?).await?,
                _ = scene.tick() => self.follow().await?,
                _ = tools.tick(), if self.wants.tools => self.tools(&states.get()).await?,
                _ = surfaces.tick(), if self.wants.surfaces => self.surfaces().await?,
                () = tick(&mut self.wants.tracking) => self.tracking(&states.get()).await?,
            }
        }
    }

    /// Follows the bodies of the scene that the server has now.
    async fn follow(&mut self) -> Result<(), Ended> {
        let generation = self.link.presence().borrow().generation;
        let now = match self.link.info().await {
            Ok(info) => {
                let bodies = info.bodies.into_iter().map(|body| body.id).collect();
                Some(Followed { generation, scene_seq: info.scene_seq, bodies })
            }
            Err(LinkError::NoServer { .. } | LinkError::Timeout { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        if self.followed.as_ref() == Some(&now) {
            return Ok(());
        }
        self.bodies.clear();
        self.tools.clear();
        for id in now.iter().flat_map(|now| &now.bodies) {
            let (device, mirror) = (device_of("", id), self.link.mirror(id).await?);
            let writer = SurfaceWriter::default();
            self.bodies.push(Body { id: id.clone(), device, mirror, sent: None, writer });
        }
        self.followed = Some(now);
        self.status().await
    }

    async fn surfaces(&mut self) -> Result<(), Ended> {
        for number in 0..self.bodies.len() {
            let body = &mut self.bodies[number];
            let Some(surface) = body.mirror.latest() else { continue };
            if body.sent.as_ref().is_some_and(|sent| Arc::ptr_eq(sent, &surface)) {
                continue;
            }
            let encoded = body.writer.encode(&body.device, &surface, self.settings.axes);
            body.sent = Some(surface);
            match encoded {
                Ok(message) => self.write(message).await?,
                Err(error) => tracing::warn!(body = body.id, %error, "a surface is not sent"),
            }
        }
        Ok(())
    }

    async fn tools(&mut self, states: &BTreeMap<String, Arc<ToolState>>) -> Result<(), Ended> {
        for (id, state) in states {
            let (seq, told) = self.tools.get(id).cloned().unwrap_or_default();
            let Some(pose) = state.proxy_pose.as_ref().or(state.pose.as_ref()).filter(|_| seq != state.seq)
            else {
                continue;
            };
            let (axes, time) = (self.settings.axes, TimeStamp::from_unix_ns(state.publish_unix_ns));
            self.write(Encoded::transform(&device_of("scindo-", id), time, &axes.transform(pose))).await?;
            let force = state.force_n.unwrap_or_default();
            let force = axes.turn(nalgebra::Vector3::new(force.x, force.y, force.z));
            // Without the sign of a zero.
            let [x, y, z] = [force.x, force.y, force.z].map(|f| if f.abs() < 5e-4 { 0.0 } else { f });
            let force = format!("{x:.3} {y:.3} {z:.3}");
            if self.wants.texts && force != told {
                self.write(Encoded::text(&device_of("force-", id), time, &force)).await?;
            }
            self.tools.insert(id.clone(), (state.seq, force));
        }
        self.tools.retain(|id, _| states.contains_key(id));
        Ok(())
    }

    async fn tracking(&mut self, states: &BTreeMap<String, Arc<ToolState>>) -> Result<(), Ended> {
        let tracked = |(id, state): (&String, &Arc<ToolState>)| {
            let pose = state.proxy_pose.as_ref().or(state.pose.as_ref())?;
            Some(Tracked { name: device_of("scindo-", id), transform: self.settings.axes.transform(pose) })
        };
        let all: Vec<Tracked> = states.iter().filter_map(tracked).collect();
        self.write(Encoded::tracking(SELF, TimeStamp::now(), &all)).await
    }

    async fn event(&mut self, event: &Event) -> Result<(), Ended> {
        if !self.wants.texts {
            return Ok(());
        }
        let time = TimeStamp::from_unix_ns(event.publish_unix_ns);
        let text = format!("{}: {}", event.name, event.message);
        self.write(Encoded::text("scindo-event", time, &text)).await
    }

    async fn answer(&mut self, order: Order, states: &BTreeMap<String, Arc<ToolState>>) -> Result<(), Ended> {
        let now = TimeStamp::now();
        let (what, device, wanted, period) = match order {
            Order::Get { what, device } => return self.get(&what, &device, states).await,
            Order::Start { what, device, period } => (what, device, true, period),
            Order::Stop { what, device } => (what, device, false, Duration::ZERO),
        };
        let done = match what.as_str() {
            "POLYDATA" => {
                self.wants.surfaces = wanted;
                true
            }
            "TRANS" | "TRANSFORM" => {
                self.wants.tools = wanted;
                true
            }
            "STRING" => {
                self.wants.texts = wanted;
                true
            }
            "TDATA" => {
                self.wants.tracking = wanted.then(|| periodic(period.max(MIN_TRACKING)));
                true
            }
            _ => false,
        };
        self.write(Encoded::ready(&what, &device, now, done)).await
    }

    async fn get(
        &mut self,
        what: &str,
        device: &str,
        states: &BTreeMap<String, Arc<ToolState>>,
    ) -> Result<(), Ended> {
        let now = TimeStamp::now();
        match what {
            "STATUS" => self.status().await,
            "CAPABIL" => self.write(Encoded::capability(SELF, now, &KINDS)).await,
            "POLYDATA" => {
                let asked = |body: &&mut Body| device.is_empty() || body.device == device;
                self.bodies.iter_mut().filter(asked).for_each(|body| body.sent = None);
                self.surfaces().await
            }
            "TRANS" | "TRANSFORM" => {
                self.tools.clear();
                self.tools(states).await
            }
            "TDATA" => self.tracking(states).await,
            // Unknown questions have no answer in the protocol.
            _ => Ok(()),
        }
    }

    async fn status(&mut self) -> Result<(), Ended> {
        let (code, error, text) = match self.followed.as_ref().and_then(Option::as_ref) {
            Some(followed) => (FINE, "OK", format!("bodies: {}", followed.bodies.join(" "))),
            None => (NOT_READY, "Not ready", "no scindo server answers".to_owned()),
        };
        self.write(Encoded::status(SELF, TimeStamp::now(), code, error, &text)).await
    }

    /// Writes all of a message. It waits as long as the peer takes some of it from time to time.
    async fn write(&mut self, message: Encoded) -> Result<(), Ended> {
        let mut left = message.into_bytes();
        while !left.is_empty() {
            let written =
                timeout(PATIENCE, self.to.write(&left)).await.map_err(|_| Ended::Slow(PATIENCE))??;
            if written == 0 {
                return Err(Ended::Closed);
            }
            drop(left.split_to(written));
        }
        Ok(())
    }
}

/// Ticks at once, then every `period`. Ticks that were missed are left out.
fn periodic(period: Duration) -> Interval {
    let mut ticks = interval(period);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    ticks
}

/// The next tick; never without an interval.
async fn tick(interval: &mut Option<Interval>) {
    match interval {
        Some(interval) => drop::<Instant>(interval.tick().await),
        None => std::future::pending().await,
    }
}
