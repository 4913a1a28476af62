//! The study of one case within a time: the reference, the points, the recommendation.
//!
//! A scene is measured first. That fixes the length of the motion to study and the levels that the reference
//! may reach. Half of the time goes to the reference, the other half to configurations. Those of the design
//! come first, cheapest first, then neighbours of the best one that fits the budget. A recommended
//! configuration is run once more before it is named.

use crate::advice::pareto::front;
use crate::advice::recommend::{Candidate, Recommendation, recommend};
use crate::advice::sources::peel;
use crate::bench::Bench;
use crate::bench::runner::{Ask, PATIENCE, Runner, fits};
use crate::case::{Case, Ladder, Truth};
use crate::design::axes::Factor;
use crate::design::{Configuration, design};
use crate::reference::{Climb, Reference, settle};
use crate::result::{CaseResult, Outcome};
use crate::trial::distance::Errors;
use crate::trial::sight::{SAME, largest_change};
use crate::trial::{Protocol, Trial};
use crate::words::{percent, short};

/// Share of a scene's time that the reference leaves for the configurations and for what follows them.
const FOR_POINTS: f64 = 0.5;
const FOR_REST: f64 = 0.15;

/// With an error bar above this, another way to the reference is tried.
const WIDE: f64 = 0.1;

/// Number of frames of the first look.
const LOOK: u32 = 5;

/// Longest time of a run of a case without a budget [s], in a full study and in a quick one. References and
/// twins may take ten times as long.
const RUN_S: [f64; 2] = [12.0, 3.0];

/// Configurations that need more than this many budgets per solution are not run.
const TOO_SLOW: f64 = 6.0;

/// Studies `case` within `seconds`.
pub(super) fn study(bench: &mut Bench<'_>, mut case: Case, seconds: f64) -> CaseResult {
    bench.begin(&case.name, seconds);
    let mut notes = std::mem::take(&mut case.notes);
    let reference = match case.truth.clone() {
        Truth::Refined { law, ladders } => match look(bench, &mut case, &ladders, &mut notes) {
            Ok(()) => refine(bench, &case, &law, &ladders, &mut notes),
            Err(why) => return nothing(case, why, notes),
        },
        _ => {
            let cap_s = 10.0 * RUN_S[usize::from(bench.settings().quick)];
            let mut on = bench.on(&case);
            settle(&case, &mut |c| {
                let cap_s = cap_s.min(on.left_s());
                on.run(c, Ask { timed: false, cap_s })
            })
        }
    };
    let keep_s = if seconds.is_finite() { FOR_REST * seconds } else { 0.0 };
    let mut survey =
        Survey { bench, case: &case, reference: &reference, points: Vec::new(), left_out: 0, keep_s };
    survey.design();
    survey.search();
    let recommendation = survey.advise();
    survey.sources(recommendation.as_ref().and_then(|advice| advice.choice));
    let Survey { points, left_out, .. } = survey;
    let coordinates: Vec<(f64, f64)> = points.iter().map(Outcome::point).collect();
    // The sources of error are known by now, so that the text can name them.
    let recommendation = recommendation.map(|advice| words_again(&advice, &points, &reference));
    CaseResult {
        front: front(&coordinates),
        complete: left_out == 0 && !bench.is_over(),
        recommendation,
        reference,
        points,
        left_out,
        notes,
        case,
    }
}

/// The result of a case in which nothing could be run.
fn nothing(case: Case, why: String, notes: Vec<String>) -> CaseResult {
    CaseResult {
        case,
        reference: Err(why),
        points: Vec::new(),
        front: Vec::new(),
        recommendation: None,
        left_out: 0,
        complete: false,
        notes,
    }
}

