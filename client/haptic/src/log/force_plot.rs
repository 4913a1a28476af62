//! Force and contact age over the time of a run, as an SVG plot.
//!
//! A run of any length fits a fixed memory: when the bins are full, neighbours are merged.

use std::fmt::Write as _;
use std::path::Path;

use super::row::LogRow;
use crate::safety::flag;

/// Most bins of a trace: more than the picture has pixels in a row.
const MAX_BINS: usize = 4096;

/// Width of a bin until the first merge [s]: one tick.
const FIRST_WIDTH_S: f64 = 1e-3;

/// Size of the picture [px].
const SIZE: [f64; 2] = [1200.0, 640.0];

/// Left and right edge of both diagrams, and top and bottom of each [px].
const X_PX: [f64; 2] = [76.0, 1188.0];
const FORCE_PX: [f64; 2] = [44.0, 390.0];
const AGE_PX: [f64; 2] = [450.0, 588.0];

/// Most grid lines along an axis.
const GRID: [f64; 2] = [12.0, 7.0];

/// A larger age is drawn at the edge [ms]: the contact is lost.
const MAX_AGE_MS: f64 = 500.0;

const FORCE: &str = "#b23a30";
const TISSUE: &str = "#2e619e";
const AGE: &str = "#5c5c5c";

/// Summary of an interval of time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bin {
    time_s: f64,
    /// Smallest and largest force sent to the device [N].
    force_n: [f64; 2],
    /// Largest force of the tissue, before blend and safety [N].
    tissue_n: f64,
    /// Largest age of the contact in use [ms].
    age_ms: f64,
    /// All flags raised in the interval.
    flags: u32,
}

impl Bin {
    fn of(row: &LogRow) -> Self {
        let force_n = row.force_n.norm();
        Self {
            time_s: row.time_s,
            force_n: [force_n; 2],
            tissue_n: row.tissue_n.norm(),
            age_ms: row.contact_age_ms,
            flags: row.flags,
        }
    }

    fn merge(&mut self, later: &Self) {
        self.force_n = [self.force_n[0].min(later.force_n[0]), self.force_n[1].max(later.force_n[1])];
        self.tissue_n = self.tissue_n.max(later.tissue_n);
        self.age_ms = self.age_ms.max(later.age_ms);
        self.flags |= later.flags;
    }
}

/// Force and age over time, in a bounded number of bins.
#[derive(Debug)]
pub struct Trace {
    bins: Vec<Bin>,
    width_s: f64,
    rows: u64,
}

impl Default for Trace {
    fn default() -> Self {
        Self { bins: Vec::with_capacity(MAX_BINS), width_s: FIRST_WIDTH_S, rows: 0 }
    }
}

impl Trace {
    /// Adds one tick.
    pub fn push(&mut self, row: &LogRow) {
        self.rows += 1;
        let bin = Bin::of(row);
        match self.bins.last_mut() {
            Some(last) if bin.time_s < last.time_s + 0.999 * self.width_s => last.merge(&bin),
            _ => self.bins.push(bin),
        }
        if self.bins.len() == MAX_BINS {
            self.width_s *= 2.0;
            let merged = self.bins.chunks(2).map(|pair| {
                let mut bin = pair[0];
                pair[1..].iter().for_each(|later| bin.merge(later));
                bin
            });
            self.bins = merged.collect();
        }
    }

    /// Number of ticks added.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// First and last time; never equal [s].
    fn span_s(&self) -> [f64; 2] {
        let start = self.bins.first().map_or(0.0, |bin| bin.time_s);
        let end = self.bins.last().map_or(0.0, |bin| bin.time_s);
        [start, end.max(start + 1e-3)]
    }
}

/// Draws a trace. `limit_n` is the clamp of the force [N].
///
/// # Errors
/// The file cannot be written.
pub fn draw(file: &Path, trace: &Trace, limit_n: f64) -> std::io::Result<()> {
    let [width, height] = SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"13\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
    );
    draw_force(&mut svg, trace, limit_n);
    draw_age(&mut svg, trace);
    svg += "</svg>\n";
    std::fs::write(file, svg)
}

/// Axes of a diagram: time along x, and values from 0 to `top` along y.
struct Axes {
    span_s: [f64; 2],
    top: f64,
    y_px: [f64; 2],
}

