//! The page: an overview with a row per case, then a section per case with figures, charts and pictures.

use std::fmt::Write as _;

use scindo_study::report::frame::page;
use scindo_study::report::html::{escape, prose};
use scindo_study::words::compact;

use super::case::{CaseReport, Status};
use super::evidence::{Bound, Figure};
use super::mutation::Row;
use super::suite::SuiteReport;

/// Style of status marks, chart lines and case cards.
const STYLE: &str = "
.state { display: inline-block; min-width: 66px; padding: 1px 9px; border-radius: 10px; font-size: 13px; font-weight: 600; text-align: center; color: #fff; }
.state.passed { background: #1f7a4d; } .state.failed { background: #b3261e; }
.whole, p code { white-space: nowrap; }
table.glance td:nth-child(3) { white-space: normal; min-width: 30ch; }
table.glance td:nth-child(4) { white-space: normal; color: var(--soft); }
td.out { color: var(--bad); font-weight: 600; }
table.figures { width: auto; min-width: 60%; }
table.figures td:first-child { white-space: normal; }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(260px, 1fr)); gap: 12px 24px; }
.pictures figure { margin: 8px 0 0; }
h2 .state { vertical-align: 4px; margin-left: 10px; }
";

/// The page as one self-contained file.
pub(super) fn html(report: &SuiteReport, table: Option<&[Row]>) -> String {
    let mut body = opening(report) + &glance(report);
    body.extend(table.map(mutations));
    body.extend(report.cases.iter().map(section));
    body += &closing(report);
    page("hard cases", STYLE, &body)
}

fn opening(report: &SuiteReport) -> String {
    let machine = &report.origin.machine;
    let mut out = format!(
        "<header>\n<h1>Hard cases</h1>\n<p class=\"lead\">{} passed, {} failed · scindo {} · commit {} · {}</p>\n",
        report.count(Status::Passed),
        report.count(Status::Failed),
        escape(&report.origin.version),
        escape(&report.origin.commit),
        escape(&machine.processor)
    );
    if report.interrupted {
        out += "<p class=\"advice\"><strong>Interrupted.</strong> Only completed cases are listed.</p>\n";
    }
    out += "<p>These cases break codes for deformation and cutting: slivers, cuts exactly through nodes, \
            fragments in free fall, inverted and collapsed bodies, steps far too large, meaningless input. Each \
            case has a rule that it passes or fails. Cases marked <strong>C</strong> also keep the common rule: \
            everything is finite; mass is constant to 1e-12; the momentum of free parts is balanced to 1e-6; \
            energy never exceeds that of the start plus the work done by more than one percent; and every step \
            that is held, refused or divided is reported.</p>\n</header>\n";
    out
}

fn state(status: Status) -> String {
    format!("<span class=\"state {0}\">{0}</span>", status.name())
}

fn number(report: &CaseReport) -> String {
    report.case.number.map_or(String::new(), |number| number.to_string())
}

fn glance(report: &SuiteReport) -> String {
    let mut out = "<div class=\"scroll\"><table class=\"glance\">\n<thead><tr><th class=\"number\">no.</th><th></th><th>case</th><th>closest to its bound, or why it failed</th></tr></thead>\n<tbody>\n".to_owned();
    for case in &report.cases {
        let told = match case.status {
            Status::Failed => case.failures().into_iter().next().unwrap_or_default(),
            Status::Passed => closest(&case.evidence.figures).map_or(String::new(), Figure::words),
        };
        let _ = writeln!(
            out,
            "<tr><td class=\"number\">{}</td><td>{}</td><td><a href=\"#{}\">{}</a></td><td>{}</td></tr>",
            number(case),
            state(case.status),
            case.case.name,
            whole(case.case.title),
            whole(&told)
        );
    }
    out += "</tbody></table></div>\n";
    out
}

