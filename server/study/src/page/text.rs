//! The prose of the page: what is shown, how it was measured, and on which machine.

use std::fmt::Write as _;

use super::html::{escape, time};
use crate::result::{CaseResult, StudyResult};
use crate::words::percent;

/// Heading, reading guide, and an overview of the cases.
pub fn opening(study: &StudyResult) -> String {
    let machine = &study.origin.machine;
    let mut out = "<header>\n<h1>What accuracy costs</h1>\n".to_owned();
    let _ = writeln!(
        out,
        "<p class=\"lead\">scindo {} · commit {} · {} · {} threads</p>",
        escape(&study.origin.version),
        escape(&study.origin.commit),
        escape(&machine.processor),
        machine.threads
    );
    if !machine.optimised {
        out += "<p class=\"advice\"><strong>Not optimised.</strong> This is a development build: its times say nothing about a release.</p>\n";
    }
    if let Some(load) = study.load[0].filter(|load| *load > machine.threads as f64) {
        let _ = writeln!(
            out,
            "<p class=\"advice\"><strong>Busy machine.</strong> Other programs kept its threads at work (load average \
             {load:.1}): times are longer than they need be, and runs may have been stopped as too slow.</p>"
        );
    }
    if study.interrupted {
        out += "<p class=\"advice\"><strong>Interrupted.</strong> The same command with the same directory goes on from here.</p>\n";
    }
    study.cases.iter().for_each(|result| out += &answer(result, study.cases.len() > 1));
    out += "<p class=\"soft\">Files: <a href=\"points.csv\">points.csv</a> · <a href=\"study.json\">study.json</a>";
    for result in &study.cases {
        let name = escape(&result.case.name);
        let _ = write!(out, " · <a href=\"pareto-{name}.svg\">pareto-{name}.svg</a>");
    }
    out += "</p>\n<p>Every case below is one scene, solved with many settings. What a setting costs is measured on this \
            machine; what it is worth is its distance from a reference that is known better than any of them. \
            Runs that failed stay in the picture.</p>\n</header>\n";
    out += &glance(study);
    out
}

/// The result of a case in a sentence.
fn answer(result: &CaseResult, named: bool) -> String {
    let words = match (&result.recommendation, &result.reference) {
        (_, Err(why)) => format!("No answer: {why}."),
        (Some(advice), Ok(_)) => advice.words.clone(),
        (None, Ok(reference)) => without_budget(result, reference.error_bar),
    };
    let title = if named { format!("{}: ", result.case.title) } else { String::new() };
    format!("<p class=\"advice answer\"><strong>{}</strong>{}</p>\n", escape(&title), escape(&words))
}

/// A summary without a budget: the scene as it stands, the first point, and what beats it.
fn without_budget(result: &CaseResult, bar: f64) -> String {
    let Some(own) = result.points.first() else { return "Nothing was run.".to_owned() };
    let (ms, error) = own.point();
    let mut words =
        format!("As it stands: {} per solution, error {} ± {}.", time(ms), percent(error), percent(bar));
    let better = result.front.iter().map(|&i| &result.points[i]);
    let mut better = better.filter(|point| point.point().0 <= ms && point.point().1 + bar < error);
    if let Some(point) = better.next_back() {
        let (ms, error) = point.point();
        let _ = write!(
            words,
            " For no more time: {} ({}, error {}).",
            point.configuration.words(),
            time(ms),
            percent(error)
        );
    }
    words
}

fn glance(study: &StudyResult) -> String {
    let mut out = "<div class=\"scroll\"><table class=\"glance\">\n<thead><tr><th>case</th><th class=\"number\">points</th><th class=\"number\">no result</th><th class=\"number\">fastest on the front</th><th class=\"number\">most accurate</th><th class=\"number\">reference known to</th></tr></thead>\n<tbody>\n".to_owned();
    for result in &study.cases {
        let counts = result.counts();
        let end = |i: Option<&usize>| {
            let point = i.map(|&i| &result.points[i])?;
            Some(format!("{} at {}", percent(point.point().1), time(point.trial.cost.median_ms)))
        };
        let known = result.reference.as_ref().map_or("–".to_owned(), |r| percent(r.error_bar));
        let _ = writeln!(
            out,
            "<tr><td><a href=\"#{}\">{}</a></td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{known}</td></tr>",
            escape(&result.case.name),
            escape(&result.case.title),
            counts.points,
            counts.failures,
            end(result.front.first()).unwrap_or_else(|| "–".to_owned()),
            end(result.front.last()).unwrap_or_else(|| "–".to_owned()),
        );
    }
    out += "</tbody></table></div>\n";
    out
}

