//! Messages: what a server reads from clients, what clients read from a server, what a viewer reads from pages.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use bytes::Bytes;
use prost::Message as _;
use scindo::exchange::Exchange;
use scindo::inbox::Inbox;
use scindo::receive::{Arrival, capability, cut, pose, token};
use scindo_fuzz::attack;
use scindo_haptic::device::haply::service::Update;
use scindo_igtl::wire::content::Content;
use scindo_igtl::wire::encode::Encoded;
use scindo_igtl::wire::header::{HEADER_BYTES, MAX_BODY_IN, TimeStamp, check_sum};
use scindo_igtl::wire::stream::Deframer;
use scindo_proto::messages::*;
use scindo_proto::{KeySpace, WireMessage, decode, encode, encoding};
use scindo_world::inputs::Inputs;

/// Recipes per target in an ordinary run of the tests.
const RECIPES: usize = 20_000;

fn vector(x: f64) -> Option<Vec3> {
    Some(Vec3 { x, y: -x, z: 0.5 * x })
}

fn sample() -> ToolSample {
    ToolSample {
        seq: 7,
        client_id: "a".into(),
        tool_id: "probe".into(),
        client_time_ns: 1 << 40,
        pose: Some(Pose { position_m: vector(0.1), qw: 1.0, ..Pose::default() }),
        velocity_m_s: vector(0.2),
        shape: Some(ToolShape {
            kind: Some(tool_shape::Kind::Sphere(tool_shape::Sphere { radius_m: 0.005 })),
        }),
        ..ToolSample::default()
    }
}

fn command() -> CutCommand {
    let segment = |x| BladeSegment { tip_m: vector(x), heel_m: vector(x + 0.1) };
    CutCommand {
        seq: 3,
        client_id: "a".into(),
        tool_id: "probe".into(),
        body_id: "block".into(),
        sweep: (0..5).map(|k| segment(f64::from(k))).collect(),
        ..CutCommand::default()
    }
}

fn device() -> DeviceCapability {
    DeviceCapability { client_id: "a".into(), tool_id: "probe".into(), ..DeviceCapability::default() }
}

fn topology() -> SurfaceTopology {
    SurfaceTopology {
        body_id: "block".into(),
        vertex_count: 3,
        triangle_count: 1,
        triangles: [0u32, 1, 2].iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<_>>().into(),
        tags: vec![0; 4].into(),
        texture_coordinates: vec![0; 24].into(),
        ..SurfaceTopology::default()
    }
}

fn frame() -> SurfaceFrame {
    let positions: Vec<u8> = (0..9).flat_map(|i| (i as f32).to_le_bytes()).collect();
    SurfaceFrame {
        body_id: "block".into(),
        seq: 9,
        vertex_count: 3,
        positions: positions.into(),
        ..SurfaceFrame::default()
    }
}

/// Decodes as each of the types. What is accepted is the same after another round.
fn all<M: WireMessage + PartialEq + std::fmt::Debug>(bytes: &[u8]) {
    if let Ok(message) = decode::<M>(Bytes::copy_from_slice(bytes)) {
        let again = decode::<M>(encode(&message)).expect("what was accepted is accepted again");
        assert!(again == message, "{message:?} became {again:?}");
    }
}

struct Sent<'a>(&'a str, String, &'a [u8]);

impl Arrival for Sent<'_> {
    fn key(&self) -> &str {
        self.0
    }

    fn encoding(&self) -> String {
        self.1.clone()
    }

    fn length(&self) -> usize {
        self.2.len()
    }

    fn content(&self) -> Bytes {
        Bytes::copy_from_slice(self.2)
    }
}

/// What poses, cuts and capabilities leave in the inbox is finite and bounded.
#[test]
fn inbox() {
    let keys = KeySpace::new("scindo", "main").unwrap();
    let seeds = vec![encode(&sample()).to_vec(), encode(&command()).to_vec(), encode(&device()).to_vec()];
    let start = Instant::now();
    attack!(seeds, RECIPES, |bytes: &[u8]| {
        let (outgoing, _events) = crossbeam_channel::bounded(16);
        let (answers, _answered) = crossbeam_channel::bounded(16);
        let inbox = Inbox::new([Arc::from("block")], [Arc::from("probe")]);
        let exchange = Exchange::new(inbox, 1, (outgoing, answers));
        token(&keys, &exchange, "scindo/@v1/main/client/a/live/haptic", true, start);
        let later = start + Duration::from_millis(1);
        let key = |kind| format!("scindo/@v1/main/client/a/tool/probe/{kind}");
        pose(&keys, &exchange, &Sent(&key("pose"), encoding::<ToolSample>(), bytes), later);
        cut(&keys, &exchange, &Sent(&key("cut"), encoding::<CutCommand>(), bytes), later);
        capability(&keys, &exchange, &Sent(&key("capability"), encoding::<DeviceCapability>(), bytes), later);
        let mut inputs = Inputs::default();
        exchange.inbox().take(&mut inputs);
        for tool in &inputs.tools {
            assert!(tool.pose.translation.vector.iter().all(|x| x.is_finite()), "{tool:?}");
            assert!((tool.pose.rotation.norm() - 1.0).abs() < 1e-6, "{tool:?}");
            assert!(tool.velocity_m_s.iter().all(|v| v.is_finite()), "{tool:?}");
        }
        let ends = inputs.cuts.iter().flat_map(|cut| cut.segments.iter().flatten());
        assert!(ends.into_iter().all(|end| end.iter().all(|x| x.is_finite())));
    });
}

