//! The page without a server: an ellipsoid that breathes, gives way under the mouse and opens a slit.
//!
//! For work on `web/`: `cargo run -p scindo-view --example synthetic -- 127.0.0.1:8090 [folder of the page]`.

use std::f32::consts::PI;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use scindo_proto::messages::tool_sample::Mode;
use scindo_proto::messages::viewer_down::Message as Down;
use scindo_proto::messages::viewer_rpc::Call;
use scindo_proto::messages::{
    BodyInfo, BodyStats, Counter, Effect, Event, Plan, Pose, RpcReply, SessionInfo, StageTime, Stats,
    SurfaceFrame, SurfaceTopology, ToolSample, ToolState, ToolStats, Vec3, ViewerRpcReply, ViewerToolGone,
};
use scindo_view::hub::{Hub, Up};
use scindo_view::{WebConfig, WebServer};

/// Half axes [m], poles on x, so that the meridian on top can be slit.
const AXES: [f32; 3] = [0.11, 0.075, 0.045];
const RINGS: usize = 90;
const COLUMNS: usize = 120;

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let mut args = std::env::args().skip(1);
    let listen = args.next().unwrap_or_else(|| "127.0.0.1:8090".into()).parse()?;
    let page_folder = args.next().map(Into::into);
    let (hub, mut up) = Hub::new("view-synthetic");
    let web = WebServer::bind(
        WebConfig { listen, page_folder, ..WebConfig::default() },
        Arc::clone(&hub),
        "synthetic feed".into(),
    )
    .await?;
    println!("http://{}", web.address());
    tokio::spawn(web.run());

    let mut feed = Feed::default();
    hub.set_link(true, "synthetic feed");
    hub.publish(Down::Info(info()));
    hub.publish(Down::Plan(plan()));
    let mut ticks = tokio::time::interval(Duration::from_millis(16));
    loop {
        tokio::select! {
            _ = ticks.tick() => feed.tick(&hub),
            Some(message) = up.recv() => feed.take(message, &hub),
        }
    }
}

#[derive(Default)]
struct Feed {
    step: u64,
    paused: bool,
    open_rings: usize,
    epoch: u32,
    tool: Option<ToolSample>,
    force_n: f32,
}

impl Feed {
    fn tick(&mut self, hub: &Hub) {
        if !self.paused {
            self.step += 1;
        }
        // The slit grows by a ring now and then, closes after a while, and starts again.
        let cycle = self.step % 1500;
        let open = if cycle < 300 { 0 } else { ((cycle - 300) / 6).min(50) as usize };
        if open != self.open_rings || self.epoch == 0 {
            self.open_rings = open;
            self.epoch += 1;
            hub.publish(Down::Topology(self.topology()));
            if open == 0 || open == 50 {
                hub.publish(Down::Event(self.event(if open == 0 { "slit closed" } else { "slit complete" })));
            }
        }
        hub.publish(Down::Frame(self.frame()));
        if let Some(sample) = self.tool.clone() {
            hub.publish(Down::Tool(self.tool_state(sample)));
        }
        if self.step.is_multiple_of(15) {
            hub.publish(Down::Stats(self.stats()));
        }
    }

    fn take(&mut self, message: Up, hub: &Hub) {
        match message {
            Up::Tool(sample) => self.tool = Some(*sample),
            Up::Release { tool_id } => {
                self.tool = None;
                hub.publish(Down::ToolGone(ViewerToolGone { tool_id }));
            }
            Up::Rpc { browser, call } => {
                let message = match call.call {
                    Some(Call::Pause(pause)) => {
                        self.paused = pause.paused;
                        hub.publish(Down::Stats(self.stats()));
                        if pause.paused { "paused" } else { "running" }
                    }
                    Some(Call::Reset(_)) => {
                        self.step = 0;
                        "back at the start"
                    }
                    Some(Call::Step(step)) => {
                        self.step += u64::from(step.count);
                        "stepped"
                    }
                    _ => "nothing to do",
                };
                let reply = RpcReply { ok: true, message: message.into(), ..Default::default() };
                let answer =
                    ViewerRpcReply { call_id: call.call_id, reply: Some(reply), ..Default::default() };
                hub.answer(browser, answer);
            }
        }
    }

    /// Rings of the slit: the middle of the body.
    fn slit(&self) -> std::ops::Range<usize> {
        let first = (RINGS - 50) / 2;
        first..first + self.open_rings
    }

