//! Access control of a laboratory with certificates: every role, key and verb is tried by a real client over QUIC
//! against a real server.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use scindo::lab::folder::Folder;
use scindo::lab::issue::{Holder, authority, issue};
use scindo::lab::members::Lab;
use scindo::lab::roles::LabRole;
use scindo::server::{Server, ServerConfig};
use scindo::sim::engine::Engine;
use scindo::wire::session::{NetworkConfig, Sessions};
use scindo_client::messages::cut_ack::Outcome;
use scindo_client::messages::{BladeSegment, CutCommand, Pose, ToolSample, Vec3, tool_sample};
use scindo_client::{Link, LinkConfig, Role};
use scindo_proto::{encode, encoding};
use scindo_tests::{PATIENCE, free_pair};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait as _};

use crate::lab_scene;

const YEAR: Duration = Duration::from_secs(365 * 86400);
/// Time in which a message certainly arrives on loopback.
const SETTLE: Duration = Duration::from_millis(700);
const PREFIX: &str = "scindo/@v1/main/";

/// Clients of the laboratory, one per role, and a second one that touches.
const CLIENTS: [(&str, LabRole); 5] = [
    ("watcher", LabRole::Viewer),
    ("hand", LabRole::Haptic),
    ("console", LabRole::Operator),
    ("teacher", LabRole::Teacher),
    ("rival", LabRole::Haptic),
];

/// Keys of the session; `ME` stands for the client that tries, and `OTHER` for another.
const KEYS: [&str; 33] = [
    "body/block/surface/frame",
    "body/block/surface/topology",
    "body/block/surface/keyframe",
    "body/block/surface/field/von-mises",
    "measures",
    "forces",
    "tool/probe/contact",
    "tool/probe/state",
    "tool/probe/cut_ack",
    "stats",
    "event",
    "plan",
    "server/main/live",
    "client/ME/tool/probe/pose",
    "client/ME/tool/probe/cut",
    "client/ME/tool/probe/capability",
    "client/ME-mouse-1/tool/ME-mouse-1/pose",
    "client/ME/live/haptic",
    "client/ME-mouse-1/live/viewer",
    "client/OTHER/tool/probe/pose",
    "client/OTHER/tool/probe/cut",
    "client/OTHER-mouse-1/tool/probe/pose",
    "client/OTHER/live/haptic",
    "rpc/info",
    "rpc/params",
    "rpc/scenes",
    "rpc/schema",
    "rpc/pause",
    "rpc/step",
    "rpc/reset",
    "rpc/set",
    "rpc/undo",
    "rpc/load",
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verb {
    Put,
    Delete,
    Get,
    Subscribe,
    Answer,
    Token,
}

const VERBS: [Verb; 6] = [Verb::Put, Verb::Delete, Verb::Get, Verb::Subscribe, Verb::Answer, Verb::Token];

/// What the laboratory's table says, written without the code that makes the rules.
fn allowed(role: LabRole, key: &str, verb: Verb) -> bool {
    let own_tool = key.starts_with("client/ME") && key.contains("/tool/");
    let own_token = key.starts_with("client/ME") && key.contains("/live/");
    let question = ["rpc/info", "rpc/params", "rpc/scenes", "rpc/schema"].contains(&key);
    let order = key.starts_with("rpc/") && !question;
    let touches = role == LabRole::Haptic || role == LabRole::Teacher;
    let orders = role == LabRole::Operator || role == LabRole::Teacher;
    match verb {
        Verb::Put => own_tool && touches,
        Verb::Delete | Verb::Answer => false,
        Verb::Get => question || key == "body/block/surface/keyframe" || (order && orders),
        Verb::Subscribe => true,
        Verb::Token => own_token,
    }
}

/// A laboratory with a running server.
struct Running {
    dir: tempfile::TempDir,
    endpoint: String,
    server: Option<Server>,
    /// The server's own session, for looking at what arrives.
    session: Session,
    folder: Folder,
}

impl Running {
    fn start() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let lab = Lab {
            lab: "anatomy".into(),
            realm: "scindo".into(),
            session: "main".into(),
            server: vec!["localhost".into(), "127.0.0.1".into()],
            clients: BTreeMap::new(),
        };
        let mut folder = Folder::create(dir.path(), lab, YEAR).unwrap();
        for (id, role) in CLIENTS {
            folder.admit(id, role, YEAR).unwrap();
        }
        let endpoint = format!("quic/localhost:{}", free_pair());
        let network = NetworkConfig {
            listen: vec![endpoint.clone()],
            zenoh_file: Some(folder.path().join("server.json5")),
            ..NetworkConfig::default()
        };
        let scene = Scene::from_toml(&lab_scene()).unwrap();
        let engine = Engine::new(Simulation::new(&scene, Path::new("")).unwrap(), None).unwrap();
        let sessions = Sessions::open(&network).unwrap();
        let session = sessions.haptic.clone();
        let server = Server::start(engine, Some(sessions), &ServerConfig::default()).unwrap();
        Self { dir, endpoint, server: Some(server), session, folder }
    }

    /// A plain session of the client whose configuration is `file`.
    fn session_of(&self, file: &Path) -> Result<Session, String> {
        let mut config = zenoh::Config::from_file(file).unwrap();
        config.insert_json5("connect/endpoints", &format!("[{:?}]", self.endpoint)).unwrap();
        config.insert_json5("connect/timeout_ms", "3000").unwrap();
        config.insert_json5("connect/exit_on_failure", "true").unwrap();
        zenoh::open(config).wait().map_err(|error| error.to_string())
    }

    fn client(&self, id: &str) -> Session {
        self.session_of(&self.folder.path().join(format!("{id}.json5"))).unwrap()
    }

    async fn link(&self, id: &str) -> Link {
        let config = LinkConfig::new(Role::Haptic, id).with_connect([self.endpoint.clone()]);
        let zenoh_file = Some(self.folder.path().join(format!("{id}.json5")));
        Link::connect(LinkConfig { timeout: PATIENCE, zenoh_file, ..config }).await.unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(server) = self.server.take() {
            server.stop();
            let _ = server.join();
        }
    }
}

