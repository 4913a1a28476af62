//! Rigid motions and uniform strain, which every discretisation must reproduce to round-off, for every
//! element, law and remedy, whole and cut.

use nalgebra::{Matrix3, Rotation3, Vector3};
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::element::FixedCopy;
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, HexMesh, TetMesh, box_hexes, box_mesh};

use crate::support::{equilibrium, held, material};

const SIZE: Vector3<f64> = Vector3::new(1.2, 0.8, 1.0);
const YOUNG: f64 = 3.0;
/// Forces [N] below this are round-off: 1e-13 · E · (1 m)², with some hundred terms.
const ROUND_OFF: f64 = 3e-12;

/// Moves the nodes inside the box about, so that no element is regular.
fn distort(nodes: &mut [Vector3<f64>]) {
    for (i, x) in nodes.iter_mut().enumerate() {
        let inside = (0..3).all(|k| x[k] > 1e-9 && x[k] < SIZE[k] - 1e-9);
        if inside {
            let t = i as f64;
            *x += 0.04 * Vector3::new((3.0 * t).sin(), (5.0 * t).cos(), (7.0 * t).sin());
        }
    }
}

fn tets(cells: [usize; 3]) -> TetMesh {
    let mut mesh = box_mesh(Vector3::zeros(), SIZE, cells, BoxPattern::Tet5 { parity: false });
    distort(&mut mesh.nodes);
    mesh
}

fn hexes() -> HexMesh {
    let mut mesh = box_hexes(Vector3::zeros(), SIZE, [4, 3, 3]);
    distort(&mut mesh.nodes);
    mesh
}

/// The box with one oblique cut right through and a second, partial one across it. Neither follows
/// the mesh; both are parallel to the x axis, so that no tension along x crosses them.
fn cut_tets() -> CutMesh {
    let mut cut = CutMesh::new(tets([6, 5, 6])).unwrap();
    let blade = |from: [f64; 2], to: [f64; 2], depth: f64| {
        let at = |x: f64| [Vector3::new(x, from[0], from[1]), Vector3::new(x, to[0], to[1])];
        BladeSweep { segments: vec![at(-0.2), at(0.5 * depth), at(depth)] }
    };
    let x = cut.rest_positions();
    cut.sweep(&x, &blade([-0.1, 0.42], [0.9, 0.61], 1.4), 1).unwrap();
    let x = cut.rest_positions();
    cut.sweep(&x, &blade([0.33, -0.1], [0.47, 0.45], 0.75), 2).unwrap();
    assert_eq!(cut.components().len(), 2);
    cut
}

/// Every element with every law and the remedies it allows.
fn models() -> Vec<Model> {
    let (tets, hexes, cut) = (tets([4, 3, 3]), hexes(), cut_tets());
    let averaged = Volumetric::NodeAveraged { kept: 0.05 };
    let mut models = Vec::new();
    for law in Law::ALL {
        let material = material(YOUNG, 0.3, 1.0, law);
        models.push(Model::tet4(&tets, &material, Volumetric::Full).unwrap());
        models.push(Model::tet4_cut(&cut, &material, Volumetric::Full).unwrap());
        models.push(Model::tet10(&tets, &material).unwrap());
        models.push(Model::hex8(&hexes, &material, Volumetric::Full).unwrap());
        if law.splits() {
            models.push(Model::tet4(&tets, &material, averaged).unwrap());
            models.push(Model::tet4_cut(&cut, &material, averaged).unwrap());
            models.push(Model::hex8(&hexes, &material, Volumetric::Selective).unwrap());
        } else {
            assert!(Model::tet4(&tets, &material, averaged).is_err());
            assert!(Model::hex8(&hexes, &material, Volumetric::Selective).is_err());
        }
    }
    models
}

fn name(model: &Model) -> String {
    format!("{:?} {:?} {:?}, {} nodes", model.kind(), model.law(), model.volumetric(), model.n_nodes())
}

fn largest(f: &[Vector3<f64>]) -> f64 {
    f.iter().map(|f| f.amax()).fold(0.0, f64::max)
}

/// Parts of a model that hang together, as a label per node.
fn parts(model: &Model) -> Vec<usize> {
    let mut label: Vec<usize> = (0..model.n_nodes()).collect();
    let mut changed = true;
    while changed {
        changed = false;
        for e in 0..model.n_elements() {
            let least = model.element(e).iter().map(|&n| label[n as usize]).min().unwrap();
            for &n in model.element(e) {
                changed |= label[n as usize] != least;
                label[n as usize] = least;
            }
        }
    }
    label
}

