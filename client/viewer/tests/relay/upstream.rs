//! The viewer against a server made of plain zenoh: late joining, going away, coming back, and no
//! subscription while nobody watches.
use std::net::SocketAddr;
use std::time::Duration;

use bytes::Bytes;
use futures_util::{SinkExt, StreamExt};
use prost::Message as _;
use scindo_proto::messages::viewer_down::Message as Down;
use scindo_proto::messages::viewer_rpc::Call;
use scindo_proto::messages::viewer_up::Message as FromPage;
use scindo_proto::messages::{
    BodyInfo, Param, ParamsReply, PauseRequest, Pose, RpcReply, SessionInfo, SurfaceFrame, SurfaceKeyframe,
    SurfaceTopology, ToolSample, ToolShape, Vec3, ViewerDown, ViewerParamsCall, ViewerRpc, ViewerUp,
    tool_sample, tool_shape,
};
use scindo_proto::{Chunk, KeySpace, Topic, Verb, WireMessage, decode, encode, encoding};
use scindo_tests::{PATIENCE, free_pair};
use scindo_view::{ViewConfig, Viewer};
use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};
use zenoh::Wait as _;
use zenoh::query::Query;
use zenoh::sample::SampleKind;

type Browser = WebSocketStream<MaybeTlsStream<TcpStream>>;

fn keys() -> KeySpace {
    KeySpace::new("scindo", "main").unwrap()
}

fn body() -> Chunk {
    Chunk::new("body id", "liver").unwrap()
}

fn topology(epoch: u32) -> SurfaceTopology {
    let words = |n: u32| Bytes::from((0..n).flat_map(u32::to_le_bytes).collect::<Vec<u8>>());
    SurfaceTopology {
        body_id: "liver".into(),
        epoch,
        vertex_count: 3,
        triangle_count: 1,
        triangles: words(3),
        tags: words(1),
        ..Default::default()
    }
}

fn frame(epoch: u32, step: u64) -> SurfaceFrame {
    SurfaceFrame {
        seq: step,
        sim_step: step,
        body_id: "liver".into(),
        epoch,
        vertex_count: 3,
        positions: vec![0_u8; 36].into(),
        ..Default::default()
    }
}

/// The frame in a message for pages, whatever its precision.
fn shown(message: Down) -> Option<SurfaceFrame> {
    match message {
        Down::Frame(frame) => Some(frame),
        Down::CoarseFrame(coarse) => {
            assert_eq!(coarse.positions.len(), 6 * 3, "three vertices of 16 bits");
            coarse.frame
        }
        _ => None,
    }
}

/// A server that shows one triangle, at epoch `epoch`.
struct Server {
    session: zenoh::Session,
    epoch: u32,
}

impl Server {
    /// With a port of its own for surfaces, one above.
    fn start(port: u16, epoch: u32) -> Self {
        Self::start_at(&[port, port + 1], epoch)
    }

    fn start_at(ports: &[u16], epoch: u32) -> Self {
        let listen: Vec<String> = ports.iter().map(|port| format!("\"tcp/127.0.0.1:{port}\"")).collect();
        let mut config = zenoh::Config::default();
        for (key, value) in [
            ("mode", "\"router\"".to_owned()),
            ("listen/endpoints", format!("[{}]", listen.join(","))),
            ("scouting/multicast/enabled", "false".to_owned()),
        ] {
            config.insert_json5(key, &value).unwrap();
        }
        let session = zenoh::open(config).wait().unwrap();
        let info = SessionInfo {
            scene_name: format!("scene {epoch}"),
            bodies: vec![BodyInfo { id: "liver".into(), epoch, ..Default::default() }],
            ..Default::default()
        };
        answer(&session, Topic::Rpc(Verb::Info), info);
        answer(
            &session,
            Topic::Rpc(Verb::Pause),
            RpcReply { ok: true, message: "paused".into(), ..Default::default() },
        );
        let param = Param { key: "body.liver.young_pa".into(), ..Default::default() };
        answer(&session, Topic::Rpc(Verb::Params), ParamsReply { params: vec![param] });
        let keyframe = SurfaceKeyframe { topology: Some(topology(epoch)), frame: Some(frame(epoch, 1)) };
        answer(&session, Topic::SurfaceKeyframe(body()), keyframe);
        let token = keys().key(&Topic::Server(Chunk::new("id", "server").unwrap()));
        std::mem::forget(session.liveliness().declare_token(token).wait().unwrap());
        Self { session, epoch }
    }