/// Keys of any client: parsing and writing them again gives the same key.
#[test]
fn keys() {
    let keys = KeySpace::new("scindo", "main").unwrap();
    let seeds =
        ["client/a/tool/probe/pose", "body/block/surface/frame", "rpc/info", "client/a/live/haptic", "stats"];
    let seeds = seeds.map(|rest| format!("scindo/@v1/main/{rest}").into_bytes()).to_vec();
    attack!(seeds, 5 * RECIPES, |bytes: &[u8]| {
        let Ok(key) = std::str::from_utf8(bytes) else { return };
        if let Ok(topic) = keys.parse(key) {
            assert_eq!(keys.key(&topic), key);
        }
    });
}

#[test]
fn poses() {
    attack!(vec![encode(&sample()).to_vec()], RECIPES, all::<ToolSample>);
}

#[test]
fn cuts() {
    attack!(vec![encode(&command()).to_vec()], RECIPES, all::<CutCommand>);
}

#[test]
fn orders() {
    let set = SetRequest { key: "world.gravity_m_s2".into(), value: "[0, 0, -9.81]".into() };
    let seeds = vec![
        encode(&set).to_vec(),
        encode(&StepRequest { count: 3 }).to_vec(),
        encode(&LoadRequest { name: "kidney".into() }).to_vec(),
        encode(&PauseRequest { paused: true }).to_vec(),
    ];
    attack!(seeds, RECIPES, |bytes: &[u8]| {
        all::<SetRequest>(bytes);
        all::<StepRequest>(bytes);
        all::<PauseRequest>(bytes);
        all::<LoadRequest>(bytes);
        all::<SnapshotRequest>(bytes);
        all::<RestoreRequest>(bytes);
        all::<RecordRequest>(bytes);
        all::<StateReply>(bytes);
        all::<TextureRequest>(bytes);
        all::<TextureReply>(bytes);
    });
}

#[test]
fn surfaces() {
    let keyframe = SurfaceKeyframe { topology: Some(topology()), frame: Some(frame()) };
    let seeds = vec![encode(&topology()).to_vec(), encode(&frame()).to_vec(), encode(&keyframe).to_vec()];
    attack!(seeds, RECIPES, |bytes: &[u8]| {
        all::<SurfaceFrame>(bytes);
        all::<SurfaceTopology>(bytes);
        all::<SurfaceKeyframe>(bytes);
        all::<SurfaceField>(bytes);
    });
}

#[test]
fn contacts() {
    let contact =
        HapticContact { tool_id: "probe".into(), client_id: "a".into(), ..HapticContact::default() };
    attack!(vec![encode(&contact).to_vec()], RECIPES, |bytes: &[u8]| {
        all::<HapticContact>(bytes);
        all::<CutAck>(bytes);
        all::<ToolState>(bytes);
        all::<Forces>(bytes);
    });
}

#[test]
fn reports() {
    let stage = StageTime { name: "deform".into(), milliseconds: 1.5 };
    let stats = Stats { stages: vec![stage], real_time_factor: 1.0, ..Stats::default() };
    let info =
        SessionInfo { scene_name: "a".into(), wire_version: 1, step_s: 0.01, ..SessionInfo::default() };
    attack!(vec![encode(&stats).to_vec(), encode(&info).to_vec()], RECIPES, |bytes: &[u8]| {
        all::<Stats>(bytes);
        all::<SessionInfo>(bytes);
        all::<Measures>(bytes);
        all::<Event>(bytes);
        all::<Plan>(bytes);
        all::<ParamsReply>(bytes);
        all::<RpcReply>(bytes);
    });
}

