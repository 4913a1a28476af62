//! Poses and cuts of clients: who holds which tool, what is newest, what was already applied.
//!
//! # Rules
//! * A tool belongs to the first client with a liveliness token that sends a pose for it; it is
//!   free again when that token goes. A pose that overtook the token waits for it ([`crate::early`]).
//! * Of poses only the newest counts; one that is not newer than the last is refused.
//! * A cut is applied once per (client, tool, sequence number); repetitions get the old answer.
//! * Whatever is refused is counted by reason and leaves everything as it was.
//!
//! Free of zenoh: the threads that receive call in here, the simulation thread takes out.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use scindo_proto::limits::{MAX_CLIENT_TOOLS, MAX_TOOLS};
use scindo_proto::messages::{self as wire, CutAck, CutCommand, DeviceCapability, ToolSample, cut_ack};
use scindo_world::inputs::{CutOutcome, CutRequest, Inputs, ToolInput};

use crate::convert::{from_vec3, to_tool_input};
use crate::early::EarlyPoses;

/// Cuts that may wait for the next step. A step takes all of them.
const MAX_WAITING_CUTS: usize = 64;

/// Clients times tools whose cuts are remembered.
const MAX_LOGS: usize = 256;

/// Answers remembered per client and tool. A client repeats a cut for seconds; it would have to
/// send this many others meanwhile to be told "duplicate" without the details.
const MAX_ANSWERS: usize = 256;

/// Poses per second and tool that are taken; twice what a 1 kHz device sends.
const MAX_POSE_RATE: u32 = 2000;

/// Why a message is refused; the reason is counted and, for cuts, answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Stable name, such as `not-owner`.
    pub code: &'static str,
    /// What is wrong.
    pub message: String,
    /// What to do next.
    pub hint: &'static str,
}

/// What changed hands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Change {
    /// A client took a tool.
    Taken {
        /// The tool.
        tool: Arc<str>,
        /// Its new owner.
        owner: Arc<str>,
    },
    /// A client lost a tool because it went away.
    Released {
        /// The tool.
        tool: Arc<str>,
        /// Its former owner.
        owner: Arc<str>,
    },
}

/// What becomes of a cut command.
#[derive(Debug, Clone, PartialEq)]
pub enum Cut {
    /// The next step applies it; the answer comes afterwards.
    Queued,
    /// It waits already; the answer is on its way.
    Waiting,
    /// The answer.
    Answer(CutAck),
}

/// A tool in a client's hand.
#[derive(Debug, Clone)]
struct Held {
    input: ToolInput,
    poses: u64,
    /// Poses since the second began.
    this_second: (Instant, u32),
    capability: Option<DeviceCapability>,
}

impl Held {
    /// Counts a pose; false if the client sends too many.
    fn admit(&mut self, now: Instant) -> bool {
        if now.duration_since(self.this_second.0) >= Duration::from_secs(1) {
            self.this_second = (now, 0);
        }
        self.this_second.1 += 1;
        self.this_second.1 <= MAX_POSE_RATE
    }
}

/// Cuts of one client with one tool.
#[derive(Debug, Default)]
struct CutLog {
    waiting: BTreeSet<u64>,
    answers: BTreeMap<u64, CutAck>,
    /// Every number up to here was applied or refused, and its answer forgotten.
    forgotten_up_to: u64,
}

#[derive(Debug, Clone)]
struct Ticket {
    client: String,
    tool: String,
    seq: u64,
}

/// See the module.
#[derive(Debug, Default)]
pub struct Inbox {
    bodies: BTreeSet<Arc<str>>,
    scene_tools: BTreeSet<Arc<str>>,
    alive: BTreeMap<String, usize>,
    early: EarlyPoses,
    held: BTreeMap<Arc<str>, Held>,
    queue: VecDeque<CutRequest>,
    tickets: BTreeMap<u64, Ticket>,
    logs: BTreeMap<(String, String), CutLog>,
    next_request: u64,
    cuts_applied: u64,
    refused: BTreeMap<&'static str, u64>,
}

