//! Typography and colours, light and dark.

/// Number of colours for marks, used in the order of a factor's settings. Colour-blind readers can tell them
/// apart, on light and on dark backgrounds (after Okabe and Ito).
pub const MARKS: usize = 6;

/// Colours as CSS variables.
pub const COLOURS: &str = "
:root, svg.plot {
  --ground: #ffffff; --ink: #1c2430; --soft: #5b6675; --rule: #d9dee5; --faint: #edf0f3; --panel: #f6f7f9;
  --front: #1c2430; --bad: #c2362b;
  --c0: #2f73c0; --c1: #d2691e; --c2: #1f9070; --c3: #9a55b5; --c4: #b8863b; --c5: #cc4f7c;
  --s0: #2f73c0; --s1: #1f9070; --s2: #d2a01e; --s3: #9a55b5; --s4: #8a94a0;
}
@media (prefers-color-scheme: dark) {
  :root, svg.plot {
    --ground: #14181e; --ink: #e6eaf0; --soft: #9aa5b3; --rule: #333c47; --faint: #222932; --panel: #1b2129;
    --front: #e6eaf0; --bad: #ff7a6b;
    --c0: #6aa5ea; --c1: #f0924e; --c2: #45c09c; --c3: #c58be0; --c4: #dcb066; --c5: #f083aa;
    --s0: #6aa5ea; --s1: #45c09c; --s2: #e5bd4d; --s3: #c58be0; --s4: #7f8a98;
  }
}
";

/// Style of the plots.
pub const PLOT: &str = "
svg.plot { display: block; width: 100%; height: auto; font: 14px/1.2 system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif; }
svg.plot .ground { fill: var(--ground); }
svg.plot text { fill: var(--ink); }
svg.plot text.soft, svg.plot text.tick { fill: var(--soft); }
svg.plot text.axis { font-weight: 600; }
svg.plot text.rank { font-size: 12px; font-weight: 700; }
svg.plot .frame { fill: none; stroke: var(--rule); }
svg.plot .grid { stroke: var(--rule); stroke-width: 1; }
svg.plot .fine { stroke: var(--faint); stroke-width: 1; }
svg.plot .lane { fill: var(--panel); }
svg.plot .unknown { fill: var(--soft); opacity: 0.14; }
svg.plot .front { fill: none; stroke: var(--front); stroke-width: 2; stroke-linejoin: round; opacity: 0.75; }
svg.plot .budget { stroke: var(--bad); stroke-width: 1.5; stroke-dasharray: 6 4; }
svg.plot .mark { stroke: var(--ground); stroke-width: 1; opacity: 0.8; }
svg.plot .mark.best { stroke: var(--front); stroke-width: 1.8; opacity: 1; }
svg.plot .failed { stroke: var(--bad); stroke-width: 1.8; stroke-linecap: round; }
svg.plot .hit { fill: transparent; stroke: none; }
svg.plot .c0 { fill: var(--c0); } svg.plot .c1 { fill: var(--c1); } svg.plot .c2 { fill: var(--c2); }
svg.plot .c3 { fill: var(--c3); } svg.plot .c4 { fill: var(--c4); } svg.plot .c5 { fill: var(--c5); }
svg.plot .key { fill: var(--soft); }
";

/// Style of the lines of charts.
pub const LINES: &str = "
svg.plot .line { fill: none; stroke-width: 1.8; stroke-linejoin: round; }
svg.plot .line.l0 { stroke: var(--c0); } svg.plot .line.l1 { stroke: var(--c1); } svg.plot .line.l2 { stroke: var(--c2); }
svg.plot .line.l3 { stroke: var(--c3); } svg.plot .line.l4 { stroke: var(--c4); } svg.plot .line.l5 { stroke: var(--c5); }
svg.plot .line.key { stroke: var(--soft); }
svg.plot .line.d1 { stroke-dasharray: 7 4; } svg.plot .line.d2 { stroke-dasharray: 2 3; }
";

/// Style of the page around the plots.
pub const PAGE: &str = "
:root { color-scheme: light dark; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 40px 28px 80px; }
h1 { font-size: 34px; line-height: 1.15; margin: 0 0 6px; letter-spacing: -0.01em; }
h2 { font-size: 25px; line-height: 1.2; margin: 64px 0 8px; padding-top: 26px; border-top: 1px solid var(--rule); }
h3 { font-size: 17px; margin: 30px 0 8px; }
p, ul, dl { max-width: 76ch; margin: 8px 0; }
.lead { font-size: 18px; color: var(--soft); }
.soft { color: var(--soft); }
.advice { border-left: 4px solid var(--c0); background: var(--panel); padding: 12px 18px; margin: 18px 0; max-width: none; }
.answer { font-size: 18px; }
.note { color: var(--soft); }
pre { background: var(--panel); padding: 12px 18px; white-space: pre-wrap; overflow-wrap: anywhere; font-size: 13px; }
figure { margin: 20px 0 8px; }
figcaption { color: var(--soft); font-size: 14.5px; max-width: 90ch; margin-top: 6px; }
.pair { display: grid; grid-template-columns: 1fr 1fr; gap: 24px; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 420px), 1fr)); gap: 18px 24px; }
.charts figure { margin: 8px 0 0; }
.scroll { overflow-x: auto; margin: 8px 0; }
@media screen and (min-width: 1160px) { .scroll { width: max-content; min-width: 100%; max-width: calc(50vw + 484px); } }
table { border-collapse: collapse; font-size: 14px; font-variant-numeric: tabular-nums; width: 100%; }
th { text-align: left; font-weight: 600; color: var(--soft); border-bottom: 1px solid var(--rule); padding: 6px 12px 6px 0; vertical-align: bottom; white-space: nowrap; }
td { border-bottom: 1px solid var(--faint); padding: 6px 12px 6px 0; vertical-align: top; white-space: nowrap; }
table.tight { font-size: 13.5px; }
table.tight th, table.tight td { padding-right: 7px; }
table.tight th { white-space: normal; }
td.reason { white-space: normal; min-width: 34ch; color: var(--bad); }
.number { text-align: right; }
th.number, td.number { padding-left: 4px; }
.bar { display: flex; width: 150px; height: 12px; border-radius: 3px; overflow: hidden; background: var(--faint); margin-top: 5px; }
.bar i { display: block; height: 100%; }
.s0 { background: var(--s0); } .s1 { background: var(--s1); } .s2 { background: var(--s2); } .s3 { background: var(--s3); } .s4 { background: var(--s4); }
.keys { display: flex; flex-wrap: wrap; gap: 4px 18px; font-size: 14px; color: var(--soft); margin: 6px 0; padding: 0; list-style: none; max-width: none; }
.keys i { display: inline-block; width: 12px; height: 12px; border-radius: 3px; margin-right: 6px; vertical-align: -1px; }
summary { cursor: pointer; font-weight: 600; margin: 18px 0 6px; }
dt { font-weight: 600; margin-top: 10px; } dd { margin: 0 0 0 0; }
code { font-size: 0.92em; }
@media (max-width: 800px) { .pair { grid-template-columns: 1fr; } main { padding: 24px 16px 60px; } }
";
