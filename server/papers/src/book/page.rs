//! The pages of the book.

use std::fmt::Write as _;

use scindo_study::bench::store::Origin;
use scindo_study::report::frame;
use scindo_study::report::html::{escape, prose, time};
use scindo_study::report::result::Unit;
use scindo_study::words::compact;
use scindo_world::results::Machine;
use serde_json::Value;

use super::Tally;
use super::catalogue::{Number, Paper};
use super::measured::Measured;
use super::part::{Kind, Part};
use super::verdict::{Verdict, judge, reason};

/// File of the page of a paper.
pub(super) fn name(paper: &Paper) -> String {
    format!("paper-{}.html", paper.id)
}

/// Colours of the verdicts.
const STYLE: &str = "
.verdict { font-weight: 600; }
.v0 { color: var(--c2); } .v1 { color: var(--c0); } .v2 { color: var(--c3); } .v3 { color: var(--soft); } .v4 { color: var(--bad); } .v5 { color: var(--soft); font-weight: 400; }
.filter label { margin-right: 14px; white-space: nowrap; }
.tight td:first-child { padding-right: 16px; }
.filter b { font-weight: 600; }
td.wrap { white-space: normal; min-width: 22ch; }
td.why { white-space: normal; min-width: 30ch; color: var(--soft); }
.tally { display: flex; height: 12px; width: 220px; border-radius: 3px; overflow: hidden; background: var(--faint); margin-top: 6px; }
.tally i { display: block; height: 100%; }
.b0 { background: var(--c2); } .b1 { background: var(--c0); } .b2 { background: var(--c3); } .b3 { background: var(--s4); } .b4 { background: var(--bad); } .b5 { background: transparent; }
@media print { .filter { display: none; } a { color: inherit; text-decoration: none; } }
";

/// Hides rows of verdicts that are switched off.
const FILTER: &str = "<script>
for (const box of document.querySelectorAll('.filter input'))
  box.addEventListener('change', () => {
    for (const row of document.querySelectorAll(`tr[data-verdict=\"${box.value}\"]`)) row.hidden = !box.checked;
  });
</script>
";

fn verdict_class(verdict: Verdict) -> usize {
    Verdict::ALL.iter().position(|v| *v == verdict).unwrap_or(0)
}

