//! The section of a case: plots, Pareto front, all points, reference.

use std::fmt::Write as _;

use super::wear;
use crate::advice::sources::{Source, Sources};
use crate::case::Case;
use crate::design::axes::Factor;
use crate::report::html::{escape, prose, time};
use crate::report::plot::{Failure, Mark, Plot};
use crate::report::style;
use crate::result::{CaseResult, Outcome};
use crate::trial::Protocol;
use crate::trial::distance::Errors;
use crate::words::{percent, short};

/// A plot that stands alone, with its own style.
pub(super) fn picture(result: &CaseResult) -> String {
    let mut plot = plot(result, [1000.0, 600.0], |errors| errors.l2, "displacement error");
    plot.title = Some(result.case.title.clone());
    let style = format!("<style>{}{}</style>\n", style::COLOURS, style::PLOT);
    plot.svg().replacen("<rect class=\"ground\"", &format!("{style}<rect class=\"ground\""), 1)
}

/// The whole section as HTML.
pub(super) fn section(result: &CaseResult) -> String {
    let case = &result.case;
    let mut out = format!(
        "<section id=\"{0}\">\n<h2>{1}</h2>\n<p>{2}</p>\n",
        escape(&case.name),
        escape(&case.title),
        prose(&case.about)
    );
    out += &advice(result);
    let main = plot(result, [1064.0, 580.0], |errors| errors.l2, "displacement error");
    let _ = writeln!(
        out,
        "<figure>\n{}<figcaption>Each mark is one configuration; point at it to see its settings. Left is faster, \
         down is more accurate. Names in the legend switch their marks off and on. The numbered marks on the line are the Pareto front: no other configuration is \
         both faster and more accurate.</figcaption>\n</figure>",
        main.html()
    );
    let goal = format!("error of the goal: {}", case.goal.words);
    let (a, b) = (
        plot(result, [520.0, 400.0], |errors| errors.goal, "goal error"),
        plot(result, [520.0, 400.0], |errors| errors.energy, "energy error"),
    );
    let _ = writeln!(
        out,
        "<div class=\"pair\">\n<figure>{}<figcaption>The same points by the {}. The line connects \
        the points of the front above.</figcaption></figure>\n<figure>{}<figcaption>The same points by the error \
        of their elastic energy, with the same line.</figcaption></figure>\n</div>",
        a.html(),
        escape(&goal),
        b.html()
    );
    out += &wear::table(result);
    out += &front_table(result);
    out += &reference(result);
    out += &all_points(result);
    out += "</section>\n";
    out
}

/// The recommendation, with the overrides it needs and remarks for the reader.
fn advice(result: &CaseResult) -> String {
    let mut out = String::new();
    if let Some(advice) = &result.recommendation {
        let head = if advice.indistinguishable { "Indistinguishable." } else { "Recommended." };
        let _ = writeln!(out, "<p class=\"advice\"><strong>{head}</strong> {}</p>", escape(&advice.words));
        if !advice.set.is_empty() {
            let set: Vec<String> = advice.set.iter().map(|set| format!("--set '{set}'")).collect();
            let _ = writeln!(
                out,
                "<details><summary>Run it</summary><pre>scindo run {} {}</pre></details>",
                escape(result.case.scene.file()),
                escape(&set.join(" "))
            );
        }
    }
    if result.left_out > 0 {
        let _ = writeln!(
            out,
            "<p class=\"note\">{} configurations were skipped, because they were too slow for the budget or no \
            time was left.</p>",
            result.left_out
        );
    }
    for note in &result.notes {
        let _ = writeln!(out, "<p class=\"note\">{}.</p>", prose(note));
    }
    out
}

