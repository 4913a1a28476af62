//! Which clients are present, and who holds which tool.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use scindo_proto::Role;
use scindo_proto::messages::{DeviceCapability, ToolSample};
use scindo_world::inputs::{MAX_PASSED, MAX_TOOLS, ToolInput, ToolMode};

use super::counters::ToolFigures;
use super::early::{EarlyPoses, PATIENCE};
use super::one_way::OneWay;
use super::refusal::{Refusal, refuse};
use crate::wire::convert::to_tool_input;

/// Reason of a refusal for clients without a token. They declare it and try again.
pub(super) const NO_TOKEN: &str = "no-token";

/// Poses accepted per second and tool: twice what a 1 kHz device sends.
pub const MAX_POSE_RATE: u32 = 2000;

/// Most clients with a token at a time. The tokens themselves are not limited before they arrive here. A newcomer takes
/// the place of the oldest client that has done nothing yet, so invented clients shut nobody out.
pub const MAX_CLIENTS: usize = 4096;

// All tools of the world must fit into the messages that report them.
const _: () = assert!(MAX_TOOLS <= scindo_proto::limits::MAX_TOOLS);

/// A change of ownership.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Change {
    /// A client took a tool.
    Taken {
        /// Id of the tool.
        tool: Arc<str>,
        /// Id of the new owner.
        owner: Arc<str>,
    },
    /// A client lost a tool because it went away.
    Released {
        /// Id of the tool.
        tool: Arc<str>,
        /// Id of the former owner.
        owner: Arc<str>,
    },
}

/// A tool that a client holds.
#[derive(Debug, Clone)]
struct Held {
    input: ToolInput,
    /// Whether a step has taken its pose.
    taken: bool,
    poses: u64,
    /// Age of the contact model that its device last used [ms].
    contact_age_ms: f32,
    /// How long its poses are on the way.
    one_way: OneWay,
    /// Start of the current second, and poses since then.
    this_second: (Instant, u32),
    capability: Option<DeviceCapability>,
    /// Name of the person; empty if none was given.
    name: Arc<str>,
}

impl Held {
    /// Counts a pose. False if the client sends too many.
    fn admit(&mut self, now: Instant) -> bool {
        if now.duration_since(self.this_second.0) >= Duration::from_secs(1) {
            self.this_second = (now, 0);
        }
        self.this_second.1 += 1;
        self.this_second.1 <= MAX_POSE_RATE
    }

    /// Keeps the poses of a blade that cuts until a step takes them.
    fn pass(&mut self, before: ToolInput) {
        let cuts = before.mode == ToolMode::Cut && self.input.mode == ToolMode::Cut;
        let known = std::mem::take(&mut self.taken);
        if cuts {
            self.input.passed = before.passed;
            if !known && self.input.passed.len() < MAX_PASSED {
                self.input.passed.push(before.pose);
            }
        }
    }

    /// Whether `sample` is newer than the newest known pose. A client that takes its tool again counts from
    /// 1, but its clock goes on. A sample that is newer in neither is old or a duplicate.
    fn is_older_than(&self, sample: &ToolSample) -> bool {
        sample.seq > self.input.seq || sample.client_time_ns > self.input.client_time_ns
    }
}

/// A client with a token.
#[derive(Debug)]
struct Present {
    tokens: usize,
    /// Number of its arrival.
    number: u64,
}

/// Last pose of a client before it lost a tool.
#[derive(Debug)]
struct LetGo {
    seq: u64,
    at: Instant,
}

/// Present clients and the tools that they hold.
#[derive(Debug, Default)]
pub(super) struct Owners {
    scene_tools: BTreeSet<Arc<str>>,
    here: BTreeMap<String, Present>,
    /// Clients that are here and have neither held a tool nor cut, by number of arrival.
    idle: BTreeMap<u64, String>,
    arrivals: u64,
    /// What the newest token of a client says that it is.
    roles: BTreeMap<String, Role>,
    early: EarlyPoses,
    held: BTreeMap<Arc<str>, Held>,
    /// By client and tool, kept while late poses may still arrive.
    let_go: BTreeMap<(String, String), LetGo>,
}

