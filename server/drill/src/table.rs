//! The server of an episode: the real inbox, simulation and contact models, driven by a virtual clock.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, bounded};
use scindo::contact::to_message;
use scindo::exchange::{ANSWERS, Exchange, OUTGOING};
use scindo::inbox::{Answering, Inbox};
use scindo::receive;
use scindo_proto::messages::{CutAck, CutCommand, HapticContact, ToolSample};
use scindo_proto::{Chunk, KeySpace, Role, Topic, decode_as, encode, encoding};
use scindo_world::contact::model::{ContactModels, ToolQuery};
use scindo_world::inputs::{Inputs, ToolInput, ToolShape, Wants};
use scindo_world::scene::{Scene, SceneError};
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;
use serde::Serialize;

use crate::checker::Checker;
use crate::network::{MS, Packet};

/// Name of the tool that the scene declares, for which clients compete.
pub const SCENE_TOOL: &str = "scalpel";
/// Step of the simulation [ms].
pub const STEP_MS: u64 = 10;

/// A small block on a table.
const SCENE: &str = r#"
schema = 1
name = "block"
world = { gravity_m_s2 = [0, 0, 0], step_s = 0.01 }
[[body]]
id = "block"
mesh = { box = { min_m = [-0.02, -0.02, 0], max_m = [0.02, 0.02, 0.02], cells = [2, 2, 1] } }
young_pa = 3e4
poisson = 0.3
density_kg_m3 = 1060
rayleigh = { mass_1_s = 1.0, stiffness_s = 0.01 }
solver = { iterations = 30, tolerance = 1e-4 }
[[body.fix]]
where = { slab = { axis = "z", from = 0.0, to = 0.05 } }
[[tool]]
id = "scalpel"
shape = { sphere = { radius_m = 0.005 } }
"#;

/// A safeguard that is taken out, to show that its lack is noticed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mutant {
    /// A repeated cut counts as a new one.
    NoDeduplication,
    /// A pose moves a tool whoever sent it.
    NoOwnership,
    /// The client goes on with the newest contact, however old it is.
    NoValidity,
    /// The same, and it does not notice either that the server has gone.
    NoWatchdog,
}

impl Mutant {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::NoDeduplication, Self::NoOwnership, Self::NoValidity, Self::NoWatchdog];

    /// What is taken out.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoDeduplication => "de-duplication of cuts",
            Self::NoOwnership => "ownership of tools",
            Self::NoValidity => "validity of contacts",
            Self::NoWatchdog => "the watchdog of the haptic client",
        }
    }
}

/// The server.
pub struct Table {
    keys: KeySpace,
    exchange: Arc<Exchange>,
    answers: Receiver<CutAck>,
    sim: Simulation,
    inputs: Inputs,
    models: ContactModels,
    snapshot: Snapshot,
    start: Instant,
    contacts: u64,
    steps: u64,
    mutant: Option<Mutant>,
    /// Numbers that cuts have got without de-duplication, and those that their clients gave.
    renumbered: BTreeMap<u64, u64>,
}

impl Table {
    /// A server that nobody has spoken to.
    ///
    /// # Errors
    /// If its scene cannot be built.
    pub fn new(keys: &KeySpace, mutant: Option<Mutant>) -> Result<Self, SceneError> {
        let sim = Simulation::new(&Scene::from_toml(SCENE)?, Path::new(""))?;
        let inbox = Inbox::new([Arc::from("block")], [Arc::from(SCENE_TOOL)]);
        let (answer, answers) = bounded(ANSWERS);
        let exchange = Exchange::new(inbox, 1, (bounded(OUTGOING).0, answer));
        let inputs = Inputs { wants: Wants { contact: true, ..Wants::default() }, ..Inputs::default() };
        Ok(Self {
            keys: keys.clone(),
            exchange,
            answers,
            sim,
            inputs,
            models: ContactModels::default(),
            snapshot: Snapshot::default(),
            start: Instant::now(),
            contacts: 0,
            steps: 0,
            mutant,
            renumbered: BTreeMap::new(),
        })
    }

    fn at(&self, now_ns: u64) -> Instant {
        self.start + Duration::from_nanos(now_ns)
    }

    /// The token of `client` came or went.
    pub fn token(&mut self, client: &Chunk, is_there: bool, now_ns: u64, checker: &mut Checker) {
        checker.token(client.as_str(), is_there);
        let key = self.keys.key(&Topic::Live(client.clone(), Role::Haptic));
        receive::token(&self.keys, &self.exchange, &key, is_there, self.at(now_ns));
    }