fn plot(result: &CaseResult, size: [f64; 2], measure: fn(&Errors) -> f64, what: &str) -> Plot {
    let case = &result.case;
    let mut marks = Vec::new();
    let mut failures = Vec::new();
    for (i, point) in result.points.iter().enumerate() {
        match &point.errors {
            Some(errors) => marks.push(Mark {
                x: point.trial.cost.median_ms,
                y: measure(errors).max(1e-9),
                colour: index(case, case.colour, point),
                shape: index(case, case.shape, point),
                rank: result.front.iter().position(|&j| j == i).map(|rank| rank + 1),
                title: title(case, point, errors),
            }),
            None => failures.push(Failure {
                x: Some(point.trial.cost.median_ms).filter(|_| point.trial.cost.count > 0),
                title: format!(
                    "{}\n{}: {}",
                    point.configuration.words(),
                    point.trial.status.name(),
                    point.trial.reason
                ),
            }),
        }
    }
    let used = |of: fn(&Mark) -> usize, factor: Factor| {
        let axis = case.axes.iter().find(|axis| axis.factor == factor);
        let names = axis.map(|axis| axis.settings.iter().map(|s| s.label.clone()).enumerate().collect());
        let names: Vec<(usize, String)> = names.unwrap_or_default();
        names.into_iter().filter(|(i, _)| marks.iter().any(|mark| of(mark) == *i)).collect::<Vec<_>>()
    };
    let (colours, shapes) = (used(|m| m.colour, case.colour), used(|m| m.shape, case.shape));
    Plot {
        size,
        x_label: cost_words(case),
        y_label: what.to_owned(),
        marks,
        failures,
        error_bar: result.reference.as_ref().map_or(0.0, |reference| reference.error_bar),
        budget_ms: result.recommendation.as_ref().map(|advice| advice.budget_ms),
        colours,
        shapes,
        title: None,
    }
}

/// Explains what the measured time covers.
fn cost_words(case: &Case) -> String {
    match case.protocol {
        Protocol::Static => "time to equilibrium, median".to_owned(),
        Protocol::Motion { frame_s, .. } => {
            format!("time per frame of {} ms, median", short(1e3 * frame_s))
        }
    }
}

fn index(case: &Case, factor: Factor, point: &Outcome) -> usize {
    let axis = case.axes.iter().find(|axis| axis.factor == factor);
    let label = point.configuration.label(factor);
    axis.and_then(|axis| axis.settings.iter().position(|s| s.label == label)).unwrap_or(0)
}

fn title(case: &Case, point: &Outcome, errors: &Errors) -> String {
    let (cost, trial) = (&point.trial.cost, &point.trial);
    let mut text = format!(
        "{}\nmedian {}, p99 {} ({} times), set-up {}\nerror: displacement {}, goal {}, energy {}\n{} elements, {} unknowns, {:.0} iterations per step",
        point.configuration.words(),
        time(cost.median_ms),
        time(cost.p99_ms),
        cost.count,
        time(cost.setup_ms),
        percent(errors.l2),
        percent(errors.goal),
        percent(errors.energy),
        trial.elements,
        trial.unknowns,
        trial.iterations
    );
    if case.axes.iter().any(|axis| axis.factor == Factor::Step) {
        text += "\nover the whole motion";
    }
    if let Some(source) = point.sources.as_ref().and_then(Sources::dominant) {
        let _ = write!(text, "\ndominated by the {} error", source.name());
    }
    text
}

/// Factors that these points vary. Settings that all of them share are stated once above the table.
fn factors<'p>(case: &Case, points: impl Iterator<Item = &'p Outcome> + Clone) -> (Vec<Factor>, String) {
    let known = |factor: &Factor| case.axes.iter().any(|axis| axis.factor == *factor);
    let varies = |factor: &Factor| {
        let mut labels = points.clone().map(|point| point.configuration.label(*factor));
        let first = labels.next();
        labels.any(|label| Some(label) != first)
    };
    let (varied, shared): (Vec<_>, Vec<_>) = Factor::ALL.into_iter().filter(known).partition(varies);
    let labels = points.clone().next().map(|point| {
        let told = |factor: &Factor| format!("{} {}", factor.name(), point.configuration.label(*factor));
        shared.iter().map(told).collect::<Vec<_>>().join(", ")
    });
    let shared = labels.filter(|labels| !labels.is_empty());
    let shared = shared.map_or(String::new(), |labels| {
        format!("<p class=\"soft\">Settings shared by all: {}.</p>\n", escape(&labels))
    });
    (varied, shared)
}

