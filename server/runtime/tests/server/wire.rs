//! A server and clients in one process, over loopback TCP.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use scindo::server::{Server, ServerConfig};
use scindo::sim::engine::Engine;
use scindo::wire::session::{NetworkConfig, Sessions};
use scindo_client::messages::{
    BladeSegment, CutCommand, HapticContact, Pose, SurfaceFrame, ToolSample, ToolShape, Vec3,
    cut_ack::Outcome,
    force_pair, haptic_contact,
    tool_sample::Mode,
    tool_shape::{Kind, Sphere},
};
use scindo_client::{Link, LinkConfig, LinkError, Role};
use scindo_proto::{Chunk, Topic, encode, encoding};
use scindo_tests::{PATIENCE, free_pair};
use scindo_world::inputs::Wants;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use zenoh::qos::CongestionControl;

const SCENE: &str = r#"
schema = 1
name = "wire"
[world]
gravity_m_s2 = [0, 0, -9.81]
step_s = 0.01
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.08, 0.04, 0.02], cells = [8, 4, 2], pattern = "tet5" } }
young_pa = 5e4
poisson = 0.4
density_kg_m3 = 1000
solver = { iterations = 60, tolerance = 1e-4 }
[[body.fix]]
where = { box = { min_m = [-1, -1, -1e-6], max_m = [1, 1, 1e-6] } }
[[tool]]
id = "scalpel"
shape = { blade = { length_m = 0.05, thickness_m = 0.001 } }
[[tool]]
id = "probe"
shape = { sphere = { radius_m = 0.005 } }
"#;

/// A server at a pair of free ports.
struct Running {
    server: Option<Server>,
    endpoint: String,
}

impl Running {
    fn start() -> Self {
        let endpoint = format!("tcp/127.0.0.1:{}", free_pair());
        Self { server: Some(serve(&endpoint)), endpoint }
    }

    fn server(&self) -> &Server {
        self.server.as_ref().unwrap()
    }

    async fn link(&self, role: Role, id: &str) -> Link {
        let config = LinkConfig::new(role, id).with_connect([self.endpoint.clone()]);
        Link::connect(LinkConfig { timeout: PATIENCE, ..config }).await.unwrap()
    }

    fn end(&mut self) -> Engine {
        let server = self.server.take().unwrap();
        server.stop();
        server.join().unwrap()
    }
}

fn serve(endpoint: &str) -> Server {
    let scene = Scene::from_toml(SCENE).unwrap();
    let engine = Engine::new(Simulation::new(&scene, scene.base_dir()).unwrap(), None).unwrap();
    let network = NetworkConfig { listen: vec![endpoint.to_owned()], ..NetworkConfig::default() };
    Server::start(engine, Some(Sessions::open(&network).unwrap()), &ServerConfig::default()).unwrap()
}

fn block() -> Chunk {
    Chunk::new("body id", "block").unwrap()
}

