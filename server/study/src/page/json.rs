//! The study as JSON, for programs.

use serde_json::{Value, json};

use crate::design::axes::Factor;
use crate::report::result::ExperimentResult;
use crate::result::{CaseResult, Outcome, StudyResult};

/// Contents of `study.json`.
pub(super) fn study(study: &StudyResult) -> Value {
    json!({
        "origin": study.origin,
        "seconds": study.seconds,
        "load": study.load,
        "interrupted": study.interrupted,
        "resumed_runs": study.resumed,
        "cases": study.cases.iter().map(case).collect::<Vec<_>>(),
        "experiments": study.experiments.iter().map(ExperimentResult::to_json).collect::<Vec<_>>(),
    })
}

fn case(result: &CaseResult) -> Value {
    let case = &result.case;
    let (reference, missing) = match &result.reference {
        Ok(reference) => (Some(reference), None),
        Err(why) => (None, Some(why)),
    };
    json!({
        "name": case.name,
        "title": case.title,
        "about": case.about,
        "goal": case.goal.words,
        "reference": reference,
        "no_reference": missing,
        "complete": result.complete,
        "counts": result.counts(),
        "left_out": result.left_out,
        "notes": result.notes,
        "protocol": format!("{:?}", case.protocol),
        "recommendation": result.recommendation,
        "front": result.front,
        "points": result.points.iter().map(point).collect::<Vec<_>>(),
        "scene": case.scene.to_json(),
    })
}

fn point(point: &Outcome) -> Value {
    let trial = &point.trial;
    let labels: serde_json::Map<String, Value> = Factor::ALL
        .iter()
        .filter_map(|factor| {
            Some((factor.name().to_owned(), point.configuration.setting(*factor)?.label.clone().into()))
        })
        .collect();
    let overrides: Vec<String> = point.configuration.overrides();
    json!({
        "settings": labels,
        "set": overrides,
        "status": trial.status.name(),
        "reason": trial.reason,
        "cost": trial.cost,
        "elements": trial.elements,
        "unknowns": trial.unknowns,
        "iterations": trial.iterations,
        "residual": trial.residual,
        "wear": trial.wear,
        "regions": trial.seen,
        "errors": point.errors,
        "sources": point.sources.as_ref().map(|sources| &sources.0),
        "dominant": point.sources.as_ref().and_then(|sources| sources.dominant()),
    })
}
