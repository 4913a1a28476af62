//! What the inbox counts: refused messages by reason, and a copy of its figures for reports.

use std::collections::BTreeMap;
use std::sync::Arc;

use scindo_proto::Role;

use super::one_way::OneWay;

/// Messages refused so far, by reason.
#[derive(Debug, Default)]
pub(super) struct Counters {
    refused: BTreeMap<&'static str, u64>,
}

impl Counters {
    /// Counts `more` refusals and returns the count of their kind.
    pub(super) fn count(&mut self, code: &'static str, more: u64) -> u64 {
        let count = self.refused.entry(code).or_default();
        *count += more;
        *count
    }

    /// Refusals by reason.
    pub(super) fn refused(&self) -> &BTreeMap<&'static str, u64> {
        &self.refused
    }
}

/// Most clients that a report names.
pub const MOST_CLIENTS: usize = 64;

/// Figures of a tool that a client holds.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolFigures {
    /// Id of the tool.
    pub tool: Arc<str>,
    /// Name of the person who holds it; empty if none was given.
    pub name: Arc<str>,
    /// Poses accepted since it was taken.
    pub poses: u64,
    /// Age of the contact model that its device last used [ms].
    pub contact_age_ms: f32,
    /// The way of its poses.
    pub one_way: OneWay,
}

/// A copy of all figures. It is filled under the lock of the inbox and read after the lock is released.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figures {
    /// Held tools.
    pub tools: Vec<ToolFigures>,
    /// Refused messages by reason.
    pub refused: Vec<(&'static str, u64)>,
    /// Cuts from clients applied so far.
    pub cuts_applied: u64,
    /// The first [`MOST_CLIENTS`] clients by their ids, and what they are.
    pub clients: Vec<(String, Role)>,
    /// Number of all clients.
    pub client_count: usize,
}
