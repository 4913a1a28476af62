//! Poses and cuts of clients: who holds which tool, what is newest, what was already applied.
//!
//! # Rules
//! * A tool belongs to the first client with a liveliness token that sends a pose for it. It is free again
//!   when that token goes ([`owners`]). A pose that overtook the token waits for it ([`early`]).
//! * Only the newest pose counts. A pose that is not newer than the last is refused.
//! * A cut is applied once per (client, tool, sequence number). Repetitions get the old answer ([`cut_log`]).
//!   A cut of a client without a token is refused.
//! * The id of a client is part of the keys it may publish to. A message that names another client or tool
//!   than its key does is refused ([`Sender`]).
//! * Every refusal is counted by reason and changes nothing else ([`counters`]).
//!
//! The inbox knows neither zenoh nor clocks. Receiving threads call it with the time; the simulation thread
//! takes the inputs out. Whoever reports copies the figures and goes on without the lock.

pub mod owners;

pub mod early;

pub mod cut_log;

pub mod counters;

pub mod one_way;

mod refusal;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use scindo_proto::Role;
use scindo_proto::messages::{CutAck, CutCommand, DeviceCapability, ToolSample, cut_ack};
use scindo_world::inputs::{CutOutcome, Inputs, ToolInput};

use counters::{Counters, Figures, MOST_CLIENTS};
pub use cut_log::{Answering, Cut};
use cut_log::{CutLog, answer};
pub use owners::{Change, MAX_POSE_RATE};
use owners::{NO_TOKEN, Owners};
pub use refusal::Refusal;
use refusal::refuse;

/// The client and the tool that the key of a message names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sender<'a> {
    /// Id of the client that may publish to the key.
    pub client: &'a str,
    /// Id of the tool.
    pub tool: &'a str,
}

impl Sender<'_> {
    /// Refuses a message whose content names another client or tool than its key.
    fn matches(&self, client: &str, tool: &str) -> Result<(), Refusal> {
        if (self.client, self.tool) == (client, tool) {
            return Ok(());
        }
        Err(refuse(
            "wrong-key",
            format!(
                "a message of client '{client}' for tool '{tool}' arrived under the key of client '{}' and tool '{}'",
                self.client, self.tool
            ),
            "publish to client/<client id>/tool/<tool id>/…",
        ))
    }
}

/// Poses and cuts between the receiving threads and the simulation thread.
#[derive(Debug, Default)]
pub struct Inbox {
    owners: Owners,
    cuts: CutLog,
    counters: Counters,
}

impl Inbox {
    /// An inbox for the bodies and tools of a scene.
    pub fn new(
        bodies: impl IntoIterator<Item = Arc<str>>,
        scene_tools: impl IntoIterator<Item = Arc<str>>,
    ) -> Self {
        Self {
            owners: Owners::new(scene_tools.into_iter().collect()),
            cuts: CutLog::new(bodies.into_iter().collect()),
            counters: Counters::default(),
        }
    }

    /// Registers a liveliness token of `client`. Poses that waited for it count now.
    pub fn client_came(&mut self, client: &str, now: Instant) -> Vec<Change> {
        let early = self.owners.came(client, now);
        let taken = early.iter().filter_map(|sample| {
            let sender = Sender { client, tool: &sample.tool_id };
            self.pose(sender, sample, now).ok()
        });
        taken.flatten().collect()
    }

    /// Notes what a client with a token says that it is.
    pub fn client_is(&mut self, client: &str, role: Role) {
        self.owners.is_a(client, role);
    }

    /// Removes a liveliness token of `client`. With the last one its tools are released.
    pub fn client_went(&mut self, client: &str, now: Instant) -> Vec<Change> {
        self.owners.went(client, now)
    }

    /// Takes a checked sample that arrived under the key of `sender`.
    ///
    /// # Errors
    /// The reason when the sample is refused.
    pub fn pose(
        &mut self,
        sender: Sender<'_>,
        sample: &ToolSample,
        now: Instant,
    ) -> Result<Option<Change>, Refusal> {
        let outcome = sender
            .matches(&sample.client_id, &sample.tool_id)
            .and_then(|()| self.owners.pose(sender.tool, sample, now));
        if let Err(refusal) = &outcome {
            self.count(refusal.code);
        }
        outcome
    }

