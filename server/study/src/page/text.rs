//! The prose of the page: what is shown, how it was measured, and on which machine.

use std::fmt::Write as _;

use crate::report::html::{escape, time};
use crate::result::{CaseResult, StudyResult};
use crate::words::percent;

/// Heading, reading guide, and an overview of the cases.
pub(super) fn opening(study: &StudyResult) -> String {
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
        out += "<p class=\"advice\"><strong>Not optimised.</strong> This is a development build. Its times do \
            not predict those of a release.</p>\n";
    }
    if let Some(load) = study.load[0].filter(|load| *load > machine.threads as f64) {
        let _ = writeln!(
            out,
            "<p class=\"advice\"><strong>Busy machine.</strong> Other programs used its processors (load average \
             {load:.1}). Times are therefore too long, and runs may have been stopped as too slow.</p>"
        );
    }
    if study.interrupted {
        out += "<p class=\"advice\"><strong>Interrupted.</strong> The same command with the same directory \
            resumes from here.</p>\n";
    }
    study.cases.iter().for_each(|result| out += &answer(result, study.cases.len() > 1));
    out += "<p class=\"soft\">Files: <a href=\"points.csv\">points.csv</a> · <a href=\"study.json\">study.json</a>";
    for result in &study.cases {
        let name = escape(&result.case.name);
        let _ = write!(out, " · <a href=\"pareto-{name}.svg\">pareto-{name}.svg</a>");
    }
    out += "</p>\n";
    if study.cases.is_empty() {
        out += "</header>\n";
        return out;
    }
    out += "<p>Every case below is one scene, solved with many settings. The cost of a setting is its time \
            on this machine. Its error is the distance from a reference that is known more accurately than any \
            of them. Failed runs are shown as well.</p>\n</header>\n";
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
    let Some(own) = result.points.first() else { return "No configuration was run.".to_owned() };
    let (ms, error) = own.point();
    let mut words = format!(
        "With its own settings: {} per solution, error {} ± {}.",
        time(ms),
        percent(error),
        percent(bar)
    );
    let better = result.front.iter().map(|&i| &result.points[i]);
    let mut better = better.filter(|point| point.point().0 <= ms && point.point().1 + bar < error);
    if let Some(point) = better.next_back() {
        let (ms, error) = point.point();
        let _ = write!(
            words,
            " More accurate in no more time: {} ({}, error {}).",
            point.configuration.words(),
            time(ms),
            percent(error)
        );
    }
    words
}

fn glance(study: &StudyResult) -> String {
    let mut out = "<div class=\"scroll\"><table class=\"glance\">\n<thead><tr><th>case</th><th class=\"number\">points</th><th class=\"number\">no result</th><th class=\"number\">fastest on the front</th><th class=\"number\">most accurate</th><th class=\"number\">error bar of the reference</th></tr></thead>\n<tbody>\n"
        .to_owned();
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
pub(super) fn method(study: &StudyResult) -> String {
    let mut out = "<section id=\"method\">\n<h2>How it was measured</h2>\n<dl>\n".to_owned();
    // Experiments say themselves what they measure.
    for (term, meaning) in DEFINITIONS.iter().filter(|_| !study.cases.is_empty()) {
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
        "<dt>This study</dt><dd>{points} points in {:.0} s; {} runs were reused from an earlier study. Version \
         {}, commit {}. The figures in machine-readable form: <a href=\"points.csv\">points.csv</a>, <a \
         href=\"study.json\">study.json</a>.</dd>",
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
        "The relative error of the one quantity of interest of the case. It can be small by accident, where two \
        errors cancel.",
    ),
    (
        "Energy error",
        "|Ψ − Ψ*| / Ψ* of the elastic energy; in a motion, its root mean square over the frames. For linear \
        statics under given loads, its square root is the error in the energy norm.",
    ),
    (
        "Time",
        "Processor time of the stepping thread, which does not depend on the load of the machine. With several \
        threads per step, it is wall time. Set-up (reading, meshing, cutting) is listed separately. A static \
        solution is repeated from rest up to 11 times within 1.5 s. A motion is timed frame by frame, and its \
        first frame is listed separately. The figures are the median and the 99th percentile (the slowest of \
        fewer than 100).",
    ),
    (
        "Design",
        "Factors are varied one at a time around a base configuration; factors that interact are combined in \
        factorial blocks. No setting is tuned to a case. Runs of built-in cases are stopped after 12 s (3 s in a \
        quick study) and then count as too slow. The study of a scene has a time limit (--within), and half of \
        it goes to the reference. Configurations are skipped if their forecast does not fit or is more than six \
        times the budget. Then the neighbours of the best configuration within the budget are tried, and the \
        recommended one is run once more.",
    ),
    (
        "No result",
        "Refused: the scene does not allow the combination. Exploded: a step was rolled back, or a displacement \
        grew beyond all bounds. Failed: no solution was found. Too slow: the run was stopped. The reason is \
        shown on hovering and in the table of all points.",
    ),
    (
        "Sources of error",
        "At every point of the front, a twin run removes one source after another: double precision (rounding), \
        tolerance 10⁻¹⁰ (algebraic), half the step with extrapolation (time), the law of the reference (model). \
        The rest is discretisation. The terms add up to the error as vectors, so the sum of their sizes can \
        exceed it.",
    ),
    (
        "Model error",
        "The difference between the law of the point and the law of the reference. The latter is a choice: no \
        law describes a tissue exactly.",
    ),
    (
        "Reference",
        "For a case: a formula, a stored solution of higher order on finer meshes, or Richardson extrapolation \
        over three meshes and three steps with the observed order. Its error bar is 1.25 times the extrapolated \
        change, or 3 times without an observed order. For a scene: mesh and step are refined together on as many \
        levels as the time allows, and the levels are fitted by least squares. Without a plausible order, the \
        reference is the finest level, and its error bar is the spread of the levels (Eça and Hoekstra 2014). In \
        blocks, element boundaries coincide with those of regions and cuts.",
    ),
];
