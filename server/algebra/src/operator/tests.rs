//! The kernels against double precision, and the assembled stiffness against the tets.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::cut::{BladeSweep, CutMesh, Piece};
use scindo_matter::element::{Simd, deformation_gradient, piece_forces};
use scindo_matter::material::{Corotational, Lame, Law, SignedSvd, Tangent};
use scindo_matter::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_matter::team::Team;

use super::{
    BLOCK, Block6, Elastic, ElasticUpdate, LinearOperator, OperatorChoice, Padded, Stiffness, Tension,
};

const LAME: Lame = Lame { mu: 4e4, lambda: 9e4 };

fn mesh() -> (TetMesh, Vec<Piece>) {
    let mesh = box_mesh(Vector3::zeros(), Vector3::new(0.3, 0.2, 0.2), [9, 6, 7], BoxPattern::Tet6);
    let piece = |e: usize| Piece { element: e as u32, fraction: 1.0, copies: mesh.tets[e] };
    let pieces = (0..mesh.tets.len()).map(piece).collect();
    (mesh, pieces)
}

/// A large rotation, a stretch, and noise of `noise` edge lengths; `far` [m] along x.
fn deformed(mesh: &TetMesh, noise: f64, far: f64) -> Vec<Vector3<f64>> {
    let turn = nalgebra::Rotation3::new(Vector3::new(1.0, -0.7, 0.4));
    let stretch = Matrix3::from_diagonal(&Vector3::new(1.2, 0.9, 1.05));
    let place = |(n, X): (usize, &Vector3<f64>)| {
        let t = n as f64;
        let jitter = Vector3::new((12.9 * t).sin(), (78.2 * t).sin(), (37.7 * t).sin());
        turn * (stretch * X) + (0.033 * noise) * jitter + Vector3::new(far, 0.0, 0.0)
    };
    mesh.nodes.iter().enumerate().map(place).collect()
}

struct Updated {
    elastic: Elastic,
    f: Vec<Padded>,
    diagonal: Vec<Block6>,
    inverted: usize,
}

fn updated(simd: Simd, choice: OperatorChoice, law: Law, x: &[Vector3<f64>], scale: f64) -> Updated {
    let (mesh, pieces) = mesh();
    let n = mesh.nodes.len();
    let mut elastic = Elastic::new(simd, &mesh, &pieces, n);
    elastic.set_choice(choice);
    let (mut f, mut diagonal) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
    let with = ElasticUpdate { lame: LAME, law, scale };
    let inverted = elastic.update_all(&mut Team::new(1).unwrap(), &with, x, &mut f, &mut diagonal);
    Updated { elastic, f, diagonal, inverted }
}

/// The same under the tension of the positions `at`, whose share of the stiffness is `s` of `scale`.
fn tense(simd: Simd, choice: OperatorChoice, [x, at]: [&[Vector3<f64>]; 2], s: f64, density: f64) -> Updated {
    let tension = Tension { at, start: at, s, density_kg_m3: density, damping: 0.0, definite: true };
    tense_by(Law::Corotational, (simd, choice), x, &tension)
}

fn tense_by(
    law: Law,
    (simd, choice): (Simd, OperatorChoice),
    x: &[Vector3<f64>],
    tension: &Tension<'_>,
) -> Updated {
    let (mesh, pieces) = mesh();
    let n = mesh.nodes.len();
    let mut elastic = Elastic::new(simd, &mesh, &pieces, n);
    elastic.set_choice(choice);
    let with = ElasticUpdate { lame: LAME, law, scale: 1e-4 };
    let inverted = elastic.update(&mut Team::new(2).unwrap(), &with, x, Some(tension));
    let (mut f, mut diagonal) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
    f.chunks_mut(BLOCK).enumerate().for_each(|(block, f)| elastic.forces(block, f));
    diagonal.chunks_mut(BLOCK).enumerate().for_each(|(block, d)| elastic.diagonals(block, d));
    Updated { elastic, f, diagonal, inverted }
}

