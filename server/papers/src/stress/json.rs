//! The suite as JSON, for programs. Values that depend on machine and time are all under `run`.

use serde_json::{Value, json};

use super::case::{CaseReport, Status};
use super::evidence::{Bound, Figure};
use super::mutation::Row;
use super::suite::SuiteReport;

/// Contents of `stress.json`.
pub(super) fn suite(report: &SuiteReport, table: Option<&[Row]>) -> Value {
    json!({
        "run": {
            "origin": report.origin,
            "seconds": report.seconds,
            "interrupted": report.interrupted,
            "case_seconds": report.cases.iter().zip(&report.case_seconds)
                .map(|(case, seconds)| (case.case.name.to_owned(), json!(seconds)))
                .collect::<serde_json::Map<_, _>>(),
        },
        "passed": report.count(Status::Passed),
        "failed": report.count(Status::Failed),
        "cases": report.cases.iter().map(case).collect::<Vec<_>>(),
        "mutations": table.map(|rows| rows.iter().map(row).collect::<Vec<_>>()),
    })
}

/// One case; the same on every run.
pub(super) fn case(report: &CaseReport) -> Value {
    let case = report.case;
    let charts = report.evidence.charts.iter().map(|chart| {
        let lines = chart.lines.iter().map(|line| json!({ "name": line.name, "points": line.points }));
        json!({
            "title": chart.title, "x": chart.x_label, "y": chart.y_label, "lines": lines.collect::<Vec<_>>(),
        })
    });
    json!({
        "number": case.number,
        "name": case.name,
        "title": case.title,
        "set_up": case.set_up,
        "rule": case.rule,
        "source": case.source,
        "status": report.status.name(),
        "reason": report.reason,
        "figures": report.evidence.figures.iter().map(figure).collect::<Vec<_>>(),
        "notes": report.evidence.notes,
        "charts": charts.collect::<Vec<_>>(),
    })
}

fn figure(figure: &Figure) -> Value {
    let (kind, bound) = match figure.bound {
        Bound::AtMost(bound) => ("at_most", Some(bound)),
        Bound::AtLeast(bound) => ("at_least", Some(bound)),
        Bound::Exactly(bound) => ("exactly", Some(bound)),
        Bound::Told => ("told", None),
    };
    json!({
        "name": figure.name, "value": figure.value, "unit": figure.unit,
        "kind": kind, "bound": bound, "holds": figure.holds(),
    })
}

fn row(row: &Row) -> Value {
    json!({
        "mutation": row.mutation.name(),
        "words": row.mutation.words(),
        "named": row.mutation.named(),
        "caught": row.caught(),
        "failed": row.failed.iter().map(|f| json!({ "case": f.name, "why": f.why })).collect::<Vec<_>>(),
    })
}