async fn until(what: &str, mut check: impl FnMut() -> bool) {
    let started = Instant::now();
    while !check() {
        assert!(started.elapsed() < PATIENCE, "{what}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

fn refused(running: &Running, code: &str) -> u64 {
    running.server().exchange().inbox().refused().get(code).copied().unwrap_or(0)
}

fn at(x: f64, y: f64, z: f64) -> ToolSample {
    let pose = Pose { position_m: Some(Vec3 { x, y, z }), qw: 1.0, ..Pose::default() };
    ToolSample { pose: Some(pose), mode: Mode::Touch.into(), ..ToolSample::default() }
}

/// A vertical sheet through the block at `x`.
fn sweep(x: f64) -> Vec<BladeSegment> {
    let segment =
        |y: f64| BladeSegment { tip_m: Some(Vec3 { x, y, z: -0.01 }), heel_m: Some(Vec3 { x, y, z: 0.03 }) };
    vec![segment(-0.01), segment(0.02), segment(0.05)]
}

/// The first cut of the client "script" with its scalpel.
fn cut_of_script() -> CutCommand {
    CutCommand {
        client_id: "script".into(),
        tool_id: "scalpel".into(),
        seq: 1,
        body_id: "block".into(),
        sweep: sweep(0.033),
        ..CutCommand::default()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_joiner_sees_the_same_surface() {
    let mut running = Running::start();
    let early = running.link(Role::Viewer, "early").await;
    let mut first = early.mirror("block").await.unwrap();
    first.next().await.unwrap();
    let tool = early.tool("scalpel").await.unwrap();
    for x in [0.021, 0.043, 0.064] {
        let ack = tool.cutter.cut("block", sweep(x)).await.unwrap();
        assert_eq!(ack.outcome(), Outcome::Applied, "{ack:?}");
        assert!(ack.elements_cut > 0);
    }
    early.pause(true).await.unwrap();
    let late = running.link(Role::Viewer, "late").await;
    let mut second = late.mirror("block").await.unwrap();
    let seen = second.next().await.unwrap();
    assert!(seen.topology.epoch >= 3, "epoch {}", seen.topology.epoch);
    until("both show one step", || {
        let (a, b) = (first.latest().unwrap(), second.latest().unwrap());
        a.frame.sim_step == b.frame.sim_step
            && a.topology.epoch == b.topology.epoch
            && a.topology.vertex_count == b.topology.vertex_count
            && a.topology.triangles == b.topology.triangles
            && a.topology.tags == b.topology.tags
            && a.frame.positions == b.frame.positions
    })
    .await;
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn who_joins_a_paused_simulation_sees_the_tools_that_are_held() {
    let mut running = Running::start();
    let early = running.link(Role::Client, "early").await;
    {
        let mut gone = early.guest_tool("guest").await.unwrap();
        let shape = ToolShape { kind: Some(Kind::Sphere(Sphere { radius_m: 0.004 })) };
        let held = || running.server().exchange().inbox().held().count();
        until("the guest's tool is known", || {
            gone.send(ToolSample { shape: Some(shape), ..at(0.04, 0.02, 0.1) }).unwrap();
            held() == 1
        })
        .await;
        let mut states = early.tool_states().await.unwrap();
        while !states.next().await.unwrap().contains_key("guest") {}
        early.pause(true).await.unwrap();
    }
    until("the guest's tool is put away", || running.server().exchange().inbox().held().next().is_none())
        .await;
    let late = running.link(Role::Viewer, "late").await;
    let mut states = late.tool_states().await.unwrap();
    while states.next().await.unwrap().len() < 2 {}
    // Every tool is told anew in each round.
    let probe = states.get()["probe"].seq;
    while states.next().await.unwrap()["probe"].seq < probe + 2 {}
    let seen = states.get();
    assert_eq!(seen.keys().map(String::as_str).collect::<Vec<_>>(), ["probe", "scalpel"]);
    running.end();
}

/// Ends of the marks of a frame [m].
fn marks(frame: &SurfaceFrame) -> Vec<[f32; 3]> {
    assert_eq!(frame.marks.len(), 24 * frame.mark_count as usize);
    let coordinates: Vec<f32> =
        frame.marks.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
    coordinates.chunks_exact(3).map(|point| point.try_into().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scratch_is_drawn_for_everybody_until_the_reset() {
    let mut running = Running::start();
    let link = running.link(Role::Viewer, "early").await;
    let mut mirror = link.mirror("block").await.unwrap();
    let whole = mirror.next().await.unwrap();
    assert_eq!(marks(&whole.frame), [[0.0; 3]; 0]);
    let tool = link.tool("scalpel").await.unwrap();
    // 2 mm deep in cells of 10 mm, from inside one element to inside another one.
    let segment = |y: f64| BladeSegment {
        tip_m: Some(Vec3 { x: 0.043, y, z: 0.018 }),
        heel_m: Some(Vec3 { x: 0.043, y, z: 0.04 }),
    };
    let ack = tool.cutter.cut("block", vec![segment(0.006), segment(0.033)]).await.unwrap();
    assert_eq!((ack.outcome(), ack.elements_cut), (Outcome::Applied, 0));
    until("the scratch is drawn", || mirror.latest().unwrap().frame.mark_count > 0).await;
    link.pause(true).await.unwrap();
    let late = running.link(Role::Viewer, "late").await;
    let seen = late.mirror("block").await.unwrap().next().await.unwrap();
    until("both show one step", || mirror.latest().unwrap().frame.sim_step == seen.frame.sim_step).await;
    let drawn = mirror.latest().unwrap();
    assert_eq!(seen.frame.marks, drawn.frame.marks);
    let ends = marks(&drawn.frame);
    // From the first edge of an element that it crosses, 4 mm from where it enters, to the blade.
    let length: f32 = ends.chunks_exact(2).map(|mark| (mark[1][1] - mark[0][1]).abs()).sum();
    assert!((0.022..0.028).contains(&length), "{length} m are drawn: {ends:?}");
    for [x, y, z] in ends {
        let on_top = (x - 0.043).abs() < 1e-3 && (0.005..0.034).contains(&y) && (z - 0.02).abs() < 1e-3;
        assert!(on_top, "[{x}, {y}, {z}] is not on the line");
    }
    link.reset().await.unwrap();
    until("the scratch is gone", || mirror.latest().unwrap().frame.mark_count == 0).await;
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cut_sent_twice_is_applied_once() {
    let mut running = Running::start();
    let link = running.link(Role::Client, "script").await;
    let tool = link.tool("scalpel").await.unwrap();
    let command = cut_of_script();
    let first = tool.cutter.send(command.clone()).await.unwrap();
    let second = tool.cutter.send(command).await.unwrap();
    assert_eq!(first.outcome(), Outcome::Applied);
    assert_eq!(second.outcome(), Outcome::Duplicate);
    assert_eq!((first.elements_cut, first.epochs), (second.elements_cut, second.epochs));
    assert_eq!(running.end().simulation().cuts_applied(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_messages_are_refused_and_counted_and_the_server_lives() {
    let mut running = Running::start();
    let link = running.link(Role::Client, "broken").await;
    let mut stats = link.stats().await.unwrap();
    let chunk = |id| Chunk::new("id", id).unwrap();
    let key = |topic: fn(Chunk, Chunk) -> Topic| link.keys().key(&topic(chunk("broken"), chunk("probe")));
    let mut sample = at(f64::NAN, 0.0, 0.0);
    (sample.client_id, sample.tool_id, sample.seq) = ("broken".into(), "probe".into(), 1);
    let put = |key: String, bytes: bytes::Bytes, encoding: String| {
        let link = link.clone();
        // Blocking: on a busy machine the two megabytes would be dropped before the server sees them.
        async move {
            let put = link.haptic().put(key, bytes).encoding(encoding);
            put.congestion_control(CongestionControl::Block).await.unwrap();
        }
    };
    let pose = encoding::<ToolSample>();
    put(key(Topic::ToolPose), encode(&sample), pose.clone()).await;
    put(key(Topic::ToolPose), encode(&sample), "text/plain".into()).await;
    put(key(Topic::ToolPose), vec![0xff; 100].into(), pose.clone()).await;
    put(key(Topic::ToolPose), vec![0; 5000].into(), pose).await;
    let cut = encoding::<scindo_client::messages::CutCommand>();
    put(key(Topic::ToolCut), vec![0; 200_000].into(), cut).await;
    until("all are counted", || {
        ["non-finite", "bad-encoding", "malformed"].iter().all(|code| refused(&running, code) == 1)
            && refused(&running, "too-large") == 2
    })
    .await;
    loop {
        let stats = stats.next().await.unwrap();
        if stats.refused.iter().map(|c| c.count).sum::<u64>() == 5 {
            break;
        }
    }
    let before = running.server().steps();
    until("the server steps on", || running.server().steps() > before + 5).await;
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_client_loses_its_tool_and_another_may_take_it() {
    let mut running = Running::start();
    let watcher = running.link(Role::Viewer, "watcher").await;
    let mut events = watcher.events().await.unwrap();
    let owner = || running.server().exchange().inbox().held().next().map(|tool| tool.owner.to_string());
    {
        let link = running.link(Role::Haptic, "hand-1").await;
        let mut tool = link.tool("probe").await.unwrap();
        // Poses may be lost: a newer one follows.
        until("the first hand holds it", || {
            tool.poses.send(at(0.04, 0.02, 0.1)).unwrap();
            owner().as_deref() == Some("hand-1")
        })
        .await;
        let other = running.link(Role::Haptic, "hand-2").await;
        let mut same = other.tool("probe").await.unwrap();
        until("the second hand is refused", || {
            same.poses.send(at(0.04, 0.02, 0.1)).unwrap();
            refused(&running, "not-owner") >= 1
        })
        .await;
        assert_eq!(owner().as_deref(), Some("hand-1"));
    }
    until("the tool is free", || owner().is_none()).await;
    let third = running.link(Role::Haptic, "hand-3").await;
    let mut tool = third.tool("probe").await.unwrap();
    until("the third hand holds it", || {
        tool.poses.send(at(0.04, 0.02, 0.1)).unwrap();
        owner().as_deref() == Some("hand-3")
    })
    .await;
    loop {
        let event = events.next().await.unwrap();
        if event.name == "tool-released" {
            assert!(event.message.contains("hand-1"), "{}", event.message);
            break;
        }
    }
    running.end();
}

/// The first poses are on their way before the token of who sends them is.
#[tokio::test(flavor = "multi_thread")]
async fn who_moves_a_tool_at_once_is_not_refused() {
    let mut running = Running::start();
    let link = running.link(Role::Viewer, "page").await;
    let shape = ToolShape { kind: Some(Kind::Sphere(Sphere { radius_m: 0.004 })) };
    for guest in 0..40 {
        let mut hand = link.guest_tool(&format!("guest-{guest}")).await.unwrap();
        let holds = || running.server().exchange().inbox().held().count() == 1;
        until("the guest holds its tool", || {
            for _ in 0..3 {
                hand.send(ToolSample { shape: Some(shape), ..at(0.04, 0.02, 0.1) }).unwrap();
            }
            holds()
        })
        .await;
        drop(hand);
        until("the tool is put away", || !holds()).await;
    }
    assert_eq!(running.server().exchange().inbox().refused().get("no-token"), None);
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_haptic_client_feels_the_body_and_costs_nothing_when_it_is_gone() {
    let mut running = Running::start();
    {
        let link = running.link(Role::Haptic, "hand").await;
        let sent_ns = Arc::new(Mutex::new(Vec::new()));
        let stamps = sent_ns.clone();
        let on_contact = move |message: HapticContact| stamps.lock().unwrap().push(message.publish_unix_ns);
        let _stream = link.each_contact("probe", on_contact).await.unwrap();
        let mut tool = link.tool("probe").await.unwrap();
        // Lowers the ball from above the block to 4 mm below its top.
        let mut height = 0.035_f64;
        until("the block pushes back", || {
            height = (height - 2e-4).max(0.021);
            tool.poses.send(at(0.04, 0.02, height)).unwrap();
            let newest = &tool.contacts.latest().message;
            let pushes = newest.contacts.iter().any(|c| c.force_n.is_some_and(|f| f.z > 0.01));
            newest.mode() == haptic_contact::Mode::Contact && pushes
        })
        .await;
        let already = sent_ns.lock().unwrap().len();
        until("the contact is told on and on", || sent_ns.lock().unwrap().len() > already + 200).await;
        // By the server's stamps, wherever it was not held up: most models follow each other sooner than steps.
        let mut gaps_ms: Vec<f64> =
            sent_ns.lock().unwrap().windows(2).map(|two| (two[1] as f64 - two[0] as f64) * 1e-6).collect();
        gaps_ms.sort_by(f64::total_cmp);
        let median_ms = gaps_ms[gaps_ms.len() / 2];
        assert!(median_ms < 10.0, "a contact every {median_ms} ms");
    }
    until("nobody wants contact any more", || {
        let mut wants = Wants::default();
        running.server().exchange().wants_into(&mut wants);
        !wants.contact && wants.surface.iter().all(|wanted| !wanted)
    })
    .await;
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn surfaces_are_built_only_while_somebody_watches() {
    let mut running = Running::start();
    let wanted = || running.server().exchange().surface_wanted(0);
    assert!(!wanted());
    let link = running.link(Role::Viewer, "viewer").await;
    let mut mirror = link.mirror("block").await.unwrap();
    let surface = mirror.next().await.unwrap();
    assert_eq!(surface.frame.positions.len(), 12 * surface.topology.vertex_count as usize);
    until("the subscription is noticed", wanted).await;
    drop(mirror);
    until("its end is noticed", || !wanted()).await;
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn forces_are_gathered_only_while_somebody_subscribes() {
    let mut running = Running::start();
    let hand = running.link(Role::Haptic, "hand").await;
    let mut probe = hand.tool("probe").await.unwrap();
    let is_wanted = || {
        let mut wants = Wants::default();
        running.server().exchange().wants_into(&mut wants);
        wants.forces
    };
    assert!(!is_wanted());
    let mut forces = hand.forces().await.unwrap();
    until("forces are wanted", is_wanted).await;
    // Lowers the ball from above the block, which is held below, to 4 mm below its top.
    let mut height = 0.035_f64;
    let pressed = async {
        loop {
            height = (height - 1e-3).max(0.021);
            probe.poses.send(at(0.04, 0.02, height)).unwrap();
            let seen = forces.next().await.unwrap();
            if let Some(pair) = seen.pairs.first().filter(|pair| !pair.points.is_empty()) {
                return pair.clone();
            }
        }
    };
    let pair = tokio::time::timeout(PATIENCE, pressed).await.unwrap();
    assert_eq!((pair.kind(), &*pair.on, &*pair.by), (force_pair::Kind::Tool, "block", "probe"));
    assert!(pair.force_n.unwrap().z < 0.0 && pair.normal_n > 0.0 && pair.contacts > 0, "{pair:?}");
    let point = &pair.points[0];
    assert!(point.normal.unwrap().z < -0.5 && point.point_m.unwrap().z > 0.0, "{point:?}");
    drop(forces);
    until("nobody wants forces", || !is_wanted()).await;
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_last_frame_before_a_pause_is_told_twice() {
    let mut running = Running::start();
    let link = running.link(Role::Viewer, "viewer").await;
    link.pause(true).await.unwrap();
    let frames =
        link.bulk().declare_subscriber(link.keys().key(&Topic::SurfaceFrame(block()))).await.unwrap();
    let mut told = Vec::new();
    while told.len() < 2 {
        let frame = tokio::time::timeout(PATIENCE, frames.recv_async()).await.unwrap().unwrap();
        let payload = bytes::Bytes::from(frame.payload().to_bytes().into_owned());
        let frame: SurfaceFrame = scindo_proto::decode(payload).unwrap();
        told.push((frame.sim_step, frame.seq));
    }
    assert_eq!((told[1].0, told[1].1), (told[0].0, told[0].1 + 1));
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn orders_are_answered() {
    let mut running = Running::start();
    let link = running.link(Role::Client, "operator").await;
    let info = link.info().await.unwrap();
    assert_eq!((info.scene_name.as_str(), info.bodies.len(), info.tools.len()), ("wire", 1, 2));
    assert!(!link.schema().await.unwrap().file_descriptor_set.is_empty());
    link.pause(true).await.unwrap();
    let before = running.server().steps();
    let reply = link.step(7).await.unwrap();
    assert_eq!(reply.sim_step, before + 7);
    assert_eq!(running.server().steps(), before + 7);
    link.set("world.gravity_m_s2", "[0, 0, 0]").await.unwrap();
    let unknown = link.set("world.gravitas", "1").await.unwrap_err();
    assert!(matches!(&unknown, LinkError::Refused { code, .. } if code == "cannot-set"), "{unknown}");
    link.reset().await.unwrap();
    link.pause(false).await.unwrap();
    let busy = link.step(1).await.unwrap_err();
    assert!(matches!(&busy, LinkError::Refused { code, .. } if code == "not-paused"), "{busy}");
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_of_the_haptic_port_alone_gets_everything() {
    let mut running = Running::start();
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", r#""client""#.to_owned()),
        ("connect/endpoints", format!("[{:?}]", running.endpoint)),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    let session = zenoh::open(config).await.unwrap();
    let frames = session.declare_subscriber("scindo/@v1/main/body/block/surface/frame").await.unwrap();
    let frame = tokio::time::timeout(PATIENCE, frames.recv_async()).await.unwrap().unwrap();
    assert_eq!(frame.encoding().to_string(), "application/protobuf;scindo.v1.SurfaceFrame");
    let keyframe = session.get("scindo/@v1/main/body/block/surface/keyframe").await.unwrap();
    assert!(keyframe.recv_async().await.unwrap().result().is_ok());
    session.close().await.unwrap();
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_finds_a_server_that_was_restarted() {
    let mut running = Running::start();
    let link = running.link(Role::Viewer, "patient").await;
    let mut mirror = link.mirror("block").await.unwrap();
    let cutter = link.tool("scalpel").await.unwrap().cutter;
    cutter.cut("", sweep(0.033)).await.unwrap();
    until("the cut is shown", || mirror.latest().is_some_and(|s| s.topology.epoch > 0)).await;
    running.end();
    let presence = link.presence();
    until("the server is missed", || presence.borrow().servers == 0).await;
    running.server = Some(serve(&running.endpoint));
    until("the server is back", || presence.borrow().servers == 1).await;
    until("its uncut surface is shown", || mirror.latest().is_some_and(|s| s.topology.epoch == 0)).await;
    mirror.next().await.unwrap();
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_there_is_said_clearly() {
    let mut config = LinkConfig::new(Role::Viewer, "lonely").with_connect(["tcp/127.0.0.1:9".to_owned()]);
    config.timeout = Duration::from_millis(500);
    let error = Link::connect(config).await.err().unwrap();
    assert!(error.to_string().contains("no scindo server answers at tcp/127.0.0.1:9"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_may_change_is_listed_with_its_range_and_changes() {
    let mut running = Running::start();
    let link = running.link(Role::Client, "operator").await;
    let stiffness = || async {
        let params = link.params().await.unwrap().params;
        params.into_iter().find(|param| param.key == "body.block.young_pa").unwrap()
    };
    let before = stiffness().await;
    assert!(
        before.value.parse::<f64>().unwrap() == 5e4 && before.min < 5e4 && before.max > 5e4,
        "{before:?}"
    );
    link.set("body.block.young_pa", "8e4").await.unwrap();
    assert_eq!(stiffness().await.value.parse::<f64>().unwrap(), 8e4);
    let refused = link.set("body.block.young_pa", &format!("{:e}", 10.0 * before.max)).await.unwrap_err();
    assert!(matches!(&refused, LinkError::Refused { code, .. } if code == "cannot-set"), "{refused}");
    assert_eq!(stiffness().await.value.parse::<f64>().unwrap(), 8e4);
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cut_that_was_taken_back_is_still_a_duplicate() {
    let mut running = Running::start();
    let link = running.link(Role::Client, "script").await;
    let mut mirror = link.mirror("block").await.unwrap();
    let whole = mirror.next().await.unwrap().topology.triangle_count;
    let tool = link.tool("scalpel").await.unwrap();
    let command = cut_of_script();
    assert_eq!(tool.cutter.send(command.clone()).await.unwrap().outcome(), Outcome::Applied);
    until("the cut is shown", || mirror.latest().is_some_and(|s| s.topology.triangle_count > whole)).await;
    link.undo().await.unwrap();
    until("it is gone", || mirror.latest().is_some_and(|s| s.topology.triangle_count == whole)).await;
    assert_eq!(tool.cutter.send(command).await.unwrap().outcome(), Outcome::Duplicate);
    let nothing = link.undo().await.unwrap_err();
    assert!(matches!(&nothing, LinkError::Refused { code, .. } if code == "cannot-undo"), "{nothing}");
    assert_eq!(mirror.latest().unwrap().topology.triangle_count, whole);
    running.end();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_state_that_was_kept_comes_back_with_its_cuts_and_its_tools() {
    let mut running = Running::start();
    let link = running.link(Role::Client, "script").await;
    let mut mirror = link.mirror("block").await.unwrap();
    let first = mirror.next().await.unwrap().topology.clone();
    let tool = link.tool("scalpel").await.unwrap();
    let nothing = link.restore("uncut").await.unwrap_err();
    assert!(matches!(&nothing, LinkError::Refused { code, .. } if code == "cannot-restore"), "{nothing}");
    let bad = link.snapshot("Un cut").await.unwrap_err();
    assert!(!bad.to_string().is_empty());
    link.snapshot("uncut").await.unwrap();
    assert_eq!(tool.cutter.send(cut_of_script()).await.unwrap().outcome(), Outcome::Applied);
    let whole = first.triangle_count;
    until("the cut is shown", || mirror.latest().is_some_and(|s| s.topology.triangle_count > whole)).await;
    let cut = mirror.latest().unwrap().topology.clone();
    link.snapshot("cut").await.unwrap();

    link.restore("uncut").await.unwrap();
    until("it is whole again", || mirror.latest().is_some_and(|s| s.topology.triangle_count == whole)).await;
    let epoch = mirror.latest().unwrap().topology.epoch;
    assert!(epoch > cut.epoch, "epochs rise: {epoch} after {}", cut.epoch);
    link.restore("cut").await.unwrap();
    let same = cut.triangle_count;
    until("it is cut again", || mirror.latest().is_some_and(|s| s.topology.triangle_count == same)).await;
    assert!(mirror.latest().unwrap().topology.epoch > epoch);
    // What the restored state knows of the cut: it can be taken back.
    link.undo().await.unwrap();
    until("the cut is undone", || mirror.latest().is_some_and(|s| s.topology.triangle_count == whole)).await;
    let engine = running.end();
    assert!(engine.failures().is_empty(), "{:?}", engine.failures());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_runs_one_scene_loads_no_other() {
    let mut running = Running::start();
    let link = running.link(Role::Client, "operator").await;
    assert!(link.scenes().await.unwrap().scenes.is_empty());
    let refused = link.load("kidney").await.unwrap_err();
    assert!(matches!(&refused, LinkError::Refused { code, .. } if code == "not-supported"), "{refused}");
    running.end();
}

/// A client of the release before or after this one asks under keys of its own, and gets one readable sentence.
#[tokio::test(flavor = "multi_thread")]
async fn a_client_of_another_version_is_told_so_at_once() {
    let mut running = Running::start();
    let link = running.link(Role::Viewer, "bystander").await;
    for version in [0, 2, 9] {
        for verb in ["info", "pause"] {
            let started = Instant::now();
            let replies = link.bulk().get(format!("scindo/@v{version}/main/rpc/{verb}")).await.unwrap();
            let reply = replies.recv_async().await.expect("an answer");
            let refusal = reply.result().expect_err("a refusal");
            let error: scindo_client::messages::Error =
                prost::Message::decode(&*refusal.payload().to_bytes()).unwrap();
            assert_eq!(error.code, "wire-version");
            let says = format!("speaks version 1 of the wire, the client version {version}");
            assert!(error.message.contains(&says) && !error.hint.is_empty(), "{error:?}");
            assert!(started.elapsed() < PATIENCE);
            assert!(replies.recv_async().await.is_err(), "one message");
        }
    }
    assert_eq!(link.info().await.unwrap().wire_version, 1);
    running.end();
}
