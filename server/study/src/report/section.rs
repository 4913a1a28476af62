//! The section of an experiment: tables, plots, pictures.

use std::fmt::Write as _;

use super::html::{escape, prose};
use super::result::{ExperimentResult, Row, Table};

/// The whole section as HTML.
pub fn section(result: &ExperimentResult) -> String {
    let mut out = format!(
        "<section id=\"{0}\">\n<h2>{1}</h2>\n<p>{2}</p>\n",
        result.name,
        escape(&result.title),
        prose(&result.about)
    );
    if let Some(trouble) = &result.trouble {
        let _ = writeln!(out, "<p class=\"advice\"><strong>No result.</strong> {}.</p>", escape(trouble));
    }
    for note in &result.notes {
        let _ = writeln!(out, "<p class=\"note\">{}.</p>", prose(note));
    }
    result.tables.iter().for_each(|t| out += &table(t));
    for plots in &result.plots {
        out += "<figure>\n<div class=\"pair\">\n";
        plots.plots.iter().for_each(|plot| out += &plot.html());
        for chart in &plots.charts {
            let _ = writeln!(out, "<div><strong>{}</strong>{}</div>", escape(&chart.title), chart.html());
        }
        let _ = writeln!(out, "</div>\n<figcaption>{}</figcaption>\n</figure>", prose(&plots.caption));
    }
    if !result.pictures.is_empty() {
        out += "<div class=\"pair\">\n";
        for picture in &result.pictures {
            out += &picture.figure();
        }
        out += "</div>\n";
    }
    out + "</section>\n"
}

fn table(table: &Table) -> String {
    let mut out = format!(
        "<h3>{}</h3>\n<p class=\"soft\">{}</p>\n<div class=\"scroll\"><table class=\"tight\">\n<thead><tr><th></th>",
        escape(&table.title),
        prose(&table.about)
    );
    for column in &table.columns {
        let _ = write!(out, "<th class=\"number\">{}</th>", escape(column.name));
    }
    out += "</tr></thead>\n<tbody>\n";
    for row in &table.rows {
        out += &line(table, row);
    }
    out + "</tbody></table></div>\n"
}

fn line(table: &Table, row: &Row) -> String {
    let class = if row.printed { " class=\"soft\"" } else { "" };
    let mut out = format!("<tr{class}><td>{}</td>", escape(&row.name));
    for (column, value) in table.columns.iter().zip(&row.values) {
        let _ = write!(
            out,
            "<td class=\"number\">{}</td>",
            value.map_or("–".to_owned(), |value| column.unit.show(value))
        );
    }
    out + "</tr>\n"
}
