//! Forces are the gradient of the energy, and tangents that of the forces, for every element, law and
//! remedy. Masses add up. No result depends on an earlier call.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::cut::{BladeSweep, CutMesh};
use scindo_matter::element::{ElementKind, Spring};
use scindo_matter::material::{Law, Material, Rayleigh, Region, Regions};
use scindo_matter::mesh::{BoxPattern, box_hexes, box_mesh};
use scindo_matter::team::Team;

use super::*;

fn material(law: Law) -> Material {
    Material { young_pa: 3.0, poisson: 0.3, density_kg_m3: 2.0, rayleigh: Rayleigh::default(), law }
}

const AVERAGED: Volumetric = Volumetric::NodeAveraged { kept: 0.05 };

fn size() -> Vector3<f64> {
    Vector3::new(1.0, 0.8, 1.1)
}

fn cut_box() -> CutMesh {
    let mesh = box_mesh(Vector3::zeros(), size(), [2; 3], BoxPattern::Tet6);
    let mut cut = CutMesh::new(mesh).unwrap();
    let segment = |x: f64| [Vector3::new(x, -0.3, 0.47), Vector3::new(x, 1.3, 0.53)];
    let x = cut.rest_positions();
    cut.sweep(&x, &BladeSweep { segments: vec![segment(-0.3), segment(0.8)] }, 1).unwrap();
    assert!(cut.n_copies() > 27);
    cut
}

/// Every element with every law and remedy, on small meshes; one of them distorted, one cut.
fn models() -> Vec<Model> {
    let tets = box_mesh(Vector3::zeros(), size(), [2; 3], BoxPattern::Tet5 { parity: false });
    let mut hexes = box_hexes(Vector3::zeros(), size(), [2; 3]);
    for (i, x) in hexes.nodes.iter_mut().enumerate() {
        let t = i as f64;
        *x += 0.05 * Vector3::new((3.0 * t).sin(), (5.0 * t).cos(), (7.0 * t).sin());
    }
    let cut = cut_box();
    let spring = Spring { a: 0, b: 13, stiffness_n_m: 2.0, rest_length_m: 0.4 };
    let mut models = Vec::new();
    for law in Law::ALL {
        let material = material(law);
        models.push(Model::tet4(&tets, &material, Volumetric::Full).unwrap());
        models.push(
            Model::tet4_cut(&cut, &material, Volumetric::Full).unwrap().with_springs(vec![spring]).unwrap(),
        );
        models.push(Model::tet10(&tets, &material).unwrap());
        models.push(Model::hex8(&hexes, &material, Volumetric::Full).unwrap());
        if law.splits() {
            models.push(Model::tet4(&tets, &material, AVERAGED).unwrap());
            models.push(Model::tet4_cut(&cut, &material, AVERAGED).unwrap());
            models.push(Model::hex8(&hexes, &material, Volumetric::Selective).unwrap());
        }
    }
    models
}

fn name(model: &Model) -> String {
    format!("{:?} {:?} {:?}", model.kind(), model.law(), model.volumetric())
}

/// A large smooth deformation with some noise.
fn deformed(model: &Model) -> Vec<Vector3<f64>> {
    let A = Matrix3::new(0.7, -0.6, 0.1, 0.5, 0.9, 0.2, 0.1, 0.1, 1.2);
    let noise = |t: f64| 0.03 * Vector3::new((9.0 * t).sin(), (11.0 * t).cos(), (13.0 * t).sin());
    let bend = |X: &Vector3<f64>| 0.1 * Vector3::new(X.y * X.z, X.x * X.x, -X.x * X.y);
    model.rest().iter().enumerate().map(|(i, X)| A * X + bend(X) + noise(i as f64)).collect()
}

#[test]
fn forces_are_the_gradient_of_the_energy() {
    for model in models() {
        let mut x = deformed(&model);
        let mut f = vec![Vector3::zeros(); x.len()];
        let energy = model.internal_forces(&x, &mut f);
        assert!((energy - model.energy(&x)).abs() < 1e-13 * energy, "{}", name(&model));
        let h = 1e-5;
        for i in (0..x.len()).step_by(5) {
            for axis in 0..3 {
                let there = x[i][axis];
                x[i][axis] = there + h;
                let above = model.energy(&x);
                x[i][axis] = there - h;
                let below = model.energy(&x);
                x[i][axis] = there;
                let slope = (above - below) / (2.0 * h);
                assert!((slope - f[i][axis]).abs() < 1e-8, "{}: {slope} {}", name(&model), f[i][axis]);
            }
        }
    }
}