    /// Takes a checked cut that arrived under the key of `sender`. One that names another client or tool is not
    /// answered, so that nobody can refuse a cut of somebody else.
    pub fn cut(&mut self, sender: Sender<'_>, command: &CutCommand) -> Cut {
        if let Err(refusal) = sender.matches(&command.client_id, &command.tool_id) {
            self.count(refusal.code);
            return Cut::Stray(refusal);
        }
        if let Some(known) = self.cuts.known(command) {
            return known;
        }
        let accepted = self
            .owners
            .may_cut(sender.tool, sender.client)
            .and_then(|()| self.cuts.accept(command, |client| self.owners.is_here(client)));
        match accepted {
            Ok(()) => Cut::Queued,
            Err(refusal) => {
                self.count(refusal.code);
                let code = refusal.code;
                let mut answer = answer(command, cut_ack::Outcome::Refused);
                answer.error = Some(refusal.into());
                // A client without a token sends its cut again. Any other refusal is final: a copy that arrives later
                // must not be made.
                if code != NO_TOKEN {
                    self.cuts.remember(&answer, |client| self.owners.is_here(client));
                }
                Cut::Answer(answer)
            }
        }
    }

    /// Stores what a device can do. Clients send it once per connection.
    ///
    /// # Errors
    /// The reason when the message names another client or tool than its key.
    pub fn capability(&mut self, sender: Sender<'_>, capability: DeviceCapability) -> Result<(), Refusal> {
        let outcome = sender.matches(&capability.client_id, &capability.tool_id);
        match &outcome {
            Ok(()) => self.owners.capability(capability),
            Err(refusal) => drop(self.count(refusal.code)),
        }
        outcome
    }

    /// Counts a refused message and returns the count of its kind.
    pub fn count(&mut self, code: &'static str) -> u64 {
        self.counters.count(code, 1)
    }

    /// Moves the inputs of the next step into `inputs`: the newest poses, those that blades have passed
    /// in between, and all cuts since the last step.
    pub fn take(&mut self, inputs: &mut Inputs) {
        self.owners.take(&mut inputs.tools);
        self.cuts.take(&mut inputs.cuts);
    }

    /// Answers the cuts that have an outcome, each of them once.
    pub fn finish(&mut self, outcomes: &[CutOutcome], with: &Answering<'_>) -> Vec<CutAck> {
        let answers = self.cuts.finish(outcomes, with);
        let failed = answers.iter().filter(|answer| answer.error.is_some()).count() as u64;
        if failed > 0 {
            self.counters.count(with.code, failed);
        }
        answers
    }

    /// Answers every cut that no step has taken yet with `reason`.
    pub fn discard(&mut self, reason: &str, with: &Answering<'_>) -> Vec<CutAck> {
        let outcomes = self.cuts.discard(reason);
        self.finish(&outcomes, with)
    }

    /// Newest pose of every held tool.
    pub fn held(&self) -> impl Iterator<Item = &ToolInput> {
        self.owners.held()
    }

    /// Capability of the device behind `tool`, if the device reported one.
    pub fn capability_of(&self, tool: &str) -> Option<&DeviceCapability> {
        self.owners.capability_of(tool)
    }

    /// True while a client holds a tool.
    pub fn anybody_holds(&self) -> bool {
        self.owners.held().next().is_some()
    }

    /// Copies all figures into `figures`, whose buffers are reused.
    pub fn figures_into(&self, figures: &mut Figures) {
        figures.tools.clear();
        figures.tools.extend(self.owners.figures());
        figures.refused.clear();
        figures.refused.extend(self.refused().iter().map(|(&code, &count)| (code, count)));
        figures.cuts_applied = self.cuts.applied();
        let clients = self.owners.clients();
        figures.client_count = clients.len();
        figures.clients.clear();
        figures.clients.extend(clients.take(MOST_CLIENTS).map(|(id, role)| (id.to_owned(), role)));
    }

    /// Messages refused so far, by reason.
    pub fn refused(&self) -> &BTreeMap<&'static str, u64> {
        self.counters.refused()
    }
}