impl Axes {
    fn at(&self, time_s: f64, value: f64) -> [f64; 2] {
        let [start, end] = self.span_s;
        let [above, below] = self.y_px;
        let x = X_PX[0] + (X_PX[1] - X_PX[0]) * (time_s - start) / (end - start);
        [x, below - (below - above) * value / self.top]
    }

    /// The points (time, value) as a list for SVG.
    fn points(&self, points: impl Iterator<Item = (f64, f64)>) -> String {
        points.fold(String::new(), |mut out, (time_s, value)| {
            let [x, y] = self.at(time_s, value);
            let _ = write!(out, "{x:.1},{y:.1} ");
            out
        })
    }

    fn line(&self, svg: &mut String, points: impl Iterator<Item = (f64, f64)>, colour: &str, width: f64) {
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"/>",
            self.points(points)
        );
    }

    /// Frame, grid, numbers and the name of the vertical axis.
    fn frame(&self, svg: &mut String, name: &str) {
        let [[left, right], [above, below], [start, end]] = [X_PX, self.y_px, self.span_s];
        for time_s in round_values(start, end, GRID[0]) {
            let x = self.at(time_s, 0.0)[0];
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {above}V{below}\" stroke=\"#ddd\"/>\
                 <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{time_s}</text>",
                below + 18.0
            );
        }
        for value in round_values(0.0, self.top, GRID[1]) {
            let y = self.at(start, value)[1];
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#ddd\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{value}</text>",
                left - 8.0,
                y + 4.5
            );
        }
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {above}V{below}H{right}\" fill=\"none\" stroke=\"#000\"/>\
             <text transform=\"translate(20,{}) rotate(-90)\" text-anchor=\"middle\">{name}</text>",
            0.5 * (above + below)
        );
    }
}

/// Multiples of 1, 2 or 5 times a power of ten from `low` to `high`, `most` or fewer, without the digits of rounding.
fn round_values(low: f64, high: f64, most: f64) -> Vec<f64> {
    let least = (high - low) / most;
    let power = 10_f64.powf(least.log10().floor());
    let step = power * [1.0, 2.0, 5.0].into_iter().find(|digit| digit * power >= least).unwrap_or(10.0);
    let digits = 10_f64.powi((-step.log10().floor()).max(0.0) as i32);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    (first..=last).map(|k| (k as f64 * step * digits).round() / digits).collect()
}

fn draw_force(svg: &mut String, trace: &Trace, limit_n: f64) {
    let span_s = trace.span_s();
    let largest = trace.bins.iter().map(|bin| bin.force_n[1]).fold(0.0, f64::max);
    let top = 1.15 * largest.max(0.25 * limit_n);
    let axes = Axes { span_s, top, y_px: FORCE_PX };
    *svg += "<text x=\"600\" y=\"28\" font-size=\"20\" text-anchor=\"middle\">Force on the hand</text>\n";
    axes.frame(svg, "force [N]");
    // The tissue may ask for far more than any device gives. Its force is drawn up to the edge.
    let tissue = trace.bins.iter().map(|bin| (bin.time_s, bin.tissue_n.min(top)));
    axes.line(svg, tissue, TISSUE, 1.0);
    let upper = trace.bins.iter().map(|bin| (bin.time_s, bin.force_n[1]));
    let lower = trace.bins.iter().rev().map(|bin| (bin.time_s, bin.force_n[0]));
    let band = axes.points(upper.clone().chain(lower));
    let _ = writeln!(svg, "<polygon points=\"{band}\" fill=\"{FORCE}\" fill-opacity=\"0.35\"/>");
    axes.line(svg, upper, FORCE, 2.0);
    let mut names = vec![("from the contact model", TISSUE), ("on the hand", FORCE)];
    if limit_n < top {
        axes.line(svg, span_s.into_iter().map(|time_s| (time_s, limit_n)), "#000", 1.0);
        names.push(("limit", "#000"));
    }
    let height = 8 + 20 * names.len();
    let _ = writeln!(
        svg,
        "<g transform=\"translate(1000,50)\"><rect width=\"182\" height=\"{height}\" fill=\"#fff\" \
         fill-opacity=\"0.85\" stroke=\"{AGE}\"/>"
    );
    for (i, (name, colour)) in names.into_iter().enumerate() {
        let y = 14 + 20 * i;
        let _ = writeln!(
            svg,
            "<path d=\"M8 {y}H26\" stroke=\"{colour}\" stroke-width=\"2\"/><text x=\"34\" y=\"{}\">{name}</text>",
            y + 4
        );
    }
    *svg += "</g>\n";
}

