//! Force and contact age over the time of a run, as an SVG plot.
//!
//! A run of any length fits a fixed memory: when the bins are full, neighbours are merged.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::FontTransform;

use super::row::LogRow;
use crate::safety::flag;

/// Most bins of a trace: more than the picture has pixels in a row.
const MAX_BINS: usize = 4096;

/// Width of a bin until the first merge [s]: one tick.
const FIRST_WIDTH_S: f64 = 1e-3;

/// Size of the picture [px].
const SIZE: (u32, u32) = (1200, 640);

/// A larger age is drawn at the edge [ms]: the contact is lost.
const MAX_AGE_MS: f64 = 500.0;

const FORCE: RGBColor = RGBColor(178, 58, 48);
const TISSUE: RGBColor = RGBColor(46, 97, 158);
const AGE: RGBColor = RGBColor(92, 92, 92);

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
    let mut text = String::new();
    {
        let picture = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        draw_on(&picture, trace, limit_n)
            .and_then(|()| picture.present())
            .map_err(|error| std::io::Error::other(error.to_string()))?;
    }
    std::fs::write(file, text)
}

type Picture<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn<'a> = Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw_on<'a>(picture: &Picture<'a>, trace: &Trace, limit_n: f64) -> Drawn<'a> {
    picture.fill(&WHITE)?;
    let (upper, lower) = picture.split_vertically(430);
    draw_force(&upper, trace, limit_n)?;
    draw_age(&lower, trace)
}

fn draw_force<'a>(area: &Picture<'a>, trace: &Trace, limit_n: f64) -> Drawn<'a> {
    let [start, end] = trace.span_s();
    let largest = trace.bins.iter().map(|bin| bin.force_n[1]).fold(0.0, f64::max);
    let top = 1.15 * largest.max(0.25 * limit_n);
    let mut chart = ChartBuilder::on(area)
        .caption("Force on the hand", ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(28)
        .y_label_area_size(64)
        .build_cartesian_2d(start..end, 0.0..top)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).y_desc("force [N]").draw()?;
    // The tissue may ask for far more than any device gives. Its force is drawn up to the edge.
    let tissue = trace.bins.iter().map(|bin| (bin.time_s, bin.tissue_n.min(top)));
    chart
        .draw_series(LineSeries::new(tissue, TISSUE.stroke_width(1)))?
        .label("from the contact model")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], TISSUE.stroke_width(2)));
    let upper = trace.bins.iter().map(|bin| (bin.time_s, bin.force_n[1]));
    let lower = trace.bins.iter().rev().map(|bin| (bin.time_s, bin.force_n[0]));
    let band: Vec<(f64, f64)> = upper.clone().chain(lower).collect();
    chart.draw_series([Polygon::new(band, FORCE.mix(0.35))])?;
    chart
        .draw_series(LineSeries::new(upper, FORCE.stroke_width(2)))?
        .label("on the hand")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], FORCE.stroke_width(2)));
    if limit_n < top {
        chart
            .draw_series(LineSeries::new([(start, limit_n), (end, limit_n)], BLACK.stroke_width(1)))?
            .label("limit")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], BLACK));
    }
    let legend = SeriesLabelPosition::UpperRight;
    chart
        .configure_series_labels()
        .position(legend)
        .background_style(WHITE.mix(0.85))
        .border_style(AGE)
        .draw()
}

fn draw_age<'a>(area: &Picture<'a>, trace: &Trace) -> Drawn<'a> {
    let [start, end] = trace.span_s();
    let age = |bin: &Bin| bin.age_ms.min(MAX_AGE_MS);
    let top = 1.15 * trace.bins.iter().map(age).fold(5.0, f64::max);
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(start..end, 0.0..top)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("time [s]")
        .y_desc("age of contact [ms]")
        .y_labels(5)
        .draw()?;
    let half = 0.5 * trace.width_s;
    let stale = trace.bins.iter().filter(|bin| bin.flags & (flag::STALE | flag::LOST) != 0);
    chart.draw_series(stale.map(|bin| {
        let corners = [(bin.time_s - half, 0.0), (bin.time_s + half, top)];
        Rectangle::new(corners, FORCE.mix(0.2).filled())
    }))?;
    let line = trace.bins.iter().map(|bin| (bin.time_s, age(bin)));
    chart.draw_series(LineSeries::new(line, AGE.stroke_width(1)))?;
    let note = TextStyle::from(("sans-serif", 13)).color(&FORCE).transform(FontTransform::None);
    area.draw_text("red: contact is too old, and the force ramps down to zero", &note, (80, 14))
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
