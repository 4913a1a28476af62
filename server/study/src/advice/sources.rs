//! Finds the dominant source of error: twin runs remove one source after another.
//!
//! The error of a run telescopes into the changes from twin to twin,
//!
//! u − u* = (u − u_d) + (u_d − u_t) + (u_t − u_h) + (u_h − u_m) + (u_m − u*)
//!
//! where u_d is the same run in double precision, and u_t is u_d solved to 1e-10. u_h is u_t extrapolated to
//! Δt → 0, and u_m is u_h with the law of the reference. The five terms are rounding, algebraic, time, model
//! and the rest, which is discretisation. All are relative to ‖u*‖ over the probes.

use serde::{Deserialize, Serialize};

use crate::case::Case;
use crate::design::Configuration;
use crate::design::axes::{Factor, Setting, step, tolerance};
use crate::reference::Reference;
use crate::trial::Trial;
use crate::trial::series::Series;

/// A source of error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Elements are too large or too poor.
    Discretisation,
    /// Steps are too long.
    Time,
    /// The solver stopped too early.
    Algebraic,
    /// The law differs from that of the reference.
    Model,
    /// The arithmetic has too few digits.
    Rounding,
}

impl Source {
    /// All sources, in the order of tables.
    pub const ALL: [Source; 5] =
        [Source::Discretisation, Source::Time, Source::Algebraic, Source::Model, Source::Rounding];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Source::Discretisation => "discretisation",
            Source::Time => "time",
            Source::Algebraic => "algebraic",
            Source::Model => "model",
            Source::Rounding => "rounding",
        }
    }

    /// Advice that reduces this error.
    pub fn remedy(self) -> &'static str {
        match self {
            Source::Discretisation => "a finer mesh or a better element",
            Source::Time => "a shorter step or an integrator of higher order",
            Source::Algebraic => "a tighter solver tolerance",
            Source::Model => "another constitutive law",
            Source::Rounding => "double precision",
        }
    }
}

/// Relative size of each term. Sources that could not be told apart are absent.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sources(pub Vec<(Source, f64)>);

impl Sources {
    /// Relative size of one source, if known.
    pub fn of(&self, source: Source) -> Option<f64> {
        self.0.iter().find(|(s, _)| *s == source).map(|(_, size)| *size)
    }

    /// The source with the largest term.
    pub fn dominant(&self) -> Option<Source> {
        let usable = self.0.iter().filter(|(_, size)| size.is_finite());
        usable.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(source, _)| *source)
    }
}

/// Tolerance of a twin whose algebraic error is negligible.
const TIGHT: f64 = 1e-10;

/// The same for twins without double precision.
const TIGHT_MIXED: f64 = 1e-8;

/// Splits the error of `configuration`, whose run gave `series`. The twins are made by `run`.
pub fn peel(
    case: &Case,
    configuration: &Configuration,
    series: &Series,
    reference: &Reference,
    run: &mut dyn FnMut(&Configuration) -> Option<Trial>,
) -> Sources {
    let scale = reference.series.at_instants_of(series).norm();
    let mut peeling = Peeling {
        run,
        twin: configuration.clone(),
        left: series.clone(),
        ahead: None,
        scale,
        found: Sources::default(),
    };
    let exact = |t: f64| tolerance(&case.bodies, t);
    let double = Setting::new("double", 0.0, double_precision(case));
    if peeling.take(Source::Rounding, Factor::Precision, &double) {
        peeling.take(Source::Algebraic, Factor::Tolerance, &exact(TIGHT));
    } else {
        peeling.take(Source::Algebraic, Factor::Tolerance, &exact(TIGHT_MIXED));
    }
    if let Some(h) = configuration.setting(Factor::Step) {
        peeling.take_time(h.size, order(configuration.label(Factor::Integrator)));
    }
    let law =
        case.axes.iter().find(|axis| axis.factor == Factor::Law).and_then(|axis| axis.find(&reference.law));
    if let Some(law) = law {
        peeling.take(Source::Model, Factor::Law, law);
    }
    let rest = peeling.rest(&reference.series);
    peeling.found.0.push((Source::Discretisation, rest));
    peeling.found
}

/// Overrides for double precision, as the case itself defines them.
fn double_precision(case: &Case) -> Vec<String> {
    let axis = case.axes.iter().find(|axis| axis.factor == Factor::Precision);
    axis.and_then(|axis| axis.find("double")).map(|setting| setting.set.clone()).unwrap_or_default()
}

/// Order of an integrator in Δt.
fn order(integrator: &str) -> i32 {
    match integrator {
        "rk4" => 4,
        "bdf2" | "newmark" | "generalised-alpha" | "midpoint" => 2,
        _ => 1,
    }
}

struct Peeling<'a> {
    run: &'a mut dyn FnMut(&Configuration) -> Option<Trial>,
    /// The configuration without the sources removed so far.
    twin: Configuration,
    /// Result of the twin.
    left: Series,
    /// Correction of `left` by extrapolation to Δt → 0.
    ahead: Option<Series>,
    scale: f64,
    found: Sources,
}

impl Peeling<'_> {
    /// Removes one source by changing one factor. False if that twin could not be run.
    fn take(&mut self, source: Source, factor: Factor, setting: &Setting) -> bool {
        if self.twin.label(factor) == setting.label {
            self.found.0.push((source, 0.0));
            return true;
        }
        let twin = self.twin.with(factor, setting);
        let Some(trial) = (self.run)(&twin).filter(Trial::is_done) else { return false };
        self.found.0.push((source, self.left.minus(&trial.series).norm() / self.scale));
        self.left = trial.series;
        self.twin = twin;
        true
    }

    /// Removes the error of the step h by a run with h/2 and an extrapolation from both.
    fn take_time(&mut self, step_s: f64, order: i32) {
        let twin = self.twin.with(Factor::Step, &step(0.5 * step_s));
        let Some(trial) = (self.run)(&twin).filter(Trial::is_done) else { return };
        let change = trial.series.minus(&self.left);
        let ahead = 1.0 / (2.0_f64.powi(order) - 1.0);
        self.found.0.push((Source::Time, (1.0 + ahead) * change.norm() / self.scale));
        self.ahead = Some(change.combine(ahead, &change, 0.0));
        self.left = trial.series;
        self.twin = twin;
    }

    /// The error that remains against the reference after all sources were removed.
    fn rest(&self, reference: &Series) -> f64 {
        let rest = self.left.minus(reference);
        let rest = self.ahead.as_ref().map_or_else(|| rest.clone(), |ahead| rest.combine(1.0, ahead, 1.0));
        rest.norm() / self.scale
    }
}
