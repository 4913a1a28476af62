//! What every page is made of: its frame, plots, charts, pictures of bodies, and tables of measured values.

pub mod html;

pub mod style;

pub mod interactive;

pub mod scale;

pub mod plot;

pub mod chart;

pub mod view;

pub mod result;

pub mod section;

/// A self-contained page in the style of the others, with `body` as its content (HTML).
pub fn wrap(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>scindo · {}</title>\n<style>\n{}{}{}{}{}</style>\n</head>\n<body>\n<main>\n{body}</main>\n{}</body>\n</html>\n",
        html::escape(title),
        style::PAGE,
        style::COLOURS,
        style::PLOT,
        style::LINES,
        interactive::STYLE,
        interactive::SCRIPT
    )
}
