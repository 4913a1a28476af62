//! Line charts over time as SVG, in the colours of the page.

use std::fmt::Write as _;

use super::html::escape;
use super::interactive;
use super::scale::round_step;

/// One line of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Name in the legend; empty: it does not stand there.
    pub name: String,
    /// Points (x, y), in the units of the axes.
    pub points: Vec<[f64; 2]>,
}

/// Several lines over one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Title of the chart.
    pub title: String,
    /// Label of the horizontal axis, with its unit.
    pub x_label: String,
    /// Label of the vertical axis, with its unit.
    pub y_label: String,
    /// The curves, each with its name.
    pub lines: Vec<Line>,
    /// Whether the vertical axis is logarithmic at first.
    pub logarithmic: bool,
}

const WIDTH: f64 = 520.0;
const LEFT: f64 = 72.0;
const RIGHT: f64 = 14.0;
const HEIGHT: f64 = 230.0;
const BOTTOM: f64 = 46.0;
const ROW: f64 = 19.0;
/// Longer lines are thinned to this many points.
const POINTS: usize = 240;
/// Number of colours.
const COLOURS: usize = 6;
/// Suffixes of the names of the two energies of a run.
const KINETIC: &str = ", kinetic";
const ELASTIC: &str = ", elastic";

impl Chart {
    /// A chart without lines.
    pub fn new(title: &str, x_label: &str, y_label: &str) -> Self {
        Self {
            title: title.to_owned(),
            x_label: x_label.to_owned(),
            y_label: y_label.to_owned(),
            lines: Vec::new(),
            logarithmic: false,
        }
    }

    /// The chart for a page; a button changes its vertical axis. Empty if there is nothing to draw.
    pub fn html(&self) -> String {
        let first = self.svg();
        let other = self.draw(!self.logarithmic);
        let name = |logarithmic| if logarithmic { "logarithmic" } else { "linear" };
        let mut drawings = vec![(name(self.logarithmic), first), (name(!self.logarithmic), other)];
        drawings.retain(|(_, svg)| !svg.is_empty());
        match &drawings[..] {
            [] => String::new(),
            drawings => interactive::axes(drawings),
        }
    }

    /// The chart as SVG; empty if there is nothing to draw.
    pub fn svg(&self) -> String {
        self.draw(self.logarithmic)
    }

    fn draw(&self, logarithmic: bool) -> String {
        let usable = |p: &&[f64; 2]| p[0].is_finite() && p[1].is_finite() && (!logarithmic || p[1] > 0.0);
        let points = || self.lines.iter().flat_map(|line| &line.points).filter(usable);
        if points().next().is_none() {
            return String::new();
        }
        // A logarithmic axis is a linear one of exponents.
        let height = |y: f64| if logarithmic { y.log10() } else { y };
        let x = Axis::around(points().map(|p| p[0]), false, (LEFT, WIDTH - RIGHT));
        // The legend adds to the height, so that the frame has the same size whatever stands above it.
        let legend = self.legend();
        let top = 10.0 + ROW * legend.len() as f64;
        let total = HEIGHT + top;
        let bottom = total - BOTTOM;
        let y = Axis::around(points().map(|p| height(p[1])), !logarithmic, (bottom, top));
        let mut out = format!(
            "<svg class=\"plot\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {total}\" role=\"img\" aria-label=\"{}\" data-x=\"{}\" data-x-label=\"{}\" data-y=\"{}\" data-y-label=\"{}\"{}>\n<rect class=\"ground\" width=\"{WIDTH}\" height=\"{total}\"/>\n",
            escape(&self.title),
            x.words(),
            escape(&self.x_label),
            y.words(),
            escape(&self.y_label),
            if logarithmic { " data-y-power=\"10\"" } else { "" }
        );
        legend.iter().enumerate().for_each(|(i, row)| {
            let _ = writeln!(
                out,
                "<g transform=\"translate({LEFT},{})\">{row}</g>",
                4.0 + ROW * (i as f64 + 0.5)
            );
        });
        for tick in x.ticks() {
            let at = x.at(tick);
            let _ = writeln!(
                out,
                "<line class=\"fine\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{top}\" y2=\"{bottom}\"/><text class=\"tick\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 17.0,
                label(tick, x.step)
            );
        }
        for tick in y.ticks() {
            let at = y.at(tick);
            let words = if logarithmic { power(tick) } else { label(tick, y.step) };
            let _ = writeln!(
                out,
                "<line class=\"fine\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/><text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{words}</text>",
                WIDTH - RIGHT,
                LEFT - 7.0,
                at + 4.5
            );
        }
        let classes = self.classes();
        for (i, line) in self.lines.iter().enumerate() {
            let usable: Vec<&[f64; 2]> = line.points.iter().filter(usable).collect();
            // Thinned evenly, but the last point stays: a curve has to end where its run did.
            let stride = usable.len().div_ceil(POINTS).max(1);
            let last = usable.len().saturating_sub(1);
            let mut path = String::new();
            for (k, p) in usable.iter().enumerate().filter(|(k, _)| k % stride == 0 || *k == last) {
                let command = if k == 0 { 'M' } else { 'L' };
                let _ = write!(path, "{command}{:.1} {:.1}", x.at(p[0]), y.at(height(p[1])));
            }
            let (class, name, series) = (&classes[i], escape(&line.name), self.series(i));
            let _ = writeln!(
                out,
                "<path class=\"line {class}\" data-name=\"{name}\" data-series=\"{series}\" d=\"{path}\"/>"
            );
        }
        let _ = writeln!(
            out,
            "<rect class=\"frame\" x=\"{LEFT}\" y=\"{top}\" width=\"{}\" height=\"{}\"/>\n<text class=\"axis\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n<text class=\"axis\" transform=\"translate(15,{}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n</svg>",
            WIDTH - RIGHT - LEFT,
            bottom - top,
            0.5 * (LEFT + WIDTH - RIGHT),
            total - 8.0,
            escape(&self.x_label),
            0.5 * (top + bottom),
            escape(&self.y_label)
        );
        out
    }

