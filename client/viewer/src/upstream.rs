//! The link to the server. Its messages go to the hub, and messages of browsers go to it.
//!
//! Surfaces and tool states are subscribed only while a browser watches. A server whose viewers are all
//! closed therefore builds no surface.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use scindo_client::messages::viewer_down::Message as Down;
use scindo_client::messages::viewer_rpc::Call;
use scindo_client::messages::{
    Error, RpcReply, ToolSample, ToolState, ViewerRpc, ViewerRpcReply, ViewerToolGone,
};
use scindo_client::{BodyMirror, GuestTool, Latest, Link, LinkConfig, LinkError, ToolStates};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, timeout};

use crate::coarse::for_page;
use crate::hub::{Hub, Up};

/// Pause between two attempts to reach a server.
const RETRY: Duration = Duration::from_millis(700);

/// A tool that has sent nothing for this long has left.
const TOOL_SILENCE: Duration = Duration::from_millis(1500);

/// How often the image on a body is asked for.
const TEXTURE_ATTEMPTS: usize = 5;

/// Longest time between the appearance of a server and its answer to `info`.
const INFO_PATIENCE: Duration = Duration::from_secs(10);

/// Keeps a link to the server for as long as the viewer lives.
pub(crate) async fn run(hub: Arc<Hub>, mut up: mpsc::Receiver<Up>, config: LinkConfig) {
    let place = config.connect.join(", ");
    loop {
        let waiting = format!("no server yet at {place}");
        let link = tokio::select! {
            link = Link::connect(config.clone()) => link,
            () = refuse_calls(&hub, &mut up, &waiting) => return,
        };
        match link {
            Ok(link) => match relay(&hub, &mut up, link, &place).await {
                Ok(()) => return,
                Err(error) => hub.set_link(false, &error.to_string()),
            },
            Err(error) => {
                tracing::debug!(%error, "no link yet");
                hub.set_link(false, &waiting);
            }
        }
        tokio::select! {
            () = sleep(RETRY) => {}
            () = refuse_calls(&hub, &mut up, &waiting) => return,
        }
    }
}

/// Refuses calls of browsers while there is no server. Ends when the hub is gone.
async fn refuse_calls(hub: &Hub, up: &mut mpsc::Receiver<Up>, words: &str) {
    while let Some(message) = up.recv().await {
        if let Up::Rpc { browser, call } = message {
            hub.answer(browser, failed(call.call_id, refused("no-server", words)));
        }
    }
}

/// Relays messages over one link. Returns `Ok` when the hub is gone.
async fn relay(
    hub: &Arc<Hub>,
    up: &mut mpsc::Receiver<Up>,
    link: Link,
    place: &str,
) -> Result<(), LinkError> {
    let mut presence = link.presence();
    let mut watched = hub.watched();
    let mut stats = link.stats().await?;
    let mut plan = link.plan().await?;
    let mut events = link.events().await?;
    let mut hands = Hands::new(link.clone());
    let mut followed = Followed::default();
    refresh(hub, &link, place, &mut followed).await?;
    loop {
        tokio::select! {
            changed = presence.changed() => {
                changed.map_err(|_| LinkError::Closed)?;
                refresh(hub, &link, place, &mut followed).await?;
            }
            changed = watched.changed() => {
                if changed.is_err() { return Ok(()); }
                refresh(hub, &link, place, &mut followed).await?;
            }
            message = stats.next() => hub.publish(Down::Stats((*message?).clone())),
            message = plan.next() => hub.publish(Down::Plan((*message?).clone())),
            message = events.next() => hub.publish(Down::Event(message?)),
            message = up.recv() => match message {
                None => return Ok(()),
                Some(Up::Tool(sample)) => hands.move_tool(*sample).await,
                Some(Up::Release { tool_id }) => hands.release(&tool_id),
                Some(Up::Rpc { browser, call }) => {
                    let (hub, link) = (Arc::clone(hub), link.clone());
                    tokio::spawn(async move {
                        hub.answer(browser, ask(&link, call).await);
                    });
                }
            },
        }
    }
}

/// Topics followed on the server. Their tasks end when they are dropped.
#[derive(Default)]
struct Followed {
    /// Generation of the server that they belong to.
    generation: u64,
    /// Ids of the bodies, while surfaces and tools are followed.
    bodies: Vec<String>,
    scene: Option<JoinSet<()>>,
    stress: Option<JoinSet<()>>,
    measures: Option<JoinSet<()>>,
    forces: Option<JoinSet<()>>,
}

