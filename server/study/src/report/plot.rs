//! A plot of error over time: points, Pareto front, failures, and the error bar of the reference.
//! Colours are CSS classes, so that they follow the light or dark theme of the page.

use std::fmt::Write as _;

use super::html::{escape, time};
use super::interactive;
use super::scale::{Scale, Spacing};
use crate::words::{percent, short};

/// A run with a result.
#[derive(Debug, Clone)]
pub struct Mark {
    /// Time per solution or frame [ms].
    pub x: f64,
    /// Relative error.
    pub y: f64,
    /// Index into the colours.
    pub colour: usize,
    /// Index into the shapes.
    pub shape: usize,
    /// Number on the Pareto front, counted from 1; `None` off the front.
    pub rank: Option<usize>,
    /// Text shown on hovering.
    pub title: String,
}

/// A run without a result.
#[derive(Debug, Clone)]
pub struct Failure {
    /// Time until the run failed [ms]; `None` if it never ran.
    pub x: Option<f64>,
    /// Text shown on hovering.
    pub title: String,
}

/// Everything that one plot shows.
#[derive(Debug, Clone)]
pub struct Plot {
    /// Width and height [px].
    pub size: [f64; 2],
    /// Label of the horizontal axis.
    pub x_label: String,
    /// Label of the vertical axis.
    pub y_label: String,
    /// Runs with a result.
    pub marks: Vec<Mark>,
    /// Runs without a result.
    pub failures: Vec<Failure>,
    /// Relative error bar of the reference.
    pub error_bar: f64,
    /// Time budget [ms], drawn as a line.
    pub budget_ms: Option<f64>,
    /// Names of the colours in use, by index.
    pub colours: Vec<(usize, String)>,
    /// Names of the shapes in use, by index.
    pub shapes: Vec<(usize, String)>,
    /// Title within the picture, for a plot that stands alone.
    pub title: Option<String>,
}

const LEFT: f64 = 86.0;
const RIGHT: f64 = 22.0;
const BOTTOM: f64 = 58.0;
const LANE: f64 = 34.0;
const ROW: f64 = 24.0;
/// Upper bound on the width of a character in a tick label [px].
const CHARACTER: f64 = 8.5;

/// Distance of a number from others that leaves both legible [px].
const ROOM: f64 = 15.0;

/// An error bar smaller than every error by this factor is not drawn.
const FAR_BELOW: f64 = 20.0;

impl Plot {
    /// The plot for a page: with logarithmic axes, and with linear ones by a button.
    pub fn html(&self) -> String {
        let linear = self.draw(Spacing::Linear);
        interactive::axes(&[("logarithmic", self.svg()), ("linear", linear)])
    }

    /// The picture as SVG with logarithmic axes, with classes of [`super::style`].
    pub fn svg(&self) -> String {
        self.draw(Spacing::Logarithmic)
    }

    fn draw(&self, spacing: Spacing) -> String {
        let [width, height] = self.size;
        let legend = self.legend();
        let title = if self.title.is_some() { 34.0 } else { 0.0 };
        let rows = legend.len() as f64;
        let top = title + 8.0 + ROW * rows;
        let lane = if self.failures.is_empty() { 0.0 } else { LANE + 8.0 };
        let (y0, y1) = (height - BOTTOM, top + lane);
        let known = self.failures.iter().filter_map(|failure| failure.x);
        let budget = self.budget_ms.into_iter();
        let xs = self.marks.iter().map(|mark| mark.x).chain(known).chain(budget);
        let x = Scale::around(xs, LEFT, width - RIGHT, spacing);
        let bar = Some(self.error_bar).filter(|_| self.shows_error_bar());
        let y = Scale::around(self.marks.iter().map(|mark| mark.y).chain(bar), y0, y1, spacing);
        let mut out = format!(
            "<svg class=\"plot\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">\n<rect class=\"ground\" width=\"{width}\" height=\"{height}\"/>\n",
            escape(&format!("{} over {}", self.y_label, self.x_label))
        );
        if let Some(title) = &self.title {
            let _ = writeln!(
                out,
                "<text x=\"{LEFT}\" y=\"24\" font-size=\"18\" font-weight=\"700\">{}</text>",
                escape(title)
            );
        }
        for (i, row) in legend.iter().enumerate() {
            let _ = writeln!(
                out,
                "<g transform=\"translate({LEFT},{})\">{row}</g>",
                title + 6.0 + ROW * (i as f64 + 0.5)
            );
        }
        self.grid(&mut out, &x, &y, (y0, y1));
        self.bands(&mut out, &x, &y, (y0, y1));
        self.front(&mut out, &x, &y, y1);
        self.points(&mut out, &x, &y, spacing == Spacing::Linear);
        if lane > 0.0 {
            self.lane(&mut out, &x, top);
        }
        out += "</svg>\n";
        out
    }

