//! A service that speaks the format that Haply documents, for tests: one device and one wireless grip.
//!
//! It is strict: a force in the field of the other version is counted and not obeyed. Haply's own client (crate
//! `haply` 1.3.1) has been held against it; it cannot be a dependency, because it brings OpenSSL.

use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// Which service it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Version {
    /// Force in `values`, short configuration.
    Old,
    /// Force in `vector`, long configuration.
    New,
}

/// What the test sets and what the service has seen.
#[derive(Debug, Clone)]
pub(crate) struct World {
    pub position_m: [f64; 3],
    pub velocity_m_s: [f64; 3],
    pub buttons: [bool; 2],
    /// The device is plugged in.
    pub is_there: bool,
    pub is_ready: bool,
    /// It answers; otherwise it keeps the connection and says nothing.
    pub answers: bool,
    /// Force at present, and when it was last set.
    pub force_n: [f64; 3],
    pub set: Option<Instant>,
    /// Messages, sessions, named sessions, forces in the wrong field.
    pub messages: u64,
    pub sessions: u64,
    pub named: u64,
    pub wrong: u64,
}

impl Default for World {
    fn default() -> Self {
        Self {
            position_m: [0.0, -0.12, 0.15],
            velocity_m_s: [0.0; 3],
            buttons: [false; 2],
            is_there: true,
            is_ready: true,
            answers: true,
            force_n: [0.0; 3],
            set: None,
            messages: 0,
            sessions: 0,
            named: 0,
            wrong: 0,
        }
    }
}

/// The service. It ends with the test.
pub(crate) struct FakeService {
    pub address: String,
    pub world: Arc<Mutex<World>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl FakeService {
    pub(crate) fn start(version: Version) -> Self {
        Self::at("127.0.0.1:0", version)
    }

    pub(crate) fn at(address: &str, version: Version) -> Self {
        // A port that was used a moment ago may take a while to be free.
        let end = Instant::now() + Duration::from_secs(20);
        let listener = loop {
            match TcpListener::bind(address) {
                Ok(listener) => break listener,
                Err(error) => assert!(Instant::now() < end, "{address}: {error}"),
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        let address = listener.local_addr().unwrap().to_string();
        listener.set_nonblocking(true).unwrap();
        let (world, stop) = (Arc::new(Mutex::new(World::default())), Arc::new(AtomicBool::new(false)));
        let (shared, ended) = (world.clone(), stop.clone());
        let run = move || {
            while !ended.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) => drop(serve(stream, version, &shared, &ended)),
                    Err(_) => std::thread::sleep(Duration::from_millis(5)),
                }
            }
        };
        let thread = std::thread::Builder::new().name("fake-haply".into()).spawn(run).unwrap();
        Self { address, world, stop, thread: Some(thread) }
    }

    pub(crate) fn set(&self, change: impl FnOnce(&mut World)) {
        change(&mut self.world.lock().unwrap());
    }

    pub(crate) fn seen(&self) -> World {
        self.world.lock().unwrap().clone()
    }
}

impl Drop for FakeService {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }
}

/// One client at a time.
fn serve(
    stream: TcpStream,
    version: Version,
    world: &Mutex<World>,
    stop: &AtomicBool,
) -> Result<(), Box<tungstenite::Error>> {
    stream.set_nonblocking(false).unwrap();
    stream.set_nodelay(true).unwrap();
    let Ok(mut socket) = tungstenite::accept(stream) else { return Ok(()) };
    socket.get_ref().set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    world.lock().unwrap().sessions += 1;
    send(&mut socket, &update(&world.lock().unwrap(), version, true))?;
    while !stop.load(Ordering::Relaxed) {
        let text = match socket.read() {
            Ok(Message::Text(text)) => text,
            Ok(_) => continue,
            Err(tungstenite::Error::Io(e)) if e.kind() == std::io::ErrorKind::WouldBlock => continue,
            Err(error) => return Err(error.into()),
        };
        let message: Value = serde_json::from_str(&text).expect("JSON");
        let mut world = world.lock().unwrap();
        world.messages += 1;
        obey(&mut world, version, &message);
        let whole = message["session"]["force_render_full_state"].is_object();
        if world.answers {
            let update = update(&world, version, whole);
            drop(world);
            send(&mut socket, &update)?;
        }
    }
    Ok(())
}