/// A direction with an entry of its own for every copy.
fn direction(n: usize) -> Vec<Padded> {
    (0..n).map(|n| [(0.3 * n as f32).sin(), (1.7 * n as f32).cos(), (0.9 * n as f32).sin(), 0.0]).collect()
}

/// s Σ V (Q̂ w) × ĝ of the twists by their definition, with rotations of `x` and stretches of `at`.
fn twists(x: &[Vector3<f64>], at: &[Vector3<f64>], u: &[Padded]) -> Vec<Vector3<f64>> {
    let (mesh, pieces) = mesh();
    let mut y = vec![Vector3::zeros(); x.len()];
    for piece in &pieces {
        let g = mesh.gradients(piece.element as usize);
        let F = |x: &[Vector3<f64>]| deformation_gradient(&piece.copies.map(|c| x[c as usize]), &g);
        let R = SignedSvd::new(&F(x)).rotation();
        let Q = R * Corotational(LAME).twists(&F(at)) * R.transpose();
        let curl = piece.copies.iter().zip(&g).map(|(&c, g)| (R * g).cross(&wide(&u[c as usize])));
        let w: Vector3<f64> = 0.5 * curl.sum::<Vector3<f64>>();
        for (&c, g) in piece.copies.iter().zip(&g) {
            y[c as usize] += mesh.volume(piece.element as usize) * (Q * w).cross(&(R * g));
        }
    }
    y
}

fn wide(v: &Padded) -> Vector3<f64> {
    Vector3::new(v[0], v[1], v[2]).map(f64::from)
}

fn largest(v: impl Iterator<Item = Vector3<f64>>) -> f64 {
    v.map(|v| v.norm()).fold(0.0, f64::max)
}

#[test]
fn forces_agree_with_double_precision_also_where_tets_are_inverted() {
    let (mesh, pieces) = mesh();
    for law in Law::ALL {
        for noise in [0.0, 0.1, 0.6] {
            let x = deformed(&mesh, noise, 0.0);
            let mut exact = vec![Vector3::zeros(); x.len()];
            let (mut inverted, mut force) = (0, 0.0_f64);
            for piece in &pieces {
                let e = piece.element as usize;
                let g = mesh.gradients(e);
                let F = deformation_gradient(&piece.copies.map(|c| x[c as usize]), &g);
                inverted += usize::from(law != Law::Linear && F.determinant() <= 0.0);
                let parts = piece_forces(&law.stress(&F, LAME), &g, mesh.volume(e));
                for (&copy, part) in piece.copies.iter().zip(parts) {
                    exact[copy as usize] += part;
                    force = force.max(part.norm());
                }
            }
            assert_eq!(inverted > 0, noise == 0.6 && law != Law::Linear, "noise {noise}");
            for simd in [Simd::Baseline, Simd::detect()] {
                let found = updated(simd, OperatorChoice::Auto, law, &x, 1e-4);
                let error = largest(found.f.iter().zip(&exact).map(|(f, exact)| wide(f) - exact));
                assert!(error < 1e-5 * force, "{law:?} {simd:?} noise {noise}: {error:e} of {force:e}");
                assert_eq!(found.inverted, inverted, "{law:?} {simd:?} noise {noise}");
            }
        }
    }
}