    fn grid(&self, out: &mut String, x: &Scale, y: &Scale, (y0, y1): (f64, f64)) {
        let right = self.size[0] - RIGHT;
        for (fine, class) in [(true, "fine"), (false, "grid")] {
            for tick in x.ticks().iter().filter(|tick| tick.labelled != fine) {
                let at = x.at(tick.value);
                let _ = writeln!(
                    out,
                    "<line class=\"{class}\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{y0:.1}\" y2=\"{y1:.1}\"/>"
                );
            }
            for tick in y.ticks().iter().filter(|tick| tick.labelled != fine) {
                let at = y.at(tick.value);
                let _ = writeln!(
                    out,
                    "<line class=\"{class}\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>"
                );
            }
        }
        for tick in x.ticks().iter().filter(|tick| tick.labelled) {
            let label = tick_time(tick.value);
            // Keeps a label at the end of the axis inside the picture.
            let half = 0.5 * CHARACTER * label.chars().count() as f64;
            let at = x.at(tick.value).min(self.size[0] - half);
            let _ = writeln!(
                out,
                "<text class=\"tick\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                y0 + 20.0
            );
        }
        for tick in y.ticks().iter().filter(|tick| tick.labelled) {
            let (at, label) = (y.at(tick.value), tick_percent(tick.value));
            let _ = writeln!(
                out,
                "<text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                LEFT - 9.0,
                at + 4.5
            );
        }
        let (middle, below) = (0.5 * (LEFT + right), self.size[1] - 12.0);
        let _ = writeln!(
            out,
            "<text class=\"axis\" x=\"{middle}\" y=\"{below}\" text-anchor=\"middle\">{}</text>",
            escape(&self.x_label)
        );
        let centre = 0.5 * (y0 + y1);
        let _ = writeln!(
            out,
            "<text class=\"axis\" transform=\"translate(18,{centre:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            escape(&self.y_label)
        );
        let _ = writeln!(
            out,
            "<rect class=\"frame\" x=\"{LEFT}\" y=\"{y1:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
            right - LEFT,
            y0 - y1
        );
    }

    /// Whether the error bar of the reference comes near any mark. Far below all marks, it would press them
    /// into a corner.
    fn shows_error_bar(&self) -> bool {
        let least = self.marks.iter().map(|mark| mark.y).filter(|y| *y > 0.0).fold(f64::INFINITY, f64::min);
        self.error_bar > 0.0 && !(self.error_bar * FAR_BELOW < least && least.is_finite())
    }

    /// Draws the range below the error bar, and the budget.
    fn bands(&self, out: &mut String, x: &Scale, y: &Scale, (y0, y1): (f64, f64)) {
        if self.shows_error_bar() {
            let at = y.at(self.error_bar);
            let _ = writeln!(
                out,
                "<g><rect class=\"unknown\" x=\"{LEFT}\" y=\"{at:.1}\" width=\"{:.1}\" height=\"{:.1}\"/><title>error bar of the reference: ± {}</title></g>",
                self.size[0] - RIGHT - LEFT,
                (y0 - at).max(0.0),
                percent(self.error_bar)
            );
        }
        if let Some(budget) = self.budget_ms {
            let at = x.at(budget);
            let _ = writeln!(
                out,
                "<g><line class=\"budget\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{y0:.1}\" y2=\"{y1:.1}\"/><title>budget {}</title></g>",
                time(budget)
            );
        }
    }

    fn front(&self, out: &mut String, x: &Scale, y: &Scale, y1: f64) {
        let mut best: Vec<&Mark> = self.marks.iter().filter(|mark| mark.rank.is_some()).collect();
        best.sort_by_key(|mark| mark.rank);
        let Some(first) = best.first() else { return };
        let mut path = format!("M{:.1} {y1:.1}", x.at(first.x));
        for mark in &best {
            let _ = write!(path, " H{:.1} V{:.1}", x.at(mark.x), y.at(mark.y));
        }
        let _ = write!(path, " H{:.1}", self.size[0] - RIGHT);
        let _ = writeln!(out, "<path class=\"front\" data-series=\"front\" d=\"{path}\"/>");
    }