fn send(socket: &mut WebSocket<TcpStream>, update: &Value) -> Result<(), Box<tungstenite::Error>> {
    Ok(socket.send(Message::text(update.to_string()))?)
}

fn obey(world: &mut World, version: Version, message: &Value) {
    world.named += u64::from(message["session"]["configure"]["profile"]["name"].is_string());
    for device in message["inverse3"].as_array().into_iter().flatten() {
        assert_eq!(device["device_id"], "049D", "{message}");
        let command = &device["commands"]["set_cursor_force"];
        let (mine, other) = match version {
            Version::Old => ("values", "vector"),
            Version::New => ("vector", "values"),
        };
        world.wrong += u64::from(command[other].is_object());
        if command[mine].is_object() {
            world.force_n = ["x", "y", "z"].map(|axis| command[mine][axis].as_f64().expect("a number"));
            world.set = Some(Instant::now());
        }
    }
}

fn update(world: &World, version: Version, whole: bool) -> Value {
    let xyz = |v: [f64; 3]| json!({ "x": v[0], "y": v[1], "z": v[2] });
    let angles = json!({ "a0": 0.0, "a1": 0.0, "a2": 0.0 });
    let upright = json!({ "w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0 });
    let mut config = json!({
        "type": "inverse3", "port": "COM12", "extended_device_id": "…", "extended_firmware_version": "…",
        "device_info": { "major_version": 7, "minor_version": 4, "id": "049D", "device_type": 4, "uuid": "…" },
        "gravity_compensation": { "enabled": true, "scaling_factor": 1.0 },
        "handedness": "right", "streaming_mode": "USB", "torque_scaling": { "enabled": true },
    });
    if version == Version::New {
        config["home_return"] = json!({ "enabled": false });
        config["preset"] = json!("defaults");
        config["basis"] = json!({ "permutation": "XYZ" });
        config["mount"] = json!({ "position": xyz([0.0; 3]), "rotation": upright, "scale": xyz([1.0; 3]) });
        config["filters"] = json!({ "force_gate": { "gain": 0.3 }, "damping": { "scalar": 0.0 } });
    }
    let mut inverse3 = json!({
        "device_id": "049D",
        "state": {
            "cursor_position": xyz(world.position_m), "cursor_velocity": xyz(world.velocity_m_s),
            "angular_position": angles, "angular_velocity": angles, "body_orientation": upright,
            "current_cursor_force": xyz(world.force_n), "mode": "idle", "control_mode": "idle",
            "control_domain": "cartesian", "transform": {},
        },
        "status": {
            "calibrated": true, "in_use": false, "power_supply": true, "ready": world.is_ready, "started": true,
        },
    });
    let [a, b] = world.buttons;
    let mut grip = json!({
        "device_id": "61548",
        "state": {
            "orientation": { "w": 0.5, "x": 0.5, "y": 0.5, "z": 0.5 }, "hall": 0, "battery_level": 0.9,
            "buttons": { "a": a, "b": b, "c": false },
        },
        "status": { "ready": true, "connected": true, "awake": true },
    });
    if whole {
        inverse3["config"] = config;
        grip["config"] = json!({
            "port": "COM3", "type": "wireless_verse_grip", "major_version": 1, "minor_version": 0, "hardware_version": 2,
        });
    }
    let there = |device: Value| if world.is_there { vec![device] } else { vec![] };
    json!({ "session_id": 7, "inverse3": there(inverse3), "wireless_verse_grip": there(grip), "verse_grip": [] })
}