#[test]
fn the_energy_agrees_with_double_precision_wherever_the_body_is() {
    let (mesh, pieces) = mesh();
    for law in [Law::Corotational, Law::Linear] {
        for (strained, far) in [(1.0, 0.0), (1.0, 1e4), (1e-6, 0.0), (1e-6, 1e4)] {
            let x: Vec<Vector3<f64>> = deformed(&mesh, 0.1, 0.0)
                .iter()
                .zip(&mesh.nodes)
                .map(|(x, X)| X + strained * (x - X) + Vector3::new(far, 0.0, 0.0))
                .collect();
            let energy = |piece: &Piece| {
                let e = piece.element as usize;
                let F = deformation_gradient(&piece.copies.map(|c| x[c as usize]), &mesh.gradients(e));
                mesh.volume(e) * law.energy(&F, LAME)
            };
            let exact: f64 = pieces.iter().map(energy).sum();
            // Rotations are known to 6e-8, and positions far away to 2e-12 m.
            let bound = match (strained < 1.0, law.rotates()) {
                (true, true) => 5e-3,
                (true, false) if far > 0.0 => 1e-3,
                _ => 2e-6,
            };
            for simd in [Simd::Baseline, Simd::detect()] {
                let mut elastic = updated(simd, OperatorChoice::Auto, law, &x, 1e-4).elastic;
                let with = ElasticUpdate { lame: LAME, law, scale: 1.0 };
                let found = [1, 3].map(|n| elastic.energy(&mut Team::new(n).unwrap(), &with, &x).unwrap());
                assert_eq!(found[0], found[1], "threads");
                let error = (found[0] / exact - 1.0).abs();
                assert!(error < bound, "{law:?} {simd:?} {strained} at {far} m: {error:e}");
            }
        }
    }
}

#[test]
fn assembled_and_matrix_free_stiffness_are_the_same_map() {
    let (mesh, _) = mesh();
    let x = deformed(&mesh, 0.6, 0.0);
    let direction = direction(x.len());
    let mut team = Team::new(2).unwrap();
    for law in [Law::Corotational, Law::Linear] {
        for simd in [Simd::Baseline, Simd::detect()] {
            let apply = |choice, team: &mut Team| {
                let mut y = vec![[0.0; 4]; x.len()];
                let mut elastic = updated(simd, choice, law, &x, 1e-4).elastic;
                assert_eq!(elastic.assembled(), choice == OperatorChoice::Assembled);
                elastic.apply(team, &direction, &mut y);
                y
            };
            let tets = apply(OperatorChoice::MatrixFree, &mut team);
            let assembled = apply(OperatorChoice::Assembled, &mut team);
            let size = largest(tets.iter().map(wide));
            let error = largest(tets.iter().zip(&assembled).map(|(a, b)| wide(a) - wide(b)));
            assert!(size > 0.0 && error < 2e-6 * size, "{law:?} {simd:?}: {error:e} of {size:e}");
        }
    }
}

/// Under tension, the stiffness is the tangent of the law, projected or not, and damping that of Hooke's law in a turned
/// frame.
#[test]
fn the_stiffness_is_the_tangent_of_the_law() {
    let (mesh, pieces) = mesh();
    let u = direction(mesh.nodes.len());
    let s = 0.6e-4;
    let nonlinear = [Law::StVenantKirchhoff, Law::NeoHookean];
    let laws = nonlinear.into_iter().flat_map(|law| [(law, Tangent::Projected), (law, Tangent::Exact)]);
    for (law, tangent) in laws.chain([(Law::Corotational, Tangent::Projected)]) {
        // Twists of inverted elements are not those of the law.
        for noise in [0.0, 0.1, 0.2, 0.6].into_iter().filter(|n| law != Law::Corotational || *n < 0.5) {
            let x = deformed(&mesh, noise, 0.0);
            let mut exact = vec![Vector3::zeros(); x.len()];
            let mut damped = exact.clone();
            for piece in &pieces {
                let (g, V) = (mesh.gradients(piece.element as usize), mesh.volume(piece.element as usize));
                let F = deformation_gradient(&piece.copies.map(|c| x[c as usize]), &g);
                let dF = deformation_gradient(&piece.copies.map(|c| wide(&u[c as usize])), &g);
                let dF = nalgebra::SVector::<f64, 9>::from_column_slice(dF.as_slice());
                let held = Corotational(LAME).tangent(&F, Tangent::Held) * dF * V;
                let dP = s * V * law.tangent(&F, LAME, tangent) * dF + (1e-4 - s) * held;
                for (&c, g) in piece.copies.iter().zip(&g) {
                    exact[c as usize] += Matrix3::from_column_slice(dP.as_slice()) * g;
                    damped[c as usize] += 1e-4 * Matrix3::from_column_slice(held.as_slice()) * g;
                }
            }
            let (mut y, mut team) = (vec![[0.0; 4]; x.len()], Team::new(2).unwrap());
            let check = |case: &str, y: &[Padded], exact: &[Vector3<f64>]| {
                let error = largest(y.iter().zip(exact).map(|(y, exact)| wide(y) - exact));
                let size = largest(exact.iter().copied());
                assert!(error < 2e-5 * size, "{law:?} {tangent:?} {noise} {case}: {error:e} of {size:e}");
            };
            for simd in [Simd::Baseline, Simd::detect()] {
                for choice in [OperatorChoice::MatrixFree, OperatorChoice::Assembled] {
                    let definite = tangent == Tangent::Projected;
                    let tension =
                        Tension { at: &x, start: &x, s, density_kg_m3: 1e-3, damping: 0.0, definite };
                    let mut of = tense_by(law, (simd, choice), &x, &tension);
                    let elastic = &mut of.elastic;
                    elastic.apply(&mut team, &u, &mut y);
                    check(&format!("{simd:?} {choice:?}"), &y, &exact);
                    super::apply_damping(elastic, &mut team, &u, &mut y);
                    check(&format!("{simd:?} {choice:?}, damping"), &y, &damped);
                    check_diagonals(of, &x);
                }
            }
        }
    }
}