    /// Draws the marks. Where they may be `crowded`, those of the front without room for their number have none.
    fn points(&self, out: &mut String, x: &Scale, y: &Scale, crowded: bool) {
        let (best, others): (Vec<&Mark>, Vec<&Mark>) =
            self.marks.iter().partition(|mark| mark.rank.is_some());
        let mut taken: Vec<[f64; 2]> = best.iter().map(|mark| [x.at(mark.x), y.at(mark.y)]).collect();
        for mark in others.iter().chain(&best) {
            let (px, py) = (x.at(mark.x), y.at(mark.y));
            let class = if mark.rank.is_some() { "mark best" } else { "mark" };
            let radius = if mark.rank.is_some() { 6.5 } else { 5.0 };
            let _ = writeln!(
                out,
                "<g data-series=\"{}\" transform=\"translate({px:.1},{py:.1})\"><title>{}</title>{}</g>",
                series(mark),
                escape(&mark.title),
                shape(mark.shape, radius, &format!("{class} c{}", mark.colour % super::style::MARKS))
            );
        }
        for mark in &best {
            let (Some(rank), at) = (mark.rank, [x.at(mark.x), y.at(mark.y)]) else { continue };
            let Some(place) = free_place(at, &taken, [self.size[0] - RIGHT, self.size[1] - BOTTOM], crowded)
            else {
                continue;
            };
            taken.push(place);
            let _ = writeln!(
                out,
                "<text class=\"rank\" data-series=\"{}\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{rank}</text>",
                series(mark),
                place[0],
                place[1] + 4.0
            );
        }
    }

    /// Draws runs without a result above the frame: at the time they took, or at the left if they never ran.
    fn lane(&self, out: &mut String, x: &Scale, top: f64) {
        let middle = top + 0.5 * LANE;
        let width = self.size[0] - RIGHT - LEFT;
        let _ = writeln!(
            out,
            "<rect class=\"lane\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{LANE}\" rx=\"3\"/>"
        );
        let _ = writeln!(
            out,
            "<text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">no result</text>",
            LEFT - 9.0,
            middle + 4.5
        );
        let mut never = 0.0_f64;
        for failure in &self.failures {
            let at = match failure.x {
                Some(ms) => x.at(ms),
                None => {
                    never += 1.0;
                    LEFT + (12.0 * never).min(width - 8.0)
                }
            };
            let _ = writeln!(
                out,
                "<g transform=\"translate({at:.1},{middle:.1})\"><title>{}</title><rect class=\"hit\" x=\"-7\" y=\"-7\" width=\"14\" height=\"14\"/><path class=\"failed\" d=\"M-4.5 -4.5L4.5 4.5M-4.5 4.5L4.5 -4.5\"/></g>",
                escape(&failure.title)
            );
        }
    }

    /// Rows of the legend: colours, shapes, and what lines and crosses mean.
    fn legend(&self) -> Vec<String> {
        // Mark, name, and the series that it switches.
        let mut items: Vec<(String, String, Option<String>)> = Vec::new();
        // A single shape tells nothing apart: it has no entry, and the marks of the colours are drawn in it.
        let single = self.shapes.len() < 2;
        for (i, name) in &self.colours {
            let mark = shape(
                if single { self.shapes.first().map_or(0, |s| s.0) } else { 0 },
                5.5,
                &format!("mark c{}", i % super::style::MARKS),
            );
            items.push((mark, name.clone(), Some(format!("c{i}"))));
        }
        if !single {
            for (i, name) in &self.shapes {
                items.push((shape(*i, 5.5, "mark key"), name.clone(), Some(format!("k{i}"))));
            }
        }
        // Small plots have no room to explain lines and crosses.
        if self.size[0] > 600.0 {
            let front = "<path class=\"front\" d=\"M-9 -5H0V5H9\"/>";
            items.push((front.to_owned(), "Pareto front".to_owned(), Some("front".to_owned())));
            if !self.failures.is_empty() {
                items.push((
                    "<path class=\"failed\" d=\"M-4.5 -4.5L4.5 4.5M-4.5 4.5L4.5 -4.5\"/>".to_owned(),
                    "no result".to_owned(),
                    None,
                ));
            }
            if self.shows_error_bar() {
                items.push((
                    "<rect class=\"unknown\" x=\"-9\" y=\"-6\" width=\"18\" height=\"12\"/>".to_owned(),
                    "within the error bar of the reference".to_owned(),
                    None,
                ));
            }
            if let Some(budget) = self.budget_ms {
                items.push((
                    "<line class=\"budget\" x1=\"0\" x2=\"0\" y1=\"-9\" y2=\"9\"/>".to_owned(),
                    format!("budget {}", time(budget)),
                    None,
                ));
            }
        }
        let mut rows = Vec::new();
        let (mut row, mut at) = (String::new(), 0.0);
        for (mark, name, series) in items {
            let toggles = series.map_or(String::new(), |series| format!("data-toggles=\"{series}\" "));
            // SVG breaks no lines, so the width of a name is estimated from its number of characters.
            let width = 24.0 + 7.6 * name.chars().count() as f64 + 18.0;
            if at + width > self.size[0] - LEFT - RIGHT && at > 0.0 {
                rows.push(std::mem::take(&mut row));
                at = 0.0;
            }
            let _ = write!(
                row,
                "<g {toggles}transform=\"translate({:.1},0)\">{mark}<text x=\"15\" y=\"4.5\">{}</text></g>",
                at + 9.0,
                escape(&name)
            );
            at += width;
        }
        rows.push(row);
        rows
    }
}