    fn send_frame(&self, step: u64) {
        let key = keys().key(&Topic::SurfaceFrame(body()));
        let payload = encode(&frame(self.epoch, step));
        self.session.put(key, payload).encoding(encoding::<SurfaceFrame>()).wait().unwrap();
    }

    /// Whether anybody subscribes to the surface.
    async fn is_watched(&self) -> bool {
        let publisher =
            self.session.declare_publisher(keys().key(&Topic::SurfaceFrame(body()))).await.unwrap();
        publisher.matching_status().await.unwrap().matching()
    }

    /// Waits until the viewer has declared all it wants while nobody watches.
    async fn becomes_joined(&self) {
        let publisher = self.session.declare_publisher(keys().key(&Topic::Event)).await.unwrap();
        let wait = async {
            while !publisher.matching_status().await.unwrap().matching() {
                sleep(Duration::from_millis(50)).await;
            }
        };
        timeout(PATIENCE, wait).await.expect("the viewer subscribes to events");
    }

    async fn becomes_watched(&self, wanted: bool) {
        let wait = async {
            while self.is_watched().await != wanted {
                sleep(Duration::from_millis(50)).await;
            }
        };
        timeout(PATIENCE, wait).await.unwrap_or_else(|_| panic!("watched never became {wanted}"));
    }
}

fn answer<M: WireMessage + 'static>(session: &zenoh::Session, topic: Topic, message: M) {
    let reply = move |query: Query| {
        query.reply(query.key_expr(), encode(&message)).encoding(encoding::<M>()).wait().unwrap();
    };
    session.declare_queryable(keys().key(&topic)).callback(reply).background().wait().unwrap();
}

async fn viewer(port: u16) -> SocketAddr {
    let mut config = ViewConfig::new(SocketAddr::from(([127, 0, 0, 1], 0)));
    config.link.connect = vec![format!("tcp/127.0.0.1:{port}")];
    config.link.timeout = Duration::from_secs(3);
    let viewer = Viewer::bind(config).await.unwrap();
    let address = viewer.address();
    tokio::spawn(viewer.run());
    address
}

async fn join(address: SocketAddr) -> Browser {
    connect_async(format!("ws://{address}/ws")).await.unwrap().0
}

/// Reads until a message fits; what comes before it is skipped.
async fn until<T>(browser: &mut Browser, what: &str, mut fits: impl FnMut(Down) -> Option<T>) -> T {
    let read = async {
        loop {
            let message = browser.next().await.expect("the viewer closed the socket").unwrap();
            if let Message::Binary(bytes) = message
                && let Some(found) = fits(ViewerDown::decode(bytes).unwrap().message.unwrap())
            {
                return found;
            }
        }
    };
    timeout(PATIENCE, read).await.unwrap_or_else(|_| panic!("{what} never came"))
}