/// Definitions, method and machine.
pub fn method(study: &StudyResult) -> String {
    let mut out = "<section id=\"method\">\n<h2>How it was measured</h2>\n<dl>\n".to_owned();
    for (term, meaning) in DEFINITIONS {
        let _ = writeln!(out, "<dt>{term}</dt><dd>{meaning}</dd>");
    }
    let machine = &study.origin.machine;
    let load = |x: Option<f64>| x.map_or("unknown".to_owned(), |x| format!("{x:.2}"));
    let _ = writeln!(
        out,
        "<dt>Machine</dt><dd>{}, {}, {} hardware threads; load average {} at the start and {} at the end; {}.</dd>",
        escape(&machine.processor),
        escape(&machine.system),
        machine.threads,
        load(study.load[0]),
        load(study.load[1]),
        if machine.optimised { "release build" } else { "development build, without optimisation" }
    );
    let points: usize = study.cases.iter().map(|case: &CaseResult| case.counts().points).sum();
    let _ = writeln!(
        out,
        "<dt>This study</dt><dd>{points} points in {:.0} s; {} runs were taken over from an earlier study. Version {}, commit {}. \
         The same figures for programs: <a href=\"points.csv\">points.csv</a>, <a href=\"study.json\">study.json</a>.</dd>",
        study.seconds,
        study.resumed,
        escape(&study.origin.version),
        escape(&study.origin.commit)
    );
    out += "</dl>\n</section>\n";
    out
}

const DEFINITIONS: [(&str, &str); 9] = [
    (
        "Displacement error",
        "‖u − u*‖ / ‖u*‖ over all probes and, in a motion, all frames; u is the displacement of a probe, u* that of the reference. The Pareto front is drawn by it.",
    ),
    (
        "Goal error",
        "The relative error of the one number that the case is asked for. It can be small by accident where two errors cancel.",
    ),
    (
        "Energy error",
        "|Ψ − Ψ*| / Ψ* of the elastic energy, in a motion root mean square over the frames. Its square root is the error in the energy norm for linear statics under given loads.",
    ),
    (
        "Time",
        "Processor time of the thread that steps, which a busy machine does not stretch (wall time where several threads work on a step), without set-up (reading, meshing, cutting), which is listed apart. A static solution is found anew from rest up to 11 times, as far as 1.5 s allow; a motion is timed frame by frame, and its first frame stands apart. Median and 99th percentile (the slowest of fewer than 100).",
    ),
    (
        "Design",
        "One factor at a time around a base, and factorial blocks of those that matter together. No setting is tuned to a case. Runs of the program’s own cases are stopped after 12 s (3 s in a quick study) and then count as too slow. A scene has a time (--within): half of it goes to the reference; configurations whose forecast does not fit, or is six times over the budget, are left out; then neighbours of the best one that fits are tried, and the one that is recommended is run once more.",
    ),
    (
        "No result",
        "Refused: the scene does not allow the combination. Exploded: a step was rolled back, or a displacement left every measure. Failed: no solution. Too slow: stopped. Hovering tells the reason; the table of all points has it, too.",
    ),
    (
        "Sources of error",
        "At every point of the front, one source after another is removed by a twin run: double precision (rounding), tolerance 10⁻¹⁰ (algebraic), half the step with extrapolation (time), the law of the reference (model). What is left is discretisation. The terms add up to the error as vectors, so their sizes can exceed it.",
    ),
    (
        "Model error",
        "The distance between the point’s law and the law of the reference, which is a choice: no law is the truth about a tissue.",
    ),
    (
        "Reference",
        "A formula, a stored solution of higher order on finer meshes, or Richardson extrapolation over three meshes and three steps with the observed order; its error bar is 1.25 times the extrapolated change, 3 times where no order shows. Of a scene: levels on which mesh and step are refined together, as many as the time allows, fitted by least squares; where no plausible order shows, the finest level with the spread of the levels as its bar (Eça and Hoekstra 2014). Blocks have their elements end where regions and cuts end there.",
    ),
];
