//! Mechanics of a body: invariants that hold to round-off, and energies that must not grow.

#![allow(clippy::unwrap_used)]
#![allow(non_snake_case)] // the symbols of the field: X, K

mod adapt;
mod adjoining;
mod cells;
mod combinations;
mod conservation;
mod cutting;
mod determinism;
mod dynamics;
mod equilibrium;
mod explicit_slivers;
mod foreign_space;
mod friction;
mod fronts;
mod half_cut_beam;
mod hex8_cubes;
mod inclined;
mod multigrid;
mod nonlinear;
mod multistep;
mod octree;
mod octree_statics;
mod own_skin;
mod paths;
mod phases;
mod pressure;
mod quadratic_cuts;
mod reference;
mod regions;
mod repeated_solves;
mod robustness;
mod sensible;
mod simulated;
mod snapping;
mod springs;
mod tension;
mod together;
mod two_level;
mod verdicts;
mod viscoelastic;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, PcgSettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};

/// A light, soft material.
pub const SOFT: Material = Material {
    young_pa: 1e5,
    poisson: 0.33,
    density_kg_m3: 100.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};

/// Gravity [m/s²].
pub const DOWN: Vector3<f64> = Vector3::new(0.0, -9.81, 0.0);

/// Default settings (one thread) with this solver.
pub fn settings(iterations: u32, tolerance: f64) -> BodySettings {
    BodySettings { solver: PcgSettings { iterations, tolerance }, ..BodySettings::default() }
}

/// A bar of 1 m × 0.2 m × 0.2 m with 12 800 tets.
pub fn bar_mesh() -> TetMesh {
    box_mesh(Vector3::zeros(), Vector3::new(1.0, 0.2, 0.2), [40, 8, 8], BoxPattern::Tet5 { parity: false })
}

/// A cube of 0.1 m.
pub fn cube(cells: usize, material: Material, settings: BodySettings) -> Body {
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [cells; 3], BoxPattern::Tet6);
    Body::new(mesh, material, settings).unwrap()
}

/// The nodes at x = 0 of a bar.
pub fn left_face(body: &Body) -> Vec<u32> {
    let nodes = &body.rest_positions()[..body.n_copies()];
    (0..nodes.len() as u32).filter(|&n| nodes[n as usize].x == 0.0).collect()
}

/// Holds the nodes at x = 0, and names them.
pub fn hold_left(body: &mut Body) -> Vec<u32> {
    let clamp = left_face(body);
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    clamp
}

/// Blade number `k` of many in all directions, through the middle of a body of 0.1 m where it is now.
pub fn tumbling_blade(body: &Body, k: u32) -> BladeSweep {
    let t = f64::from(k);
    let normal = Vector3::new((1.3 * t).sin(), (2.1 * t).cos(), (0.7 * t + 1.0).sin()).normalize();
    let along = normal.cross(&Vector3::new(0.3, 0.5, -0.8)).normalize();
    let across = normal.cross(&along);
    let centre = body.centre_of_mass() + 0.03 * (0.9 * t).sin() * normal;
    let segment = |s: f64| [centre + s * along - 0.06 * across, centre + s * along + 0.06 * across];
    BladeSweep { segments: vec![segment(-0.06), segment(-0.02), segment(0.03)] }
}

/// Largest distance between the nodes of two bodies [m].
pub fn apart(a: &Body, b: &Body) -> f64 {
    a.positions().iter().zip(b.positions()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}
