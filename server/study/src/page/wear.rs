//! The table of cutting methods: error, time, size, and quality after 1, 10 and 100 cuts.

use std::fmt::Write as _;

use super::{escape, time};
use crate::axes::Factor;
use crate::recommend::percent;
use crate::study::{CaseResult, Outcome};
use crate::wear::{CUTS, Wear};

/// The table; empty where a case compares no methods of cutting.
pub fn table(result: &CaseResult) -> String {
    let rows: Vec<&Outcome> = result.points.iter().filter(|point| !point.trial.wear.is_empty()).collect();
    if rows.is_empty() {
        return String::new();
    }
    let mut out =
        "<h3>The methods side by side</h3>\n<div class=\"scroll\"><table>\n<thead><tr><th>cutting</th>"
            .to_owned();
    let heads = ["displacement", "goal", "energy", "median", "iterations", "elements", "unknowns"];
    heads.iter().for_each(|head| {
        let _ = write!(out, "<th class=\"number\">{head}</th>");
    });
    for cuts in CUTS {
        let word = if cuts == 1 { "cut" } else { "cuts" };
        let _ = write!(out, "<th class=\"number\">worst element after {cuts} {word}</th>");
    }
    out += "<th class=\"number\">elements, nodes then</th><th class=\"number\">cutting took</th></tr></thead>\n<tbody>\n";
    for point in rows {
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
        let last = trial.wear.last();
        let size = |w: &Wear| format!("{}, {}", w.elements, w.nodes);
        cells.push(last.map_or(String::new(), size));
        cells.push(last.map_or(String::new(), |w| time(w.cut_ms)));
        cells.iter().for_each(|cell| {
            let _ = write!(out, "<td class=\"number\">{cell}</td>");
        });
        out += "</tr>\n";
    }
    out += "</tbody></table></div>\n<p class=\"soft\">The worst element is told by its mean ratio: 1 regular, 0 flat. \
            The cuts after the first are planes across the beam to random depths, the same for all; a mesh that \
            was made with its cut takes no further one. Inside the elements, `xfem` leaves the mesh as it was and \
            makes copies of nodes; `snap` moves nodes.</p>\n";
    out
}