impl Owners {
    pub(super) fn new(scene_tools: BTreeSet<Arc<str>>) -> Self {
        Self { scene_tools, ..Self::default() }
    }

    /// Registers a token of `client` and returns the poses that waited for it.
    pub(super) fn came(&mut self, client: &str, now: Instant) -> Vec<ToolSample> {
        if let Some(known) = self.here.get_mut(client) {
            known.tokens += 1;
        } else if self.here.len() < MAX_CLIENTS || self.dismiss_idle() {
            self.arrivals += 1;
            self.idle.insert(self.arrivals, client.to_owned());
            self.here.insert(client.to_owned(), Present { tokens: 1, number: self.arrivals });
        }
        self.early.take(client, now)
    }

    /// Forgets the oldest client that has done nothing yet; false if there is none. It declares its token again before
    /// it does something.
    fn dismiss_idle(&mut self) -> bool {
        let Some((_, client)) = self.idle.pop_first() else { return false };
        self.here.remove(&client);
        self.roles.remove(&client);
        true
    }

    /// Notes that a client that is here has done something.
    fn acted(&mut self, client: &str) {
        if let Some(present) = self.here.get(client) {
            self.idle.remove(&present.number);
        }
    }

    /// Removes a token of `client`. The last one releases its tools.
    pub(super) fn went(&mut self, client: &str, now: Instant) -> Vec<Change> {
        let Some(present) = self.here.get_mut(client) else { return Vec::new() };
        present.tokens -= 1;
        if present.tokens > 0 {
            return Vec::new();
        }
        self.idle.remove(&present.number);
        self.here.remove(client);
        self.roles.remove(client);
        self.let_go.retain(|_, last| now.duration_since(last.at) < PATIENCE);
        let lost = self.held.extract_if(.., |_, held| &*held.input.owner == client);
        let mut changes = Vec::new();
        for (tool, held) in lost {
            self.let_go.insert((client.to_owned(), tool.to_string()), LetGo { seq: held.input.seq, at: now });
            changes.push(Change::Released { tool, owner: held.input.owner });
        }
        changes
    }

    /// Notes what a client that is here says that it is.
    pub(super) fn is_a(&mut self, client: &str, role: Role) {
        if self.here.contains_key(client) {
            self.roles.insert(client.to_owned(), role);
        }
    }

    /// Clients that are here and what they are, in the order of their ids.
    pub(super) fn clients(&self) -> impl ExactSizeIterator<Item = (&str, Role)> {
        self.here.keys().map(|id| (&**id, self.roles.get(id).copied().unwrap_or(Role::Client)))
    }

    pub(super) fn is_here(&self, client: &str) -> bool {
        self.here.contains_key(client)
    }