    /// Whether line `i` is the elastic energy of the run whose kinetic energy is the previous line.
    fn is_elastic_of_last(&self, i: usize) -> bool {
        let run = |i: usize, kind| self.lines[i].name.strip_suffix(kind);
        i > 0 && run(i, ELASTIC).is_some_and(|name| run(i - 1, KINETIC) == Some(name))
    }

    /// Colour and dash of every line. Both energies of a run share one colour.
    fn classes(&self) -> Vec<String> {
        let mut runs = 0;
        let mut of_line = |i: usize| {
            if self.is_elastic_of_last(i) {
                return format!("l{} d1", (runs - 1) % COLOURS);
            }
            runs += 1;
            class(runs - 1)
        };
        (0..self.lines.len()).map(&mut of_line).collect()
    }

    /// The series of line `i`, by which the legend switches it: its run and, if the run has two energies, which one.
    fn series(&self, i: usize) -> String {
        let elastic = self.is_elastic_of_last(i);
        let kinetic = i + 1 < self.lines.len() && self.is_elastic_of_last(i + 1);
        let run = if elastic { i - 1 } else { i };
        let energy = if elastic {
            " elastic"
        } else if kinetic {
            " kinetic"
        } else {
            ""
        };
        format!("r{run}{energy}")
    }

    fn legend(&self) -> Vec<String> {
        let classes = self.classes();
        let paired = |i: usize| i < self.lines.len() && self.is_elastic_of_last(i);
        let mut items = Vec::new();
        for (i, line) in self.lines.iter().enumerate().filter(|(i, _)| !paired(*i)) {
            let run = line.name.strip_suffix(KINETIC).filter(|_| paired(i + 1));
            items.push((classes[i].as_str(), run.unwrap_or(&line.name), format!("r{i}")));
        }
        if items.len() < self.lines.len() {
            items.push(("key", "kinetic", "kinetic".to_owned()));
            items.push(("key d1", "elastic", "elastic".to_owned()));
        }
        items.retain(|(_, name, _)| !name.is_empty());
        if items.is_empty() {
            return Vec::new();
        }
        let mut rows = Vec::new();
        let (mut row, mut at) = (String::new(), 0.0);
        for (class, name, series) in items {
            let width = 44.0 + 8.0 * name.chars().count() as f64;
            if at + width > WIDTH - LEFT && at > 0.0 {
                rows.push(std::mem::take(&mut row));
                at = 0.0;
            }
            let _ = write!(
                row,
                "<g data-toggles=\"{series}\" transform=\"translate({at:.0},0)\"><path class=\"line {class}\" d=\"M0 0H22\"/><text x=\"28\" y=\"4.5\">{}</text></g>",
                escape(name)
            );
            at += width;
        }
        rows.push(row);
        rows
    }
}

/// A colour, with another dash for every further round of colours.
fn class(i: usize) -> String {
    format!("l{} d{}", i % COLOURS, (i / COLOURS) % 3)
}

/// A linear axis.
struct Axis {
    low: f64,
    high: f64,
    step: f64,
    pixels: (f64, f64),
}