impl Inbox {
    /// An inbox for the bodies and tools of a scene.
    pub fn new(
        bodies: impl IntoIterator<Item = Arc<str>>,
        scene_tools: impl IntoIterator<Item = Arc<str>>,
    ) -> Self {
        Self {
            bodies: bodies.into_iter().collect(),
            scene_tools: scene_tools.into_iter().collect(),
            ..Self::default()
        }
    }

    /// A liveliness token of `client` appeared: what it sent before counts now.
    pub fn client_came(&mut self, client: &str) -> Vec<Change> {
        *self.alive.entry(client.to_owned()).or_default() += 1;
        let early = self.early.take(client, Instant::now());
        let taken = early.iter().filter_map(|sample| self.pose(&sample.tool_id, sample).ok());
        taken.flatten().collect()
    }

    /// A liveliness token of `client` went; with the last one its tools are released.
    pub fn client_went(&mut self, client: &str) -> Vec<Change> {
        let Some(tokens) = self.alive.get_mut(client) else { return Vec::new() };
        *tokens -= 1;
        if *tokens > 0 {
            return Vec::new();
        }
        self.alive.remove(client);
        let lost = self.held.extract_if(.., |_, held| &*held.input.owner == client);
        lost.map(|(tool, held)| Change::Released { tool, owner: held.input.owner }).collect()
    }

    /// A checked sample that arrived under the key of tool `key_tool`.
    pub fn pose(&mut self, key_tool: &str, sample: &ToolSample) -> Result<Option<Change>, Refusal> {
        let outcome = self.accept_pose(key_tool, sample, Instant::now());
        if let Err(refusal) = &outcome {
            self.count(refusal.code);
        }
        outcome
    }

    fn accept_pose(
        &mut self,
        key_tool: &str,
        sample: &ToolSample,
        now: Instant,
    ) -> Result<Option<Change>, Refusal> {
        same_key(key_tool, &sample.tool_id)?;
        let client = &*sample.client_id;
        if !self.alive.contains_key(client) {
            if self.early.keep(sample, now) {
                return Ok(None);
            }
            return Err(refuse(
                "no-token",
                format!("client '{client}' has no liveliness token"),
                "declare live/<role>/<client id> before the first pose",
            ));
        }
        if let Some(held) = self.held.get_mut(key_tool) {
            if &*held.input.owner != client {
                return Err(not_owner(key_tool, &held.input.owner));
            }
            if sample.seq <= held.input.seq {
                return Err(refuse(
                    "stale-sequence",
                    format!("pose {} of tool '{key_tool}' is not newer than {}", sample.seq, held.input.seq),
                    "number poses upwards",
                ));
            }
            if !held.admit(now) {
                return Err(refuse(
                    "too-fast",
                    format!("more than {MAX_POSE_RATE} poses per second for tool '{key_tool}'"),
                    "send at most 1000 per second",
                ));
            }
            let (id, owner) = (held.input.id.clone(), held.input.owner.clone());
            held.input = to_tool_input(sample, id, owner);
            held.poses += 1;
            return Ok(None);
        }
        self.take_tool(key_tool, sample).map(Some)
    }

    fn take_tool(&mut self, tool: &str, sample: &ToolSample) -> Result<Change, Refusal> {
        let known = self.scene_tools.get(tool).cloned();
        if known.is_none() {
            if sample.shape.is_none() {
                return Err(refuse(
                    "unknown-tool",
                    format!("the scene has no tool '{tool}' and the sample states no shape"),
                    "use a tool of rpc/info or state a shape",
                ));
            }
            let brought = self.held.keys().filter(|id| !self.scene_tools.contains(*id)).count();
            if brought >= MAX_CLIENT_TOOLS || self.scene_tools.len() + brought >= MAX_TOOLS {
                return Err(refuse(
                    "too-many-tools",
                    format!("clients brought {brought} tools already, allowed {MAX_CLIENT_TOOLS}"),
                    "wait until another client leaves",
                ));
            }
        }
        let id = known.unwrap_or_else(|| Arc::from(tool));
        let owner: Arc<str> = Arc::from(sample.client_id.as_str());
        let input = to_tool_input(sample, id.clone(), owner.clone());
        self.held
            .insert(id.clone(), Held { input, poses: 1, this_second: (Instant::now(), 1), capability: None });
        Ok(Change::Taken { tool: id, owner })
    }