/// Keys at which the server's session saw something.
type Seen = Arc<Mutex<BTreeSet<String>>>;

fn remember(seen: &Seen, key: &str) {
    seen.lock().unwrap().insert(key.to_owned());
}

/// The keys at which `client` gets through with `verb`.
fn tried(running: &Running, client: &Session, keys: &[String], verb: Verb) -> BTreeSet<String> {
    let seen = Seen::default();
    let shared = seen.clone();
    let every = format!("{PREFIX}**");
    let marker: &[u8] = b"access test";
    match verb {
        Verb::Put | Verb::Delete => {
            let kind = if verb == Verb::Put { SampleKind::Put } else { SampleKind::Delete };
            let watch = running.session.declare_subscriber(every).callback(move |sample| {
                // Surfaces and reports of the server go on meanwhile.
                let is_ours = sample.kind() == SampleKind::Delete || sample.payload().to_bytes() == marker;
                if sample.kind() == kind && is_ours {
                    remember(&shared, sample.key_expr().as_str());
                }
            });
            let _watch = watch.wait().unwrap();
            for key in keys {
                if verb == Verb::Put {
                    client.put(key, marker).wait().unwrap();
                } else {
                    client.delete(key).wait().unwrap();
                }
            }
            std::thread::sleep(SETTLE);
        }
        Verb::Get => {
            let watch = running.session.declare_queryable(every).callback(move |query| {
                if query.payload().is_some_and(|payload| payload.to_bytes() == marker) {
                    remember(&shared, query.key_expr().as_str());
                }
            });
            let _watch = watch.wait().unwrap();
            std::thread::sleep(SETTLE);
            let replies: Vec<_> = keys
                .iter()
                .map(|key| client.get(key).payload(marker).timeout(SETTLE).wait().unwrap())
                .collect();
            std::thread::sleep(SETTLE);
            drop(replies);
        }
        Verb::Subscribe => {
            let watch = |key: &String| {
                let shared = shared.clone();
                client
                    .declare_subscriber(key)
                    .callback(move |sample| {
                        if sample.payload().to_bytes() == marker {
                            remember(&shared, sample.key_expr().as_str());
                        }
                    })
                    .wait()
                    .unwrap()
            };
            let _watches: Vec<_> = keys.iter().map(watch).collect();
            std::thread::sleep(SETTLE);
            keys.iter().for_each(|key| running.session.put(key, marker).wait().unwrap());
            std::thread::sleep(SETTLE);
        }
        Verb::Answer => {
            let answer = |key: &String| {
                client
                    .declare_queryable(key)
                    .callback(move |query| {
                        let _ = query.reply(query.key_expr().clone(), marker).wait();
                    })
                    .wait()
                    .unwrap()
            };
            let _answers: Vec<_> = keys.iter().map(answer).collect();
            std::thread::sleep(SETTLE);
            for key in keys {
                let replies = running.session.get(key).timeout(SETTLE).wait().unwrap();
                while let Ok(reply) = replies.recv_timeout(SETTLE / 10) {
                    let Some(reply) = reply else { break };
                    if reply.result().is_ok_and(|sample| sample.payload().to_bytes() == marker) {
                        remember(&shared, key);
                    }
                }
            }
        }
        Verb::Token => {
            let watch = running.session.liveliness().declare_subscriber(every).callback(move |sample| {
                if sample.kind() == SampleKind::Put {
                    remember(&shared, sample.key_expr().as_str());
                }
            });
            let _watch = watch.wait().unwrap();
            let _tokens: Vec<_> =
                keys.iter().map(|key| client.liveliness().declare_token(key).wait().unwrap()).collect();
            std::thread::sleep(SETTLE);
        }
    }
    std::mem::take(&mut seen.lock().unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn every_cell_of_the_table_is_as_it_says() {
    let running = Running::start();
    let (mut cells, mut wrong) = (0, Vec::new());
    for (id, role) in &CLIENTS[..4] {
        let client = running.client(id);
        let full = |key: &str| format!("{PREFIX}{}", key.replace("ME", id).replace("OTHER", "rival"));
        for verb in VERBS {
            let keys: Vec<String> = KEYS.iter().map(|key| full(key)).collect();
            let through = tried(&running, &client, &keys, verb);
            for key in KEYS {
                cells += 1;
                let (got, wanted) = (through.contains(&full(key)), allowed(*role, key, verb));
                if got != wanted {
                    wrong.push(format!("{role} {verb:?} {key}: got through: {got}"));
                }
            }
        }
        client.close().wait().unwrap();
    }
    println!("{cells} cells, {} wrong", wrong.len());
    assert!(cells >= 500);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A configuration like that of `hand`, with another certificate.
fn config_with(running: &Running, name: &str, certificate: &str, key: &str) -> std::path::PathBuf {
    let dir = running.dir.path();
    fs::write(dir.join(format!("{name}.pem")), certificate).unwrap();
    fs::write(dir.join(format!("{name}.key")), key).unwrap();
    let config = fs::read_to_string(running.folder.path().join("hand.json5")).unwrap();
    let path = dir.join(format!("{name}.json5"));
    fs::write(
        &path,
        config.replace("hand.pem", &format!("{name}.pem")).replace("hand.key", &format!("{name}.key")),
    )
    .unwrap();
    path
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_missing_and_expired_certificates_are_refused() {
    let running = Running::start();
    let own = |end: &str| fs::read_to_string(running.folder.path().join(format!("ca.{end}"))).unwrap();
    let ca = scindo::lab::issue::Papers { certificate: own("pem"), key: own("key") };

    let stranger = authority("elsewhere", YEAR).unwrap();
    let papers = issue(&stranger, "hand", Holder::Client, YEAR).unwrap();
    let foreign = config_with(&running, "foreign", &papers.certificate, &papers.key);
    assert!(running.session_of(&foreign).is_err(), "a certificate of another laboratory");

    let config = fs::read_to_string(running.folder.path().join("hand.json5")).unwrap();
    let lines = config
        .lines()
        .filter(|line| !line.contains("connect_certificate") && !line.contains("connect_private_key"));
    let bare = running.dir.path().join("bare.json5");
    fs::write(&bare, lines.collect::<Vec<_>>().join("\n")).unwrap();
    assert!(running.session_of(&bare).is_err(), "no certificate");

    let papers = issue(&ca, "hand", Holder::Client, Duration::ZERO).unwrap();
    let expired = config_with(&running, "expired", &papers.certificate, &papers.key);
    std::thread::sleep(Duration::from_millis(1100));
    assert!(running.session_of(&expired).is_err(), "an expired certificate");

    // One that expires while its link is open.
    let papers = issue(&ca, "hand", Holder::Client, Duration::from_secs(4)).unwrap();
    let fleeting = config_with(&running, "fleeting", &papers.certificate, &papers.key);
    let client = running.session_of(&fleeting).unwrap();
    let key = format!("{PREFIX}client/hand/live/haptic");
    let _token = client.liveliness().declare_token(&key).wait().unwrap();
    let there = || {
        running
            .session
            .liveliness()
            .get(&key)
            .wait()
            .unwrap()
            .recv_timeout(SETTLE)
            .is_ok_and(|reply| reply.is_some())
    };
    std::thread::sleep(SETTLE);
    assert!(there());
    let since = Instant::now();
    while there() {
        assert!(since.elapsed() < Duration::from_secs(30), "the link outlives its certificate");
        std::thread::sleep(Duration::from_millis(200));
    }
}

fn sample(client: &str, seq: u64, x: f64) -> ToolSample {
    let position_m = Some(Vec3 { x, y: 0.02, z: 0.05 });
    ToolSample {
        seq,
        client_time_ns: seq,
        client_id: client.into(),
        tool_id: "probe".into(),
        pose: Some(Pose { position_m, qw: 1.0, ..Pose::default() }),
        mode: tool_sample::Mode::Touch.into(),
        ..ToolSample::default()
    }
}

/// Poses and contacts cross on an encrypted link all the time. zenoh's TLS link does not bear this.
#[tokio::test(flavor = "multi_thread")]
async fn a_hand_keeps_its_link() {
    let running = Running::start();
    let gone = Arc::new(Mutex::new(0));
    let count = Arc::clone(&gone);
    let watch = running
        .session
        .liveliness()
        .declare_subscriber(format!("{PREFIX}client/**"))
        .callback(move |sample| *count.lock().unwrap() += i32::from(sample.kind() == SampleKind::Delete));
    let _watch = watch.wait().unwrap();
    let hand = running.link("hand").await;
    let mut tool = hand.tool("probe").await.unwrap();
    let mut every = tokio::time::interval(Duration::from_millis(1));
    for seq in 0..10_000 {
        every.tick().await;
        tool.poses.send(sample("hand", seq, 0.01)).unwrap();
    }
    assert!(tool.contacts.received() > 1000, "{} contacts", tool.contacts.received());
    assert_eq!(*gone.lock().unwrap(), 0, "the link was lost");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_client_cannot_move_release_or_cut_with_the_tool_of_another() {
    let running = Running::start();
    let hand = running.link("hand").await;
    let mut tool = hand.tool("probe").await.unwrap();
    let holds = || {
        let inbox = running.server.as_ref().unwrap().exchange().inbox();
        inbox.held().next().map(|input| (input.owner.to_string(), input.pose.translation.x))
    };
    let started = Instant::now();
    while holds().is_none() {
        assert!(started.elapsed() < PATIENCE);
        tool.poses.send(sample("hand", 0, 0.01)).unwrap();
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let rival = running.link("rival").await;
    let put = |key: String, sample: &ToolSample| {
        let put = rival.haptic().put(key, encode(sample)).encoding(encoding::<ToolSample>());
        put.wait().unwrap();
    };
    // Under the key of the hand, under its own key in the name of the hand, and as itself.
    put(format!("{PREFIX}client/hand/tool/probe/pose"), &sample("hand", u64::MAX - 1, 0.5));
    put(format!("{PREFIX}client/rival/tool/probe/pose"), &sample("hand", u64::MAX - 1, 0.5));
    put(format!("{PREFIX}client/rival/tool/probe/pose"), &sample("rival", u64::MAX - 1, 0.5));
    // A token in the name of the hand that goes again.
    let token = rival.haptic().liveliness().declare_token(format!("{PREFIX}client/hand/live/haptic"));
    drop(token.wait());
    let cutter = rival.tool("probe").await.unwrap().cutter;
    let line = |x: f64| BladeSegment {
        tip_m: Some(Vec3 { x, y: 0.0, z: 0.01 }),
        heel_m: Some(Vec3 { x, y: 0.0, z: 0.03 }),
    };
    let command = CutCommand {
        client_id: "rival".into(),
        tool_id: "probe".into(),
        seq: 7,
        sweep: vec![line(0.0), line(0.01)],
        ..CutCommand::default()
    };
    let answer = cutter.send(command).await.unwrap();
    assert_eq!(answer.outcome(), Outcome::Refused);
    assert_eq!(answer.error.unwrap().code, "not-owner");
    tokio::time::sleep(SETTLE).await;
    assert_eq!(holds(), Some(("hand".to_owned(), 0.01)));
}