#[test]
fn a_rigid_motion_of_every_part_costs_nothing() {
    for model in models() {
        let parts = parts(&model);
        let motion = |part: usize| {
            let t = part as f64;
            let turn = Vector3::new(1.1 + t, -0.7 * t, 0.4);
            let shift = Vector3::new(2.0, -1.0 + t, 0.5);
            // Small-strain elasticity knows small rotations only: x = X + ω × X.
            let R = match model.law() {
                Law::Linear => Matrix3::identity() + turn.cross_matrix(),
                _ => *Rotation3::new(turn).matrix(),
            };
            move |X: &Vector3<f64>| R * X + shift
        };
        let x: Vec<_> = model.rest().iter().zip(&parts).map(|(X, &part)| motion(part % 7)(X)).collect();
        let mut f = vec![Vector3::zeros(); x.len()];
        let energy = model.internal_forces(&x, &mut f);
        assert!(energy.abs() < 1e-15 * YOUNG, "{}: {energy:e} J", name(&model));
        assert!(largest(&f) < ROUND_OFF, "{}: {:e} N", name(&model), largest(&f));
    }
}

#[test]
fn internal_forces_have_no_resultant_and_no_moment() {
    for model in models() {
        let A = Matrix3::new(0.8, -0.5, 0.1, 0.4, 1.1, 0.2, 0.1, 0.1, 0.9);
        let wave = |X: &Vector3<f64>, i: usize| {
            0.1 * Vector3::new(X.y * X.z, X.x * X.x, -X.x * X.y) + 0.02 * Vector3::repeat((i as f64).sin())
        };
        let x: Vec<_> = model.rest().iter().enumerate().map(|(i, X)| A * X + wave(X, i)).collect();
        let mut f = vec![Vector3::zeros(); x.len()];
        model.internal_forces(&x, &mut f);
        // The moment of small-strain forces is balanced at rest, that of the others in place.
        let arms = if model.law() == Law::Linear { model.rest() } else { &x };
        let force: Vector3<f64> = f.iter().sum();
        let moment: Vector3<f64> = arms.iter().zip(&f).map(|(x, f)| x.cross(f)).sum();
        assert!(largest(&f) > 1e-3);
        assert!(force.amax() < ROUND_OFF && moment.amax() < ROUND_OFF, "{}: {force} {moment}", name(&model));
    }
}

/// Uniform strain on the boundary is the solution inside.
#[test]
fn uniform_strain_is_reproduced() {
    let A = Matrix3::new(1.1, 0.05, -0.04, 0.08, 0.95, 0.06, 0.02, -0.03, 1.04);
    for model in models() {
        let exact: Vec<_> = model.rest().iter().map(|X| A * X).collect();
        // Copies that carry material beside a cut see its free faces; they are prescribed as well.
        let mut at_boundary: Vec<bool> =
            model.rest().iter().map(|X| (0..3).any(|k| X[k] < 1e-9 || X[k] > SIZE[k] - 1e-9)).collect();
        let mut f = vec![Vector3::zeros(); exact.len()];
        model.internal_forces(&exact, &mut f);
        for (b, f) in at_boundary.iter_mut().zip(&f) {
            *b |= f.amax() > 1e-12;
        }
        let inside = at_boundary.iter().filter(|b| !**b).count();
        assert!(inside >= 5, "{}: {inside} nodes inside", name(&model));
        let fixed: Vec<FixedCopy> =
            (0..exact.len()).filter(|&n| at_boundary[n]).map(|n| held(n, [true; 3], exact[n])).collect();
        let start: Vec<_> = exact
            .iter()
            .enumerate()
            .map(|(i, x)| {
                x + if at_boundary[i] { Vector3::zeros() } else { Vector3::repeat(0.02 * (i as f64).sin()) }
            })
            .collect();
        let x = equilibrium(&model, &[], &fixed, &start);
        let error = exact.iter().zip(&x).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        assert!(error < 1e-10, "{}: {error:e} m", name(&model));
    }
}

/// Tension along x, between two clamps that let the sides contract: uniform whatever is cut along x,
/// and every copy at the cuts is free.
#[test]
fn tension_along_a_cut_does_not_notice_it() {
    for model in models() {
        let stretch = 1.07;
        let F = |side: f64| Matrix3::from_diagonal(&Vector3::new(stretch, side, side));
        let sideways = |side: f64| model.law().stress(&F(side), model.lame())[(1, 1)];
        let (mut low, mut high) = (0.9, 1.1);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if sideways(middle) > 0.0 { high = middle } else { low = middle }
        }
        let A = F(low);
        let exact: Vec<_> = model.rest().iter().map(|X| A * X).collect();
        // Every copy at the ends carries some of the clamped face.
        let fixed: Vec<FixedCopy> = (0..model.n_nodes())
            .filter(|&n| model.rest()[n].x < 1e-9 || model.rest()[n].x > SIZE.x - 1e-9)
            .map(|n| held(n, [true; 3], exact[n]))
            .collect();
        let x = equilibrium(&model, &[], &fixed, model.rest());
        let error = exact.iter().zip(&x).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        assert!(error < 1e-9, "{}: {error:e} m", name(&model));
    }
}
