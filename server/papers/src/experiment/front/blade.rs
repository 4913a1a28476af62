//! A blade that advances through the loaded beam, with an equilibrium after each step.
//!
//! Before every step its edge is put on the material line where the last one ended, so it stays on the plane of the cut
//! however far the beam bends.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Vector3;
use scindo_study::case::Point;
use scindo_study::trial::series::Series;
use scindo_world::assemble::BuildOptions;
use scindo_world::body::Probe;
use scindo_world::inputs::{CutRequest, Inputs};
use scindo_world::report::{Level, StepReport};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use crate::lab::Trouble;

type V = Vector3<f64>;

/// Steps of the blade to the front, and those of the simulation that one of them may take.
pub(super) const ADVANCES: usize = 15;
const MOST_STEPS: usize = 50;
/// Where the edge is located: through the beam [m], and above and below the plane of the cut [m]. Between the lips it
/// lies in the middle.
const THROUGH_M: [f64; 2] = [0.002, 0.058];
const BESIDE_M: f64 = 5e-4;
/// The blade leaves the plane a little. Displacements of a lip are continued from places this deep behind it, and twice
/// as deep [m].
const BEHIND_M: f64 = 5e-4;
/// How far the blade sticks out on both sides, in distances between these places.
const BEYOND: f64 = 5.0;

/// The plane of the cut and the depth to which it goes [m].
#[derive(Clone, Copy, Debug)]
pub(super) struct Depth {
    pub plane_m: f64,
    pub front_m: f64,
}

/// A material line across the plane of the cut: its two places, above and below the plane.
struct Edge([[Probe; 2]; 2]);

impl Edge {
    fn new(simulation: &Simulation, x: f64, plane_m: f64) -> Result<Self, Trouble> {
        let bind = |y: f64, side: f64| bind(simulation, "edge", V::new(x, y, plane_m + side * BESIDE_M));
        let [a, b] = THROUGH_M;
        Ok(Self([[bind(a, -1.0)?, bind(a, 1.0)?], [bind(b, -1.0)?, bind(b, 1.0)?]]))
    }

    /// Where the line is now: tip and heel of a blade on it [m].
    fn now(&mut self, simulation: &Simulation) -> [V; 2] {
        let [a, b] = self.0.each_mut().map(|sides| {
            let [below, above] = sides.each_mut().map(|probe| place(simulation, probe));
            0.5 * (below + above)
        });
        [a - BEYOND * (b - a), b + BEYOND * (b - a)]
    }
}

/// Where a displacement is measured: at the same place twice, or behind a lip and twice as deep.
struct Mark([Probe; 2]);

impl Mark {
    fn new(simulation: &Simulation, point: &Point) -> Result<Self, Trouble> {
        let (at, side) = (V::from(point.point_m), point.side.map_or(V::zeros(), V::from));
        let behind = BEHIND_M * side.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        let [near, far] = [1.0, 2.0].map(|k| bind(simulation, &point.id, at + k * behind));
        Ok(Self([near?, far?]))
    }

    fn displacement(&mut self, simulation: &Simulation) -> V {
        let [near, far] = self.0.each_mut().map(|probe| place(simulation, probe) - probe.rest_m);
        2.0 * near - far
    }
}

/// A material point of the beam.
fn bind(simulation: &Simulation, id: &str, at: V) -> Result<Probe, Trouble> {
    let body = &simulation.bodies()[0].body;
    Probe::bind(id, 0, body, at, None).map_err(|_| format!("{at:?} is outside of the beam").into())
}

/// Where a material point is now [m].
fn place(simulation: &Simulation, probe: &mut Probe) -> V {
    let body = &simulation.bodies()[0].body;
    probe.follow(body);
    probe.position(body.positions())
}

/// Lets the blade advance through the beam of `scene`, which is not cut yet. Returns the displacements of the points
/// `at` at the end, or why there are none.
///
/// # Errors
/// The user ended the study, or the beam is another one.
pub(super) fn advance(
    scene: &Scene,
    depth: Depth,
    at: &[Point],
    stop: &AtomicBool,
) -> Result<Result<Series, String>, Trouble> {
    let options = BuildOptions { threads: 1, ..BuildOptions::default() };
    let mut simulation = Simulation::with_options(scene, Path::new("."), options)?;
    let places = (0..=ADVANCES).map(|k| k as f64 / ADVANCES as f64 * depth.front_m);
    let mut edges =
        places.map(|x| Edge::new(&simulation, x.max(1e-9), depth.plane_m)).collect::<Result<Vec<_>, _>>()?;
    let mut marks = at.iter().map(|point| Mark::new(&simulation, point)).collect::<Result<Vec<_>, _>>()?;
    simulation.step(&Inputs::default());
    for k in 0..ADVANCES {
        let [mut from, to] = [k, k + 1].map(|i| edges[i].now(&simulation));
        if k == 0 {
            // It begins outside.
            from = [0, 1].map(|i| from[i] - (to[i] - from[i]));
        }
        let cut =
            CutRequest { request: k as u64, tool: Arc::from("knife"), body: None, segments: vec![from, to] };
        let mut inputs = Inputs { cuts: vec![cut], ..Inputs::default() };
        let mut steps = 0;
        loop {
            let report = simulation.step(&inputs);
            steps += 1;
            if stop.load(Ordering::Relaxed) {
                return Err("interrupted".into());
            }
            if let Some(reason) = trouble(report) {
                return Ok(Err(format!("advance {}: {reason}", k + 1)));
            }
            if !report.cuts.is_empty() {
                break;
            }
            if steps == MOST_STEPS {
                return Ok(Err(format!("advance {} was not made within {MOST_STEPS} steps", k + 1)));
            }
            inputs = Inputs::default();
        }
    }
    Ok(Ok(Series {
        frames: vec![0],
        displacement_m: marks
            .iter_mut()
            .flat_map(|mark| <[f64; 3]>::from(mark.displacement(&simulation)))
            .collect(),
        energy_j: simulation.bodies().iter().map(|body| body.energy().elastic_j).collect(),
    }))
}

/// What is wrong with a step. An edge that crosses no element completely opens nothing, which is right.
fn trouble(report: &StepReport) -> Option<String> {
    let bad = report.events.iter().find(|event| event.level == Level::Error && event.name != "cut-refused");
    let stopped = report.bodies.iter().find(|body| body.solve.stop != Default::default());
    bad.map(|event| event.message.clone())
        .or_else(|| stopped.map(|body| format!("no equilibrium: {:?}", body.solve.stop)))
}