/// Prose whose powers of ten do not break at their sign.
fn whole(text: &str) -> String {
    let is_power = |word: &str| {
        word.split_once("e-").is_some_and(|(digits, exponent)| {
            [digits.chars().last(), exponent.chars().next()].iter().flatten().all(char::is_ascii_digit)
        })
    };
    let word = |word: &str| match is_power(word) {
        true => format!("<span class=\"whole\">{word}</span>"),
        false => word.to_owned(),
    };
    prose(text).split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// The figure that uses most of what its bound allows, preferably one of the case's own rule.
fn closest(figures: &[Figure]) -> Option<&Figure> {
    let used = |figure: &&Figure| match figure.bound {
        Bound::AtMost(bound) if bound > 0.0 => figure.value / bound,
        Bound::AtLeast(bound) if bound > 0.0 => bound / figure.value,
        _ => 0.0,
    };
    let most = |own: bool| {
        let held = |f: &&Figure| f.bound != Bound::Told && f.name.starts_with("C: ") != own;
        figures.iter().filter(held).max_by(|a, b| used(a).total_cmp(&used(b)))
    };
    most(true).or_else(|| most(false))
}

fn section(report: &CaseReport) -> String {
    let case = report.case;
    let title = case.number.map_or(case.title.to_owned(), |number| format!("{number}. {}", case.title));
    let mut out = format!(
        "<section id=\"{}\">\n<h2>{} {}</h2>\n<p>{}</p>\n<p><strong>Passes if:</strong> {}</p>\n<p class=\"soft\">Source: {} · <code>scindo stress --case {}</code></p>\n",
        case.name,
        whole(&title),
        state(report.status),
        whole(case.set_up),
        whole(case.rule),
        prose(case.source),
        case.name
    );
    if let Some(reason) = &report.reason {
        let _ = writeln!(out, "<p class=\"advice\">The case did not complete: {}</p>", escape(reason));
    }
    let evidence = &report.evidence;
    evidence.notes.iter().for_each(|note| {
        let _ = writeln!(out, "<p>{}</p>", prose(note));
    });
    if !evidence.pictures.is_empty() {
        out += "<div class=\"pictures\">\n";
        for picture in &evidence.pictures {
            out += &picture.figure();
        }
        out += "</div>\n";
    }
    let drawn: Vec<String> = evidence.charts.iter().map(|chart| chart.html()).collect();
    if drawn.iter().any(|svg| !svg.is_empty()) {
        out += "<div class=\"charts\">\n";
        for (svg, chart) in drawn.iter().zip(&evidence.charts).filter(|(svg, _)| !svg.is_empty()) {
            let _ = writeln!(out, "<figure>{svg}<figcaption>{}</figcaption></figure>", escape(&chart.title));
        }
        out += "</div>\n";
    }
    out += &figures(&evidence.figures, report.status == Status::Failed);
    out += "</section>\n";
    out
}

/// All figures, folded away unless one of them is out of bounds.
fn figures(figures: &[Figure], open: bool) -> String {
    if figures.is_empty() {
        return String::new();
    }
    let mut out = format!(
        "<details{}><summary>{} figures with their bounds</summary>\n<div class=\"scroll\"><table class=\"figures\">\n<thead><tr><th>figure</th><th class=\"number\">value</th><th class=\"number\">bound</th></tr></thead>\n<tbody>\n",
        if open { " open" } else { "" },
        figures.len()
    );
    for figure in figures {
        let bound = match figure.bound {
            Bound::AtMost(bound) => format!("≤ {}", compact(bound)),
            Bound::AtLeast(bound) => format!("≥ {}", compact(bound)),
            Bound::Exactly(bound) => format!("= {}", compact(bound)),
            Bound::Told => String::new(),
        };
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td class=\"number{}\">{} {}</td><td class=\"number\">{bound}</td></tr>",
            escape(&figure.name),
            if figure.holds() { "" } else { " out" },
            compact(figure.value),
            figure.unit
        );
    }
    out += "</tbody></table></div></details>\n";
    out
}

fn mutations(rows: &[Row]) -> String {
    let mut out = "<section id=\"mutations\">\n<h2>Can the cases fail?</h2>\n<p>One part of the method is disabled at a time, and all cases are run again. The named cases must fail.</p>\n<div class=\"scroll\"><table>\n<thead><tr><th>without</th><th>instead</th><th>named cases</th><th></th><th>cases that fail</th></tr></thead>\n<tbody>\n"
        .to_owned();
    for row in rows {
        let failed: Vec<String> =
            row.failed.iter().map(|f| format!("<strong>{}</strong>: {}", f.name, escape(&f.why))).collect();
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td style=\"white-space:normal\">{}</td><td>{}</td><td>{}</td><td style=\"white-space:normal\">{}</td></tr>",
            row.mutation.name(),
            escape(row.mutation.words()),
            row.mutation.named().join("<br>"),
            if row.caught() { "caught" } else { "<strong>missed</strong>" },
            failed.join("<br>")
        );
    }
    out += "</tbody></table></div>\n</section>\n";
    out
}

fn closing(report: &SuiteReport) -> String {
    let machine = &report.origin.machine;
    let slow = report.cases.iter().zip(&report.case_seconds).max_by(|a, b| a.1.total_cmp(b.1));
    let slow = slow
        .map_or(String::new(), |(case, s)| format!("; the longest case, {}, took {s:.0} s", case.case.name));
    format!(
        "<section id=\"run\">\n<h2>This run</h2>\n<p>{:.0} s on {}, {}, {} hardware threads, {}{slow}. Figures, \
        charts and pictures are the same on every run. The results in machine-readable form: \
        <code>stress.json</code>.</p>\n</section>\n",
        report.seconds,
        escape(&machine.processor),
        escape(&machine.system),
        machine.threads,
        if machine.optimised { "release build" } else { "development build" },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_ten_stay_whole_and_commands_are_code() {
        let power = "<span class=\"whole\">1e-6</span>";
        assert_eq!(whole("1e-6 of `scindo a dick-b`"), format!("{power} of <code>scindo a dick-b</code>"));
        assert_eq!(whole("tree-trunk & root"), "tree-trunk &amp; root");
    }
}