/// Runs a few frames of the scene as it stands and of the reference's coarsest run. They show how long the
/// motion can be, and give the estimate that the user sees first.
fn look(
    bench: &mut Bench<'_>,
    case: &mut Case,
    ladders: &[Ladder],
    notes: &mut Vec<String>,
) -> Result<(), String> {
    let whole = case.protocol;
    let total_s = bench.on(case).left_s();
    if let Protocol::Motion { frame_s, frames } = whole {
        case.protocol = Protocol::Motion { frame_s, frames: frames.min(LOOK) };
    }
    let base = Configuration::base(&case.axes);
    let cap_s = 0.5 * total_s;
    let first = bench.on(case).run(&base, Ask { timed: true, cap_s }).ok_or("interrupted")?;
    if !first.is_done() {
        return Err(format!(
            "the scene with its own settings gives no result ({}): {}",
            first.status.name(),
            first.reason
        ));
    }
    let finest = |ladder: &Ladder| ladder.meshes.iter().position(|mesh| mesh.size > 1.3).unwrap_or(0);
    let mut reference_s = 0.0;
    for ladder in ladders {
        let cap_s = 0.1 * total_s;
        let Some(trial) = bench.on(case).run(&ladder.at(0, 1), Ask { timed: false, cap_s }) else { break };
        if trial.is_done() {
            // The finest level costs about as much as all others and the pilots together.
            reference_s = 2.0 * bench.on(case).forecast_s(&ladder.at(finest(ladder), 4), false);
            break;
        }
    }
    if let Protocol::Motion { frame_s, frames: most } = whole {
        let looked = f64::from(most.min(LOOK));
        let per_frame_s = (reference_s / looked).max(40.0 * first.cost.median_ms * 1e-3);
        let affordable = ((FOR_POINTS * total_s / per_frame_s) as u32).max(1);
        let frames = affordable.max(case.fewest_frames).min(most);
        case.protocol = Protocol::Motion { frame_s, frames };
        if frames < most {
            notes.push(format!(
                "only the first {} s of {} s are studied; --seconds {} with a longer --within studies all of them",
                short(f64::from(frames) * frame_s),
                short(f64::from(most) * frame_s),
                short(f64::from(most) * frame_s),
            ));
        }
    }
    let estimate = estimate(bench, case, &first, reference_s, total_s);
    bench.note(estimate);
    Ok(())
}

/// Tells the user how long the study will take.
fn estimate(bench: &mut Bench<'_>, case: &Case, first: &Trial, reference_s: f64, total_s: f64) -> String {
    let scale = match case.protocol {
        Protocol::Motion { frames, .. } => f64::from(frames) / f64::from(frames.min(LOOK)),
        Protocol::Static => 1.0,
    };
    let all = candidates(case);
    let on = bench.on(case);
    let points_s: f64 = all.iter().map(|c| on.forecast_s(c, true).min(0.1 * total_s)).sum();
    let points_s = points_s.min((1.0 - FOR_REST) * total_s);
    let reference_s = (scale * reference_s).min(FOR_POINTS * total_s);
    let what = match case.protocol {
        Protocol::Static => format!("{} ms to equilibrium", short(first.cost.median_ms)),
        Protocol::Motion { frame_s, frames } => {
            format!(
                "{} ms per frame, {frames} frames of {} ms",
                short(first.cost.median_ms),
                short(1e3 * frame_s)
            )
        }
    };
    let sum_s = (reference_s + points_s + 0.05 * total_s).min(total_s);
    format!(
        "{}: with its own settings {what}, {} elements. Estimate: reference {}, up to {} configurations {}; \
         about {} in total, at most {} (--within)",
        case.title,
        first.elements,
        seconds(reference_s),
        all.len(),
        seconds(points_s),
        seconds(sum_s),
        seconds(total_s)
    )
}

/// The reference of a scene: the best working way to it, refined as far as half of the time allows.
fn refine(
    bench: &mut Bench<'_>,
    case: &Case,
    law: &str,
    ladders: &[Ladder],
    notes: &mut Vec<String>,
) -> Result<Reference, String> {
    let keep_s = FOR_POINTS * bench.on(case).left_s();
    let mut best: Option<Climb<'_>> = None;
    let mut why = "nothing to compute it from".to_owned();
    for ladder in ladders {
        if best.as_ref().is_some_and(|best| best.bar() <= WIDE) || bench.on(case).left_s() < 1.2 * keep_s {
            break;
        }
        match Climb::start(ladder, law, &mut bench.on(case), keep_s) {
            Ok(Some(mut climb)) => {
                climb.climb(&mut bench.on(case), keep_s);
                if best.as_ref().is_none_or(|best| climb.bar() < best.bar()) {
                    best = Some(climb);
                }
            }
            Ok(None) => break,
            Err(reason) => why = reason,
        }
    }
    let best = best.ok_or(why)?;
    let base = Configuration::base(&case.axes);
    let cap_s = bench.on(case).left_s();
    let own = bench.on(case).run(&base, Ask { timed: true, cap_s });
    if let Some(own) = own
        && let Some((on_own, on_finest, change)) = largest_change(&own.seen, best.seen())
        && change > SAME
    {
        notes.push(format!(
            "`{}` selects {:.3e} m² and {:.3e} m³ on the scene’s mesh, {:.3e} m² and {:.3e} m³ in the reference \
             (a difference of {}), because only whole faces and elements count; this is part of the error",
            on_own.region,
            on_own.area_m2,
            on_own.volume_m3,
            on_finest.area_m2,
            on_finest.volume_m3,
            percent(change)
        ));
    }
    best.reference()
}

