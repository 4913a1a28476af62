//! The effect of many cuts on a mesh: quality and size after 1, 10 and 100 cuts.
//!
//! The body lies still, weightless and without loads. The first cut is that of the case. The others are
//! planes across the beam to seeded random depths, the same for every method.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Vector3;
use scindo_physics::space::Tets;
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::{CutRequest, Inputs};
use scindo_world::scene::Scene;
use scindo_world::simulation::{Simulation, Stage};
use serde::{Deserialize, Serialize};

use crate::trial::random::Random;

/// Numbers of cuts after which the mesh is measured.
pub const CUTS: [usize; 3] = [1, 10, 100];

/// The mesh after a number of cuts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wear {
    /// Number of cuts so far.
    pub cuts: usize,
    /// Mean ratio of the worst element: 1 regular, 0 flat (Liu, Joe 1994).
    pub quality: f64,
    /// Number of elements.
    pub elements: usize,
    /// Number of pieces inside the elements; equal to the number of elements if none is cut.
    pub pieces: usize,
    /// Number of nodes, copies included.
    pub nodes: usize,
    /// Smallest volume fraction of a piece in its element.
    pub least_fraction: f64,
    /// Number of connected parts.
    pub parts: usize,
    /// Time of all cuts so far [ms].
    pub cut_ms: f64,
}

/// Overrides that leave the bodies at rest: no gravity, no loads, no held places.
pub fn at_rest(bodies: &[String]) -> Vec<String> {
    let mut set = vec!["world.gravity_m_s2=[0.0, 0.0, 0.0]".to_owned(), "world.step_s=0.001".to_owned()];
    for id in bodies {
        set.push(format!("body.{id}.load=[]"));
        set.push(format!("body.{id}.fix=[]"));
        set.push(format!("body.{id}.integrator=\"implicit-euler\""));
        set.push(format!("body.{id}.law=\"linear\""));
        set.push(format!("body.{id}.solver.tolerance=1e-2"));
    }
    set
}

/// Cuts the first body of a scene, only once if `once`. `None` if the scene is refused or `stop` was raised.
pub fn measure(scene: &Scene, base_dir: &Path, once: bool, stop: &AtomicBool) -> Option<Vec<Wear>> {
    let mut simulation = Simulation::with_options(scene, base_dir, BuildOptions::default()).ok()?;
    let [low, high] = simulation.bodies().first()?.body.bounds();
    let mut random = Random(4);
    let (mut cut_ms, mut found) = (0.0, Vec::new());
    for cut in 1..=CUTS[2] {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let cuts = if cut == 1 { Vec::new() } else { vec![plane(&mut random, cut, low, high)] };
        let report = simulation.step(&Inputs { cuts, ..Inputs::default() });
        cut_ms += 1e3 * report.seconds.of(Stage::Cuts);
        if CUTS.contains(&cut) {
            let body = &simulation.bodies().first()?.body;
            let tets = body.tets();
            found.push(Wear {
                cuts: cut,
                // Cells of an octree are cubes.
                quality: tets.map_or(1.0, |tets| tets.mesh().quality().min_mean_ratio.0),
                elements: body.n_elements(),
                pieces: body.n_pieces(),
                nodes: body.n_copies(),
                least_fraction: tets.map_or(1.0, least_fraction),
                parts: body.components().len(),
                cut_ms,
            });
        }
        if once {
            break;
        }
    }
    Some(found)
}

fn least_fraction(tets: &Tets) -> f64 {
    tets.pieces().iter().map(|p| p.fraction).fold(1.0, f64::min)
}

/// A randomly tilted sweep across the box, from outside to a random depth.
fn plane(random: &mut Random, cut: usize, low: Vector3<f64>, high: Vector3<f64>) -> CutRequest {
    let size = high - low;
    let across = (0.15 + 0.7 * random.uniform()) * size.z + low.z;
    let tilt = [0.2 * size.x * (random.uniform() - 0.5), 0.2 * size.y * (random.uniform() - 0.5)];
    let depth = low.x + size.x * (0.2 + 0.6 * random.uniform());
    let at = |x: f64, far: bool, rise: f64| {
        let y = if far { high.y + 0.1 * size.y } else { low.y - 0.1 * size.y };
        Vector3::new(x, y, across + rise + if far { tilt[1] } else { 0.0 })
    };
    let outside = low.x - 0.1 * size.x;
    CutRequest {
        request: cut as u64,
        // Every cut is a separate incision.
        tool: Arc::from(format!("wear-{cut}")),
        body: None,
        segments: vec![
            [at(outside, false, 0.0), at(outside, true, 0.0)],
            [at(depth, false, tilt[0]), at(depth, true, tilt[0])],
        ],
    }
}
