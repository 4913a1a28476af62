//! The common rule **C**: what every case must keep, checked at every step.
//!
//! Everything stays finite. Σm is constant to 1e-12. The momentum of every free part changes by the impulse
//! of gravity and drag, to 1e-6 of the motion so far. Energy never exceeds the energy of the start and the
//! work done on the body by more than one percent. No step is left out, divided or held without being
//! counted. The momentum that a clamp takes up cannot be told from an error, so clamped parts are left out of
//! the balance.

use nalgebra::Vector3;
use scindo_physics::body::{AdaptReport, Body, BodyError, Outcome, SolveReport};
use scindo_physics::cut::{BladeSweep, CutReport};
use scindo_physics::octree::AdaptSettings;
use scindo_study::report::chart::{Chart, Line};

use super::evidence::Evidence;

/// The worst values seen so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Common {
    /// Largest |Σm/Σm₀ − 1|.
    pub mass: f64,
    /// Largest missing momentum of a free part, relative to its mass times the largest mean speed so far.
    pub momentum: f64,
    /// Largest (E − E₀ − W), relative to the larger of E₀ and W.
    pub energy: f64,
    /// Count of positions and velocities that were not finite.
    pub not_finite: usize,
    /// Count of steps that were held, refused, or divided without a notice.
    pub not_whole: usize,
    /// Number of steps.
    pub steps: usize,
}

impl Default for Common {
    fn default() -> Self {
        Self { mass: 0.0, momentum: 0.0, energy: f64::NEG_INFINITY, not_finite: 0, not_whole: 0, steps: 0 }
    }
}

impl Common {
    /// Takes over every value of `other` that is worse.
    pub fn merge(&mut self, other: &Common) {
        // NaN must win; a plain comparison would lose it.
        let worse = |a: f64, b: f64| if b.is_nan() || b > a { b } else { a };
        self.mass = worse(self.mass, other.mass);
        self.momentum = worse(self.momentum, other.momentum);
        self.energy = worse(self.energy, other.energy);
        self.not_finite += other.not_finite;
        self.not_whole += other.not_whole;
        self.steps += other.steps;
    }

    /// Adds the figures of rule C.
    pub fn tell(&self, evidence: &mut Evidence) {
        evidence.exactly("C: positions and velocities that are not finite", self.not_finite, 0);
        evidence.at_most("C: largest change of mass", self.mass, 1e-12, "");
        evidence.at_most("C: unbalanced momentum, over that of the part", self.momentum, 1e-6, "");
        evidence.at_most("C: energy beyond that of the start and work", self.energy, 0.01, "");
        evidence.exactly("C: steps held, refused, or divided without a notice", self.not_whole, 0);
        evidence.tell("steps", self.steps as f64, "");
    }
}

/// A body that is stepped, checked and drawn.
#[derive(Debug)]
pub struct Watch {
    /// The watched body.
    pub body: Body,
    name: String,
    h: f64,
    gravity: Vector3<f64>,
    mass: f64,
    /// Kinetic and elastic energy at the start [J], and Σ m g·x [J].
    start: (f64, f64),
    excess: f64,
    scale: f64,
    /// Largest Σ m |v| so far, divided by the mass [m/s].
    speed: f64,
    common: Common,
    time: f64,
    kinetic: Vec<[f64; 2]>,
    elastic: Vec<[f64; 2]>,
    iterations: Vec<[f64; 2]>,
}

