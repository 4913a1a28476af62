//! Counts the troubles in the steps of a body by kind, and reports each once when it begins and once when it
//! is over.

use std::fmt::Write as _;
use std::sync::Arc;

use scindo_physics::body::{Body, Method, Notice, Outcome, Scheme, SolveReport, StopReason};

use crate::report::{Level, StepReport};

/// Steps without a trouble after which it counts as over.
const CALM: u64 = 50;

/// Share of unconverged steps above which the run as a whole counts as failed.
const MOSTLY: f64 = 0.5;

/// Share of steps found unbalanced above which the run counts as failed. Energy is looked at in one of sixteen steps, and
/// 64 careful steps follow.
const RARELY: f64 = 0.005;

/// Steps of one body, counted by what went wrong in them. One step may count in several fields.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StepCounts {
    /// Steps requested.
    pub steps: u64,
    /// Steps that ended above their tolerance.
    pub unconverged: u64,
    /// Steps refused because they could not be made as requested. The body stood still.
    pub refused: u64,
    /// Steps that failed as a whole and were divided.
    pub divided: u64,
    /// Steps that also failed when divided. The body was put back, at rest.
    pub rolled_back: u64,
    /// Steps that ended with inverted elements.
    pub inverted: u64,
    /// Steps after which energy had come from nowhere.
    pub unbalanced: u64,
    /// Largest residual of the unconverged steps, relative to their reference.
    pub worst_residual: f64,
    /// Most parts into which a step was divided.
    pub most_parts: u32,
    /// Most inverted elements in a step.
    pub most_inverted: usize,
}

/// Kinds of trouble in a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trouble {
    Unconverged,
    Refused,
    Divided,
    RolledBack,
    Inverted,
    Unbalanced,
}

impl Trouble {
    const ALL: [Self; 6] =
        [Self::Unconverged, Self::Refused, Self::Divided, Self::RolledBack, Self::Inverted, Self::Unbalanced];

    /// Name of its events in the report.
    fn name(self) -> &'static str {
        match self {
            Self::Unconverged => "step-unconverged",
            Self::Refused => "step-refused",
            Self::Divided => "step-divided",
            Self::RolledBack => "step-rolled-back",
            Self::Inverted => "elements-inverted",
            Self::Unbalanced => "step-unbalanced",
        }
    }

    fn level(self) -> Level {
        match self {
            Self::Refused | Self::RolledBack => Level::Error,
            Self::Unconverged | Self::Divided | Self::Inverted | Self::Unbalanced => Level::Warning,
        }
    }

    /// Whether the trouble occurred in the step.
    fn is_in(self, solve: &SolveReport) -> bool {
        match self {
            Self::Unconverged => solve.is_unconverged(),
            Self::Refused => solve.outcome == Outcome::Refused,
            Self::Divided => solve.is_divided(),
            Self::RolledBack => solve.outcome == Outcome::Held,
            Self::Inverted => solve.inverted_pieces > 0,
            Self::Unbalanced => solve.is_unbalanced(),
        }
    }

    /// Message for its first step.
    fn begins(self, solve: &SolveReport) -> String {
        match self {
            Self::Unconverged => {
                format!(
                    "the step ended above its tolerance {:e}: residual {:.1e}",
                    solve.tolerance, solve.residual
                )
            }
            Self::Refused => refusal(solve.notice),
            Self::Divided => format!("divided into {} sub-steps to stay finite", solve.substeps),
            Self::RolledBack => match solve.notice {
                Some(why @ Notice::OutOfRange { .. }) => why.to_string(),
                _ => format!(
                    "not finite even in {} sub-steps; the body was put back where it was, at rest",
                    solve.substeps
                ),
            },
            Self::Inverted => format!("{} elements are inverted", solve.inverted_pieces),
            Self::Unbalanced => solve.notice.map_or_else(String::new, |why| why.to_string()),
        }
    }

    /// Phrase for its past steps in the closing message.
    fn past(self) -> &'static str {
        match self {
            Self::Unconverged => "ended above the tolerance",
            Self::Refused => "were refused",
            Self::Divided => "were divided",
            Self::RolledBack => "were rolled back",
            Self::Inverted => "contained inverted elements",
            Self::Unbalanced => "gained energy from nowhere",
        }
    }
}

fn refusal(notice: Option<Notice>) -> String {
    notice.map_or_else(|| "the step or gravity is not valid".into(), |why| why.to_string())
}

/// A trouble from its first step until it is over.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
struct Spell {
    /// Steps with the trouble since it began. 0: there is none.
    steps: u64,
    /// All steps since it began.
    of: u64,
    /// Steps since its last occurrence.
    calm: u64,
}

/// Observes the steps of one body.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Watch {
    /// Counts since the start or the last reset.
    pub counts: StepCounts,
    spells: [Spell; 6],
    /// Why the first refused step was refused.
    refused_for: Option<Notice>,
    /// How far the first step that left every sensible range would have gone.
    out_of_range: Option<Notice>,
    /// Why the solver stopped in the worst unconverged step.
    stop: StopReason,
    /// Whether the last step ended above its tolerance.
    last_unconverged: bool,
}