impl Axis {
    fn around(values: impl Iterator<Item = f64>, from_zero: bool, pixels: (f64, f64)) -> Self {
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let low = if from_zero && low > 0.0 { 0.0 } else { low };
        let span = if high > low { high - low } else { high.abs().max(1.0) };
        let step = round_step(span / 5.0);
        let air = if pixels.0 > pixels.1 { 0.04 * span } else { 0.0 };
        Self { low: if low == 0.0 { 0.0 } else { low - air }, high: low + span + air, step, pixels }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        self.pixels.0 + (self.pixels.1 - self.pixels.0) * share
    }

    /// Its range and pixels, for the script of the page.
    fn words(&self) -> String {
        let Self { low, high, pixels: (from, to), .. } = self;
        format!("{low} {high} {from} {to}")
    }

    fn ticks(&self) -> Vec<f64> {
        let first = (self.low / self.step).ceil() as i64;
        let last = (self.high / self.step).floor() as i64;
        (first..=last).take(12).map(|k| k as f64 * self.step).collect()
    }
}

fn label(value: f64, step: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e5).contains(&step) {
        return format!("{value:.1e}");
    }
    let digits = (-step.log10().floor() as i32).clamp(0, 4) as usize;
    format!("{value:.digits$}")
}

fn power(exponent: f64) -> String {
    let digits = if exponent == exponent.round() { 0 } else { 1 };
    format!("10<tspan baseline-shift=\"super\" font-size=\"10\">{exponent:.digits$}</tspan>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_energies_of_a_run_have_one_colour_and_one_name() {
        let mut chart = Chart::new("energy", "time [s]", "energy [J]");
        for name in ["cut, kinetic", "cut, elastic", "uncut, kinetic", "uncut, elastic", "all"] {
            chart.lines.push(Line { name: name.to_owned(), points: vec![[0.0, 1.0], [1.0, 2.0]] });
        }
        assert_eq!(chart.classes(), ["l0 d0", "l0 d1", "l1 d0", "l1 d1", "l2 d0"]);
        let legend = chart.legend().concat();
        let names = [">cut<", ">uncut<", ">all<", ">kinetic<", ">elastic<"];
        assert!(names.iter().all(|name| legend.contains(name)), "{legend}");
        assert_eq!(legend.matches("<text").count(), names.len());
    }

    #[test]
    fn a_chart_draws_what_is_finite() {
        let mut chart = Chart::new("energy", "time [s]", "energy [J]");
        assert!(chart.svg().is_empty());
        chart
            .lines
            .push(Line { name: "a < b".into(), points: vec![[0.0, 1.0], [1.0, f64::NAN], [2.0, 3.0]] });
        let svg = chart.svg();
        assert!(svg.contains("a &lt; b") && !svg.contains("NaN"));
        chart.logarithmic = true;
        assert!(!chart.svg().contains("NaN"));
        assert_eq!(chart.html().matches("<svg").count(), 2);
        chart.lines[0].points = vec![[0.0, -1.0], [1.0, 0.0]];
        assert_eq!(chart.html().matches("<svg").count(), 1, "nothing lies on a logarithmic axis");
    }

    #[test]
    fn a_line_without_a_name_has_no_legend() {
        let line = Line { name: String::new(), points: vec![[0.0, 0.0], [1.0, 1.0]] };
        let chart = Chart { lines: vec![line], ..Chart::new("depth", "time [s]", "depth [h]") };
        assert!(chart.legend().is_empty());
        assert!(chart.html().contains("class=\"plot\""));
    }

    #[test]
    fn the_legend_switches_runs_and_energies() {
        let mut chart = Chart::new("energy", "time [s]", "energy [J]");
        for name in ["cut, kinetic", "cut, elastic", "all"] {
            chart.lines.push(Line { name: name.to_owned(), points: vec![[0.0, 1.0], [1.0, 2.0]] });
        }
        let series: Vec<String> = (0..3).map(|i| chart.series(i)).collect();
        assert_eq!(series, ["r0 kinetic", "r0 elastic", "r2"]);
        let legend = chart.legend().concat();
        for name in ["r0", "r2", "kinetic", "elastic"] {
            assert!(legend.contains(&format!("data-toggles=\"{name}\"")), "{legend}");
        }
    }

    #[test]
    fn ticks_are_round() {
        let axis = Axis::around([0.0, 0.97].into_iter(), true, (0.0, 1.0));
        assert_eq!(axis.ticks().len(), 5);
        assert!((axis.ticks()[1] - 0.2).abs() < 1e-12);
    }
}