    pub(super) fn pose(
        &mut self,
        key_tool: &str,
        sample: &ToolSample,
        now: Instant,
    ) -> Result<Option<Change>, Refusal> {
        let client = &*sample.client_id;
        if !self.is_here(client) {
            return self.wait_for_token(sample, now).map(|()| None);
        }
        let Some(held) = self.held.get_mut(key_tool) else {
            return self.take_tool(key_tool, sample, now).map(Some);
        };
        if &*held.input.owner != client {
            return Err(not_owner(key_tool, &held.input.owner));
        }
        if !held.is_older_than(sample) {
            return Err(refuse(
                "stale-sequence",
                format!("pose {} of tool '{key_tool}' is not newer than {}", sample.seq, held.input.seq),
                "number poses in ascending order",
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
        let before = std::mem::replace(&mut held.input, to_tool_input(sample, id, owner));
        held.pass(before);
        held.poses += 1;
        held.contact_age_ms = sample.contact_age_ms;
        held.one_way.arrived(sample, now);
        if *held.name != *sample.name {
            held.name = Arc::from(&*sample.name);
        }
        Ok(None)
    }

    /// Handles a pose of a client without a token. A pose that overtook the token is kept. A pose sent before
    /// the client let go of the tool is refused.
    fn wait_for_token(&mut self, sample: &ToolSample, now: Instant) -> Result<(), Refusal> {
        let whose = (sample.client_id.clone(), sample.tool_id.clone());
        let comes_late = |last: &LetGo| sample.seq > last.seq && now.duration_since(last.at) < PATIENCE;
        if self.let_go.get(&whose).is_some_and(comes_late) {
            return Err(refuse(
                "let-go",
                format!("a pose of '{}' arrived after it released tool '{}'", whose.0, whose.1),
                "declare the token again before the next pose",
            ));
        }
        if self.early.keep(sample, now) {
            return Ok(());
        }
        Err(no_token(&whose.0))
    }

    fn take_tool(&mut self, tool: &str, sample: &ToolSample, now: Instant) -> Result<Change, Refusal> {
        let known = self.scene_tools.get(tool).cloned();
        if known.is_none() {
            if sample.shape.is_none() {
                return Err(refuse(
                    "unknown-tool",
                    format!("the scene has no tool '{tool}', and the sample gives no shape"),
                    "use a tool of rpc/info or give a shape",
                ));
            }
            let brought = self.held.keys().filter(|id| !self.scene_tools.contains(*id)).count();
            if self.scene_tools.len() + brought >= MAX_TOOLS {
                let of_scene = self.scene_tools.len();
                return Err(refuse(
                    "too-many-tools",
                    format!(
                        "the scene has {of_scene} tools and clients added {brought}; at most {MAX_TOOLS} are allowed"
                    ),
                    "wait until another client leaves",
                ));
            }
        }
        let id = known.unwrap_or_else(|| Arc::from(tool));
        let owner: Arc<str> = Arc::from(sample.client_id.as_str());
        let input = to_tool_input(sample, id.clone(), owner.clone());
        let contact_age_ms = sample.contact_age_ms;
        let mut one_way = OneWay::new(now);
        one_way.arrived(sample, now);
        let held = Held {
            input,
            taken: false,
            poses: 1,
            contact_age_ms,
            one_way,
            this_second: (now, 1),
            capability: None,
            name: Arc::from(&*sample.name),
        };
        self.held.insert(id.clone(), held);
        self.acted(&owner);
        Ok(Change::Taken { tool: id, owner })
    }

    /// Whether `client` may cut with a tool: the client is present, and nobody else holds the tool.
    pub(super) fn may_cut(&mut self, tool: &str, client: &str) -> Result<(), Refusal> {
        if !self.is_here(client) {
            return Err(no_token(client));
        }
        match self.held.get(tool) {
            Some(held) if *held.input.owner != *client => Err(not_owner(tool, &held.input.owner)),
            _ => {
                self.acted(client);
                Ok(())
            }
        }
    }

    pub(super) fn capability(&mut self, capability: DeviceCapability) {
        if let Some(held) = self.held.get_mut(&*capability.tool_id)
            && *held.input.owner == *capability.client_id
        {
            held.capability = Some(capability);
        }
    }

    pub(super) fn held(&self) -> impl Iterator<Item = &ToolInput> {
        self.held.values().map(|held| &held.input)
    }

    /// Moves what the clients hold into `tools`, for a step.
    pub(super) fn take(&mut self, tools: &mut Vec<ToolInput>) {
        tools.clear();
        for held in self.held.values_mut() {
            let mut input = held.input.clone();
            input.passed = std::mem::take(&mut held.input.passed);
            held.taken = true;
            tools.push(input);
        }
    }

    pub(super) fn capability_of(&self, tool: &str) -> Option<&DeviceCapability> {
        self.held.get(tool)?.capability.as_ref()
    }

    pub(super) fn figures(&self) -> impl Iterator<Item = ToolFigures> {
        self.held.iter().map(|(tool, &Held { poses, contact_age_ms, one_way, ref name, .. })| ToolFigures {
            tool: tool.clone(),
            name: name.clone(),
            poses,
            contact_age_ms,
            one_way,
        })
    }
}

fn no_token(client: &str) -> Refusal {
    refuse(
        NO_TOKEN,
        format!("client '{client}' has no liveliness token"),
        "declare client/<client id>/live/<role> before the first message",
    )
}

fn not_owner(tool: &str, owner: &str) -> Refusal {
    refuse(
        "not-owner",
        format!("tool '{tool}' is held by '{owner}'"),
        "take another tool or wait until it is free",
    )
}
