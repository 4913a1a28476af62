//! The table of cutting methods: error, time, size, and quality after 1, 10 and 100 cuts.

use std::fmt::Write as _;

use crate::design::axes::Factor;
use crate::report::html::{escape, prose, time};
use crate::result::{CaseResult, Outcome};
use crate::trial::wear::{CUTS, Wear};
use crate::words::percent;

/// The table; empty if the case does not compare methods of cutting.
pub(super) fn table(result: &CaseResult) -> String {
    let rows: Vec<&Outcome> = result.points.iter().filter(|point| !point.trial.wear.is_empty()).collect();
    if rows.is_empty() {
        return String::new();
    }
    let mut out = "<h3>The methods side by side</h3>\n".to_owned();
    let _ = writeln!(out, "<p>{}</p>", prose(&compared(&rows)));
    out += "<div class=\"scroll\"><table class=\"tight\">\n<thead><tr><th rowspan=\"2\">cutting</th>";
    let heads = ["displacement", "goal", "energy", "median", "iterations", "elements", "unknowns"];
    heads.iter().for_each(|head| {
        let _ = write!(out, "<th class=\"number\" rowspan=\"2\">{head}</th>");
    });
    let last = CUTS[CUTS.len() - 1];
    let _ = write!(
        out,
        "<th class=\"number\" colspan=\"{}\">worst element after</th><th class=\"number\" colspan=\"3\">after {last} cuts</th></tr>\n<tr>",
        CUTS.len()
    );
    for cuts in CUTS {
        let word = if cuts == 1 { "cut" } else { "cuts" };
        let _ = write!(out, "<th class=\"number\">{cuts} {word}</th>");
    }
    out += "<th class=\"number\">elements</th><th class=\"number\">nodes</th><th class=\"number\">time</th></tr></thead>\n<tbody>\n";
    for point in &rows {
        let trial = &point.trial;
        let _ = write!(out, "<tr><td>{}</td>", escape(point.configuration.label(Factor::Cutting)));
        let errors = point.errors.map(|e| [e.l2, e.goal, e.energy]);
        let mut cells: Vec<String> =
            (0..3).map(|i| errors.map_or("–".to_owned(), |e| percent(e[i]))).collect();
        cells.push(time(trial.cost.median_ms));
        cells.push(format!("{:.0}", trial.iterations));
        cells.extend([trial.elements.to_string(), trial.unknowns.to_string()]);
        let after = |cuts: usize| trial.wear.iter().find(|wear| wear.cuts == cuts);
        cells.extend(CUTS.map(|cuts| after(cuts).map_or("–".to_owned(), |w| format!("{:.3}", w.quality))));
        let last = |of: fn(&Wear) -> String| after(last).map_or("–".to_owned(), of);
        cells.extend([
            last(|w| w.elements.to_string()),
            last(|w| w.nodes.to_string()),
            last(|w| time(w.cut_ms)),
        ]);
        cells.iter().for_each(|cell| {
            let _ = write!(out, "<td class=\"number\">{cell}</td>");
        });
        out += "</tr>\n";
    }
    out += "</tbody></table></div>\n";
    let _ = writeln!(
        out,
        "<p class=\"soft\">{}</p>",
        prose(
            "The worst element is the one with the smallest mean ratio, which is 1 for a regular element and 0 \
             for a flat one. The cuts after the first are planes across the beam to random depths, the same for \
             all methods. A mesh made with its cut takes no further cuts. Meshes with their front on faces \
             degrade like the others of their method and are not repeated. `xfem` keeps the mesh and makes \
             copies of nodes, which count as unknowns. `snap` moves nodes and removes elements that become flat."
        )
    );
    out
}

/// A text on what the rows have in common, and what follows from them.
fn compared(rows: &[&Outcome]) -> String {
    let label = |factor| rows[0].configuration.label(factor);
    let mut words = format!("With law {} and tolerance {}", label(Factor::Law), label(Factor::Tolerance));
    let error = |name: &str| {
        let row = rows.iter().find(|row| row.configuration.label(Factor::Cutting) == name);
        row.and_then(|row| row.errors.map(|errors| errors.l2))
    };
    if let (Some(precut), Some(xfem), Some(snap)) = (error("precut"), error("xfem"), error("snap")) {
        let _ = write!(
            words,
            ", the error is {} on a mesh made with its cut; on a mesh made without it, the error is {} with \
             `xfem` and {} with `snap`",
            percent(precut),
            percent(xfem),
            percent(snap)
        );
        if let (Some(xfem_front), Some(snap_front)) = (error("xfem-front"), error("snap-front")) {
            let _ = write!(
                words,
                ". If the front of the cut lies on faces and only its plane inside elements, the errors are {} \
                 and {}",
                percent(xfem_front),
                percent(snap_front)
            );
            // The remaining distance to a mesh that was made with its cut.
            let left = [(xfem, xfem_front), (snap, snap_front)]
                .map(|(all, front)| (front - precut) / (all - precut));
            if xfem > precut && snap > precut && left.iter().all(|left| *left < 0.5) {
                words += ": most of the difference comes from the front, because neither method can end a cut \
                    inside an element";
            }
        }
    }
    let worn = |name: &str| {
        let row = rows.iter().find(|row| row.configuration.label(Factor::Cutting) == name)?;
        row.trial.wear.last().map(|wear| (wear.cuts, wear.quality))
    };
    if let (Some((cuts, xfem)), Some((_, snap))) = (worn("xfem"), worn("snap")) {
        let _ = write!(
            words,
            ". After {cuts} cuts the worst element has quality {xfem:.3} with `xfem` and {snap:.3} with `snap`"
        );
    }
    words + "."
}