#[test]
fn the_exact_tangent_is_the_gradient_of_the_forces() {
    for model in models() {
        let mut x = deformed(&model);
        let n = x.len();
        let mut K = model.pattern();
        model.tangent(&x, Tangent::Exact, &mut K);
        let (mut above, mut below) = (vec![Vector3::zeros(); n], vec![Vector3::zeros(); n]);
        let h = 1e-5;
        for j in (0..n).step_by(7) {
            for axis in 0..3 {
                let there = x[j][axis];
                x[j][axis] = there + h;
                model.internal_forces(&x, &mut above);
                x[j][axis] = there - h;
                model.internal_forces(&x, &mut below);
                x[j][axis] = there;
                for i in 0..n {
                    let slope = (above[i] - below[i]) / (2.0 * h);
                    let column = K.block(i, j as u32).column(axis).into_owned();
                    assert!((slope - column).norm() < 1e-7, "{} {i} {j}", name(&model));
                }
            }
        }
    }
}

/// With the stress of E(F) − ½ DᵀD, D the step, the forces change by that of ½ DᵀD less as F does.
#[test]
fn the_extrapolated_tangent_has_the_stress_of_a_straight_step() {
    for model in models() {
        // Part of the way, where no stretch is below that of the continuation.
        let part = |t: f64| model.rest().iter().zip(deformed(&model)).map(|(X, x)| X + t * (x - X)).collect();
        let (from, x): (Vec<_>, Vec<_>) = (part(0.1), part(0.25));
        let (mut K, mut exact) = (model.pattern(), model.pattern());
        let mut team = scindo_matter::team::Team::new(1).unwrap();
        let known = model.extrapolated_tangent_by(&mut team, &x, &x, &mut K);
        assert_eq!(known, model.law() == Law::StVenantKirchhoff, "{}", name(&model));
        if !known {
            assert_eq!(K, model.pattern());
            continue;
        }
        model.tangent(&x, Tangent::Exact, &mut exact);
        assert_eq!(K, exact, "a step of length zero extrapolates nothing");
        model.extrapolated_tangent_by(&mut team, &from, &x, &mut K);
        let v: Vec<_> = model.rest().iter().map(|X| Vector3::new(X.y * X.z, X.x, X.x * X.x - X.y)).collect();
        let (mut f, mut expected) = (vec![Vector3::zeros(); x.len()], vec![Vector3::zeros(); x.len()]);
        K.multiply(&v, &mut f);
        exact.multiply(&v, &mut expected);
        for e in 0..model.n_elements() {
            for q in 0..model.kind().points() {
                let [F, F_from, F_v] = [&x, &from, &v].map(|x| model.deformation_gradient(e, q, x));
                let half = 0.5 * (F - F_from).transpose() * (F - F_from);
                let S = 2.0 * model.lame().mu * half
                    + Matrix3::from_diagonal_element(model.lame().lambda * half.trace());
                for (&n, g) in model.element(e).iter().zip(model.gradients(e, q)) {
                    expected[n as usize] -= model.weights(e)[q] * F_v * S * g;
                }
            }
        }
        let apart = f.iter().zip(&expected).map(|(f, e)| (f - e).norm()).fold(0.0, f64::max);
        assert!(apart < 1e-13, "{}: {apart:e}", name(&model));
        assert!(exact != K);
        for threads in [2, 3] {
            let mut K_by = model.pattern();
            let mut team = scindo_matter::team::Team::new(threads).unwrap();
            model.extrapolated_tangent_by(&mut team, &from, &x, &mut K_by);
            assert_eq!(K_by, K, "{} on {threads} threads", name(&model));
        }
    }
}

