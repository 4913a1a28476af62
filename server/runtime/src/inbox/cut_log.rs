//! Cuts on their way, and the answers to finished ones. The log makes sure that each cut is applied once.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use nalgebra::Vector3;
use scindo_proto::messages::{self as wire, CutAck, CutCommand, cut_ack};
use scindo_world::inputs::{CutOutcome, CutRequest};

use super::refusal::{Refusal, refuse};
use crate::wire::convert::from_vec3;

/// Most cuts without an answer, whether they wait here or in the simulation.
pub const MAX_WAITING_CUTS: usize = 64;

/// Most pairs of client and tool whose cuts are remembered.
const MAX_LOGS: usize = 256;

/// Most tools of one client whose cuts are remembered, so that no client takes the places of others.
const MAX_TOOLS_OF_ONE: usize = 16;

/// Answers remembered per client and tool. A client repeats a cut for seconds. Only after this many others is
/// it answered "duplicate" without details.
pub(super) const MAX_ANSWERS: usize = 256;

/// What happens to a cut command.
#[derive(Debug, Clone, PartialEq)]
pub enum Cut {
    /// It is new. A step will apply it, and the answer follows.
    Queued,
    /// It is a repetition of one that still waits. The answer is on its way.
    Waiting,
    /// It is a repetition of one that has its answer.
    Answer(CutAck),
    /// It names another client or tool than its key, so it is not known whom to answer.
    Stray(Refusal),
}

/// The part of an answer that does not depend on the cut.
#[derive(Debug, Clone, Copy)]
pub struct Answering<'a> {
    /// The step after the cut.
    pub step: u64,
    /// Epochs of all bodies after the cut.
    pub epochs: &'a [wire::BodyEpoch],
    /// Reason given for cuts that were not applied, such as `cut-failed`.
    pub code: &'static str,
    /// Advice to the client of a cut that was not applied.
    pub hint: &'static str,
}

/// Cuts that one client made with one tool.
#[derive(Debug, Default)]
struct ToolLog {
    waiting: BTreeSet<u64>,
    answers: BTreeMap<u64, CutAck>,
    /// Every cut up to this number was applied or refused, and its answer is forgotten.
    forgotten_up_to: u64,
}

impl ToolLog {
    /// Keeps an answer for repetitions, and forgets the oldest if there are too many.
    fn store(&mut self, answer: CutAck) {
        self.waiting.remove(&answer.seq);
        self.answers.insert(answer.seq, answer);
        while self.answers.len() > MAX_ANSWERS {
            if let Some((seq, _)) = self.answers.pop_first() {
                self.forgotten_up_to = self.forgotten_up_to.max(seq);
            }
        }
    }
}

#[derive(Debug, Clone)]
struct Ticket {
    client: String,
    tool: String,
    seq: u64,
}

/// The queue of cuts, and the log that recognises repetitions.
#[derive(Debug, Default)]
pub(super) struct CutLog {
    bodies: BTreeSet<Arc<str>>,
    queue: VecDeque<CutRequest>,
    /// The origin of every cut without an answer, by request.
    tickets: BTreeMap<u64, Ticket>,
    logs: BTreeMap<(String, String), ToolLog>,
    next_request: u64,
    applied: u64,
}

impl CutLog {
    pub(super) fn new(bodies: BTreeSet<Arc<str>>) -> Self {
        Self { bodies, ..Self::default() }
    }

    /// Looks up a repeated command. `None` if the command is new.
    pub(super) fn known(&self, command: &CutCommand) -> Option<Cut> {
        let log = self.logs.get(&(command.client_id.clone(), command.tool_id.clone()))?;
        if log.waiting.contains(&command.seq) {
            return Some(Cut::Waiting);
        }
        if let Some(answer) = log.answers.get(&command.seq) {
            return Some(Cut::Answer(repeated(answer)));
        }
        let forgotten = command.seq <= log.forgotten_up_to;
        forgotten.then(|| Cut::Answer(answer(command, cut_ack::Outcome::Duplicate)))
    }

