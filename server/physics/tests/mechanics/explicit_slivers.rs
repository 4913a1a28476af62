//! Explicit steps of a body most of whose elements are cut to slivers of 1e-6 of their size, with masses that keep the
//! critical step of the uncut body.

use nalgebra::Vector3;
use scindo_physics::assembly::{MassSharing, Model, Volumetric};
use scindo_physics::body::{Body, BodySettings, MassKind, Outcome, PcgSettings, Scheme};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::integrator::omega_max;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_physics::team::Team;

use crate::DOWN;

const MATERIAL: Material = Material {
    young_pa: 3e4,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 5.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};
const CELLS: [usize; 3] = [6, 4, 3];
/// Edge of a cell [m], and distance of the cuts from its nodes.
const H: f64 = 0.025;
const THIN: f64 = 1e-6 * H;

fn mesh() -> TetMesh {
    box_mesh(Vector3::zeros(), CELLS.map(|n| n as f64 * H).into(), CELLS, BoxPattern::Tet6)
}

/// Cuts beside all inner layers of nodes, from above through three of four layers of cells.
fn cuts() -> impl Iterator<Item = (u32, BladeSweep)> {
    (1..CELLS[0] as u32).map(|k| {
        let segment = |y: f64| [-H, 4.0 * H].map(|z| Vector3::new(f64::from(k) * H + THIN, y, z));
        (k, BladeSweep { segments: vec![segment(5.0 * H), segment(H - THIN)] })
    })
}

/// ω_max [rad/s] at rest, in the directions that the floor leaves free.
fn omega(cut: &CutMesh, sharing: Option<MassSharing>) -> f64 {
    let mut model = Model::tet4_cut(cut, &MATERIAL, Volumetric::Full).unwrap();
    if let Some(sharing) = sharing {
        model.share_mass(sharing);
    }
    let at = (MATERIAL.density_kg_m3, MassKind::Lumped);
    omega_max(&mut Team::alone(), &model, at, &cut.rest_positions(), &[])
}

fn body(scheme: Scheme, mass: MassKind) -> Body {
    let solver = PcgSettings { iterations: 5_000, tolerance: 1e-8 };
    let mut body =
        Body::new(mesh(), MATERIAL, BodySettings { scheme, mass, solver, ..BodySettings::default() })
            .unwrap();
    for (incision, sweep) in cuts() {
        body.cut(&sweep, incision).unwrap();
    }
    let rest = body.rest_positions();
    let floor: Vec<u32> = (0..rest.len() as u32).filter(|&c| rest[c as usize].y == 0.0).collect();
    body.fix(&floor, [true; 3], Vector3::zeros()).unwrap();
    body
}

#[test]
fn slivers_keep_the_critical_step_and_are_stepped_for_five_seconds() {
    let mut cut = CutMesh::new(mesh()).unwrap();
    let whole = omega(&cut, None);
    let mut elements = 0;
    for (incision, sweep) in cuts() {
        elements += cut.sweep(&cut.rest_positions(), &sweep, incision).unwrap().elements_cut;
    }
    assert!(2 * elements >= mesh().tets.len(), "half of the elements are cut: {elements}");
    let ratio = |sharing| whole / omega(&cut, sharing);
    assert!(ratio(None) < 0.01, "the integrals of slivers: {}", ratio(None));
    let even = ratio(Some(MassSharing::Even));
    assert!(even > 0.95, "even shares: {even}");
    let floored = ratio(Some(MassSharing::Floored));
    assert!(floored > 0.7, "floored: {floored}");

    let mut still = body(Scheme::Static, MassKind::Lumped);
    let report = still.step(1.0, DOWN, &[]);
    assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
    let h = 0.7 * 2.0 / whole;
    for mass in [MassKind::Menouillard, MassKind::Floored] {
        let mut body = body(Scheme::SymplecticEuler, mass);
        for step in 0..(5.0 / h) as usize {
            let report = body.step(h, DOWN, &[]);
            let advanced = report.outcome == Outcome::Advanced && report.substeps == 1;
            assert!(advanced, "{mass:?}, step {step}: {report:?}");
        }
        let nodes = || 0..mesh().nodes.len();
        let sunk = nodes().map(|c| body.rest_positions()[c].y - still.positions()[c].y).fold(0.0, f64::max);
        let apart = nodes().map(|c| (body.positions()[c] - still.positions()[c]).norm()).fold(0.0, f64::max);
        assert!(sunk > 1e-3, "{sunk}");
        assert!(apart < 0.01 * sunk, "{mass:?}: {apart} m from the equilibrium, which sinks by {sunk} m");
    }
}

/// Slices that are cut loose swing, and stiffen as they are stretched: steps that were stable before are none then.
#[test]
fn material_that_stiffens_takes_shorter_steps() {
    for law in [Law::StVenantKirchhoff, Law::NeoHookean] {
        for scheme in [Scheme::SymplecticEuler, Scheme::Rk4] {
            let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [8; 3], BoxPattern::Tet6);
            let settings = BodySettings { scheme, mass: MassKind::Floored, ..BodySettings::default() };
            let mut body = Body::new(mesh, Material { law, ..MATERIAL }, settings).unwrap();
            let held: Vec<u32> =
                (0..).zip(body.rest_positions()).filter(|(_, X)| X.x == 0.0).map(|(n, _)| n).collect();
            body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
            for step in 0..200_u32 {
                if step >= 24 && step % 4 == 0 && step < 52 {
                    // Beside nodes by three tenths of a cell, through all but the lowest layers.
                    let at = 0.0125 * (f64::from((step - 24) / 4 + 1) + 0.3);
                    let edge = |y: f64| [Vector3::new(at, y, -0.02), Vector3::new(at, y, 0.12)];
                    body.cut(&BladeSweep { segments: vec![edge(-0.02), edge(0.08)] }, step).unwrap();
                }
                let report = body.step(0.005, DOWN, &[]);
                assert_eq!(report.outcome, Outcome::Advanced, "{law:?} {scheme:?} {step}: {report:?}");
            }
        }
    }
}