impl Watch {
    /// Counts a step, and reports troubles that begin or end. If the scene sets a fixed number of iterations,
    /// unconverged steps are counted but not reported.
    pub(super) fn follow(
        &mut self,
        body: &Arc<str>,
        solve: &SolveReport,
        fixed: bool,
        report: &mut StepReport,
    ) {
        self.count(solve);
        for (trouble, spell) in Trouble::ALL.into_iter().zip(&mut self.spells) {
            if fixed && trouble == Trouble::Unconverged {
                continue;
            }
            let seen = trouble.is_in(solve);
            if seen && spell.steps == 0 {
                report.tell(trouble.level(), trouble.name(), body, trouble.begins(solve));
            }
            if seen || spell.steps > 0 {
                spell.of += 1;
                spell.steps += u64::from(seen);
                spell.calm = if seen { 0 } else { spell.calm + 1 };
            }
            if spell.calm == CALM {
                let (steps, of) = (spell.steps, spell.of - CALM);
                let message = format!("resolved: {steps} of {of} steps {}", trouble.past());
                report.tell(Level::Info, trouble.name(), body, message);
                *spell = Spell::default();
            }
        }
    }

    fn count(&mut self, solve: &SolveReport) {
        let counts = &mut self.counts;
        counts.steps += 1;
        for (trouble, count) in Trouble::ALL.into_iter().zip([
            &mut counts.unconverged,
            &mut counts.refused,
            &mut counts.divided,
            &mut counts.rolled_back,
            &mut counts.inverted,
            &mut counts.unbalanced,
        ]) {
            *count += u64::from(trouble.is_in(solve));
        }
        self.last_unconverged = solve.is_unconverged();
        if self.last_unconverged && solve.residual >= counts.worst_residual {
            (counts.worst_residual, self.stop) = (solve.residual, solve.stop);
        }
        if solve.is_divided() {
            counts.most_parts = counts.most_parts.max(solve.substeps);
        }
        counts.most_inverted = counts.most_inverted.max(solve.inverted_pieces);
        if solve.outcome == Outcome::Refused && self.refused_for.is_none() {
            self.refused_for = solve.notice;
        }
        if let (None, Some(Notice::OutOfRange { .. })) = (self.out_of_range, solve.notice) {
            self.out_of_range = solve.notice;
        }
    }

    /// One line per trouble that the body has had, with numbers and a remedy.
    pub(super) fn warnings(&self, id: &str, body: &Body, fixed: bool) -> Vec<String> {
        let StepCounts { steps, refused, divided, rolled_back, inverted, .. } = self.counts;
        let mut lines = Vec::new();
        let mut add = |text: String| lines.push(format!("body `{id}`: {text}"));
        if self.counts.unconverged > 0 && !fixed {
            add(self.unconverged(body));
        }
        if refused > 0 {
            let why = refusal(self.refused_for);
            add(format!("{refused} of {steps} steps were refused, and the body stood still: {why}"));
        }
        if let Some(why) = self.out_of_range {
            add(format!("{rolled_back} of {steps} steps were rolled back, the first because {why}"));
        } else if rolled_back > 0 {
            add(format!(
                "{rolled_back} of {steps} steps did not stay finite and were rolled back to rest; take a shorter \
                 world.step_s or smaller loads"
            ));
        }
        if divided > 0 {
            add(format!(
                "{divided} of {steps} steps had to be divided into up to {} parts; take a shorter world.step_s",
                self.counts.most_parts
            ));
        }
        if self.counts.unbalanced > 0 {
            add(format!(
                "energy came from nowhere {} times in {steps} steps: forces were not in balance at their ends, and the \
                 body may shake for ever; take a shorter world.step_s (half of it doubles the cost)",
                self.counts.unbalanced
            ));
        }
        // The present state counts too, even if no step was counted as inverted.
        let least = body.least_volume_ratio();
        if inverted > 0 || least <= 0.0 {
            let displaced = body.fixed_nodes().iter().any(|held| held.displacement_m.norm() > 0.0);
            let slower =
                if displaced { ", and displacement_over_s applies displacements gradually" } else { "" };
            add(format!(
                "{inverted} of {steps} steps contained inverted elements, up to {} at a time, and the smallest \
                 det F is now {least:.3}: the loads are too large for the stiffness or for the held region; law \
                 = \"neo-hookean\" resists inversion{slower}",
                self.counts.most_inverted
            ));
        }
        lines
    }

    fn unconverged(&self, body: &Body) -> String {
        let StepCounts { steps, unconverged, worst_residual, .. } = self.counts;
        let tolerance = body.settings().solver.tolerance;
        let mut text = format!(
            "{unconverged} of {steps} steps ended above the tolerance {tolerance:e} (largest residual \
            {worst_residual:.1e}); "
        );
        let _ = write!(text, "{}", advice(body, self.stop, worst_residual));
        text
    }