#[test]
fn twists_belong_to_the_positions_of_the_tension_and_not_to_damping() {
    let (mesh, _) = mesh();
    let (x, at) = (deformed(&mesh, 0.2, 0.0), deformed(&mesh, 0.1, 3.0));
    let u = direction(x.len());
    let (s, mut team) = (0.3e-4, Team::new(2).unwrap());
    let exact = twists(&x, &at, &u);
    let size = largest(exact.iter().copied());
    for simd in [Simd::Baseline, Simd::detect()] {
        let plain = updated(simd, OperatorChoice::Auto, Law::Corotational, &x, 1e-4);
        let found = tense(simd, OperatorChoice::Auto, [&x, &at], s, 1e-3);
        assert_eq!((plain.f, plain.inverted), (found.f, found.inverted));
        let (mut without, mut with, mut damping) =
            (vec![[0.0; 4]; x.len()], vec![[0.0; 4]; x.len()], vec![[0.0; 4]; x.len()]);
        let (mut plain, mut elastic) = (plain.elastic, found.elastic);
        plain.apply(&mut team, &u, &mut without);
        elastic.apply(&mut team, &u, &mut with);
        super::apply_damping(&mut elastic, &mut team, &u, &mut damping);
        assert_eq!(without, damping, "{simd:?}");
        let twist = with.iter().zip(&without).map(|(a, b)| (wide(a) - wide(b)) / s);
        let error = largest(twist.zip(&exact).map(|(found, exact)| found - exact));
        assert!(error < 1e-4 * size, "{simd:?}: {error:e} of {size:e}");
    }
}

