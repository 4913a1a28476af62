//! Two clients at one body: one holds a flap with forceps, the other cuts below it with force.

use std::time::{Duration, Instant};

use scindo::server::{Server, ServerConfig};
use scindo::sim::engine::Engine;
use scindo::wire::session::{NetworkConfig, Sessions};
use scindo_client::messages::{Pose, ToolSample, ToolState, Vec3, tool_sample::Mode};
use scindo_client::{Link, LinkConfig, Role, ToolLink, ToolStates};
use scindo_tests::{PATIENCE, free_pair};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

const SCENE: &str = include_str!("../../../world/scenes/two-hands.toml");
/// Between two samples of a hand.
const SAMPLE: Duration = Duration::from_millis(10);

/// The forceps with their edge in the flap, lifted from 0 to 1: first along +x with the jaws one above the other, then
/// tilted with the flap.
fn forceps(lift: f64) -> ToolSample {
    let half_turn = (0.5 * (-90.0 + 30.0 * lift)).to_radians();
    let position_m = Some(Vec3 { x: -0.044 + 0.001 * lift, y: 0.0, z: 0.026 + 0.008 * lift });
    let pose = Pose { position_m, qx: 0.0, qy: half_turn.sin(), qz: 0.0, qw: half_turn.cos() };
    ToolSample { pose: Some(pose), mode: Mode::Grab.into(), ..ToolSample::default() }
}

/// The blade lies along y.
fn scalpel(x: f64, mode: Mode) -> ToolSample {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let position_m = Some(Vec3 { x, y: -0.03, z: 0.0225 });
    let pose = Pose { position_m, qx: -half, qy: 0.0, qz: 0.0, qw: half };
    ToolSample { pose: Some(pose), mode: mode.into(), ..ToolSample::default() }
}

/// One client with one tool.
struct Hand {
    id: &'static str,
    tool: ToolLink,
    states: ToolStates,
    link: Link,
}

impl Hand {
    async fn new(endpoint: &str, client: &str, id: &'static str) -> Self {
        let config = LinkConfig::new(Role::Client, client).with_connect([endpoint.to_owned()]);
        let link = Link::connect(LinkConfig { timeout: PATIENCE, ..config }).await.unwrap();
        let (tool, states) = (link.tool(id).await.unwrap(), link.tool_states().await.unwrap());
        Self { id, tool, states, link }
    }

    /// Sends a sample; the state of the tool, once it is in this hand.
    async fn sample(&mut self, sample: ToolSample) -> Option<ToolState> {
        self.tool.poses.send(sample).unwrap();
        tokio::time::sleep(SAMPLE).await;
        let states = self.states.get();
        states.get(self.id).filter(|state| state.owner == self.link.id()).map(|state| (**state).clone())
    }

    /// Moves from 0 to 1 in this simulated time, and waits there until `seen` of the tool's state.
    async fn go(
        &mut self,
        seconds: f64,
        sample: impl Fn(f64) -> ToolSample,
        seen: impl Fn(&ToolState) -> bool,
    ) -> ToolState {
        let started = Instant::now();
        let (mut began, mut part) = (None, 0.0);
        loop {
            let now = self.sample(sample(part)).await;
            if let Some(now) = &now {
                part = ((now.sim_time_s - *began.get_or_insert(now.sim_time_s)) / seconds).min(1.0);
                if part == 1.0 && seen(now) {
                    return now.clone();
                }
            }
            assert!(started.elapsed() < PATIENCE, "{} stays {now:?}", self.id);
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_client_lifts_the_flap_while_another_cuts_below_it() {
    let endpoint = format!("tcp/127.0.0.1:{}", free_pair());
    let scene = Scene::from_toml(SCENE).unwrap();
    let engine = Engine::new(Simulation::new(&scene, scene.base_dir()).unwrap(), None).unwrap();
    let network = NetworkConfig { listen: vec![endpoint.clone()], ..NetworkConfig::default() };
    let sessions = Sessions::open(&network).unwrap();
    let server = Server::start(engine, Some(sessions), &ServerConfig::default()).unwrap();
    let mut left = Hand::new(&endpoint, "left", "forceps").await;
    let mut right = Hand::new(&endpoint, "right", "scalpel").await;

    // Both hands take their tools from the script. The left one closes on the edge, and lifts it.
    right.go(0.1, |_| scalpel(-0.07, Mode::Hover), |_| true).await;
    left.go(0.4, |_| ToolSample { closed: Some(0.0), ..forceps(0.0) }, |_| true).await;
    let gripped = left.go(0.8, |_| forceps(0.0), |tool| tool.held_point_m.is_some()).await;
    assert!(gripped.closed > 0.3 && gripped.closed < 0.9, "the flap is between the jaws: {}", gripped.closed);
    let lifted = left.go(2.0, forceps, |tool| tool.held_point_m.is_some_and(|at| at.z > 0.031)).await;
    assert!(lifted.force_n.unwrap().z < -0.1, "it pulls back: {:?}", lifted.force_n);

    // The left hand stays while the right one cuts.
    let way = |part: f64| scalpel(-0.035 + 0.030 * part, Mode::Cut);
    let place = |tool: &ToolState| tool.proxy_pose.unwrap().position_m.unwrap().x;
    let mut held = lifted;
    let cutting = right.go(3.0, way, |tool| place(tool) > -0.018);
    tokio::pin!(cutting);
    let cut = loop {
        tokio::select! {
            cut = &mut cutting => break cut,
            Some(now) = left.sample(forceps(1.0)) => held = now,
        }
    };
    let load = -cut.force_n.unwrap().x;
    assert!(load > 0.5, "the flesh resists: {load} N");
    assert!(held.held_point_m.is_some_and(|at| at.z > 0.031), "the forceps have held on: {held:?}");
    // Opened by the hand, without another mode.
    let open = |_| ToolSample { closed: Some(0.0), ..forceps(1.0) };
    left.go(0.8, open, |tool| tool.closed == 0.0 && tool.held_point_m.is_none()).await;

    server.stop();
    let engine = server.join().unwrap();
    assert!(engine.simulation().cuts_applied() > 1, "cut by force");
}
