//! Schoch's beam cases by X-FEM: the cut runs through linear tetrahedra at every fraction, on meshes that
//! know nothing of it, and the solutions converge to the reference.
//!
//! Half of the beam is computed, y ≤ 0.03 m. Cells are tilted against the cut by up to 11°, so that it
//! meets them everywhere between a face and the next; the mesh has lines only where the strip of the load
//! ends. References: `tests/reference/R2`.

use nalgebra::{Matrix4, Vector3, Vector4};
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_physics::solver::Method;

use crate::beam_case::{CUT_Z, DENSITY, FRONT_X, on_strip, solve};
use crate::support::{long_tests, material, reference, vector};

type V = Vector3<f64>;
/// The singularities at the front and at the edge of the strip allow 1.
const LEAST_ORDER: f64 = 0.85;
/// Largest error in the limit of fine meshes.
const LIMIT: f64 = 0.03;

/// 6 n × 6 n × 40 n cells of 5/n mm, tilted by up to 11°.
fn cut_beam(n: usize) -> CutMesh {
    let mut mesh: TetMesh = box_mesh(
        V::zeros(),
        V::new(0.03, 0.03, 0.2),
        [6 * n, 6 * n, 40 * n],
        BoxPattern::Tet5 { parity: false },
    );
    for X in &mut mesh.nodes {
        X.z += (0.2 * (X.y - 0.013) + 0.16 * (X.x - 0.008)) * (std::f64::consts::PI * X.z / 0.2).sin();
    }
    let mut beam = CutMesh::new(mesh).unwrap();
    let blade = |x: f64| [V::new(x, -0.01, CUT_Z), V::new(x, 0.04, CUT_Z)];
    let x = beam.rest_positions();
    beam.sweep(&x, &BladeSweep { segments: vec![blade(-0.01), blade(FRONT_X + 1e-5)] }, 1).unwrap();
    beam
}

/// Displacement [m] of the material at `X`, just above or below the cut where `side` says so.
fn displacement(beam: &CutMesh, model: &Model, x: &[V], X: &V, side: i64) -> V {
    let X = X + V::new(0.0, 0.0, 1e-9 * side as f64);
    let mesh = beam.mesh();
    for (e, tet) in (0u32..).zip(&mesh.tets) {
        let near = tet.iter().any(|&n| (mesh.nodes[n as usize] - X).norm() < 0.012);
        if !near {
            continue;
        }
        let corners = Matrix4::from_columns(&tet.map(|n| mesh.nodes[n as usize].push(1.0)));
        let weights: Vector4<f64> = corners.try_inverse().unwrap() * X.push(1.0);
        if weights.min() > -1e-9 {
            let piece = &beam.pieces()[beam.piece_at(e, weights.into()) as usize];
            let u = |c: u32| x[c as usize] - model.rest()[c as usize];
            return (0..4).map(|a| weights[a] * u(piece.copies[a])).sum();
        }
    }
    panic!("{X} is outside");
}

const QUANTITIES: [&str; 4] = ["energy", "tip", "opening", "reaction"];

/// Signed relative errors of [`QUANTITIES`]; the reaction is that of the strip, 0 without one.
fn errors(beam: &CutMesh, case: &str, key: &str, law: Law) -> [f64; 4] {
    let expected = &reference("R2/beam.json")[case][key];
    let model = Model::tet4_cut(beam, &material(3e5, 0.35, DENSITY, law), Volumetric::Full).unwrap();
    let x = solve(Method::Pcg, &model, case);
    let probe = |name: &str| {
        let probe = &expected["probes"][name];
        let side = probe["side"].as_i64().unwrap();
        [displacement(beam, &model, &x, &vector(&probe["X"]), side), vector(&probe["u"])]
    };
    // Along the reference, in parts of it.
    let relative = |[found, expected]: [V; 2]| (found - expected).dot(&expected) / expected.norm_squared();
    let (low, high) = (probe("mouth_lo_mid"), probe("mouth_hi_mid"));
    let mut errors = [
        2.0 * model.energy(&x) / expected["strain_energy"].as_f64().unwrap() - 1.0,
        relative(probe("tip_mid")),
        relative([high[0] - low[0], high[1] - low[1]]),
        0.0,
    ];
    if case.contains("strip") {
        let mut f = vec![V::zeros(); x.len()];
        model.internal_forces(&x, &mut f);
        let strip = (0..x.len()).filter(|&n| on_strip(&model.rest()[n]));
        let pull: f64 = strip.map(|n| 2.0 * f[n].z).sum();
        errors[3] = pull / expected["reactions"]["left"][2].as_f64().unwrap() - 1.0;
    }
    println!("{case} {law:?}, {} pieces, {} copies: {errors:.4?}", beam.pieces().len(), model.n_nodes());
    errors
}

/// First-order convergence, as the front of a cut and the edge of a strip allow, to the reference: what
/// the two finest meshes say of the limit, 2 u(h/2) − u(h) for h and h/2, is it to `LIMIT`.
fn assert_converges(case: &str, key: &str, law: Law) {
    let finest = if long_tests() && law == Law::Linear { 3 } else { 2 };
    let meshes: Vec<usize> = (1..=finest).collect();
    let errors: Vec<[f64; 4]> = meshes.iter().map(|&n| errors(&cut_beam(n), case, key, law)).collect();
    for (pair, n) in errors.windows(2).zip(meshes.windows(2)) {
        let refined = n[1] as f64 / n[0] as f64;
        for (k, quantity) in QUANTITIES.iter().enumerate().filter(|(k, _)| errors[0][*k] != 0.0) {
            let (coarse, fine) = (pair[0][k], pair[1][k]);
            let order = (coarse / fine).abs().ln() / refined.ln();
            let limit = (refined * fine - coarse) / (refined - 1.0);
            println!(
                "{case} {law:?}: {quantity} off by {:.2} %, order {order:.2}, in the limit {:.2} %",
                100.0 * fine,
                100.0 * limit
            );
            assert!(order > LEAST_ORDER, "{case} {law:?}: {quantity} converges with order {order}");
            assert!(limit.abs() < LIMIT, "{case} {law:?}: {quantity} tends to an error of {limit}");
        }
    }
}

#[test]
fn gravity() {
    assert_converges("tc1_cut", "linear", Law::Linear);
    assert_converges("tc1_cut", "corot", Law::Corotational);
    if long_tests() {
        assert_converges("tc1_cut", "stvk", Law::StVenantKirchhoff);
    }
}

#[test]
fn traction_on_a_strip() {
    assert_converges("tc2force_cut", "linear", Law::Linear);
    assert_converges("tc2force_cut", "stvk", Law::StVenantKirchhoff);
    if long_tests() {
        assert_converges("tc2force_cut", "corot", Law::Corotational);
    }
}

#[test]
fn strip_pulled_along_z() {
    assert_converges("tc2strip_z_cut", "linear", Law::Linear);
    if long_tests() {
        assert_converges("tc2strip_z_cut", "stvk", Law::StVenantKirchhoff);
    }
}

#[test]
fn strip_pulled_along_z_and_held_across() {
    assert_converges("tc2strip_xyz_cut", "linear", Law::Linear);
    if long_tests() {
        assert_converges("tc2strip_xyz_cut", "stvk", Law::StVenantKirchhoff);
    }
}
