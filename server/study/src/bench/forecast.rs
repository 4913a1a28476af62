//! Forecasts how long a run takes: its work, times the time that such work has taken so far.

use crate::case::{Case, Truth};
use crate::design::Configuration;
use crate::design::axes::Factor;
use crate::trial::Protocol;

/// Times of the runs that ended, by kind and work.
#[derive(Debug, Clone, Default)]
pub struct Forecast {
    seen: Vec<Seen>,
}

#[derive(Debug, Clone)]
struct Seen {
    kind: String,
    work: f64,
    seconds: f64,
}

impl Forecast {
    /// Adds a run that took `seconds`.
    pub fn learn(&mut self, case: &Case, configuration: &Configuration, seconds: f64) {
        let kind = kind(case, configuration);
        self.seen.push(Seen { kind, work: work(case, configuration), seconds });
    }

    /// Expected duration of a run [s]; `None` before the first run has ended.
    pub fn seconds(&self, case: &Case, configuration: &Configuration) -> Option<f64> {
        let (kind, work) = (kind(case, configuration), work(case, configuration));
        let far = |seen: &Seen| (seen.work / work).ln().abs();
        // A run of the same kind is the better guide, however different its size.
        let rank = |seen: &Seen| far(seen) + if seen.kind == kind { 0.0 } else { 100.0 };
        let best = self.seen.iter().rev().min_by(|a, b| rank(a).total_cmp(&rank(b)))?;
        Some(best.seconds * work / best.work)
    }
}

/// Runs of one kind differ only in size.
fn kind(case: &Case, configuration: &Configuration) -> String {
    let alike = [Factor::Element, Factor::Integrator, Factor::Solver, Factor::Tolerance, Factor::Law];
    let labels: Vec<&str> = alike.iter().map(|factor| configuration.label(*factor)).collect();
    format!("{} {}", case.name, labels.join(" "))
}

/// Expected work of a run, in an arbitrary unit. Elements count to the power 4/3, because iterations grow
/// with the number of elements along an edge. That is multiplied by the cost of element and integrator, and
/// by the number of steps.
pub fn work(case: &Case, configuration: &Configuration) -> f64 {
    let scale = if let Truth::Refined { .. } = case.truth { 1.0 } else { 20.0 };
    let finer = configuration.setting(Factor::Mesh).map_or(1.0, |setting| setting.size / scale);
    let element = match configuration.label(Factor::Element) {
        "tet10" => 12.0,
        "hex8" | "hex8 selective" => 3.0,
        "tet4 node-averaged" => 4.0,
        _ => 1.0,
    };
    let integrator = match configuration.label(Factor::Integrator) {
        "bdf2" | "newmark" | "generalised-alpha" => 4.0,
        _ => 1.0,
    };
    let law = match configuration.label(Factor::Law) {
        "stvk" | "neo-hookean" => 4.0,
        _ => 1.0,
    };
    let steps = match case.protocol {
        Protocol::Static => 10.0,
        Protocol::Motion { frame_s, frames } => {
            f64::from(frames) * configuration.setting(Factor::Step).map_or(1.0, |h| frame_s / h.size)
        }
    };
    finer.powi(4).max(1e-3) * element * integrator * law * steps
}