/// What a page says to its viewer: decoded, then checked as the viewer does.
#[test]
fn pages() {
    let up = |message| ViewerUp { message: Some(message) }.encode_to_vec();
    let seeds = vec![
        up(viewer_up::Message::Tool(sample())),
        up(viewer_up::Message::Ping(ViewerPing { page_time_ms: 1.0 })),
        up(viewer_up::Message::Name(ViewerName { name: "Anna".into() })),
    ];
    attack!(seeds, RECIPES, |bytes: &[u8]| {
        let Ok(up) = ViewerUp::decode(bytes) else { return };
        match up.message {
            Some(viewer_up::Message::Tool(sample)) => {
                let _ = sample.check();
            }
            Some(viewer_up::Message::Name(name)) => {
                let _ = scindo_proto::name::check_name(name.name.trim());
            }
            _ => {}
        }
    });
}

/// A message whose length and check sum are right, whatever its body is: otherwise hardly any body would be read.
fn repaired(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if let Some((header, body)) = bytes.split_first_chunk_mut::<HEADER_BYTES>() {
        header[HEADER_BYTES - 16..HEADER_BYTES - 8].copy_from_slice(&(body.len() as u64).to_be_bytes());
        header[HEADER_BYTES - 8..].copy_from_slice(&check_sum(body).to_be_bytes());
    }
    bytes
}

/// The stream of a tracker or of 3D Slicer, in pieces of any length. What it holds stays bounded.
#[test]
fn igtl() {
    let time = TimeStamp::from_unix_ns(1 << 60);
    let text = Encoded::text("Probe", time, "cut").into_bytes().to_vec();
    let status = Encoded::status("Probe", time, 1, "", "ok").into_bytes().to_vec();
    let tracking = Encoded::tracking("Probe", time, &[]).into_bytes().to_vec();
    let mut transform = text.clone();
    transform[2..14].copy_from_slice(b"TRANSFORM\0\0\0");
    transform.truncate(HEADER_BYTES);
    transform.extend(
        [1.0f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 5.0, 6.0, 7.0].iter().flat_map(|x| x.to_be_bytes()),
    );
    let transform = repaired(&transform);
    let both = [text.clone(), transform.clone()].concat();
    let transforms = AtomicU32::new(0);
    attack!(vec![text, status, tracking, transform, both], RECIPES, |bytes: &[u8]| {
        for bytes in [bytes.to_vec(), repaired(bytes)] {
            let mut stream = Deframer::default();
            let piece = 1 + bytes.first().map_or(0, |&b| usize::from(b));
            for piece in bytes.chunks(piece) {
                let read = stream.push(piece, &mut |message| {
                    if let Ok(message) = message
                        && let Content::Transform(transform) = message.content
                    {
                        transforms.fetch_add(1, Ordering::Relaxed);
                        let words = format!("{transform:?}");
                        assert!(!words.contains("NaN") && !words.contains("inf"), "{words}");
                    }
                });
                if read.is_err() {
                    break;
                }
            }
            assert!(stream.held_bytes() <= 2 * MAX_BODY_IN as usize, "{} bytes", stream.held_bytes());
        }
    });
    assert!(transforms.load(Ordering::Relaxed) > 2, "some messages are read");
}

/// What Haply's service says about its devices.
#[test]
fn haply() {
    let full = r#"{"inverse3":[{"device_id":"04BA","config":{"preset":"defaults","mount":{}},"state":{
        "cursor_position":{"x":0.1,"y":0,"z":0.2},"cursor_velocity":{"x":0,"y":0,"z":0}}}],
        "verse_grip":[{"device_id":"61576","state":{"orientation":{"w":1,"x":0,"y":0,"z":0},"buttons":{"a":true}}}]}"#;
    attack!(vec![full.as_bytes().to_vec(), b"{}".to_vec()], RECIPES, |bytes: &[u8]| {
        let Ok(text) = std::str::from_utf8(bytes) else { return };
        let Ok(update) = Update::read(text) else { return };
        let Some(device) = update.device(None) else { return };
        let _ = device.force_field();
        if let Some(hand) = update.hand(device)
            && let Some(orientation) = hand.orientation
        {
            assert!(orientation.iter().all(|x| x.is_finite()), "{orientation:?}");
        }
    });
}

/// Addresses that people and files name.
#[test]
fn addresses() {
    let seeds =
        ["8080", "0.0.0.0:8080", "localhost", "[::1]:80", "tcp/10.0.0.1:7447", "quic/[::1]:7447?a=b#c"];
    attack!(seeds.map(|s| s.as_bytes().to_vec()).to_vec(), 5 * RECIPES, |bytes: &[u8]| {
        let Ok(text) = std::str::from_utf8(bytes) else { return };
        let _ = scindo_view::listen_address(text);
        let _ = scindo_proto::endpoint::bulk_endpoint(text);
        let _ = scindo::wire::door::local(text);
    });
}