/// Adjusts the followed topics to the present server and to what browsers watch.
async fn refresh(hub: &Arc<Hub>, link: &Link, place: &str, followed: &mut Followed) -> Result<(), LinkError> {
    let presence = *link.presence().borrow();
    let watched = *hub.watched().borrow();
    if presence.servers == 0 {
        *followed = Followed { generation: followed.generation, ..Followed::default() };
        hub.set_link(false, &format!("no server at {place}"));
        return Ok(());
    }
    if !hub.connected() {
        hub.set_link(true, place);
    }
    if !watched.scene || followed.generation != presence.generation {
        *followed = Followed::default();
        hub.forget_scene();
    }
    followed.generation = presence.generation;
    if watched.scene && followed.scene.is_none() {
        let (bodies, tasks) = follow_scene(hub, link).await?;
        (followed.bodies, followed.scene) = (bodies, Some(tasks));
    }
    if !watched.stress {
        followed.stress = None;
    } else if followed.stress.is_none() {
        let mut tasks = JoinSet::new();
        for body in &followed.bodies {
            tasks.spawn(pass_on(Arc::clone(hub), link.stress(body).await?, Down::Field));
        }
        followed.stress = Some(tasks);
    }
    if !watched.measures {
        followed.measures = None;
    } else if followed.measures.is_none() {
        let mut tasks = JoinSet::new();
        tasks.spawn(pass_on(Arc::clone(hub), link.measures().await?, Down::Measures));
        followed.measures = Some(tasks);
    }
    if !watched.forces {
        followed.forces = None;
    } else if followed.forces.is_none() {
        let mut tasks = JoinSet::new();
        tasks.spawn(pass_on(Arc::clone(hub), link.forces().await?, Down::Forces));
        followed.forces = Some(tasks);
    }
    Ok(())
}

/// Forwards every new message of a topic to the hub.
async fn pass_on<M: Clone>(hub: Arc<Hub>, mut latest: Latest<M>, to_down: fn(M) -> Down) {
    while let Ok(message) = latest.next().await {
        hub.publish(to_down((*message).clone()));
    }
}

/// Starts to follow every body and tool of the present server, and returns the ids of the bodies.
async fn follow_scene(hub: &Arc<Hub>, link: &Link) -> Result<(Vec<String>, JoinSet<()>), LinkError> {
    let asked = Instant::now();
    let info = loop {
        match link.info().await {
            Ok(info) => break info,
            // The server announces itself before its scene is ready.
            Err(LinkError::NoServer { .. } | LinkError::Timeout { .. })
                if asked.elapsed() < INFO_PATIENCE =>
            {
                sleep(Duration::from_millis(200)).await;
            }
            Err(error) => return Err(error),
        }
    };
    let mut tasks = JoinSet::new();
    for body in &info.bodies {
        tasks.spawn(follow_body(Arc::clone(hub), link.mirror(&body.id).await?));
        if body.look.as_ref().is_some_and(|look| look.textured) {
            tasks.spawn(fetch_texture(Arc::clone(hub), link.clone(), body.id.clone()));
        }
    }
    tasks.spawn(follow_tools(Arc::clone(hub), link.tool_states().await?));
    let bodies = info.bodies.iter().map(|body| body.id.clone()).collect();
    hub.publish(Down::Info(info));
    Ok((bodies, tasks))
}

/// Forwards the image on the skin of one body. Until it arrives, the body has one colour.
async fn fetch_texture(hub: Arc<Hub>, link: Link, body: String) {
    for _ in 0..TEXTURE_ATTEMPTS {
        match link.texture(&body).await {
            Ok(texture) => return hub.publish(Down::Texture(texture)),
            Err(error) => tracing::warn!(%error, body, "no image for the skin of the body"),
        }
        sleep(RETRY).await;
    }
}

/// Forwards the surface of one body: the topology if it changed, then the frame.
async fn follow_body(hub: Arc<Hub>, mut mirror: BodyMirror) {
    let mut shown = None;
    while let Ok(surface) = mirror.next().await {
        if !shown.as_ref().is_some_and(|topology| Arc::ptr_eq(topology, &surface.topology)) {
            hub.publish(Down::Topology((*surface.topology).clone()));
            shown = Some(Arc::clone(&surface.topology));
        }
        hub.publish(for_page(surface.frame.clone()));
    }
}

