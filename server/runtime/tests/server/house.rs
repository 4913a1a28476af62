//! Several laboratories behind one router with certificates: each keeps to its own realm, and a guest watches both.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use scindo::lab::folder::Folder;
use scindo::lab::house::House;
use scindo::lab::members::Lab;
use scindo::lab::roles::LabRole;
use scindo::server::{Server, ServerConfig};
use scindo::sim::engine::Engine;
use scindo::wire::session::{NetworkConfig, Sessions, router};
use scindo_client::messages::{Pose, ToolSample, Vec3, tool_sample};
use scindo_client::{Link, LinkConfig, Role};
use scindo_proto::{encode, encoding};
use scindo_tests::{PATIENCE, free_pair};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use zenoh::{Session, Wait as _};

use crate::lab_scene;

const YEAR: Duration = Duration::from_secs(365 * 86400);
/// Time in which a message certainly arrives on loopback, through a router.
const SETTLE: Duration = Duration::from_millis(1000);
const LABS: [&str; 2] = ["anatomy", "surgery"];

/// A house with a router, two laboratories with a running server each, a teacher in each, and a guest.
struct Campus {
    dir: tempfile::TempDir,
    endpoint: String,
    servers: Vec<Server>,
    _router: Session,
}

impl Campus {
    fn start() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut house = House::create(dir.path(), "campus", &["localhost".into()], YEAR).unwrap();
        for lab in LABS {
            let record = Lab {
                lab: lab.into(),
                realm: lab.into(),
                session: "main".into(),
                server: vec![],
                clients: BTreeMap::new(),
            };
            let mut folder = Folder::create(&dir.path().join(lab), record, YEAR).unwrap();
            folder.admit(&format!("{lab}-teacher"), LabRole::Teacher, YEAR).unwrap();
            folder.admit(&format!("{lab}-watcher"), LabRole::Viewer, YEAR).unwrap();
        }
        house.welcome("beamer", &BTreeSet::from(LABS.map(str::to_owned)), YEAR).unwrap();
        let endpoint = format!("quic/localhost:{}", free_pair());
        let network = NetworkConfig {
            listen: vec![endpoint.clone()],
            zenoh_file: Some(dir.path().join("router.json5")),
            ..NetworkConfig::default()
        };
        let router = router(&network, 16 << 20, 64).unwrap();
        let servers = LABS.map(|lab| {
            let network = NetworkConfig {
                connect: vec![endpoint.clone()],
                zenoh_file: Some(dir.path().join(lab).join("server.json5")),
                ..NetworkConfig::default()
            };
            let scene = Scene::from_toml(&lab_scene()).unwrap();
            let engine = Engine::new(Simulation::new(&scene, Path::new("")).unwrap(), None).unwrap();
            let config = ServerConfig { realm: lab.to_owned(), ..ServerConfig::default() };
            Server::start(engine, Some(Sessions::open(&network).unwrap()), &config).unwrap()
        });
        Self { dir, endpoint, servers: servers.into(), _router: router }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// A plain session with the configuration of `file`.
    fn session(&self, file: &str) -> Session {
        let mut config = zenoh::Config::from_file(self.file(file)).unwrap();
        config.insert_json5("connect/endpoints", &format!("[{:?}]", self.endpoint)).unwrap();
        config.insert_json5("mode", "\"client\"").unwrap();
        config.insert_json5("connect/timeout_ms", "10000").unwrap();
        config.insert_json5("connect/exit_on_failure", "true").unwrap();
        zenoh::open(config).wait().unwrap()
    }

    async fn link(&self, lab: &str, file: &str, id: &str) -> Result<Link, scindo_client::LinkError> {
        let config = LinkConfig::new(Role::Haptic, id).with_connect([self.endpoint.clone()]);
        let zenoh_file = Some(self.file(file));
        Link::connect(LinkConfig { realm: lab.to_owned(), timeout: PATIENCE, zenoh_file, ..config }).await
    }
}

impl Drop for Campus {
    fn drop(&mut self) {
        for server in self.servers.drain(..) {
            server.stop();
            let _ = server.join();
        }
    }
}

fn sample(client: &str, seq: u64) -> ToolSample {
    ToolSample {
        seq,
        client_time_ns: seq,
        client_id: client.into(),
        tool_id: "probe".into(),
        pose: Some(Pose { position_m: Some(Vec3 { x: 0.02, y: 0.02, z: 0.05 }), qw: 1.0, ..Pose::default() }),
        mode: tool_sample::Mode::Touch.into(),
        ..ToolSample::default()
    }
}

/// The realms from which `session` hears something.
fn heard(session: &Session, expressions: &[&str]) -> BTreeSet<String> {
    let seen = Arc::new(Mutex::new(BTreeSet::new()));
    let _watches: Vec<_> = expressions
        .iter()
        .map(|expression| {
            let seen = Arc::clone(&seen);
            let remember = move |sample: zenoh::sample::Sample| {
                let realm = sample.key_expr().as_str().split('/').next().unwrap_or_default().to_owned();
                seen.lock().unwrap().insert(realm);
            };
            session.declare_subscriber(*expression).callback(remember).wait().unwrap()
        })
        .collect();
    std::thread::sleep(2 * SETTLE);
    let seen = seen.lock().unwrap();
    seen.clone()
}