    fn topology(&self) -> SurfaceTopology {
        let mut triangles: Vec<u32> = Vec::new();
        let mut tags: Vec<u32> = Vec::new();
        let slit = self.slit();
        let column = |j: usize, k: usize| {
            // The last column is the first again, unless the slit is open there.
            let inside = j > slit.start && j < slit.end;
            if k == COLUMNS && !inside { vertex(j, 0) } else { vertex(j, k) }
        };
        let mut add = |t: [u32; 3], tag: u32| {
            triangles.extend(t);
            tags.push(tag);
        };
        for j in 0..=RINGS {
            for k in 0..COLUMNS {
                if j == 0 {
                    add([POLES, column(1, k + 1), column(1, k)], 0);
                } else if j == RINGS {
                    add([POLES + 1, column(RINGS, k), column(RINGS, k + 1)], 0);
                } else {
                    let (a, b) = (column(j, k), column(j, k + 1));
                    let (c, d) = (column(j + 1, k), column(j + 1, k + 1));
                    add([a, b, d], 0);
                    add([a, d, c], 0);
                }
            }
        }
        for j in slit.start..slit.end.saturating_sub(1) {
            let (left, right) =
                ([column(j, 0), column(j + 1, 0)], [column(j, COLUMNS), column(j + 1, COLUMNS)]);
            let floor =
                |j: usize, edge: u32| if j > slit.start && j < slit.end { FLOOR + j as u32 } else { edge };
            let (f0, f1) = (floor(j, left[0]), floor(j + 1, left[1]));
            for t in [[left[0], left[1], f1], [left[0], f1, f0], [right[1], right[0], f0], [right[1], f0, f1]]
            {
                if t[0] != t[1] && t[1] != t[2] && t[0] != t[2] {
                    add(t, 1);
                }
            }
        }
        let bytes =
            |words: &[u32]| Bytes::from(words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>());
        SurfaceTopology {
            seq: u64::from(self.epoch),
            sim_step: self.step,
            publish_unix_ns: unix_ns(),
            body_id: "liver".into(),
            epoch: self.epoch,
            vertex_count: VERTICES,
            triangle_count: tags.len() as u32,
            triangles: bytes(&triangles),
            tags: bytes(&tags),
            ..Default::default()
        }
    }

    fn frame(&mut self) -> SurfaceFrame {
        let slit = self.slit();
        let mut x = vec![[0.0_f32; 3]; VERTICES as usize];
        for j in 1..=RINGS {
            let along = (j as f32 - slit.start as f32) / slit.len().max(1) as f32;
            let gape = if slit.contains(&j) {
                0.16 * (PI * along.clamp(0.0, 1.0)).sin().max(0.0) * slit.len() as f32 / 50.0
            } else {
                0.0
            };
            for k in 0..=COLUMNS {
                let u = k as f32 / COLUMNS as f32;
                let near = (1.0 - 8.0 * u.min(1.0 - u)).max(0.0);
                let side = if u < 0.5 { 1.0 } else { -1.0 };
                x[vertex(j, k) as usize] = self.point(j, 2.0 * PI * u + side * gape * near, 1.0);
            }
            x[(FLOOR + j as u32) as usize] = self.point(j, 0.0, 1.0 - 2.2 * gape);
        }
        x[POLES as usize] = self.point(0, 0.0, 1.0);
        x[POLES as usize + 1] = self.point(RINGS + 1, 0.0, 1.0);
        self.force_n = self.press(&mut x);
        SurfaceFrame {
            seq: self.step,
            sim_step: self.step,
            sim_time_s: self.step as f64 / 60.0,
            publish_unix_ns: unix_ns(),
            body_id: "liver".into(),
            epoch: self.epoch,
            vertex_count: VERTICES,
            positions: x.iter().flatten().flat_map(|f| f.to_le_bytes()).collect::<Vec<u8>>().into(),
            ..SurfaceFrame::default()
        }
    }

    fn point(&self, j: usize, phi: f32, scale: f32) -> [f32; 3] {
        let theta = PI * j as f32 / (RINGS + 1) as f32;
        let t = self.step as f32 / 60.0;
        let lobes = 1.0 + 0.06 * (3.0 * phi + 0.8).sin() * theta.sin() + 0.05 * (2.0 * theta - 0.5).cos();
        let breath = 1.0 + 0.03 * (1.7 * t + theta).sin();
        let r = scale * lobes * breath;
        [
            AXES[0] * theta.cos() * lobes,
            AXES[1] * r * theta.sin() * phi.sin(),
            AXES[2] * r * theta.sin() * phi.cos() + 0.05,
        ]
    }