#[test]
fn projected_and_held_tangents_are_symmetric_and_not_negative() {
    for model in models() {
        let mut x = deformed(&model);
        x.iter_mut().for_each(|x| x.z *= 0.4); // compressed: the exact tangent is indefinite
        let n = x.len();
        let mut K = model.pattern();
        for kind in [Tangent::Projected, Tangent::Held] {
            model.tangent(&x, kind, &mut K);
            let dense = nalgebra::DMatrix::from_fn(3 * n, 3 * n, |r, c| {
                K.block(r / 3, (c / 3) as u32)[(r % 3, c % 3)]
            });
            let size = dense.amax();
            assert!((&dense - dense.transpose()).amax() < 1e-14 * size, "{}", name(&model));
            let least = dense.symmetric_eigenvalues().min();
            assert!(least > -1e-12 * size, "{} {kind:?}: {least}", name(&model));
        }
    }
}

#[test]
fn masses_add_up_and_agree_in_their_moments() {
    for model in models() {
        let total: f64 = (0..model.n_elements()).map(|e| model.volume(e)).sum::<f64>() * 2.0;
        let lumped = model.lumped_mass(2.0);
        assert!((lumped.iter().sum::<f64>() - total).abs() < 1e-12);
        assert!(lumped.iter().all(|m| *m > 0.0));
        let mut M = model.pattern();
        model.consistent_mass(2.0, &mut M);
        // Linear fields are in the space, so their integrals are exact with either mass.
        let one = vec![Vector3::repeat(1.0); model.n_nodes()];
        let x = model.rest().to_vec();
        let consistent = M.bilinear(&one, &x);
        let from_lumped: f64 = lumped.iter().zip(&x).map(|(m, x)| m * x.sum()).sum();
        let from_integrals: f64 =
            model.shape_integrals().iter().zip(&x).map(|(v, x)| 2.0 * v * x.sum()).sum();
        assert!(
            (consistent - from_lumped).abs() < 1e-12 && (consistent - from_integrals).abs() < 1e-12,
            "{}",
            name(&model)
        );
    }
    // ∫ x² over the cut box is that of the box: quadratic products of the pieces are exact.
    let model = Model::tet4_cut(&cut_box(), &material(Law::Linear), Volumetric::Full).unwrap();
    let mut M = model.pattern();
    model.consistent_mass(1.0, &mut M);
    let x: Vec<_> = model.rest().iter().map(|X| Vector3::new(X.x, 0.0, 0.0)).collect();
    assert!((M.bilinear(&x, &x) - 0.8 * 1.1 / 3.0).abs() < 1e-12);
}

#[test]
fn unusable_combinations_are_refused() {
    let tets = box_mesh(Vector3::zeros(), size(), [1; 3], BoxPattern::Tet6);
    let hexes = box_hexes(Vector3::zeros(), size(), [1; 3]);
    let linear = material(Law::Linear);
    let refused = Model::tet4(&tets, &linear, Volumetric::Selective);
    assert!(matches!(refused, Err(ModelError::Remedy { element: ElementKind::Tet4, .. })));
    assert!(matches!(Model::hex8(&hexes, &linear, AVERAGED), Err(ModelError::Remedy { .. })));
    let kept = Model::tet4(&tets, &linear, Volumetric::NodeAveraged { kept: f64::NAN });
    assert!(matches!(kept, Err(ModelError::Kept { .. })));
    let model = Model::tet4(&tets, &linear, Volumetric::Full).unwrap();
    let loop_spring = Spring { a: 1, b: 1, stiffness_n_m: 1.0, rest_length_m: 0.0 };
    assert!(matches!(model.with_springs(vec![loop_spring]), Err(ModelError::Spring { spring: 0 })));
    let broken = Material { poisson: 0.6, ..linear };
    assert!(matches!(Model::tet10(&tets, &broken), Err(ModelError::Material(_))));
}