/// Number of servers that answer a question about the session of `lab`.
fn answers(session: &Session, lab: &str) -> usize {
    let replies = session.get(format!("{lab}/@v1/main/rpc/info")).timeout(SETTLE).wait().unwrap();
    std::iter::from_fn(|| replies.recv().ok()).filter(|reply| reply.result().is_ok()).count()
}

const EVERYTHING: [&str; 3] = ["anatomy/@v1/main/**", "surgery/@v1/main/**", "**"];

#[tokio::test(flavor = "multi_thread")]
async fn each_laboratory_keeps_to_its_realm() {
    let campus = Campus::start();
    for (own, other) in [("anatomy", "surgery"), ("surgery", "anatomy")] {
        let (id, file) = (format!("{own}-teacher"), format!("{own}/{own}-teacher.json5"));
        let link = campus.link(own, &file, &id).await.unwrap();
        let mut tool = link.tool("probe").await.unwrap();
        let started = Instant::now();
        let holder = |lab: usize| {
            let inbox = campus.servers[lab].exchange().inbox();
            inbox.held().next().map(|input| input.owner.to_string())
        };
        let here = LABS.iter().position(|lab| *lab == own).unwrap();
        while holder(here).as_deref() != Some(id.as_str()) || tool.contacts.received() == 0 {
            assert!(started.elapsed() < PATIENCE, "{own}: {:?}", holder(here));
            tool.poses.send(sample(&id, 0)).unwrap();
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        let reply = link.pause(true).await.unwrap();
        assert!(reply.ok, "a teacher may pause its own laboratory: {}", reply.message);
        assert!(link.pause(false).await.unwrap().ok);

        // The other laboratory: nothing is heard, answered or held.
        let there = 1 - here;
        let before = holder(there);
        let intruder = campus.session(&file);
        assert_eq!(heard(&intruder, &EVERYTHING), BTreeSet::from([own.to_owned()]));
        assert_eq!((answers(&intruder, own), answers(&intruder, other)), (1, 0));
        for seq in 1..20 {
            let key = format!("{other}/@v1/main/client/{id}/tool/probe/pose");
            let put = intruder.put(key, encode(&sample(&id, seq))).encoding(encoding::<ToolSample>());
            put.wait().unwrap();
        }
        let replies = intruder.get(format!("{other}/@v1/main/rpc/pause")).timeout(SETTLE).wait().unwrap();
        assert_eq!(std::iter::from_fn(|| replies.recv().ok()).filter(|r| r.result().is_ok()).count(), 0);
        std::thread::sleep(SETTLE);
        assert_eq!(holder(there), before, "a tool of {other} was taken by a client of {own}");
        if let Ok(stranger) = campus.link(other, &file, &id).await {
            assert!(stranger.info().await.is_err(), "a client of {own} was answered by {other}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_guest_watches_both_and_touches_nothing() {
    let campus = Campus::start();
    let guest = campus.session("beamer.json5");
    assert_eq!(heard(&guest, &EVERYTHING), BTreeSet::from(LABS.map(str::to_owned)));
    for (lab, server) in LABS.into_iter().zip(&campus.servers) {
        assert_eq!(answers(&guest, lab), 1, "{lab}");
        let key = format!("{lab}/@v1/main/client/beamer/tool/probe/pose");
        let put = guest.put(key, encode(&sample("beamer", 1))).encoding(encoding::<ToolSample>());
        put.wait().unwrap();
        std::thread::sleep(SETTLE);
        assert!(server.exchange().inbox().held().next().is_none(), "{lab}: a guest took a tool");
    }
}

#[test]
fn a_server_cannot_speak_for_another_laboratory() {
    let campus = Campus::start();
    let watcher = campus.session("surgery/surgery-watcher.json5");
    let traitor = campus.session("anatomy/server.json5");
    let seen = Arc::new(Mutex::new(Vec::new()));
    let (key, shared) = ("surgery/@v1/main/body/ghost/surface/frame", Arc::clone(&seen));
    let remember = move |sample: zenoh::sample::Sample| shared.lock().unwrap().push(sample.payload().len());
    let _watch = watcher.declare_subscriber(key).callback(remember).wait().unwrap();
    std::thread::sleep(SETTLE);
    traitor.put(key, b"false".as_slice()).wait().unwrap();
    std::thread::sleep(SETTLE);
    assert!(seen.lock().unwrap().is_empty());
    let own = campus.session("surgery/server.json5");
    std::thread::sleep(SETTLE);
    own.put(key, b"true".as_slice()).wait().unwrap();
    std::thread::sleep(SETTLE);
    assert_eq!(seen.lock().unwrap().as_slice(), [4], "its own server is heard");
}