    /// A checked cut that arrived under the key of tool `key_tool`.
    pub fn cut(&mut self, key_tool: &str, command: &CutCommand) -> Cut {
        let log = self.logs.get(&(command.client_id.clone(), command.tool_id.clone()));
        if let Some(log) = log {
            if log.waiting.contains(&command.seq) {
                return Cut::Waiting;
            }
            if let Some(answer) = log.answers.get(&command.seq) {
                return Cut::Answer(repeated(answer));
            }
            if command.seq <= log.forgotten_up_to {
                return Cut::Answer(answer(command, cut_ack::Outcome::Duplicate));
            }
        }
        match self.accept_cut(key_tool, command) {
            Ok(()) => Cut::Queued,
            Err(refusal) => {
                self.count(refusal.code);
                let mut answer = answer(command, cut_ack::Outcome::Refused);
                answer.error = Some(refusal.into());
                Cut::Answer(answer)
            }
        }
    }

    fn accept_cut(&mut self, key_tool: &str, command: &CutCommand) -> Result<(), Refusal> {
        same_key(key_tool, &command.tool_id)?;
        if let Some(held) = self.held.get(key_tool)
            && *held.input.owner != *command.client_id
        {
            return Err(not_owner(key_tool, &held.input.owner));
        }
        let body = match &*command.body_id {
            "" => None,
            id => Some(self.bodies.get(id).cloned().ok_or_else(|| {
                let names: Vec<&str> = self.bodies.iter().map(|b| &**b).collect();
                refuse(
                    "unknown-body",
                    format!("the scene has no body '{id}', it has {}", names.join(", ")),
                    "name one of these bodies, or none for all",
                )
            })?),
        };
        if self.queue.len() >= MAX_WAITING_CUTS {
            return Err(refuse(
                "queue-full",
                format!("{MAX_WAITING_CUTS} cuts wait already"),
                "send it again after the simulation has stepped",
            ));
        }
        let whose = (command.client_id.clone(), command.tool_id.clone());
        if !self.logs.contains_key(&whose) && self.logs.len() >= MAX_LOGS {
            self.forget_departed()?;
        }
        self.logs.entry(whose).or_default().waiting.insert(command.seq);
        self.next_request += 1;
        let segments = command.sweep.iter();
        self.queue.push_back(CutRequest {
            request: self.next_request,
            tool: Arc::from(command.tool_id.as_str()),
            body,
            segments: segments
                .map(|s| -> [Vector3<f64>; 2] { [from_vec3(s.tip_m), from_vec3(s.heel_m)] })
                .collect(),
        });
        let ticket =
            Ticket { client: command.client_id.clone(), tool: command.tool_id.clone(), seq: command.seq };
        self.tickets.insert(self.next_request, ticket);
        Ok(())
    }

    /// Makes room by forgetting the cuts of clients that are gone.
    fn forget_departed(&mut self) -> Result<(), Refusal> {
        self.logs.retain(|(client, _), log| !log.waiting.is_empty() || self.alive.contains_key(client));
        if self.logs.len() < MAX_LOGS {
            return Ok(());
        }
        Err(refuse(
            "too-many-clients",
            format!("cuts of {MAX_LOGS} clients and tools are remembered already"),
            "use fewer client and tool ids",
        ))
    }

    /// What a device can do, told once per connection.
    pub fn capability(&mut self, capability: DeviceCapability) {
        if let Some(held) = self.held.get_mut(&*capability.tool_id)
            && *held.input.owner == *capability.client_id
        {
            held.capability = Some(capability);
        }
    }

    /// Counts a refused message.
    pub fn count(&mut self, code: &'static str) {
        *self.refused.entry(code).or_default() += 1;
    }

