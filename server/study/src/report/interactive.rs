//! What people can do with the plots of a page: see values, switch series, change the axes.

use std::fmt::Write as _;

/// The script for the end of a page with plots.
pub const SCRIPT: &str = concat!("<script>\n", include_str!("plots.js"), "</script>\n");

/// Style of what the script adds.
pub const STYLE: &str = "
.axes { position: relative; }
.axes button { position: absolute; right: 6px; bottom: 2px; font: inherit; font-size: 12px; padding: 1px 8px; color: var(--soft); background: var(--ground); border: 1px solid var(--rule); border-radius: 4px; cursor: pointer; }
.axes button:hover, .axes button:focus-visible { color: var(--ink); border-color: var(--soft); }
svg.plot [data-toggles] { cursor: pointer; }
svg.plot [data-toggles][aria-checked=false] { opacity: 0.35; }
.tip { position: fixed; z-index: 1; max-width: 46ch; padding: 6px 10px; white-space: pre-line; pointer-events: none; font-size: 13px; line-height: 1.4; color: var(--ink); background: var(--panel); border: 1px solid var(--rule); border-radius: 4px; box-shadow: 0 2px 8px #0003; }
@media print { .tip, .axes button { display: none; } }
";

/// One plot drawn with several kinds of axes, each with its name. The first is shown; the script changes it.
pub fn axes(drawings: &[(&str, String)]) -> String {
    let mut out = "<div class=\"axes\">".to_owned();
    for (i, (name, svg)) in drawings.iter().enumerate() {
        let hidden = if i == 0 { "" } else { " hidden" };
        let _ = write!(out, "<div data-axes=\"{name}\"{hidden}>{svg}</div>");
    }
    out + "</div>"
}