#[test]
fn a_team_gives_the_bits_of_one_thread() {
    let big = box_mesh(Vector3::zeros(), size(), [7; 3], BoxPattern::Tet5 { parity: false });
    let mut all = models();
    all.push(Model::tet4(&big, &material(Law::Corotational), AVERAGED).unwrap());
    all.push(Model::tet10(&big, &material(Law::NeoHookean)).unwrap());
    for model in all {
        let x = deformed(&model);
        let mut f = vec![Vector3::zeros(); x.len()];
        let mut K = model.pattern();
        let energy = model.internal_forces(&x, &mut f);
        model.tangent(&x, Tangent::Projected, &mut K);
        for threads in [1, 2, 3] {
            let mut team = Team::new(threads).unwrap();
            let (mut f_by, mut K_by) = (vec![Vector3::repeat(7.0); x.len()], model.pattern());
            assert_eq!(model.internal_forces_by(&mut team, &x, &mut f_by), energy, "{}", name(&model));
            assert_eq!(model.energy_by(&mut team, &x), model.energy(&x), "{}", name(&model));
            model.tangent_by(&mut team, &x, Tangent::Projected, &mut K_by);
            assert!(f_by == f && K_by == K, "{} on {threads} threads", name(&model));
        }
    }
}

/// Incisions that end inside, go on and cut parts off.
#[test]
fn a_model_that_follows_cuts_is_the_one_built_anew() {
    let mesh = box_mesh(Vector3::zeros(), size(), [4; 3], BoxPattern::Tet6);
    let [even, floored] = [MassSharing::Even, MassSharing::Floored].map(Some);
    let kinds = [Volumetric::Full; 3].into_iter().zip([None, even, floored]).chain([(AVERAGED, None)]);
    let upper = mesh.tets.iter().map(|tet| u16::from(tet.iter().all(|&n| mesh.nodes[n as usize].z > 0.5)));
    let dense = Region { young_pa: 30.0, poisson: 0.2, density_kg_m3: 5.0 };
    let two = Regions::new(vec![dense], upper.collect()).unwrap();
    assert!((20..mesh.tets.len() - 20).contains(&two.counts()[0]));
    let kinds = kinds.map(|kind| (kind, Regions::default()));
    for ((volumetric, sharing), regions) in kinds.chain([((Volumetric::Full, None), two)]) {
        let material = material(Law::Corotational);
        let mut cut = CutMesh::new(mesh.clone()).unwrap();
        let fresh = |cut: &CutMesh| {
            let model = Model::tet4_cut(cut, &material, volumetric).unwrap();
            let mut model = model.with_regions_of_tets(cut, &regions).unwrap();
            if let Some(sharing) = sharing {
                model.share_mass(sharing);
            }
            model
        };
        let mut followed = fresh(&cut);
        for (incision, x, reach) in [(1, 0.31, 0.5), (2, 0.62, 1.3), (1, 0.31, 1.3), (3, 0.9, 0.7)] {
            let segment = |y: f64| [Vector3::new(x, y, -0.3), Vector3::new(x + 0.05, y, 1.4)];
            let sweep = BladeSweep { segments: vec![segment(-0.3), segment(reach)] };
            let at_rest = cut.rest_positions();
            assert!(cut.sweep(&at_rest, &sweep, incision).unwrap().elements_cut > 0);
            followed.follow_cut(&cut, &regions);
            let anew = fresh(&cut);
            assert_eq!(followed.lumped_mass(2.0), anew.lumped_mass(2.0));
            assert_eq!(followed.shape_integrals(), anew.shape_integrals());
            let at = deformed(&anew);
            let mut team = Team::new(2).unwrap();
            let results = [&followed, &anew].map(|model| {
                let (mut K, mut M) = (model.pattern(), model.pattern());
                let mut f = vec![Vector3::zeros(); model.n_nodes()];
                model.tangent_by(&mut team, &at, Tangent::Exact, &mut K);
                model.consistent_mass(2.0, &mut M);
                let energy = model.internal_forces_by(&mut team, &at, &mut f);
                (M, (K, energy, f, model.energy(&at)))
            });
            let [(M, of_followed), (expected, of_anew)] = &results;
            assert!(of_followed == of_anew, "{volumetric:?} {sharing:?} incision {incision}");
            // A piece that is bisected, but not divided, sums its products over other fragments.
            let equal = |(a, b): (&[f64; 9], &[f64; 9])| (a[0] - b[0]).abs() <= 1e-14 * b[0].abs();
            assert!(M.blocks.iter().zip(&expected.blocks).all(equal), "{volumetric:?} incision {incision}");
        }
        assert!(followed.n_nodes() > mesh.nodes.len() + 50);
    }
}