/// Forwards the states of all tools, and reports tools that fall silent.
async fn follow_tools(hub: Arc<Hub>, mut states: ToolStates) {
    let mut shown: BTreeMap<String, (Arc<ToolState>, Instant)> = BTreeMap::new();
    let mut clock = interval(TOOL_SILENCE / 3);
    clock.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            newest = states.next() => {
                let Ok(newest) = newest else { return };
                for (id, state) in newest.iter() {
                    if shown.get(id).is_some_and(|(old, _)| Arc::ptr_eq(old, state)) {
                        continue;
                    }
                    shown.insert(id.clone(), (Arc::clone(state), Instant::now()));
                    hub.publish(Down::Tool((**state).clone()));
                }
            }
            _ = clock.tick() => {
                for (id, (_, at)) in &mut shown {
                    if at.elapsed() > TOOL_SILENCE {
                        hub.publish(Down::ToolGone(ViewerToolGone { tool_id: id.clone() }));
                        // Reported once; a new state shows the tool again.
                        *at += Duration::from_secs(365 * 86_400);
                    }
                }
            }
        }
    }
}

/// The mouse tools of all browsers. Each has a liveliness token of its own. The server takes the tool back
/// when its browser leaves, and all tools when the viewer leaves.
struct Hands {
    link: Link,
    held: BTreeMap<String, GuestTool>,
}

impl Hands {
    fn new(link: Link) -> Self {
        Self { link, held: BTreeMap::new() }
    }

    async fn move_tool(&mut self, sample: ToolSample) {
        let id = sample.tool_id.clone();
        if !self.held.contains_key(&id) {
            match timeout(RETRY, self.link.guest_tool(&id)).await {
                Ok(Ok(tool)) => {
                    self.held.insert(id.clone(), tool);
                }
                Ok(Err(error)) => return tracing::warn!(%error, tool = id, "cannot take the tool"),
                Err(_) => return tracing::warn!(tool = id, "the link is too slow to take the tool"),
            }
        }
        if let Some(tool) = self.held.get_mut(&id)
            && let Err(error) = tool.send(sample)
        {
            tracing::debug!(%error, tool = id, "pose not sent");
        }
    }

    fn release(&mut self, id: &str) {
        self.held.remove(id);
    }
}

/// Makes one call of a page and returns the answer.
async fn ask(link: &Link, call: ViewerRpc) -> ViewerRpcReply {
    let call_id = call.call_id;
    let mut answer = ViewerRpcReply { call_id, ..ViewerRpcReply::default() };
    let outcome = match call.call {
        Some(Call::Pause(request)) => link.pause(request.paused).await,
        Some(Call::Step(request)) => link.step(request.count).await,
        Some(Call::Reset(_)) => link.reset().await,
        Some(Call::Set(request)) => link.set(&request.key, &request.value).await,
        Some(Call::Undo(_)) => link.undo().await,
        Some(Call::Load(request)) => link.load(&request.name).await,
        Some(Call::Record(request)) => link.record(request.on).await,
        Some(Call::State(_)) => link.state().await.map(|state| {
            answer.state = Some(state);
            RpcReply { ok: true, ..RpcReply::default() }
        }),
        Some(Call::Params(_)) => link.params().await.map(|params| {
            answer.params = Some(params);
            RpcReply { ok: true, ..RpcReply::default() }
        }),
        Some(Call::Scenes(_)) => link.scenes().await.map(|scenes| {
            answer.scenes = Some(scenes);
            RpcReply { ok: true, ..RpcReply::default() }
        }),
        None => return failed(call_id, refused("empty", "the request of the page is empty")),
    };
    answer.reply = Some(outcome.unwrap_or_else(|error| match error {
        LinkError::Refused { code, message, hint } => {
            RpcReply { ok: false, error: Some(Error { code, message, hint }), ..RpcReply::default() }
        }
        other => refused("not-answered", &other.to_string()),
    }));
    answer
}

fn failed(call_id: u32, reply: RpcReply) -> ViewerRpcReply {
    ViewerRpcReply { call_id, reply: Some(reply), ..ViewerRpcReply::default() }
}

fn refused(code: &str, message: &str) -> RpcReply {
    let error = Error { code: code.to_owned(), message: message.to_owned(), hint: String::new() };
    RpcReply { ok: false, error: Some(error), ..RpcReply::default() }
}