#[test]
fn forces_of_damping_are_those_of_the_rate_of_strain_and_rotations_cause_none() {
    let (mesh, pieces) = mesh();
    let (x, start) = (deformed(&mesh, 0.2, 0.0), deformed(&mesh, 0.1, 2.0));
    let turn = nalgebra::Rotation3::new(Vector3::new(0.4, 1.1, -0.6));
    let turned: Vec<Vector3<f64>> = x.iter().map(|x| turn * x).collect();
    let strain = |F: &Matrix3<f64>| {
        let R = SignedSvd::new(F).rotation();
        (R, 0.5 * (R.transpose() * F + F.transpose() * R) - Matrix3::identity())
    };
    for law in [Law::Corotational, Law::StVenantKirchhoff, Law::NeoHookean] {
        let mut exact = vec![Vector3::zeros(); x.len()];
        for piece in &pieces {
            let g = mesh.gradients(piece.element as usize);
            let at =
                |x: &[Vector3<f64>]| strain(&deformation_gradient(&piece.copies.map(|c| x[c as usize]), &g));
            let ((R, now), (_, before)) = (at(&x), at(&start));
            let damped = 2.5 * (now - before);
            let stress = 2.0 * LAME.mu * damped + LAME.lambda * damped.trace() * Matrix3::identity();
            let F = deformation_gradient(&piece.copies.map(|c| x[c as usize]), &g);
            let parts =
                piece_forces(&(law.stress(&F, LAME) + R * stress), &g, mesh.volume(piece.element as usize));
            piece.copies.iter().zip(parts).for_each(|(&c, f)| exact[c as usize] += f);
        }
        let size = largest(exact.iter().copied());
        for simd in [Simd::Baseline, Simd::detect()] {
            let damped = |start: &[Vector3<f64>]| {
                let mut elastic = Elastic::new(simd, &mesh, &pieces, x.len());
                let with = ElasticUpdate { lame: LAME, law, scale: 1e-4 };
                let tension =
                    Tension { at: start, start, s: 1e-4, density_kg_m3: 1e9, damping: 2.5, definite: true };
                elastic.update(&mut Team::new(2).unwrap(), &with, &x, Some(&tension));
                let mut f = vec![[0.0; 4]; x.len()];
                f.chunks_mut(BLOCK).enumerate().for_each(|(block, f)| elastic.forces(block, f));
                f
            };
            let error = largest(damped(&start).iter().zip(&exact).map(|(f, exact)| wide(f) - exact));
            assert!(error < 1e-5 * size, "{simd:?}: {error:e} of {size:e}");
            let plain = updated(simd, OperatorChoice::Auto, law, &x, 1e-4).f;
            let error = largest(damped(&turned).iter().zip(&plain).map(|(f, plain)| wide(f) - wide(plain)));
            assert!(error < 1e-5 * size, "{simd:?}, turned: {error:e} of {size:e}");
        }
    }
}

#[test]
fn a_step_too_short_for_twists_does_without_them() {
    let (mesh, _) = mesh();
    let x = deformed(&mesh, 0.2, 0.0);
    let u = direction(x.len());
    let plain = updated(Simd::detect(), OperatorChoice::Auto, Law::Corotational, &x, 1e-4);
    let found = tense(Simd::detect(), OperatorChoice::Auto, [&x, &x], 1e-4, 1e9);
    assert_eq!(plain.diagonal, found.diagonal);
    let [mut y, mut same] = [vec![[0.0; 4]; x.len()], vec![[0.0; 4]; x.len()]];
    let (mut plain, mut elastic, mut team) = (plain.elastic, found.elastic, Team::new(1).unwrap());
    plain.apply(&mut team, &u, &mut y);
    elastic.apply(&mut team, &u, &mut same);
    assert_eq!(y, same);
    assert_eq!(plain.bytes(), elastic.bytes());
}

#[test]
fn diagonal_blocks_are_those_of_the_map() {
    let (mesh, _) = mesh();
    let x = deformed(&mesh, 0.3, 0.0);
    check_diagonals(updated(Simd::detect(), OperatorChoice::Auto, Law::Corotational, &x, 1e-4), &x);
    for simd in [Simd::Baseline, Simd::detect()] {
        check_diagonals(tense(simd, OperatorChoice::Auto, [&x, &deformed(&mesh, 0.1, 0.0)], 1e-4, 1e-3), &x);
    }
}

fn check_diagonals(of: Updated, x: &[Vector3<f64>]) {
    let Updated { mut elastic, diagonal, .. } = of;
    let mut team = Team::new(1).unwrap();
    for n in [0, 17, 200] {
        for (axis, entries) in [[0, 1, 2], [1, 4, 5], [2, 5, 6]].into_iter().enumerate() {
            let (mut unit, mut y) = (vec![[0.0; 4]; x.len()], vec![[0.0; 4]; x.len()]);
            unit[n][axis] = 1.0;
            elastic.apply(&mut team, &unit, &mut y);
            for i in 0..3 {
                let missing = (y[n][i] - diagonal[n][entries[i]]).abs();
                assert!(missing < 1e-5 * diagonal[n][0], "copy {n}: {missing:e}");
            }
        }
    }
}