    /// Moves what the next step reads into `inputs`: newest poses and all waiting cuts.
    pub fn take(&mut self, inputs: &mut Inputs) {
        inputs.tools.clear();
        inputs.tools.extend(self.held.values().map(|held| held.input.clone()));
        inputs.cuts.clear();
        inputs.cuts.extend(self.queue.drain(..));
    }

    /// Notes what a step did with its cuts, `step` after the cut; returns the answers.
    pub fn finish(&mut self, outcomes: &[CutOutcome], step: u64, epochs: &[wire::BodyEpoch]) -> Vec<CutAck> {
        let mut answers = Vec::with_capacity(outcomes.len());
        for outcome in outcomes {
            let Some(ticket) = self.tickets.remove(&outcome.request) else { continue };
            let answer = self.answer_of(&ticket, outcome, step, epochs);
            let log = self.logs.entry((ticket.client, ticket.tool)).or_default();
            log.waiting.remove(&ticket.seq);
            log.answers.insert(ticket.seq, answer.clone());
            while log.answers.len() > MAX_ANSWERS {
                if let Some((seq, _)) = log.answers.pop_first() {
                    log.forgotten_up_to = log.forgotten_up_to.max(seq);
                }
            }
            answers.push(answer);
        }
        answers
    }

    fn answer_of(
        &mut self,
        ticket: &Ticket,
        outcome: &CutOutcome,
        step: u64,
        epochs: &[wire::BodyEpoch],
    ) -> CutAck {
        let mut ack = CutAck {
            client_id: ticket.client.clone(),
            tool_id: ticket.tool.clone(),
            seq: ticket.seq,
            sim_step: step,
            epochs: epochs.to_vec(),
            ..CutAck::default()
        };
        match &outcome.result {
            Ok(elements) => {
                self.cuts_applied += 1;
                ack.elements_cut = u32::try_from(*elements).unwrap_or(u32::MAX);
                ack.set_outcome(cut_ack::Outcome::Applied);
            }
            Err(reason) => {
                self.count("cut-failed");
                ack.set_outcome(cut_ack::Outcome::Refused);
                let hint = "change the sweep and send it with a new number";
                ack.error = Some(refuse("cut-failed", reason.clone(), hint).into());
            }
        }
        ack
    }

    /// Newest pose of every held tool.
    pub fn held(&self) -> impl Iterator<Item = &ToolInput> {
        self.held.values().map(|held| &held.input)
    }

    /// What the device behind `tool` can do, if it told.
    pub fn capability_of(&self, tool: &str) -> Option<&DeviceCapability> {
        self.held.get(tool)?.capability.as_ref()
    }

    /// True while a client holds a tool.
    pub fn anybody_holds(&self) -> bool {
        !self.held.is_empty()
    }

    /// Poses accepted per held tool since it was taken.
    pub fn pose_counts(&self) -> impl Iterator<Item = (&Arc<str>, u64)> {
        self.held.iter().map(|(tool, held)| (tool, held.poses))
    }

    /// Messages refused so far, by reason.
    pub fn refused(&self) -> &BTreeMap<&'static str, u64> {
        &self.refused
    }

    /// Cuts of clients applied so far.
    pub fn cuts_applied(&self) -> u64 {
        self.cuts_applied
    }
}

impl From<Refusal> for wire::Error {
    fn from(refusal: Refusal) -> Self {
        Self { code: refusal.code.to_owned(), message: refusal.message, hint: refusal.hint.to_owned() }
    }
}

fn refuse(code: &'static str, message: String, hint: &'static str) -> Refusal {
    Refusal { code, message, hint }
}

fn not_owner(tool: &str, owner: &str) -> Refusal {
    refuse(
        "not-owner",
        format!("tool '{tool}' is held by '{owner}'"),
        "take another tool or wait until it is free",
    )
}

fn same_key(key_tool: &str, tool: &str) -> Result<(), Refusal> {
    if key_tool == tool {
        return Ok(());
    }
    Err(refuse(
        "wrong-key",
        format!("a message for tool '{tool}' arrived under the key of '{key_tool}'"),
        "publish to tool/<tool id>/…",
    ))
}