fn front_table(result: &CaseResult) -> String {
    if result.front.is_empty() {
        return "<h3>The Pareto front</h3>\n<p>No configuration gave a result.</p>\n".to_owned();
    }
    let case = &result.case;
    let mut out = "<h3>The Pareto front and its dominant errors</h3>\n<ul class=\"keys\">".to_owned();
    for (i, source) in Source::ALL.iter().enumerate() {
        let _ = write!(out, "<li><i class=\"s{i}\"></i>{}</li>", source.name());
    }
    let (columns, shared) = factors(case, result.front.iter().map(|&i| &result.points[i]));
    out += "</ul>\n";
    out += &shared;
    out += "<div class=\"scroll\"><table class=\"front\">\n<thead><tr><th class=\"number\">#</th><th class=\"number\">median</th><th class=\"number\">p99</th><th class=\"number\">displace&shy;ment</th><th class=\"number\">goal</th><th class=\"number\">energy</th><th>dominated by</th><th>sources</th>";
    columns.iter().for_each(|factor| {
        let _ = write!(out, "<th>{}</th>", factor.name());
    });
    out += "</tr></thead>\n<tbody>\n";
    for (rank, &i) in result.front.iter().enumerate() {
        let point = &result.points[i];
        let _ = write!(out, "<tr><td class=\"number\"><strong>{}</strong></td>", rank + 1);
        out += &figures(point);
        let dominant = point.sources.as_ref().and_then(Sources::dominant).map_or("–", Source::name);
        let _ =
            write!(out, "<td>{dominant}</td><td>{}</td>", point.sources.as_ref().map_or(String::new(), bar));
        columns.iter().for_each(|factor| {
            let _ = write!(out, "<td>{}</td>", escape(point.configuration.label(*factor)));
        });
        out += "</tr>\n";
    }
    out += "</tbody></table></div>\n";
    out
}

/// Cells of the table: median, p99 and the three errors.
fn figures(point: &Outcome) -> String {
    let cost = &point.trial.cost;
    let mut cells = vec![time(cost.median_ms), time(cost.p99_ms)];
    let errors = point.errors.map(|e| [e.l2, e.goal, e.energy]);
    cells.extend((0..3).map(|i| errors.map_or("–".to_owned(), |e| percent(e[i]))));
    cells.iter().map(|cell| format!("<td class=\"number\">{cell}</td>")).collect()
}

/// A bar that shows the shares of the sources.
fn bar(sources: &Sources) -> String {
    let total: f64 = sources.0.iter().map(|(_, size)| *size).filter(|size| size.is_finite()).sum();
    let mut told = Vec::new();
    let mut parts = String::new();
    for (i, source) in Source::ALL.iter().enumerate() {
        match sources.of(*source) {
            Some(size) if size.is_finite() => {
                told.push(format!("{} {}", source.name(), percent(size)));
                let share = if total > 0.0 { 100.0 * size / total } else { 0.0 };
                let _ = write!(parts, "<i class=\"s{i}\" style=\"width:{share:.1}%\"></i>");
            }
            _ => told.push(format!("{} not separated", source.name())),
        }
    }
    format!("<span class=\"bar\" title=\"{}\">{parts}</span>", escape(&told.join("\n")))
}

fn reference(result: &CaseResult) -> String {
    let told = match &result.reference {
        Ok(reference) => format!(
            "{}. Error bar ± {}: smaller differences are not significant.",
            escape(&reference.source),
            percent(reference.error_bar)
        ),
        Err(why) => format!("None: {}. Only times are shown.", escape(why)),
    };
    format!("<h3>The reference</h3>\n<p>{told}</p>\n")
}

fn all_points(result: &CaseResult) -> String {
    let counts = result.counts();
    let (columns, shared) = factors(&result.case, result.points.iter());
    let mut order: Vec<&Outcome> = result.points.iter().collect();
    order.sort_by(|a, b| {
        let rank = |p: &Outcome| (p.errors.is_none(), p.trial.cost.median_ms);
        rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1))
    });
    let mut out = format!(
        "<details><summary>All {} points, {} of them without a result</summary>\n{shared}<div class=\"scroll\"><table class=\"all\">\n<thead><tr>",
        counts.points, counts.failures
    );
    for head in ["median", "p99", "displacement", "goal", "energy", "set-up"] {
        let _ = write!(out, "<th class=\"number\">{head}</th>");
    }
    columns.iter().for_each(|factor| {
        let _ = write!(out, "<th>{}</th>", factor.name());
    });
    out += "<th class=\"number\">elements</th><th class=\"number\">iterations</th><th>ended</th></tr></thead>\n<tbody>\n";
    for point in order {
        let trial = &point.trial;
        let _ = write!(out, "<tr>{}<td class=\"number\">{}</td>", figures(point), time(trial.cost.setup_ms));
        columns.iter().for_each(|factor| {
            let _ = write!(out, "<td>{}</td>", escape(point.configuration.label(*factor)));
        });
        let _ = write!(
            out,
            "<td class=\"number\">{}</td><td class=\"number\">{:.0}</td>",
            trial.elements, trial.iterations
        );
        if trial.is_done() {
            out += "<td>done</td></tr>\n";
        } else {
            let _ = writeln!(
                out,
                "<td class=\"reason\">{}: {}</td></tr>",
                trial.status.name(),
                escape(&trial.reason)
            );
        }
    }
    out += "</tbody></table></div></details>\n";
    out
}