#[test]
fn the_linear_stiffness_is_made_once_and_forces_do_not_feel_how_far_the_body_is() {
    let (mesh, pieces) = mesh();
    let n = mesh.nodes.len();
    let (near, far) = (deformed(&mesh, 0.1, 0.0), deformed(&mesh, 0.1, 1e4));
    let mut team = Team::new(1).unwrap();
    for choice in [OperatorChoice::MatrixFree, OperatorChoice::Auto] {
        let first = updated(Simd::detect(), choice, Law::Linear, &near, 1e-4);
        let mut elastic = first.elastic;
        let version = elastic.version();
        let (mut f, mut diagonal) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
        let mut with = ElasticUpdate { lame: LAME, law: Law::Linear, scale: 1e-4 };
        elastic.update_all(&mut team, &with, &near, &mut f, &mut diagonal);
        assert_eq!((&f, &diagonal, elastic.version()), (&first.f, &first.diagonal, version));
        elastic.update_all(&mut team, &with, &far, &mut f, &mut diagonal);
        let size = largest(first.f.iter().map(wide));
        let error = largest(f.iter().zip(&first.f).map(|(a, b)| wide(a) - wide(b)));
        assert!(error < 1e-5 * size, "{choice:?}: {error:e} of {size:e}");
        assert_eq!(elastic.version(), version);
        // Another step length, a cut: the stiffness is made anew.
        with.scale = 4e-4;
        elastic.update_all(&mut team, &with, &near, &mut f, &mut diagonal);
        assert!(elastic.version() > version && diagonal[5][0] > 3.9 * first.diagonal[5][0]);
        let version = elastic.version();
        let mut cut = pieces.clone();
        cut[70].fraction = 0.5;
        elastic.follow(&mesh, &cut, &[70], n);
        elastic.update_all(&mut team, &with, &near, &mut f, &mut diagonal);
        assert!(elastic.version() > version);
        // The update covers all that the cut changed: a fresh operator gives the same.
        let mut fresh = Elastic::new(Simd::detect(), &mesh, &cut, n);
        fresh.set_choice(choice);
        let (mut fresh_f, mut fresh_diagonal) = (f.clone(), diagonal.clone());
        fresh.update_all(&mut team, &with, &near, &mut fresh_f, &mut fresh_diagonal);
        assert_eq!((&f, &diagonal), (&fresh_f, &fresh_diagonal));
    }
}

#[test]
fn a_rotation_is_remembered_where_the_gradient_defines_none() {
    let (mesh, _) = mesh();
    let x = deformed(&mesh, 0.0, 0.0);
    let mut found = updated(Simd::detect(), OperatorChoice::Auto, Law::Corotational, &x, 1e-4);
    let before = found.elastic.rotations();
    let collapsed = vec![Vector3::zeros(); x.len()];
    let with = ElasticUpdate { lame: LAME, law: Law::Corotational, scale: 1e-4 };
    let mut team = Team::new(1).unwrap();
    let inverted = found.elastic.update_all(&mut team, &with, &collapsed, &mut found.f, &mut found.diagonal);
    assert_eq!(inverted, before.len());
    assert!(found.f.iter().flatten().all(|f| f.is_finite()));
    let drift =
        found.elastic.rotations().iter().zip(&before).map(|(a, b)| (a - b).norm()).fold(0.0, f32::max);
    assert!(drift < 1e-6, "{drift:e}");
}

/// After every cut, chunks that were amended or planned anew give the same results as new ones.
#[test]
fn amended_chunks_act_like_new_ones() {
    for (law, choice) in
        [(Law::Corotational, OperatorChoice::MatrixFree), (Law::Linear, OperatorChoice::Assembled)]
    {
        let n_pieces = amended_chunks_act_like_new(law, choice, (1..16).map(scattered).collect());
        assert!(n_pieces > 2 * mesh().0.tets.len(), "chunks have been planned anew");
        // Slices from one end: one chunk after the other is planned anew while the others stay.
        amended_chunks_act_like_new(law, choice, (1..36).map(sliced).collect());
    }
}

