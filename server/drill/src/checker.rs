//! The rules of an episode. It sees what clients have said under their own keys, what the simulation takes and does,
//! and what hands feel; it shares no code with what it checks.

use std::collections::{BTreeMap, BTreeSet};

use scindo_haptic::constants::{PERIOD_S, SILENT_ZERO_NS};
use scindo_haptic::safety::flag;
use scindo_haptic::tick::TickOutput;
use scindo_proto::messages::{CutCommand, ToolSample};
use scindo_world::inputs::{CutOutcome, Inputs};

use crate::hand::{Fate, HandClient, LIMITS};

/// Client, tool, number of the pose and clock of the client.
type PoseId = (String, String, u64, u64);

/// Client, tool and number of a cut.
type CutId = (String, String, u64);

/// The numbers of a position, bit by bit.
type Place = [u64; 3];

/// Rounding that a limit may be exceeded by.
const SLACK: f64 = 1e-9;

/// Checks the rules of one episode. It remembers the first thing that went wrong.
#[derive(Debug, Default)]
pub struct Checker {
    /// What went wrong first.
    pub violation: Option<String>,
    now_ns: u64,
    present: BTreeSet<String>,
    /// What was said under a number: more than one place where a message was spoiled on its way.
    poses: BTreeMap<PoseId, Vec<Place>>,
    /// Cuts by the y of their first tip, which no two of them share.
    said: BTreeMap<u64, BTreeSet<CutId>>,
    /// Place of the cuts that the simulation has taken and not finished, by request.
    under_way: BTreeMap<u64, u64>,
    applied: BTreeMap<u64, u64>,
    last_force_n: BTreeMap<String, nalgebra::Vector3<f64>>,
}

impl Checker {
    /// Time of what follows [ns].
    pub fn at(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn wrong(&mut self, what: String) {
        let at_ms = self.now_ns / 1_000_000;
        self.violation.get_or_insert_with(|| format!("at {at_ms} ms: {what}"));
    }

    /// The token of a client came or went.
    pub fn token(&mut self, client: &str, is_there: bool) {
        if is_there {
            self.present.insert(client.to_owned());
        } else {
            self.present.remove(client);
        }
    }

    /// A pose arrived under the key of a client and a tool.
    pub fn said_pose(&mut self, [client, tool]: [&str; 2], sample: &ToolSample) {
        if sample.client_id == client && sample.tool_id == tool {
            let at = sample.pose.and_then(|pose| pose.position_m).unwrap_or_default();
            let place = [at.x, at.y, at.z].map(f64::to_bits);
            let id = (client.to_owned(), tool.to_owned(), sample.seq, sample.client_time_ns);
            self.poses.entry(id).or_default().push(place);
        }
    }

    /// A cut arrived under the key of a client and a tool.
    pub fn said_cut(&mut self, [client, tool]: [&str; 2], command: &CutCommand) {
        if command.client_id == client
            && command.tool_id == tool
            && let Some(tip) = command.sweep.first().and_then(|segment| segment.tip_m)
        {
            let id = (client.to_owned(), tool.to_owned(), command.seq);
            self.said.entry(tip.y.to_bits()).or_default().insert(id);
        }
    }

    /// What a step takes from the inbox.
    pub fn taken(&mut self, inputs: &Inputs) {
        let mut tools = BTreeSet::new();
        for input in &inputs.tools {
            let (tool, owner) = (input.id.to_string(), input.owner.to_string());
            if !tools.insert(tool.clone()) {
                self.wrong(format!("tool '{tool}' is there twice"));
            }
            if !self.present.contains(&owner) {
                self.wrong(format!("'{owner}' holds '{tool}' and has no token"));
            }
            let place = input.pose.translation.vector.map(f64::to_bits);
            let id = (owner.clone(), tool.clone(), input.seq, input.client_time_ns);
            if !self.poses.get(&id).is_some_and(|places| places.contains(&place.into())) {
                self.wrong(format!(
                    "'{tool}' of '{owner}' stands where '{owner}' has not put it: {} in pose {}",
                    input.pose.translation.vector, input.seq
                ));
            }
        }
        for cut in &inputs.cuts {
            let Some([tip, _]) = cut.segments.first() else { continue };
            let mark = tip.y.to_bits();
            if self.said.contains_key(&mark) {
                self.under_way.insert(cut.request, mark);
            } else {
                self.wrong(format!("a cut at y = {} that nobody has sent", tip.y));
            }
        }
    }

    /// What the simulation did with cuts.
    pub fn outcomes(&mut self, outcomes: &[CutOutcome]) {
        for outcome in outcomes {
            let Some(mark) = self.under_way.remove(&outcome.request) else { continue };
            if outcome.result.is_err() {
                continue;
            }
            let applied = self.applied.entry(mark).or_default();
            *applied += 1;
            let (applied, said) = (*applied, self.said.get(&mark).map_or(0, BTreeSet::len) as u64);
            if applied > said {
                self.wrong(format!("a cut was applied {applied} times and sent under {said} numbers"));
            }
        }
    }

    /// What a hand feels in a tick.
    pub fn felt(&mut self, hand: &HandClient, output: &TickOutput) {
        let (id, force) = (hand.id.as_str(), output.force_n);
        let norm = force.norm();
        if !force.iter().all(|f| f.is_finite()) {
            return self.wrong(format!("'{id}' gets a force that is not finite: {force}"));
        }
        if norm > LIMITS.max_force_n + SLACK {
            self.wrong(format!("'{id}' gets {norm} N, more than {} N", LIMITS.max_force_n));
        }
        let before = self.last_force_n.insert(id.to_owned(), force).unwrap_or_default();
        let step = (force - before).norm();
        let silent_ns = self.now_ns.saturating_sub(hand.heard_ns);
        let is_cut = norm == 0.0 && (output.flags & flag::DEVICE_FAULTS != 0 || silent_ns > SILENT_ZERO_NS);
        if step > LIMITS.slew_n_s * PERIOD_S + SLACK && !is_cut {
            self.wrong(format!("the force on '{id}' changes by {step} N in a tick"));
        }
        if silent_ns > SILENT_ZERO_NS && norm > 0.0 {
            self.wrong(format!("'{id}' gets {norm} N after {} ms of silence", silent_ns / 1_000_000));
        }
    }

    /// A client started anew: its device is without force.
    pub fn restarted(&mut self, client: &str) {
        self.last_force_n.remove(client);
    }

    /// What a client knows about its cuts in the end.
    pub fn told(&mut self, hand: &HandClient) {
        for (seq, (_, fate)) in &hand.cuts {
            let id = (hand.id.to_string(), hand.tool.to_string(), *seq);
            let (mut applied, mut only) = (0, true);
            for (mark, _) in self.said.iter().filter(|(_, ids)| ids.contains(&id)) {
                applied += self.applied.get(mark).copied().unwrap_or(0);
                only &= self.said[mark].len() == 1;
            }
            match fate {
                Fate::Applied if applied == 0 => {
                    self.wrong(format!("'{}' was told that cut {seq} is made, and it is not", hand.id));
                }
                Fate::Refused(why) if applied > 0 && only => {
                    self.wrong(format!("'{}' was refused cut {seq} ({why}), and it was made", hand.id));
                }
                _ => {}
            }
        }
    }

    /// Something else that must hold.
    pub fn expect(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            let what = what();
            self.wrong(what);
        }
    }

    /// Cuts applied so far.
    pub fn applied(&self) -> u64 {
        self.applied.values().sum()
    }
}