    /// Pushes vertices out of the probe's ball; the force grows with how many were in it.
    fn press(&self, x: &mut [[f32; 3]]) -> f32 {
        let Some(sample) = self.tool.as_ref().filter(|sample| sample.mode() == Mode::Touch) else {
            return 0.0;
        };
        let Some(p) = sample.pose.and_then(|pose| pose.position_m) else { return 0.0 };
        let tip = [p.x as f32, p.y as f32, p.z as f32];
        let mut pushed = 0.0;
        for v in x.iter_mut() {
            let d = [v[0] - tip[0], v[1] - tip[1], v[2] - tip[2]];
            let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let reach = 0.022;
            if r < reach && r > 0.0 {
                pushed += reach - r;
                for c in 0..3 {
                    v[c] += d[c] / r * (reach - r);
                }
            }
        }
        pushed * 5.0
    }

    fn tool_state(&self, sample: ToolSample) -> ToolState {
        let axis = Vec3 { x: 0.0, y: 0.0, z: f64::from(self.force_n) };
        let mut proxy = sample.pose.unwrap_or_default();
        if let Some(p) = proxy.position_m.as_mut() {
            p.z += 0.002 * f64::from(self.force_n.min(3.0));
        }
        ToolState {
            sim_step: self.step,
            publish_unix_ns: unix_ns(),
            mode: sample.mode,
            tool_id: sample.tool_id,
            shape: sample.shape,
            pose: sample.pose,
            proxy_pose: Some(Pose { ..proxy }),
            force_n: Some(axis),
            owner: sample.client_id,
            ..Default::default()
        }
    }

    fn event(&self, words: &str) -> Event {
        Event {
            seq: self.step,
            sim_step: self.step,
            publish_unix_ns: unix_ns(),
            level: 1,
            name: "synthetic".into(),
            message: words.into(),
        }
    }

    fn stats(&self) -> Stats {
        let stage = |name: &str, milliseconds| StageTime { name: name.into(), milliseconds };
        let wave = (self.step as f32 / 50.0).sin();
        Stats {
            seq: self.step,
            sim_step: self.step,
            sim_time_s: self.step as f64 / 60.0,
            publish_unix_ns: unix_ns(),
            step_rate_hz: 60.0 + wave,
            real_time_factor: 1.0,
            stages: vec![
                stage("cuts", 0.21),
                stage("operators", 1.1 + 0.2 * wave),
                stage("contacts", 0.62),
                stage("integrator", 5.4 + wave),
                stage("snapshot", 0.4),
            ],
            bodies: vec![BodyStats {
                body_id: "liver".into(),
                iterations: 18,
                residual: 8.3e-7,
                elements: 12_800,
                pieces: 12_800 + 30 * self.open_rings as u32,
                copies: 3_300 + 8 * self.open_rings as u32,
                epoch: self.epoch,
                volume_m3: 1.5e-3,
                tolerance: 1e-6,
                ..Default::default()
            }],
            tools: self
                .tool
                .iter()
                .map(|tool| ToolStats {
                    tool_id: tool.tool_id.clone(),
                    owner: tool.client_id.clone(),
                    pose_rate_hz: 60.0,
                    force_n: self.force_n,
                    ..Default::default()
                })
                .collect(),
            refused: vec![Counter { name: "non-finite".into(), count: 2 }],
            cuts_applied: 3,
            surface_subscribers: 1,
            haptic_clients: 0,
            paused: self.paused,
            ..Default::default()
        }
    }
}

const COLUMN_VERTICES: usize = COLUMNS + 1;
const FLOOR: u32 = (RINGS * COLUMN_VERTICES) as u32;
const POLES: u32 = FLOOR + RINGS as u32 + 1;
const VERTICES: u32 = POLES + 2;

/// Vertex of ring `j` (from 1) and column `k`.
fn vertex(j: usize, k: usize) -> u32 {
    ((j - 1) * COLUMN_VERTICES + k) as u32
}

fn info() -> SessionInfo {
    let corner = |s: f64| Some(Vec3 { x: s * 0.12, y: s * 0.08, z: s * 0.05 + 0.05 });
    SessionInfo {
        scene_name: "synthetic ellipsoid".into(),
        step_s: 1.0 / 60.0,
        bodies: vec![BodyInfo {
            id: "liver".into(),
            min_m: corner(-1.0),
            max_m: corner(1.0),
            ..Default::default()
        }],
        ..Default::default()
    }
}

fn plan() -> Plan {
    let effect = |name: &str, on, why: &str, measured_ms| Effect {
        name: name.into(),
        on,
        why: why.into(),
        predicted_ms: 0.0,
        measured_ms,
    };
    Plan {
        effects: vec![
            effect("gravity", true, "world.gravity_m_s2 is set", 0.05),
            effect("large_rotation", true, "law is corotational", 1.1),
            effect("cutting", true, "tool scalpel cuts", 0.21),
            effect("self_collision", false, "not asked for by the scene", 0.0),
            effect("haptic_contact", false, "no haptic client lives", 0.0),
            effect("surface", true, "1 subscriber", 0.4),
        ],
    }
}

fn unix_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64)
}