/// Ends of the box of the mesh.
fn corners() -> [Vector3<f64>; 2] {
    let nodes = mesh().0.nodes;
    [nodes.iter().fold(nodes[0], |low, x| low.inf(x)), nodes.iter().fold(nodes[0], |high, x| high.sup(x))]
}

/// A cut through the body somewhere, every second one narrow.
fn scattered(k: u32) -> BladeSweep {
    let [low, high] = corners();
    let s = f64::from(k);
    let middle = low + (high - low) * (0.5 + 0.3 * (1.3 * s).sin());
    let normal = Vector3::new(s.sin(), (2.0 * s).cos(), (3.1 * s).sin()).normalize();
    let u = normal.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize() * (high - low).norm();
    let w = normal.cross(&u) * if k.is_multiple_of(2) { 1.0 } else { 0.1 };
    BladeSweep { segments: vec![[middle - u - w, middle - u + w], [middle + u - w, middle + u + w]] }
}

/// Cut number `k` of 36 across the body, from one end to the other.
fn sliced(k: u32) -> BladeSweep {
    let [low, high] = corners();
    let at = |y: f64, z: f64| {
        low + (high - low).component_mul(&Vector3::new((f64::from(k) + 0.2 * y) / 36.0, y, z))
    };
    BladeSweep { segments: vec![[at(-0.1, -0.1), at(-0.1, 1.1)], [at(1.1, -0.1), at(1.1, 1.1)]] }
}

/// Returns the number of pieces after these cuts.
fn amended_chunks_act_like_new(law: Law, choice: OperatorChoice, blades: Vec<BladeSweep>) -> usize {
    let (mesh, _) = mesh();
    let mut cut = CutMesh::new(mesh.clone()).unwrap();
    let mut amended = Elastic::new(Simd::detect(), &mesh, cut.pieces(), cut.n_copies());
    amended.set_choice(choice);
    let mut team = Team::new(1).unwrap();
    let with = ElasticUpdate { lame: LAME, law, scale: 1e-4 };
    for (k, blade) in (1..).zip(blades) {
        cut.sweep(&cut.rest_positions(), &blade, k).unwrap();
        let (pieces, n) = (cut.pieces(), cut.n_copies());
        amended.follow(&mesh, pieces, cut.changed_pieces(), n);
        let mut fresh = Elastic::new(Simd::detect(), &mesh, pieces, n);
        fresh.set_choice(choice);
        let rest = cut.rest_positions();
        let x: Vec<Vector3<f64>> =
            (0..n).map(|c| rest[c] + 0.004 * Vector3::new((c as f64).sin(), 0.2, 0.1)).collect();
        let direction: Vec<Padded> =
            (0..n).map(|c| [(0.3 * c as f32).sin(), (1.7 * c as f32).cos(), 0.4, 0.0]).collect();
        let mut found = [&mut fresh, &mut amended].map(|elastic| {
            let (mut f, mut diagonal) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
            let inverted = elastic.update_all(&mut team, &with, &x, &mut f, &mut diagonal);
            let mut y = vec![[0.0; 4]; n];
            elastic.apply(&mut team, &direction, &mut y);
            assert_eq!(elastic.n_pieces(), pieces.len());
            (inverted, f, y, diagonal)
        });
        let [(inverted, f, y, diagonal), other] = &mut found;
        assert_eq!(*inverted, other.0);
        for (new, old) in [(f, &other.1), (y, &other.2)] {
            let size = largest(new.iter().map(wide));
            let error = largest(new.iter().zip(old).map(|(a, b)| wide(a) - wide(b)));
            assert!(error < 1e-5 * size, "after cut {k}: {error:e} of {size:e}");
        }
        let size = diagonal.iter().flatten().fold(0.0_f32, |m, d| m.max(d.abs()));
        let same = |(a, b): (&Block6, &Block6)| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5 * size);
        assert!(diagonal.iter().zip(&other.3).all(same), "after cut {k}");
    }
    cut.pieces().len()
}