fn machine(origin: &Origin) -> String {
    let Machine { system, processor, threads, optimised } = &origin.machine;
    let note = if *optimised { "" } else { ", built without optimisation" };
    format!("{processor}, {threads} hardware threads, {system}{note}")
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The page of a paper: a row per printed number.
pub(super) fn paper(paper: &Paper, measured: &Measured, origin: &Origin, quick: bool) -> String {
    let mut out = format!(
        "<p><a href=\"index.html\">The book</a></p>\n<header><h1>{}</h1>\n<p class=\"lead\">{}, {}</p></header>\n\
         <p>{}</p>\n<p class=\"note\">Printed: {}. Here: {}.",
        escape(&paper.title),
        escape(&paper.authors),
        paper.year,
        prose(&paper.about),
        escape(&paper.machine),
        escape(&machine(origin))
    );
    if paper.core > 1.0 {
        let _ = write!(
            out,
            " A core of today is assumed to run the same scalar code {} times as fast (± 40 %). Times and rates count as \
             better only beyond that factor; the column <em>at equal cores</em> has it taken out.",
            compact(paper.core)
        );
    }
    if quick {
        out += " This is the quick form of the book: what only the whole form measures is <em>not yet</em> there.";
    }
    out += "</p>\n<p class=\"filter\">";
    for verdict in Verdict::ALL {
        let count =
            paper.number.iter().filter(|n| judge(paper, n, measured.of(paper, n, quick)) == verdict).count();
        let _ = write!(
            out,
            "<label><input type=\"checkbox\" checked value=\"{0}\"> <span class=\"verdict v{1}\">{0}</span> {count}</label>",
            verdict.name(),
            verdict_class(verdict)
        );
    }
    out += "</p>\n<div class=\"scroll\"><table class=\"tight\">\n<thead><tr><th>where</th><th>what</th>\
            <th class=\"number\">paper</th><th class=\"number\">here</th><th class=\"number\">ratio</th>\
            <th class=\"number\">at equal cores</th><th>verdict</th><th>command</th></tr></thead>\n<tbody>\n";
    for number in &paper.number {
        out += &row(paper, number, measured, quick);
    }
    out += "</tbody></table></div>\n";
    out += FILTER;
    frame::page(&paper.title, STYLE, &out)
}

fn row(paper: &Paper, number: &Number, measured: &Measured, quick: bool) -> String {
    let ours = measured.of(paper, number, quick);
    let verdict = judge(paper, number, ours);
    let class = verdict_class(verdict);
    let ratio =
        |to: f64| ours.filter(|_| to != 0.0).map_or("–".to_owned(), |ours| Unit::Times.show(ours / to));
    let bar = number.bar(paper);
    let equal = if bar == number.printed { String::new() } else { ratio(bar) };
    let missing = "not part of this form, or not run";
    let why = reason(number, verdict).or(Some(missing).filter(|_| ours.is_none())).unwrap_or_default();
    let mut out = format!(
        "<tr data-verdict=\"{}\"><td>{}</td><td class=\"wrap\">{}</td><td class=\"number\">{}</td>\
         <td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{equal}</td>\
         <td class=\"wrap\"><span class=\"verdict v{class}\">{}</span>",
        verdict.name(),
        escape(&number.place),
        escape(&number.what),
        number.unit().show(number.printed),
        ours.map_or("–".to_owned(), |ours| number.unit().show(ours)),
        ratio(number.printed),
        verdict.name(),
    );
    if !why.is_empty() && verdict != Verdict::Reproduced && verdict != Verdict::Better {
        let _ = write!(out, ": <span class=\"soft\">{}</span>", prose(why));
    }
    if measured.on_fewer_cores(paper, number, quick).is_some() {
        out += ": <span class=\"soft\">on fewer cores</span>";
    }
    let command = number.command(quick).map_or(String::new(), |c| format!("<code>{}</code>", escape(&c)));
    let _ = writeln!(out, "</td><td>{command}</td></tr>");
    out
}

/// The index: papers with their tallies, and the parts with their pages.
pub(super) fn index(
    papers: &[Paper],
    tallies: &[Tally],
    parts: &[Part],
    measured: &Measured,
    (origin, quick): (&Origin, bool),
) -> String {
    let mut out = format!(
        "<header><h1>The price list</h1>\n<p class=\"lead\">Every number that the five papers print, beside what \
         this program does on this machine{}.</p></header>\n<p class=\"note\">{}; version {}, commit {}.</p>\n",
        if quick { ", in the quick form" } else { "" },
        escape(&machine(origin)),
        escape(&origin.version),
        escape(&origin.commit)
    );
    out += "<h2>Papers</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>paper</th>";
    for verdict in Verdict::ALL {
        let _ = write!(
            out,
            "<th class=\"number\"><span class=\"verdict v{}\">{}</span></th>",
            verdict_class(verdict),
            verdict.name()
        );
    }
    out += "<th>rows</th></tr></thead>\n<tbody>\n";
    for (paper, tally) in papers.iter().zip(tallies) {
        let total: usize = tally.counts.iter().sum();
        let _ = write!(
            out,
            "<tr><td class=\"wrap\"><a href=\"{}\">{}</a><br><span class=\"soft\">{}, {}</span></td>",
            name(paper),
            escape(&paper.title),
            escape(&paper.authors),
            paper.year
        );
        tally.counts.iter().for_each(|count| {
            let _ = write!(out, "<td class=\"number\">{count}</td>");
        });
        out += "<td><div class=\"tally\">";
        // The bar shows shares, so that papers with few and with many numbers compare.
        for (i, count) in tally.counts.iter().enumerate() {
            let _ = write!(
                out,
                "<i class=\"b{i}\" style=\"width:{:.2}%\"></i>",
                100.0 * *count as f64 / total.max(1) as f64
            );
        }
        out += "</div></td></tr>\n";
    }
    out += "</tbody></table></div>\n<p class=\"soft\">Reproduced: the value agrees. Better: on the better side, on equal \
            cores where these matter. Refuted: the printed value cannot be right, with the reason. Explained: another \
            value, with the reason, and neither is better. Not yet: no measurement.</p>\n";
    out += "<h2>Studies</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>study</th><th>result</th>\
            <th class=\"number\">took</th><th>report</th></tr></thead>\n<tbody>\n";
    // Parts that were not run are listed, too: the book tells what is missing.
    for part in parts {
        let made = measured.report(&part.name);
        // Effects of all scenes share a page, on which each has its place.
        let title = match (made, part.has_page()) {
            (Some(_), true) => format!("<a href=\"{}/index.html\">{}</a>", part.name, prose(&part.title)),
            (Some(_), false) => format!("<a href=\"effects.html#{}\">{}</a>", part.name, prose(&part.title)),
            (None, _) => prose(&part.title),
        };
        // Relative to the index, so that the book can be moved as a whole.
        let report = part.report(std::path::Path::new("")).display().to_string();
        let link = made.map_or(String::new(), |_| format!("<a href=\"{report}\">JSON</a>"));
        let took = match measured.seconds(&part.name) {
            Some(seconds) => time(1e3 * seconds),
            None => "–".to_owned(),
        };
        let _ = writeln!(
            out,
            "<tr><td class=\"wrap\">{title}</td><td class=\"wrap\">{}</td><td class=\"number\">{took}</td><td>{link}</td></tr>",
            made.map_or("not run yet".to_owned(), |report| escape(&summary(part.kind, report)))
        );
    }
    out += "</tbody></table></div>\n";
    out += &haptics(measured);
    frame::page("the price list", STYLE, &out)
}

/// The result of a part in a few words.
fn summary(kind: Kind, report: &Value) -> String {
    let count = |list: &Value| list.as_array().map_or(0, Vec::len);
    match kind {
        Kind::Stress => format!("{} passed, {} failed", report["passed"], report["failed"]),
        Kind::Haptics => {
            let out = |cell: &&Value| count(&cell["failures"]) > 0;
            let cells = report["cells"].as_array().map(Vec::as_slice).unwrap_or_default();
            format!("{} of {} cells in bounds", cells.len() - cells.iter().filter(out).count(), cells.len())
        }
        Kind::Effects => format!("{} ms per step", compact(report["step_ms"].as_f64().unwrap_or(f64::NAN))),
        Kind::Accuracy => {
            let experiments = report["experiments"].as_array().map(Vec::as_slice).unwrap_or_default();
            let cases = report["cases"].as_array().map(Vec::as_slice).unwrap_or_default();
            let trouble = experiments.iter().find_map(|made| made["trouble"].as_str());
            let points: u64 = cases.iter().filter_map(|case| case["counts"]["points"].as_u64()).sum();
            match (trouble, cases.is_empty()) {
                (Some(trouble), _) => format!("no result: {trouble}"),
                (None, false) => format!("{points} configurations"),
                (None, true) => {
                    let tables: usize = experiments.iter().map(|made| count(&made["tables"])).sum();
                    format!("{tables} table{}", if tables == 1 { "" } else { "s" })
                }
            }
        }
    }
}

/// The table of what a hand feels.
fn haptics(measured: &Measured) -> String {
    let Some(cells) = measured.report("haptics").and_then(|report| report["cells"].as_array()) else {
        return String::new();
    };
    let mut out = "<h2>What a hand feels</h2>\n<p class=\"soft\">Force of the haptic client against the same tissue \
                   solved at 1 kHz without a link.</p>\n<div class=\"scroll\"><table class=\"tight\">\n<thead><tr>\
                   <th>hand</th><th class=\"number\">round trip [ms]</th><th class=\"number\">loss</th>\
                   <th class=\"number\">error, 95th percentile [%]</th><th class=\"number\">largest step [N]</th>\
                   <th>in bounds</th></tr></thead>\n<tbody>\n"
        .to_owned();
    for cell in cells {
        let figure = |key: &str, by: f64| compact(by * cell["figures"][key].as_f64().unwrap_or(f64::NAN));
        let inside = cell["failures"].as_array().is_none_or(Vec::is_empty);
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
             <td class=\"number\">{}</td><td>{}</td></tr>",
            escape(&plain(&cell["hand"])),
            plain(&cell["round_trip_ms"]),
            plain(&cell["loss"]),
            figure("error_p95", 1e2),
            figure("step_n", 1.0),
            if inside { "yes" } else { "<span class=\"verdict v4\">no</span>" }
        );
    }
    out + "</tbody></table></div>\n"
}