    /// Queues a new command. If the logs are full, it drops those of clients that have left.
    pub(super) fn accept(
        &mut self,
        command: &CutCommand,
        is_here: impl Fn(&str) -> bool,
    ) -> Result<(), Refusal> {
        let body = match &*command.body_id {
            "" => None,
            id => Some(self.bodies.get(id).cloned().ok_or_else(|| self.unknown_body(id))?),
        };
        if self.tickets.len() >= MAX_WAITING_CUTS {
            return Err(refuse(
                "queue-full",
                format!("{MAX_WAITING_CUTS} cuts are waiting already"),
                "send it again with a new number when some of them have been answered",
            ));
        }
        self.log_of(&command.client_id, &command.tool_id, is_here)?.waiting.insert(command.seq);
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

    /// Remembers the answer to a command that was refused before it was queued. Where there is no place for it, a copy
    /// that arrives later is judged anew.
    pub(super) fn remember(&mut self, answer: &CutAck, is_here: impl Fn(&str) -> bool) {
        if let Ok(log) = self.log_of(&answer.client_id, &answer.tool_id, is_here) {
            log.store(answer.clone());
        }
    }

    /// The log of a client and a tool. If the logs are full, it drops those of clients that have left.
    fn log_of(
        &mut self,
        client: &str,
        tool: &str,
        is_here: impl Fn(&str) -> bool,
    ) -> Result<&mut ToolLog, Refusal> {
        let whose = (client.to_owned(), tool.to_owned());
        if !self.logs.contains_key(&whose) {
            if self.logs.len() >= MAX_LOGS {
                self.forget_departed(is_here)?;
            }
            let own = self.logs.keys().filter(|(owner, _)| owner == client).count();
            if own >= MAX_TOOLS_OF_ONE {
                return Err(refuse(
                    "too-many-tools",
                    format!(
                        "client '{client}' has cut with {own} tools; at most {MAX_TOOLS_OF_ONE} are tracked"
                    ),
                    "use fewer tool ids",
                ));
            }
        }
        Ok(self.logs.entry(whose).or_default())
    }

    fn unknown_body(&self, id: &str) -> Refusal {
        let names: Vec<&str> = self.bodies.iter().map(|b| &**b).collect();
        refuse(
            "unknown-body",
            format!("the scene has no body '{id}'; its bodies are {}", names.join(", ")),
            "name one of these bodies, or none for all",
        )
    }

    /// Drops the logs of clients that have left.
    fn forget_departed(&mut self, is_here: impl Fn(&str) -> bool) -> Result<(), Refusal> {
        self.logs.retain(|(client, _), log| !log.waiting.is_empty() || is_here(client));
        if self.logs.len() < MAX_LOGS {
            return Ok(());
        }
        Err(refuse(
            "too-many-clients",
            format!(
                "the server tracks the cuts of at most {MAX_LOGS} clients and tools, and all places are taken"
            ),
            "use fewer client and tool ids",
        ))
    }

    /// Moves the queue into `cuts`.
    pub(super) fn take(&mut self, cuts: &mut Vec<CutRequest>) {
        cuts.clear();
        cuts.extend(self.queue.drain(..));
    }

    /// Empties the queue and returns a failed outcome for each cut in it.
    pub(super) fn discard(&mut self, reason: &str) -> Vec<CutOutcome> {
        let failed = |cut: CutRequest| CutOutcome { request: cut.request, result: Err(reason.to_owned()) };
        self.queue.drain(..).map(failed).collect()
    }

    /// Turns outcomes into answers and stores the answers for repetitions.
    pub(super) fn finish(&mut self, outcomes: &[CutOutcome], with: &Answering<'_>) -> Vec<CutAck> {
        let mut answers = Vec::with_capacity(outcomes.len());
        for outcome in outcomes {
            let Some(ticket) = self.tickets.remove(&outcome.request) else { continue };
            let answer = self.answer_of(&ticket, outcome, with);
            let log = self.logs.entry((ticket.client, ticket.tool)).or_default();
            log.store(answer.clone());
            answers.push(answer);
        }
        answers
    }

    fn answer_of(&mut self, ticket: &Ticket, outcome: &CutOutcome, with: &Answering<'_>) -> CutAck {
        let mut ack = CutAck {
            client_id: ticket.client.clone(),
            tool_id: ticket.tool.clone(),
            seq: ticket.seq,
            sim_step: with.step,
            epochs: with.epochs.to_vec(),
            ..CutAck::default()
        };
        match &outcome.result {
            Ok(elements) => {
                self.applied += 1;
                ack.elements_cut = u32::try_from(*elements).unwrap_or(u32::MAX);
                ack.set_outcome(cut_ack::Outcome::Applied);
            }
            Err(reason) => {
                ack.set_outcome(cut_ack::Outcome::Refused);
                ack.error = Some(refuse(with.code, reason.clone(), with.hint).into());
            }
        }
        ack
    }

    pub(super) fn applied(&self) -> u64 {
        self.applied
    }
}

pub(super) fn answer(command: &CutCommand, outcome: cut_ack::Outcome) -> CutAck {
    CutAck {
        client_id: command.client_id.clone(),
        tool_id: command.tool_id.clone(),
        seq: command.seq,
        outcome: outcome.into(),
        ..CutAck::default()
    }
}

/// The stored answer for a repeated command: an applied cut becomes a duplicate.
fn repeated(answer: &CutAck) -> CutAck {
    let mut again = answer.clone();
    if again.outcome() == cut_ack::Outcome::Applied {
        again.set_outcome(cut_ack::Outcome::Duplicate);
    }
    again
}