/// A mesh with one element for every piece, so that no two pieces go together, and its pieces.
fn one_element_per_piece(cut: &CutMesh) -> (TetMesh, Vec<Piece>) {
    let mesh = cut.mesh();
    let tets = cut.pieces().iter().map(|piece| mesh.tets[piece.element as usize]).collect();
    let pieces = (0u32..).zip(cut.pieces()).map(|(element, piece)| Piece { element, ..*piece }).collect();
    (TetMesh { nodes: mesh.nodes.clone(), tets }, pieces)
}

/// Stabs hardly wider than an element divide elements, but hardly any node. The last incision goes
/// through the whole body at the same place and separates what they divided.
#[test]
fn pieces_with_the_same_copies_share_a_lane_until_a_cut_separates_them() {
    let (mesh, _) = mesh();
    let mut cut = CutMesh::new(mesh.clone()).unwrap();
    let mut elastic = Elastic::new(Simd::detect(), &mesh, cut.pieces(), cut.n_copies());
    let mut team = Team::new(1).unwrap();
    let with = ElasticUpdate { lame: LAME, law: Law::Corotational, scale: 1e-4 };
    let mut shared = vec![0];
    for k in 0..13_u32 {
        let (from, to, depth) = match k {
            12 => (-0.1, 0.3, 0.3),
            _ => (0.015 * f64::from(k), 0.015 * f64::from(k) + 0.034, 0.04 + 0.03 * f64::from(k % 4)),
        };
        // Those that overlap lie beside each other, so that none is a part of another one's cut.
        let x = |y: f64| 0.11 + 0.2 * y + 0.004 * f64::from(k % 3);
        let blade = |y: f64| [Vector3::new(x(y), y, 0.2 - depth), Vector3::new(x(y), y, 0.3)];
        let sweep = BladeSweep { segments: vec![blade(from), blade(to)] };
        let before = (elastic.rotations(), elastic.n_pieces());
        cut.sweep(&cut.rest_positions(), &sweep, k + 1).unwrap();
        let (pieces, n) = (cut.pieces(), cut.n_copies());
        elastic.follow(&mesh, pieces, cut.changed_pieces(), n);
        // Earlier pieces keep the rotation of their lane, whether or not they have one of their own now.
        assert_eq!(before.0, elastic.rotations()[..before.1], "cut {k}");
        shared.push(pieces.len() - elastic.n_lanes());

        let (apart, alone) = one_element_per_piece(&cut);
        let mut unmerged = Elastic::new(Simd::detect(), &apart, &alone, n);
        assert_eq!(unmerged.n_lanes(), pieces.len());
        // Noise inverts a few tets, also among those that share a lane.
        let rest = cut.rest_positions();
        let turn = nalgebra::Rotation3::new(Vector3::new(0.1, 0.05 * f64::from(k), 0.2));
        let noise = |c: usize| 0.02 * Vector3::new((12.9 * c as f64).sin(), (78.2 * c as f64).sin(), 0.3);
        let x: Vec<Vector3<f64>> = (0..n).map(|c| turn * rest[c] + noise(c)).collect();
        let direction: Vec<Padded> =
            (0..n).map(|c| [(0.3 * c as f32).sin(), (1.7 * c as f32).cos(), 0.4, 0.0]).collect();
        let found = [&mut elastic, &mut unmerged].map(|elastic| {
            let (mut f, mut diagonal) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
            let inverted = elastic.update_all(&mut team, &with, &x, &mut f, &mut diagonal);
            let mut y = vec![[0.0; 4]; n];
            elastic.apply(&mut team, &direction, &mut y);
            (inverted, f, y)
        });
        let [(inverted, f, y), other] = &found;
        assert!(*inverted > 0);
        assert_eq!(*inverted, other.0, "cut {k}: every inverted piece counts");
        for (new, old) in [(f, &other.1), (y, &other.2)] {
            let size = largest(old.iter().map(wide));
            let error = largest(new.iter().zip(old).map(|(a, b)| wide(a) - wide(b)));
            assert!(error < 1e-5 * size, "after cut {k}: {error:e} of {size:e}");
        }
    }
    assert!(
        shared[12] > 20 && shared[13] + 10 < shared[12],
        "pieces that share a lane after each cut: {shared:?}"
    );
}
