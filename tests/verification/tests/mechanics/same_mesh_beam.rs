//! Schoch's half-cut beam on a mesh of linear tetrahedra, cut by the real cut along a layer of faces,
//! against an independent implementation that duplicates the nodes there.

use nalgebra::Vector3;
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::support::{clamped, equilibrium, held, long_tests, material, reference, vector};

/// Displacements agree to this part of the largest one, energies and reactions to this part of
/// themselves.
const RELATIVE: f64 = 1e-6;
const DENSITY: f64 = 1070.0;

fn beam(cells: [usize; 3], cut: bool) -> CutMesh {
    let mesh =
        box_mesh(Vector3::zeros(), Vector3::new(0.03, 0.06, 0.2), cells, BoxPattern::Tet5 { parity: false });
    let mut beam = CutMesh::new(mesh).unwrap();
    if cut {
        let blade = |x: f64| [Vector3::new(x, -0.01, 0.1), Vector3::new(x, 0.07, 0.1)];
        let x = beam.rest_positions();
        beam.sweep(&x, &BladeSweep { segments: vec![blade(-0.01), blade(0.0151)] }, 1).unwrap();
    }
    beam
}

/// The copy at a rest position whose material is on this side of the cut (0: the only copy).
fn copy_at(model: &Model, X: &Vector3<f64>, side: i64) -> usize {
    let beside = |n: usize| {
        side == 0
            || (0..model.n_elements()).any(|e| {
                let nodes = model.element(e);
                nodes.contains(&(n as u32)) && {
                    let z: f64 = nodes.iter().map(|&n| model.rest()[n as usize].z).sum::<f64>() / 4.0;
                    (z > X.z) == (side > 0)
                }
            })
    };
    let copies: Vec<usize> = (0..model.n_nodes()).filter(|&n| (model.rest()[n] - X).norm() < 1e-9).collect();
    *copies.iter().find(|&&n| copies.len() == 1 || beside(n)).unwrap()
}

/// The edge {x = 0, z = 0.2}.
fn on_edge(X: &Vector3<f64>) -> bool {
    X.x < 1e-9 && X.z > 0.2 - 1e-9
}

fn assert_case(case: &str, key: &str, law: Law) {
    let expected = &reference("R2_tet4_same_mesh/beam.json")[case][key];
    let cells = if case.ends_with("12x24x80") { [12, 24, 80] } else { [6, 12, 40] };
    let beam = beam(cells, !case.contains("uncut"));
    let material = material(3e5, 0.35, DENSITY, law);
    let model = Model::tet4_cut(&beam, &material, Volumetric::Full).unwrap();
    let clamp = clamped(&model, |X| X.z < 1e-9);
    let mut loads = vec![Vector3::zeros(); model.n_nodes()];
    let mut pulled: Option<[bool; 3]> = None;
    if case.starts_with("tc1") {
        for (f, m) in loads.iter_mut().zip(model.lumped_mass(DENSITY)) {
            f.x = 9.81 * m;
        }
    } else {
        pulled = Some(if case.starts_with("tc2z") { [false, false, true] } else { [true; 3] });
    }
    let mut x = model.rest().to_vec();
    // Large pulls are made in steps, so that every step stays on the branch that starts at rest.
    let steps = if law == Law::Linear || pulled.is_none() { 1 } else { 4 };
    for step in 1..=steps {
        let pull = 0.02 * f64::from(step) / f64::from(steps);
        let mut fixed = clamp.clone();
        if let Some(axes) = pulled {
            let edge = (0..model.n_nodes()).filter(|&n| on_edge(&model.rest()[n]));
            fixed.extend(edge.map(|n| held(n, axes, model.rest()[n] + Vector3::new(0.0, 0.0, pull))));
        }
        x = equilibrium(&model, &loads, &fixed, &x);
    }
    let largest = (0..x.len()).map(|n| (x[n] - model.rest()[n]).norm()).fold(0.0, f64::max);
    let mut worst = 0.0_f64;
    for (name, probe) in expected["probes"].as_object().unwrap() {
        let n = copy_at(&model, &vector(&probe["X"]), probe["side"].as_i64().unwrap());
        let difference = x[n] - model.rest()[n] - vector(&probe["u"]);
        worst = worst.max(difference.norm() / largest);
        assert!(difference.norm() < RELATIVE * largest, "{case} {key} {name}: {difference}");
    }
    let energy = model.energy(&x);
    let reference_energy = expected["strain_energy"].as_f64().unwrap();
    println!(
        "{case} {law:?}: probes to {worst:.1e}, energy {energy:.9e} J (reference {reference_energy:.9e})"
    );
    assert!((energy / reference_energy - 1.0).abs() < RELATIVE, "{case} {key}: {energy} J");
    let mut f = vec![Vector3::zeros(); x.len()];
    model.internal_forces(&x, &mut f);
    let reaction = |held: &dyn Fn(&Vector3<f64>) -> bool| {
        let at = (0..x.len()).filter(|&n| held(&model.rest()[n]));
        at.map(|n| f[n] - loads[n]).sum::<Vector3<f64>>()
    };
    let base = vector(&expected["reaction_base"]);
    // The reference counts the load on the clamp itself as carried.
    let found = reaction(&|X| X.z < 1e-9);
    assert!((found - base).norm() < RELATIVE * base.norm(), "{case} {key}: {found} instead of {base}");
    if pulled.is_some() {
        let left = vector(&expected["reaction_left"]);
        assert!((reaction(&on_edge) - left).norm() < RELATIVE * left.norm(), "{case} {key}");
    }
}

#[test]
fn gravity_linear() {
    assert_case("tc1_cut_6x12x40", "linear", Law::Linear);
    assert_case("tc1_uncut_6x12x40", "linear", Law::Linear);
}

#[test]
fn gravity_linear_on_half_the_mesh_size() {
    if long_tests() {
        assert_case("tc1_cut_12x24x80", "linear", Law::Linear);
    }
}

#[test]
fn gravity_corotational() {
    assert_case("tc1_cut_6x12x40", "corot", Law::Corotational);
    assert_case("tc1_uncut_6x12x40", "corot", Law::Corotational);
}

#[test]
fn gravity_st_venant_kirchhoff() {
    assert_case("tc1_cut_6x12x40", "stvk", Law::StVenantKirchhoff);
    assert_case("tc1_uncut_6x12x40", "stvk", Law::StVenantKirchhoff);
}

#[test]
fn edge_pulled_along_z() {
    assert_case("tc2z_cut_6x12x40", "linear", Law::Linear);
    assert_case("tc2z_uncut_6x12x40", "linear", Law::Linear);
    assert_case("tc2z_cut_6x12x40", "corot", Law::Corotational);
    assert_case("tc2z_uncut_6x12x40", "corot", Law::Corotational);
    assert_case("tc2z_cut_6x12x40", "stvk", Law::StVenantKirchhoff);
}

#[test]
fn edge_moved_along_z_and_held_across() {
    assert_case("tc2xyz_cut_6x12x40", "linear", Law::Linear);
    assert_case("tc2xyz_cut_6x12x40", "corot", Law::Corotational);
    assert_case("tc2xyz_cut_6x12x40", "stvk", Law::StVenantKirchhoff);
}