fn draw_age(svg: &mut String, trace: &Trace) {
    let age = |bin: &Bin| bin.age_ms.min(MAX_AGE_MS);
    let top = 1.15 * trace.bins.iter().map(age).fold(5.0, f64::max);
    let axes = Axes { span_s: trace.span_s(), top, y_px: AGE_PX };
    axes.frame(svg, "age of contact [ms]");
    let half = 0.5 * trace.width_s;
    for bin in trace.bins.iter().filter(|bin| bin.flags & (flag::STALE | flag::LOST) != 0) {
        let [[left, above], [right, below]] =
            [axes.at(bin.time_s - half, top), axes.at(bin.time_s + half, 0.0)];
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{above:.1}\" width=\"{:.2}\" height=\"{:.1}\" fill=\"{FORCE}\" fill-opacity=\"0.2\"/>",
            right - left,
            below - above
        );
    }
    axes.line(svg, trace.bins.iter().map(|bin| (bin.time_s, age(bin))), AGE, 1.0);
    let _ = writeln!(
        svg,
        "<text x=\"632\" y=\"628\" text-anchor=\"middle\">time [s]</text>\
         <text x=\"80\" y=\"442\" fill=\"{FORCE}\">red: contact is too old, and the force ramps down to zero</text>"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn row(tick: u64) -> LogRow {
        let zero = Vector3::zeros();
        let force = if (20_000..30_000).contains(&tick) { 1.5 } else { 0.0 };
        LogRow {
            time_s: 1e-3 * tick as f64,
            position_m: zero,
            velocity_m_s: zero,
            tissue_n: Vector3::z() * (2.0 * force),
            force_n: Vector3::z() * force,
            contact_seq: tick,
            contact_age_ms: if tick < 100 { 1e6 } else { 2.0 },
            round_trip_ms: 0.0,
            epoch: 1,
            energy_j: 0.0,
            flags: if tick < 100 { flag::STALE } else { 0 },
        }
    }

    #[test]
    fn a_long_run_keeps_its_extremes_in_a_bounded_number_of_bins() {
        let mut trace = Trace::default();
        (0..100_000).for_each(|tick| trace.push(&row(tick)));
        assert!(trace.bins.len() < MAX_BINS && trace.bins.len() > MAX_BINS / 4, "{}", trace.bins.len());
        assert_eq!((trace.rows(), trace.span_s()[0]), (100_000, 0.0));
        let touched: Vec<f64> = trace.bins.iter().filter(|b| b.force_n[1] > 0.0).map(|b| b.time_s).collect();
        assert!((touched[0] - 20.0).abs() < 0.1 && (touched[touched.len() - 1] - 30.0).abs() < 0.1);
        assert!(trace.bins.iter().all(|b| b.force_n[1] == 0.0 || b.force_n[1] == 1.5));
    }

    #[test]
    fn numbers_of_axes_are_round() {
        assert_eq!(round_values(0.0, 1.0, 7.0), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        assert_eq!(
            round_values(12.3, 17.9, 12.0),
            [12.5, 13.0, 13.5, 14.0, 14.5, 15.0, 15.5, 16.0, 16.5, 17.0, 17.5]
        );
        assert_eq!(round_values(0.0, 575.0, 7.0), [0.0, 100.0, 200.0, 300.0, 400.0, 500.0]);
    }

    #[test]
    fn the_picture_shows_force_limit_and_age_also_of_an_empty_run() {
        let folder = std::env::temp_dir().join(format!("scindo-force-plot-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("force.svg");
        let mut trace = Trace::default();
        draw(&file, &trace, 2.5).unwrap();
        (0..40_000).for_each(|tick| trace.push(&row(tick)));
        draw(&file, &trace, 1.6).unwrap();
        let text = std::fs::read_to_string(&file).unwrap();
        for part in
            ["<svg", "force [N]", "time [s]", "age of contact [ms]", "on the hand", "limit", "<polygon"]
        {
            assert!(text.contains(part), "{part}");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