    /// A packet arrived.
    pub fn receive(&mut self, packet: &Packet, now_ns: u64, checker: &mut Checker) {
        let now = self.at(now_ns);
        match self.keys.parse(&packet.key) {
            Ok(Topic::ToolPose(client, tool)) => {
                if let Ok(sample) = decode_as::<ToolSample>(&packet.encoding, packet.content.clone()) {
                    checker.said_pose([client.as_str(), tool.as_str()], &sample);
                }
                match self.impersonated(packet) {
                    Some(packet) => receive::pose(&self.keys, &self.exchange, &packet, now),
                    None => receive::pose(&self.keys, &self.exchange, packet, now),
                }
            }
            Ok(Topic::ToolCut(client, tool)) => {
                let said = decode_as::<CutCommand>(&packet.encoding, packet.content.clone()).ok();
                if let Some(command) = &said {
                    checker.said_cut([client.as_str(), tool.as_str()], command);
                }
                match said.filter(|_| self.mutant == Some(Mutant::NoDeduplication)) {
                    Some(command) => {
                        let seq = (1 << 62) + self.renumbered.len() as u64;
                        self.renumbered.insert(seq, command.seq);
                        let content = encode(&CutCommand { seq, ..command });
                        let packet = Packet { content, ..packet.clone() };
                        receive::cut(&self.keys, &self.exchange, &packet, now);
                    }
                    None => receive::cut(&self.keys, &self.exchange, packet, now),
                }
            }
            _ => receive::capability(&self.keys, &self.exchange, packet, now),
        }
    }

    /// A pose as its owner would send it, for a server that does not ask who sends.
    fn impersonated(&self, packet: &Packet) -> Option<Packet> {
        if self.mutant != Some(Mutant::NoOwnership) {
            return None;
        }
        let sample = decode_as::<ToolSample>(&packet.encoding, packet.content.clone()).ok()?;
        let inbox = self.exchange.inbox();
        let held = inbox.held().find(|input| *input.id == *sample.tool_id)?;
        let (client_id, seq) = (held.owner.to_string(), held.seq.saturating_add(1));
        let keys = [Chunk::new("client id", &client_id).ok()?, Chunk::new("tool id", &sample.tool_id).ok()?];
        let [client, tool] = keys;
        let content = encode(&ToolSample { client_id, seq, ..sample });
        Some(Packet { key: self.keys.key(&Topic::ToolPose(client, tool)), content, ..packet.clone() })
    }

    /// One step of the simulation.
    pub fn step(&mut self, now_ns: u64, checker: &mut Checker) {
        self.exchange.inbox().take(&mut self.inputs);
        checker.taken(&self.inputs);
        self.sim.step(&self.inputs);
        self.steps += 1;
        let outcomes = &self.sim.report().cuts;
        checker.outcomes(outcomes);
        let with = Answering { step: self.steps, epochs: &[], code: "cut-failed", hint: "" };
        let answers = self.exchange.inbox().finish(outcomes, &with);
        answers.into_iter().for_each(|answer| self.exchange.answer(answer));
        self.sim.snapshot_into(&self.inputs.wants, &mut self.snapshot);
        self.models.take(&self.snapshot, now_ns as f64 * 1e-9);
    }

    /// Contact models of all held tools, with the ids of the tools.
    pub fn contacts(&mut self, now_ns: u64) -> Vec<(Arc<str>, Packet)> {
        let held: Vec<ToolInput> = self.exchange.inbox().held().cloned().collect();
        let mut packets = Vec::with_capacity(held.len());
        for input in held {
            let query = ToolQuery {
                id: Arc::clone(&input.id),
                shape: ToolShape::Sphere { radius_m: 0.005 },
                pose: input.pose,
                velocity_m_s: input.velocity_m_s,
                mode: input.mode,
            };
            let model = self.models.evaluate(&query, now_ns as f64 * 1e-9);
            self.contacts += 1;
            let message = to_message(model, &input, self.contacts);
            let message = HapticContact { publish_unix_ns: now_ns + MS, ..message };
            let content = encode(&message);
            let packet = Packet {
                key: String::new(),
                encoding: encoding::<HapticContact>(),
                content,
                is_sound: false,
            };
            packets.push((input.id, packet));
        }
        packets
    }

    /// The answers to cuts since the last call.
    pub fn answers(&mut self) -> Vec<(CutAck, Packet)> {
        let renumbered = &self.renumbered;
        let told = self.answers.try_iter().map(|answer| {
            let seq = renumbered.get(&answer.seq).copied().unwrap_or(answer.seq);
            CutAck { seq, ..answer }
        });
        told.map(|answer| {
            let content = encode(&answer);
            (answer, Packet { key: String::new(), encoding: encoding::<CutAck>(), content, is_sound: true })
        })
        .collect()
    }

    /// Who holds which tool, by tool.
    pub fn owners(&self) -> BTreeMap<String, String> {
        let inbox = self.exchange.inbox();
        inbox.held().map(|input| (input.id.to_string(), input.owner.to_string())).collect()
    }

    /// Messages that the server refused.
    pub fn refused(&self) -> u64 {
        self.exchange.inbox().refused().values().sum()
    }
}