/// What the effects of the scenes cost.
pub(super) fn effects(measured: &Measured) -> String {
    let mut out = "<p><a href=\"index.html\">The book</a></p>\n<header><h1>What effects cost</h1>\n<p class=\"lead\">Processor \
                   time of a step with an effect and without it, on one thread.</p></header>\n"
        .to_owned();
    for (part, report) in measured.effects() {
        let number = |value: &Value| value.as_f64().filter(|ms| *ms > 0.0).map_or(String::new(), compact);
        let _ = write!(
            out,
            "<h2 id=\"{part}\">{}</h2>\n<p>{} ms per step, the median of {}.</p>\n<div class=\"scroll\"><table \
             class=\"tight\">\n<thead><tr><th>effect</th><th></th><th class=\"number\">predicted [ms]</th>\
             <th class=\"number\">measured [ms]</th><th class=\"number\">off saves [ms]</th><th>why</th></tr></thead>\n<tbody>\n",
            escape(&plain(&report["scene"])),
            number(&report["step_ms"]),
            report["steps"]
        );
        for row in report["effects"].as_array().into_iter().flatten() {
            let saved = &row["off"];
            let saves = match saved["saves_ms"].as_f64() {
                Some(ms) => format!("{} ± {}", compact(ms), number(&saved["standard_error_ms"])),
                None => String::new(),
            };
            let _ = writeln!(
                out,
                "<tr><td>{}</td><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
                 <td class=\"number\">{saves}</td><td class=\"why\">{}</td></tr>",
                escape(&plain(&row["name"])),
                if row["on"] == true { "on" } else { "off" },
                number(&row["predicted_ms"]),
                number(&row["measured_ms"]),
                escape(&plain(&row["why"]))
            );
        }
        out += "</tbody></table></div>\n";
    }
    frame::page("what effects cost", STYLE, &out)
}