    /// Why the run counts as failed for this body, if it does.
    pub(super) fn failure(&self, id: &str, body: &Body, fixed: bool) -> Option<String> {
        let StepCounts { steps, unconverged, refused, rolled_back, .. } = self.counts;
        let mut reasons = Vec::new();
        if refused > 0 {
            reasons.push(format!("{refused} of {steps} steps were refused"));
        }
        if rolled_back > 0 {
            reasons.push(format!("{rolled_back} of {steps} steps were rolled back"));
        }
        if self.counts.unbalanced as f64 > RARELY * steps as f64 {
            reasons.push("forces were not in balance at the ends of many steps".into());
        }
        if !fixed && unconverged as f64 > MOSTLY * steps as f64 {
            reasons.push(format!("{unconverged} of {steps} steps did not converge"));
        } else if !fixed && self.last_unconverged && body.settings().scheme == Scheme::Static {
            reasons.push("the equilibrium was not reached".into());
        }
        (!reasons.is_empty()).then(|| format!("body `{id}`: {}", reasons.join(", ")))
    }
}

/// A remedy for steps that end above their tolerance.
fn advice(body: &Body, stop: StopReason, residual: f64) -> String {
    let (settings, law) = (body.settings(), body.material().law);
    let solver = settings.solver;
    if stop != StopReason::IterationLimit {
        return "the solver could not reduce it further: raise solver.tolerance, take solver.precision = \
                \"double\", or reduce the loads"
            .into();
    }
    let by_newton = !settings.is_linearised(law) && !settings.relaxation && !body.is_fast();
    if by_newton {
        let steps = settings.newton_steps(law);
        return format!("raise solver.newton_steps above {steps}, or take a shorter world.step_s");
    }
    if settings.method == Method::Cholesky {
        return "raise solver.tolerance, or take a shorter world.step_s".into();
    }
    let about = needed_iterations(solver.iterations, residual, solver.tolerance);
    format!("raise solver.iterations to about {about}, or write solver.fixed_iterations = true")
}

/// Iterations that reach `tolerance`, estimated from `made` iterations that left `residual`. Conjugate
/// gradients lower the residual by about the same factor in every iteration.
fn needed_iterations(made: u32, residual: f64, tolerance: f64) -> u32 {
    let decades = |residual: f64| -residual.clamp(1e-12, 0.5).log10();
    let needed = 1.2 * f64::from(made) * decades(tolerance) / decades(residual);
    let unit = 10_f64.powf((needed.log10() - 1.0).floor().max(0.0));
    ((needed / unit).ceil() * unit).min(100_000.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solve(residual: f64, inverted_pieces: usize) -> SolveReport {
        SolveReport {
            residual,
            tolerance: 1e-3,
            inverted_pieces,
            stop: StopReason::IterationLimit,
            ..SolveReport::default()
        }
    }

    #[test]
    fn a_trouble_is_told_when_it_begins_and_when_it_is_over() {
        let (mut watch, mut report) = (Watch::default(), StepReport::default());
        let body: Arc<str> = "b".into();
        for step in 0..200 {
            // In every third of the first ninety steps, then never again.
            let residual = if step < 90 && step % 3 == 0 { 0.5 } else { 1e-4 };
            watch.follow(&body, &solve(residual, 0), false, &mut report);
        }
        let told: Vec<_> = report.events.iter().map(|e| (e.level, e.name, &*e.message)).collect();
        assert_eq!(told.len(), 2, "{told:?}");
        assert_eq!((told[0].0, told[0].1), (Level::Warning, "step-unconverged"));
        assert_eq!(
            told[1],
            (Level::Info, "step-unconverged", "resolved: 30 of 88 steps ended above the tolerance")
        );
        assert_eq!((watch.counts.steps, watch.counts.unconverged), (200, 30));
    }

    #[test]
    fn kinds_are_counted_apart_and_a_meant_limit_is_not_told() {
        let (mut watch, mut report) = (Watch::default(), StepReport::default());
        let body: Arc<str> = "b".into();
        let refused = SolveReport { outcome: Outcome::Refused, ..SolveReport::default() };
        let held = SolveReport { outcome: Outcome::Held, ..solve(0.5, 0) };
        let divided = SolveReport { substeps: 4, ..solve(1e-4, 0) };
        for solve in [solve(0.5, 3), refused, held, divided, solve(1e-4, 7)] {
            watch.follow(&body, &solve, true, &mut report);
        }
        let StepCounts { unconverged, refused, rolled_back, divided, inverted, .. } = watch.counts;
        assert_eq!([unconverged, refused, rolled_back, divided, inverted], [1, 1, 1, 1, 2]);
        assert_eq!((watch.counts.most_parts, watch.counts.most_inverted), (4, 7));
        let names: Vec<_> = report.events.iter().map(|event| event.name).collect();
        assert_eq!(names, ["elements-inverted", "step-refused", "step-rolled-back", "step-divided"]);
    }

    #[test]
    fn needed_iterations_follow_the_rate() {
        assert_eq!(needed_iterations(50, 1e-3, 1e-6), 120);
        assert!(needed_iterations(50, 2.0, 1e-6) >= 1000);
        assert_eq!(needed_iterations(90_000, 1e-1, 1e-9), 100_000);
    }
}