/// Configurations to try: all of a built-in case, or those of a scene that its check accepts.
fn candidates(case: &Case) -> Vec<Configuration> {
    let mut all = design(&case.axes, &case.blocks);
    if let Truth::Refined { .. } = case.truth {
        all.retain(|configuration| case.scene.apply_sets(&configuration.overrides()).is_ok());
    }
    all
}

/// The points of a case while they are run.
struct Survey<'s, 'a> {
    bench: &'s mut Bench<'a>,
    case: &'s Case,
    reference: &'s Result<Reference, String>,
    points: Vec<Outcome>,
    left_out: usize,
    /// Time reserved for what follows the points [s].
    keep_s: f64,
}

impl Survey<'_, '_> {
    fn is_scene(&self) -> bool {
        matches!(self.case.truth, Truth::Refined { .. })
    }

    /// Runs the design: the base first, the others by rising expected cost if time is short.
    fn design(&mut self) {
        let mut all = candidates(self.case);
        if self.is_scene() {
            let on = self.bench.on(self.case);
            let mut costs: Vec<(f64, Configuration)> = all
                .into_iter()
                .enumerate()
                .map(|(i, c)| (if i == 0 { -1.0 } else { on.forecast_s(&c, true) }, c))
                .collect();
            costs.sort_by(|a, b| a.0.total_cmp(&b.0));
            all = costs.into_iter().map(|(_, c)| c).collect();
        }
        let total = all.len();
        for configuration in all {
            if self.bench.is_over() {
                self.left_out = total - self.points.len();
                return;
            }
            self.bench.count(self.points.len(), total);
            if !self.point(configuration) {
                self.left_out += 1;
            }
        }
    }

    /// Runs a configuration if it fits into the time and is anywhere near the budget.
    fn point(&mut self, configuration: Configuration) -> bool {
        let keep_s = self.keep_s;
        let is_scene = self.is_scene();
        let quick = usize::from(self.bench.settings().quick);
        let per_solution_ms = {
            let seconds = self.bench.on(self.case).forecast_s(&configuration, true);
            1e3 * seconds / self.solutions()
        };
        let budget = self.bench.settings().budget_ms.filter(|_| is_scene && !self.points.is_empty());
        if budget.is_some_and(|budget_ms| per_solution_ms > TOO_SLOW * budget_ms) {
            return false;
        }
        let mut on = self.bench.on(self.case);
        if !fits(&on, &configuration, true, keep_s) {
            return false;
        }
        let forecast_s = on.forecast_s(&configuration, true);
        let room_s = (on.left_s() - keep_s).max(1.0);
        let cap_s =
            if is_scene { room_s.min((PATIENCE * forecast_s).max(2.0)) } else { room_s.min(RUN_S[quick]) };
        let Some(trial) = on.run(&configuration, Ask { timed: true, cap_s }) else { return false };
        let point = outcome(self.case, self.reference, configuration, trial);
        self.points.push(point);
        true
    }

    /// Number of solutions or frames of a run.
    fn solutions(&self) -> f64 {
        match self.case.protocol {
            Protocol::Static => 4.0,
            Protocol::Motion { frames, .. } => f64::from(frames),
        }
    }

    /// Runs neighbours of the best point that fits the budget, as long as they are better.
    fn search(&mut self) {
        if !self.is_scene() || self.reference.is_err() {
            return;
        }
        loop {
            let Some(best) = self.best() else { return };
            let from = self.points[best].configuration.clone();
            let before = self.points.len();
            for next in self.neighbours(&from) {
                if self.bench.is_over() {
                    return;
                }
                self.point(next);
            }
            if self.points.len() == before || self.best() == Some(best) {
                return;
            }
        }
    }

    /// Index of the most accurate point that fits the budget.
    fn best(&self) -> Option<usize> {
        let budget_ms = self.bench.settings().budget_ms.unwrap_or(f64::INFINITY);
        let fitting = self.points.iter().enumerate().filter(|(_, p)| p.trial.cost.p99_ms <= budget_ms);
        let known = fitting.filter(|(_, p)| p.errors.is_some());
        known.min_by(|a, b| a.1.point().1.total_cmp(&b.1.point().1)).map(|(i, _)| i)
    }