fn answer(command: &CutCommand, outcome: cut_ack::Outcome) -> CutAck {
    CutAck {
        client_id: command.client_id.clone(),
        tool_id: command.tool_id.clone(),
        seq: command.seq,
        outcome: outcome.into(),
        ..CutAck::default()
    }
}

/// The same answer again; one that was applied is now a duplicate.
fn repeated(answer: &CutAck) -> CutAck {
    let mut again = answer.clone();
    if again.outcome() == cut_ack::Outcome::Applied {
        again.set_outcome(cut_ack::Outcome::Duplicate);
    }
    again
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::early::PATIENCE;
    use scindo_proto::messages::{BladeSegment, Pose, ToolShape, Vec3};

    fn inbox() -> Inbox {
        Inbox::new([Arc::from("beam")], [Arc::from("scalpel")])
    }

    fn sample(client: &str, tool: &str, seq: u64) -> ToolSample {
        ToolSample {
            seq,
            client_id: client.into(),
            tool_id: tool.into(),
            pose: Some(Pose { position_m: Some(Vec3::default()), qw: 1.0, ..Pose::default() }),
            ..ToolSample::default()
        }
    }

    fn command(client: &str, seq: u64) -> CutCommand {
        CutCommand {
            client_id: client.into(),
            tool_id: "scalpel".into(),
            seq,
            body_id: "beam".into(),
            sweep: vec![BladeSegment::default(); 2],
            ..CutCommand::default()
        }
    }

    #[test]
    fn a_tool_belongs_to_the_first_living_client_until_its_token_goes() {
        let mut inbox = inbox();
        inbox.client_came("a");
        inbox.client_came("b");
        assert!(matches!(inbox.pose("scalpel", &sample("a", "scalpel", 1)), Ok(Some(Change::Taken { .. }))));
        assert_eq!(inbox.pose("scalpel", &sample("b", "scalpel", 1)).unwrap_err().code, "not-owner");
        assert_eq!(inbox.pose("scalpel", &sample("a", "scalpel", 1)).unwrap_err().code, "stale-sequence");
        assert_eq!(inbox.pose("scalpel", &sample("a", "scalpel", 2)), Ok(None));
        assert!(inbox.client_went("b").is_empty());
        assert_eq!(inbox.client_went("a").len(), 1);
        assert!(!inbox.anybody_holds());
        inbox.client_came("b");
        assert!(inbox.pose("scalpel", &sample("b", "scalpel", 1)).is_ok());
        assert_eq!(inbox.refused()["not-owner"], 1);
    }

    #[test]
    fn a_pose_that_overtook_the_token_counts_when_the_token_comes() {
        let mut inbox = inbox();
        for seq in 1..4 {
            assert_eq!(inbox.pose("scalpel", &sample("a", "scalpel", seq)), Ok(None));
        }
        assert!(!inbox.anybody_holds());
        let taken = Change::Taken { tool: "scalpel".into(), owner: "a".into() };
        assert_eq!(inbox.client_came("a"), [taken]);
        assert_eq!(inbox.held().next().unwrap().seq, 3);
        assert_eq!(inbox.client_came("a"), []);
        assert_eq!(inbox.refused().len(), 0);
        let late = Instant::now() + PATIENCE;
        assert_eq!(inbox.accept_pose("scalpel", &sample("b", "scalpel", 1), late), Ok(None));
        let refused = inbox.accept_pose("scalpel", &sample("b", "scalpel", 2), late + PATIENCE);
        assert_eq!(refused.unwrap_err().code, "no-token");
    }

    #[test]
    fn a_new_tool_needs_a_shape_and_there_may_be_sixteen() {
        let mut inbox = inbox();
        inbox.client_came("a");
        assert_eq!(inbox.pose("probe", &sample("a", "probe", 1)).unwrap_err().code, "unknown-tool");
        assert_eq!(inbox.pose("probe", &sample("a", "other", 1)).unwrap_err().code, "wrong-key");
        for i in 0..=MAX_CLIENT_TOOLS {
            let id = format!("t{i}");
            let mut sample = sample("a", &id, 1);
            sample.shape = Some(ToolShape::default());
            assert_eq!(inbox.pose(&id, &sample).is_ok(), i < MAX_CLIENT_TOOLS);
        }
        assert_eq!(inbox.refused()["too-many-tools"], 1);
    }

    #[test]
    fn a_flood_of_poses_is_cut_short() {
        let mut inbox = inbox();
        inbox.client_came("a");
        for seq in 1..=u64::from(MAX_POSE_RATE) + 50 {
            let _ = inbox.pose("scalpel", &sample("a", "scalpel", seq));
        }
        // A slow machine may need more than the second that is counted.
        let refused = inbox.refused().get("too-fast").copied().unwrap_or(0);
        assert!(refused <= 50, "{refused}");
        assert_eq!(inbox.pose_counts().next().unwrap().1 + refused, u64::from(MAX_POSE_RATE) + 50);
    }

    #[test]
    fn a_cut_is_applied_once_however_often_it_comes() {
        let mut inbox = inbox();
        assert_eq!(inbox.cut("scalpel", &command("a", 1)), Cut::Queued);
        assert_eq!(inbox.cut("scalpel", &command("a", 1)), Cut::Waiting);
        let mut inputs = Inputs::default();
        inbox.take(&mut inputs);
        assert_eq!(inputs.cuts.len(), 1);
        assert_eq!(inbox.cut("scalpel", &command("a", 1)), Cut::Waiting);
        let outcome = CutOutcome { request: inputs.cuts[0].request, result: Ok(7) };
        let acks = inbox.finish(&[outcome], 3, &[]);
        assert_eq!((acks[0].outcome(), acks[0].elements_cut), (cut_ack::Outcome::Applied, 7));
        let Cut::Answer(again) = inbox.cut("scalpel", &command("a", 1)) else { panic!() };
        assert_eq!((again.outcome(), again.elements_cut), (cut_ack::Outcome::Duplicate, 7));
        assert_eq!(inbox.cut("scalpel", &command("b", 1)), Cut::Queued);
        inbox.take(&mut inputs);
        assert_eq!(inputs.cuts.len(), 1);
        assert_eq!(inbox.cuts_applied(), 1);
    }

    #[test]
    fn forgotten_answers_are_still_duplicates() {
        let mut inbox = inbox();
        for seq in 1..=MAX_ANSWERS as u64 + 10 {
            assert_eq!(inbox.cut("scalpel", &command("a", seq)), Cut::Queued);
            let mut inputs = Inputs::default();
            inbox.take(&mut inputs);
            inbox.finish(&[CutOutcome { request: inputs.cuts[0].request, result: Ok(0) }], seq, &[]);
        }
        let Cut::Answer(old) = inbox.cut("scalpel", &command("a", 1)) else { panic!() };
        assert_eq!(old.outcome(), cut_ack::Outcome::Duplicate);
    }

    #[test]
    fn refused_cuts_say_why_and_are_counted() {
        let mut inbox = inbox();
        let mut foreign = command("a", 1);
        foreign.body_id = "liver".into();
        let Cut::Answer(ack) = inbox.cut("scalpel", &foreign) else { panic!() };
        assert_eq!(ack.outcome(), cut_ack::Outcome::Refused);
        assert_eq!(ack.error.unwrap().code, "unknown-body");
        for seq in 1..=MAX_WAITING_CUTS as u64 {
            assert_eq!(inbox.cut("scalpel", &command("a", seq)), Cut::Queued);
        }
        let Cut::Answer(ack) = inbox.cut("scalpel", &command("a", 999)) else { panic!() };
        assert_eq!(ack.error.unwrap().code, "queue-full");
        inbox.client_came("b");
        inbox.pose("scalpel", &sample("b", "scalpel", 1)).unwrap();
        let Cut::Answer(ack) = inbox.cut("scalpel", &command("a", 1000)) else { panic!() };
        assert_eq!(ack.error.unwrap().code, "not-owner");
        assert_eq!(inbox.refused().values().sum::<u64>(), 3);
    }
}