/// The series of a mark, by which the legend switches it.
fn series(mark: &Mark) -> String {
    format!("c{} k{}", mark.colour, mark.shape)
}

/// Draws a shape around the origin.
fn shape(index: usize, r: f64, class: &str) -> String {
    match index % 6 {
        0 => format!("<circle class=\"{class}\" r=\"{r}\"/>"),
        1 => format!(
            "<rect class=\"{class}\" x=\"{0}\" y=\"{0}\" width=\"{1}\" height=\"{1}\"/>",
            -0.88 * r,
            1.76 * r
        ),
        2 => {
            format!("<path class=\"{class}\" d=\"M0 {}L{} {}H{}Z\"/>", -1.15 * r, 1.1 * r, 0.85 * r, -1.1 * r)
        }
        3 => format!("<path class=\"{class}\" d=\"M0 {0}L{1} 0L0 {1}L{0} 0Z\"/>", -1.25 * r, 1.25 * r),
        4 => {
            format!("<path class=\"{class}\" d=\"M0 {}L{} {}H{}Z\"/>", 1.15 * r, 1.1 * r, -0.85 * r, -1.1 * r)
        }
        _ => format!(
            "<rect class=\"{class}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>",
            -1.2 * r,
            -0.55 * r,
            2.4 * r,
            1.1 * r
        ),
    }
}

/// A position beside `at` within the frame, away from the positions in `taken`. Where it may be `crowded`, there is none
/// if others are too near.
fn free_place(
    at: [f64; 2],
    taken: &[[f64; 2]],
    [right, bottom]: [f64; 2],
    crowded: bool,
) -> Option<[f64; 2]> {
    let around = [
        [-12.0, 12.0],
        [12.0, -12.0],
        [-15.0, 0.0],
        [15.0, 0.0],
        [0.0, 16.0],
        [0.0, -16.0],
        [12.0, 12.0],
        [-12.0, -12.0],
    ];
    let clear = |place: &[f64; 2]| {
        let others = taken.iter().filter(|other| **other != at);
        others.map(|o| (o[0] - place[0]).hypot(o[1] - place[1])).fold(30.0, f64::min)
    };
    let places = around.map(|[dx, dy]| [at[0] + dx, at[1] + dy]);
    let inside = |p: &&[f64; 2]| p[0] > LEFT + 6.0 && p[0] < right - 6.0 && p[1] < bottom - 6.0;
    let best = places.iter().filter(inside).fold(None, |best: Option<([f64; 2], f64)>, place| {
        let c = clear(place);
        if best.is_none_or(|(_, b)| c > b) { Some((*place, c)) } else { best }
    });
    match best {
        Some((_, clear)) if crowded && clear < ROOM => None,
        Some((place, _)) => Some(place),
        None => Some(places[0]),
    }
}

/// Label for a time on an axis.
fn tick_time(milliseconds: f64) -> String {
    if milliseconds == 0.0 {
        return "0".to_owned();
    }
    let (value, unit) = if milliseconds >= 999.0 {
        (milliseconds / 1e3, "s")
    } else if milliseconds >= 0.0999 {
        (milliseconds, "ms")
    } else {
        (milliseconds * 1e3, "µs")
    };
    format!("{} {unit}", short(value))
}

fn tick_percent(error: f64) -> String {
    let value = 100.0 * error;
    if value > 0.0 && value < 0.9e-3 { format!("{value:.0e} %") } else { format!("{} %", short(value)) }
}