    /// Configurations that differ in one factor and were not run yet.
    fn neighbours(&self, from: &Configuration) -> Vec<Configuration> {
        let keys: Vec<String> = self.points.iter().map(|point| point.configuration.key()).collect();
        let axes = self.case.axes.iter().filter(|axis| {
            matches!(
                axis.factor,
                Factor::Mesh | Factor::Element | Factor::Step | Factor::Integrator | Factor::Tolerance
            )
        });
        let all = axes.flat_map(|axis| axis.settings.iter().map(|setting| from.with(axis.factor, setting)));
        let new = all.filter(|c| !keys.contains(&c.key()));
        new.filter(|c| self.case.scene.apply_sets(&c.overrides()).is_ok()).collect()
    }

    /// The recommendation, after its choice was run once more. If the choice is then slower, the slower time
    /// counts, and another choice may win.
    fn advise(&mut self) -> Option<Recommendation> {
        let budget_ms = self.bench.settings().budget_ms?;
        let mut advice = advise(budget_ms, &self.points, self.reference);
        for _ in 0..4 {
            let Some(choice) = advice.choice.filter(|_| self.is_scene()) else { break };
            let configuration = self.points[choice].configuration.clone();
            let cap_s = self.bench.on(self.case).left_s();
            let trial =
                self.bench.again(self.case, &configuration, Ask { timed: true, cap_s: cap_s.max(1.0) });
            let Some(trial) = trial.filter(Trial::is_done) else { break };
            let cost = &mut self.points[choice].trial.cost;
            if trial.cost.p99_ms <= cost.p99_ms {
                break;
            }
            *cost = trial.cost;
            let next = advise(budget_ms, &self.points, self.reference);
            if next.choice == advice.choice {
                advice = next;
                break;
            }
            advice = next;
        }
        Some(advice)
    }

    /// Finds the sources of error: of the choice first, then along the front, as far as time allows.
    fn sources(&mut self, choice: Option<usize>) {
        let Ok(reference) = self.reference else { return };
        let coordinates: Vec<(f64, f64)> = self.points.iter().map(Outcome::point).collect();
        let front = front(&coordinates);
        for i in choice.into_iter().chain(front.into_iter().filter(|i| Some(*i) != choice)) {
            let Outcome { configuration, trial, .. } = &self.points[i];
            let most_s = 10.0 * RUN_S[usize::from(self.bench.settings().quick)];
            let mut on = self.bench.on(self.case);
            let found = peel(self.case, configuration, &trial.series, reference, &mut |c| {
                let cap_s = most_s.min(on.left_s());
                if cap_s <= 0.0 || !fits(&on, c, false, 0.0) {
                    return None;
                }
                on.run(c, Ask { timed: false, cap_s })
            });
            self.points[i].sources = Some(found);
        }
    }
}

/// A point with its errors against the reference.
fn outcome(
    case: &Case,
    reference: &Result<Reference, String>,
    configuration: Configuration,
    trial: Trial,
) -> Outcome {
    let known = reference.as_ref().ok().filter(|_| trial.is_done());
    let errors = known.map(|r| Errors::of(&trial.series, &r.series, &case.goal, r.goal));
    Outcome { configuration, errors: errors.filter(Errors::is_finite), trial, sources: None }
}

fn advise(budget_ms: f64, points: &[Outcome], reference: &Result<Reference, String>) -> Recommendation {
    let words: Vec<String> = points.iter().map(|point| point.configuration.words()).collect();
    let mut candidates = Vec::with_capacity(points.len());
    for (point, words) in points.iter().zip(&words) {
        let (p99_ms, error) = (point.trial.cost.p99_ms, point.point().1);
        candidates.push(Candidate { p99_ms, error, words, sources: point.sources.as_ref() });
    }
    let bar = reference.as_ref().map_or(f64::INFINITY, |reference| reference.error_bar);
    let mut advice = recommend(budget_ms, bar, &candidates);
    advice.set = advice.choice.map(|i| points[i].configuration.overrides()).unwrap_or_default();
    advice
}

/// The same recommendation with a text that names the sources of error.
fn words_again(
    advice: &Recommendation,
    points: &[Outcome],
    reference: &Result<Reference, String>,
) -> Recommendation {
    let told = advise(advice.budget_ms, points, reference);
    if told.choice == advice.choice { told } else { advice.clone() }
}

fn seconds(seconds: f64) -> String {
    if seconds < 100.0 { format!("{seconds:.0} s") } else { format!("{:.1} min", seconds / 60.0) }
}