async fn send(browser: &mut Browser, message: FromPage) {
    let bytes = ViewerUp { message: Some(message) }.encode_to_vec();
    browser.send(Message::Binary(bytes.into())).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_browser_sees_the_server_come_go_and_come_back() {
    let port = free_pair();
    let address = viewer(port).await;
    let mut browser = join(address).await;
    until(&mut browser, "word that nobody is there", |m| {
        matches!(m, Down::Link(link) if !link.connected).then_some(())
    })
    .await;

    let server = Server::start(port, 4);
    until(&mut browser, "the link", |m| matches!(m, Down::Link(link) if link.connected).then_some(())).await;
    until(&mut browser, "the scene", |m| {
        matches!(m, Down::Info(info) if info.scene_name == "scene 4").then_some(())
    })
    .await;
    until(&mut browser, "the keyframe", |m| {
        shown(m).is_some_and(|f| f.epoch == 4 && f.sim_step == 1).then_some(())
    })
    .await;
    server.becomes_watched(true).await;
    server.send_frame(9);
    until(&mut browser, "a frame", |m| shown(m).is_some_and(|f| f.sim_step == 9).then_some(())).await;

    server.session.close().await.unwrap();
    until(&mut browser, "word that it left", |m| {
        matches!(m, Down::Link(link) if !link.connected).then_some(())
    })
    .await;
    let again = Server::start(port, 0);
    until(&mut browser, "the new scene", |m| {
        matches!(m, Down::Info(info) if info.scene_name == "scene 0").then_some(())
    })
    .await;
    until(&mut browser, "its keyframe", |m| shown(m).is_some_and(|f| f.epoch == 0).then_some(())).await;
    drop(again);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_is_subscribed_while_no_browser_watches() {
    // One port for everything, as behind a router.
    let port = free_pair();
    let server = Server::start_at(&[port], 0);
    let address = viewer(port).await;
    server.becomes_joined().await;
    // Nothing says that nothing more will come: a moment must do.
    sleep(Duration::from_secs(1)).await;
    assert!(!server.is_watched().await);
    let mut browser = join(address).await;
    until(&mut browser, "a surface", |m| shown(m).is_some().then_some(())).await;
    server.becomes_watched(true).await;
    drop(browser);
    server.becomes_watched(false).await;
    let mut late = join(address).await;
    until(&mut late, "a surface again", |m| shown(m).is_some().then_some(())).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn tools_have_an_owner_each_and_calls_are_answered() {
    let port = free_pair();
    let server = Server::start(port, 0);
    let address = viewer(port).await;
    let (owners, mut owner_seen) = tokio::sync::mpsc::channel::<(SampleKind, String)>(16);
    let watch =
        server.session.liveliness().declare_subscriber(keys().every_client()).callback(move |sample| {
            let _ = owners.try_send((sample.kind(), sample.key_expr().to_string()));
        });
    let _watch = watch.await.unwrap();
    let poses = server.session.declare_subscriber(keys().every_tool_pose()).await.unwrap();

    let mut browser = join(address).await;
    until(&mut browser, "a surface", |m| shown(m).is_some().then_some(())).await;
    send(
        &mut browser,
        FromPage::Rpc(ViewerRpc { call_id: 7, call: Some(Call::Pause(PauseRequest { paused: true })) }),
    )
    .await;
    let reply =
        until(&mut browser, "the answer", |m| if let Down::Rpc(reply) = m { Some(reply) } else { None })
            .await;
    assert!(reply.call_id == 7 && reply.reply.unwrap().ok);
    let question = Call::Params(ViewerParamsCall {});
    send(&mut browser, FromPage::Rpc(ViewerRpc { call_id: 8, call: Some(question) })).await;
    let answered = |m| if let Down::Rpc(reply) = m { (reply.call_id == 8).then_some(reply) } else { None };
    let reply = until(&mut browser, "the parameters", answered).await;
    assert_eq!(reply.params.unwrap().params[0].key, "body.liver.young_pa");

    let kind = tool_shape::Kind::Sphere(tool_shape::Sphere { radius_m: 0.01 });
    let sample = ToolSample {
        pose: Some(Pose { position_m: Some(Vec3::default()), qw: 1.0, ..Default::default() }),
        mode: tool_sample::Mode::Touch.into(),
        shape: Some(ToolShape { kind: Some(kind) }),
        ..Default::default()
    };
    // Best effort: the first samples may come before the subscription does.
    let arrived = async {
        loop {
            send(&mut browser, FromPage::Tool(sample.clone())).await;
            if let Ok(Ok(sample)) = timeout(Duration::from_millis(200), poses.recv_async()).await {
                return decode::<ToolSample>(Bytes::from(sample.payload().to_bytes().into_owned())).unwrap();
            }
        }
    };
    let pose = timeout(PATIENCE, arrived).await.unwrap();
    assert!(pose.tool_id.contains("-mouse-") && pose.client_id == pose.tool_id);

    drop(browser);
    let released = async {
        while let Some((kind, key)) = owner_seen.recv().await {
            if kind == SampleKind::Delete && key.contains(&format!("/{}/", pose.client_id)) {
                return;
            }
        }
        panic!("the watch ended");
    };
    timeout(PATIENCE, released).await.expect("the owner of the tool goes with its browser");
}