impl Watch {
    /// Watches `body` in steps of `h` [s] under `gravity` [m/s²].
    pub fn new(name: impl Into<String>, body: Body, h: f64, gravity: Vector3<f64>) -> Self {
        let energy = body.kinetic_energy() + body.elastic_energy();
        let start = (energy, fall(&body, gravity));
        Self {
            name: name.into(),
            h,
            gravity,
            mass: body.total_mass(),
            start,
            excess: f64::NEG_INFINITY,
            scale: energy,
            speed: flow(&body) / body.total_mass(),
            common: Common::default(),
            time: 0.0,
            kinetic: vec![[0.0, body.kinetic_energy()]],
            elastic: vec![[0.0, body.elastic_energy()]],
            iterations: Vec::new(),
            body,
        }
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Kinetic and elastic energy [J] after the last step.
    pub fn energy(&self) -> f64 {
        let last = |series: &[[f64; 2]]| series.last().map_or(0.0, |point| point[1]);
        last(&self.kinetic) + last(&self.elastic)
    }

    /// Makes one step and checks it.
    pub fn step(&mut self) -> SolveReport {
        let before = parts(&self.body);
        let report = self.body.step(self.h, self.gravity, &[]);
        self.time += self.h;
        self.common.steps += 1;
        let silent = report.substeps > 1 && report.notice.is_none();
        if report.outcome != Outcome::Advanced || silent {
            self.common.not_whole += 1;
        }
        self.common.not_finite += self
            .body
            .positions()
            .iter()
            .chain(self.body.velocities())
            .filter(|v| !v.iter().all(|c| c.is_finite()))
            .count();
        self.balance(&before);
        let (kinetic, elastic) = (self.body.kinetic_energy(), self.body.elastic_energy());
        let work = fall(&self.body, self.gravity) - self.start.1;
        self.excess = larger(self.excess, kinetic + elastic - self.start.0 - work);
        self.scale = self.scale.max(work.abs());
        self.kinetic.push([self.time, kinetic]);
        self.elastic.push([self.time, elastic]);
        self.iterations.push([self.time, f64::from(report.iterations)]);
        report
    }

    /// Makes `n` steps.
    pub fn steps(&mut self, n: usize) {
        for _ in 0..n {
            self.step();
        }
    }

    /// Makes a cut and checks that mass and momentum stay the same.
    ///
    /// # Errors
    /// The body refuses the cut.
    pub fn cut(&mut self, blade: &BladeSweep, incision: u32) -> Result<CutReport, BodyError> {
        let (before, scale) = (self.body.momentum(), flow(&self.body));
        let report = self.body.cut(blade, incision)?;
        self.hold_mass();
        if scale > 0.0 {
            let change = (self.body.momentum() - before).norm() / scale;
            self.common.momentum = larger(self.common.momentum, change);
        }
        Ok(report)
    }

    /// Adapts the cells to tools at these places [m], and checks that mass and momentum stay the same. The energy
    /// that the change of cells takes or gives, and reports, counts as work.
    ///
    /// # Errors
    /// The body refuses it.
    pub fn adapt(
        &mut self,
        settings: &AdaptSettings,
        tools: &[Vector3<f64>],
    ) -> Result<AdaptReport, BodyError> {
        let (before, scale) = (self.body.momentum(), flow(&self.body));
        let report = self.body.adapt(settings, tools, None)?;
        self.hold_mass();
        if scale > 0.0 {
            let change = (self.body.momentum() - before).norm() / scale;
            self.common.momentum = larger(self.common.momentum, change);
        }
        self.start.0 += report.kinetic_change_j + report.elastic_change_j;
        Ok(report)
    }

    fn hold_mass(&mut self) {
        let change = (self.body.total_mass() / self.mass - 1.0).abs();
        self.common.mass = larger(self.common.mass, change);
    }

    fn balance(&mut self, before: &[Part]) {
        self.hold_mass();
        self.speed = self.speed.max(flow(&self.body) / self.mass);
        let drag = 1.0 + self.h * self.body.material().rayleigh.mass_1_s;
        let now = parts(&self.body);
        for (part, (now, before)) in now.iter().zip(before).enumerate() {
            if !self.body.parts().free[part] || now.mass == 0.0 {
                continue;
            }
            let impulse = self.h * now.mass * self.gravity;
            let missing = drag * now.momentum - before.momentum - impulse;
            let scale = (now.mass * self.speed).max(before.flow).max(impulse.norm());
            if scale > 0.0 {
                self.common.momentum = larger(self.common.momentum, missing.norm() / scale);
            }
        }
    }

    /// Adds the worst values to `common` and the lines of this body to the charts.
    pub fn finish(self, common: &mut Common, energies: &mut Chart, iterations: &mut Chart) -> Body {
        common.merge(&self.common());
        let name = &self.name;
        let of = |what: &str| if name.is_empty() { what.to_owned() } else { format!("{name}, {what}") };
        energies.lines.push(Line { name: of("kinetic"), points: self.kinetic });
        energies.lines.push(Line { name: of("elastic"), points: self.elastic });
        let name = if self.name.is_empty() { "iterations".to_owned() } else { self.name };
        iterations.lines.push(Line { name, points: self.iterations });
        self.body
    }

    /// The worst values seen so far.
    pub fn common(&self) -> Common {
        let energy = if self.scale > 0.0 { self.excess / self.scale } else { self.excess };
        Common { energy, ..self.common }
    }
}

/// The energy chart and the iteration chart that most cases have.
pub fn charts() -> (Chart, Chart) {
    (
        Chart::new("energy", "time [s]", "energy [J]"),
        Chart::new("iterations of the linear solver per step", "time [s]", "iterations"),
    )
}

#[derive(Debug, Clone, Copy, Default)]
struct Part {
    mass: f64,
    momentum: Vector3<f64>,
    /// Σ m |v|.
    flow: f64,
}

fn parts(body: &Body) -> Vec<Part> {
    let mut sums = vec![Part::default(); body.parts().len()];
    for (c, &part) in body.parts().of_copy.iter().enumerate() {
        let (m, v) = (body.masses()[c], body.velocities()[c]);
        let sum = &mut sums[part as usize];
        sum.mass += m;
        sum.momentum += m * v;
        sum.flow += m * v.norm();
    }
    sums
}

fn flow(body: &Body) -> f64 {
    body.masses().iter().zip(body.velocities()).map(|(m, v)| m * v.norm()).sum()
}

/// Σ m g·x [J].
fn fall(body: &Body, gravity: Vector3<f64>) -> f64 {
    body.masses().iter().zip(body.positions()).map(|(m, x)| m * gravity.dot(x)).sum()
}

/// The larger number; NaN wins.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}
