//! The preconditioner by brute force on small bodies.

use nalgebra::{DMatrix, Vector3};
use scindo_matter::cut::{BladeSweep, CutMesh};
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::element::{MaterialPoint, Point, Points, Simd, deformation_gradient};
use scindo_matter::material::{Law, Material, Rayleigh};
use scindo_matter::mesh::{BoxPattern, box_mesh};
use scindo_matter::team::Team;

use super::interpolation::Interpolation;
use super::lattice::Lattice;
use super::{CoarseSpace, CoarseSystem, TwoLevel};
use crate::operator::{
    BLOCK, BlockJacobi, Elastic, ElasticUpdate, LinearOperator, Padded, Preconditioner, Spring,
    SystemOperator, filter,
};

const MATERIAL: Material = Material {
    young_pa: 1e5,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};

/// Linear tetrahedra, cut or not.
#[derive(Debug)]
struct Tets(CutMesh);

impl Points for Tets {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        let mesh = self.0.mesh();
        for (element, piece) in self.0.pieces().iter().enumerate() {
            let tet = piece.element as usize;
            let gradients = mesh.gradients(tet);
            let F = deformation_gradient(&piece.copies.map(|c| x[c as usize]), &gradients);
            let weight = piece.fraction * mesh.volume(tet);
            visit(Point { element, nodes: &piece.copies, gradients: &gradients, weight, F, region: 0 });
        }
    }
}

impl Tets {
    fn masses(&self) -> Vec<f64> {
        self.0.copy_volume().iter().map(|volume| MATERIAL.density_kg_m3 * volume).collect()
    }
}

/// A block of 0.3 m × 0.2 m × 0.2 m, cut across its middle as deep as `depth` [m] from above.
fn block(depth: f64) -> Tets {
    let mesh = box_mesh(Vector3::zeros(), Vector3::new(0.3, 0.2, 0.2), [6, 4, 4], BoxPattern::Tet6);
    let mut cut = CutMesh::new(mesh).unwrap();
    if depth > 0.0 {
        let segment = |z: f64| [Vector3::new(0.151, -0.1, z), Vector3::new(0.158, 0.3, z)];
        let blade = BladeSweep { segments: vec![segment(0.3), segment(0.2 - depth)] };
        assert!(cut.sweep(&cut.rest_positions(), &blade, 1).unwrap().faces_opened > 0);
    }
    Tets(cut)
}

/// A small body with everything that a preconditioner has to take into account.
struct Problem {
    team: Team,
    elastic: Elastic,
    mass: Vec<f32>,
    fixed: Vec<FixedCopy>,
    springs: Vec<Spring>,
    jacobi: BlockJacobi,
    coarse: CoarseSpace,
}

const SCALE: f64 = 1e-3;

fn problem(depth: f64, held: &[Held], springs: Vec<Spring>) -> Problem {
    let (tets, mut team) = (block(depth), Team::new(2).unwrap());
    let rest = tets.0.rest_positions();
    let n = rest.len();
    // A quarter turn and a bend, so that rotations matter.
    let bend = |X: &Vector3<f64>| Vector3::new(-X.y, X.x, X.z + 2.0 * X.x * X.x);
    let x: Vec<_> = rest.iter().map(bend).collect();
    let mut elastic = Elastic::new(Simd::detect(), tets.0.mesh(), tets.0.pieces(), n);
    let (mut f, mut diagonal) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
    let with = ElasticUpdate { lame: MATERIAL.lame(), law: MATERIAL.law, scale: SCALE };
    elastic.update_all(&mut team, &with, &x, &mut f, &mut diagonal);
    let masses = tets.masses();
    let mass: Vec<f32> = masses.iter().map(|&m| m as f32).collect();
    for (block, m) in diagonal.iter_mut().zip(&mass) {
        [0, 4, 6].iter().for_each(|&k| block[k] += m);
    }
    let left = (0..n as u32).filter(|&c| rest[c as usize].x == 0.0);
    let fixed: Vec<_> = left
        .zip(held.iter().cycle())
        .map(|(copy, &held)| FixedCopy { copy, held, position_m: [0.0; 3] })
        .collect();
    let mut jacobi = BlockJacobi::default();
    jacobi.resize(n);
    let mut sprung = diagonal.clone();
    let A = SystemOperator {
        elastic: &mut elastic,
        mass: &mass,
        mass_factor: 1.0,
        springs: &springs,
        fixed: &fixed,
    };
    A.add_springs(&mut sprung);
    jacobi.update(&mut team, &sprung, &fixed);
    let mut coarse = CoarseSpace::new((&tets, &MATERIAL), (&rest, &masses), &|_| false).unwrap();
    coarse.follow(&CoarseSystem {
        x: &x,
        rotates: true,
        scale: SCALE,
        mass_factor: 1.0,
        diagonal: &diagonal,
        fixed: &fixed,
        springs: &springs,
    });
    assert!(coarse.is_factored());
    Problem { team, elastic, mass, fixed, springs, jacobi, coarse }
}

impl Problem {
    /// The matrix of a linear map of the copies.
    fn matrix(&mut self, mut map: impl FnMut(&mut Self, &[Padded], &mut [Padded])) -> DMatrix<f64> {
        let n = self.mass.len();
        let mut out = DMatrix::zeros(3 * n, 3 * n);
        let (mut v, mut w) = (vec![[0.0; 4]; n], vec![[0.0; 4]; n]);
        for column in 0..3 * n {
            v[column / 3][column % 3] = 1.0;
            let mut r = v.clone();
            filter(&self.fixed, &mut r);
            map(self, &r, &mut w);
            (0..3 * n).for_each(|row| out[(row, column)] = f64::from(w[row / 3][row % 3]));
            v[column / 3] = [0.0; 4];
        }
        out
    }

    fn inverse(&mut self) -> DMatrix<f64> {
        self.matrix(|p, r, z| {
            let Problem { team, elastic, jacobi, coarse, fixed, .. } = p;
            let mut partial = vec![0.0; r.len().div_ceil(BLOCK)];
            let mut M = TwoLevel { jacobi, coarse: Some(coarse), fixed };
            let rz = M.apply(team, elastic, r, z, &mut partial);
            let product: f64 =
                r.iter().flatten().zip(z.iter().flatten()).map(|(r, z)| f64::from(r * z)).sum();
            assert!((rz - product).abs() <= 1e-4 * product.abs(), "{rz} {product}");
            let mut scratch = z.to_vec();
            let norm = M.norm(team, elastic, r, &mut scratch, &mut partial);
            assert!((norm * norm - rz).abs() <= 1e-4 * rz.abs(), "{norm} {rz}");
        })
    }

    fn system(&mut self) -> DMatrix<f64> {
        self.matrix(|p, x, y| {
            let Problem { team, elastic, mass, fixed, springs, .. } = p;
            SystemOperator { elastic, mass, mass_factor: 1.0, springs, fixed }.apply(team, x, y);
        })
    }
}

fn symmetric(A: &DMatrix<f64>) -> DMatrix<f64> {
    (A + A.transpose()) / 2.0
}

/// Smallest and largest eigenvalue of M⁻¹A in the free directions, by the factors of M⁻¹. A stiff spring on three nodes
/// leaves two motions that blocks of single nodes take for stiff; these two do not count.
fn spectrum(p: &mut Problem, M: &DMatrix<f64>) -> [f64; 2] {
    let (M, A) = (symmetric(M), symmetric(&p.system()));
    let eigen = M.symmetric_eigen();
    // M⁻¹ = Q Λ Qᵀ, and the nonzero eigenvalues of M⁻¹A are those of √Λ QᵀA Q √Λ.
    let root = eigen.eigenvalues.map(|l| l.max(0.0).sqrt());
    let R = &eigen.eigenvectors * DMatrix::from_diagonal(&root);
    let eigenvalues = (R.transpose() * A * R).symmetric_eigenvalues();
    let held: usize = p.fixed.iter().map(|f| f.held.count()).sum();
    let mut sorted: Vec<f64> = eigenvalues.iter().copied().collect();
    sorted.sort_by(f64::total_cmp);
    [sorted[held + 2 * p.springs.len()], sorted[sorted.len() - 1]]
}

fn mixed_holds() -> [Held; 4] {
    let inclined = Held::along(Vector3::new(1.0, 2.0, 0.5)).unwrap();
    [Held::FULLY, inclined, Held::Axes([true, false, false]), Held::NOT]
}

fn spring(stiffness: f32) -> Spring {
    let point = MaterialPoint::new([(3_u32, 0.25_f32), (4, 0.25), (10, 0.5)]);
    Spring { point, direction: Some([0.6, 0.0, 0.8]), stiffness }
}

#[test]
fn it_is_symmetric_and_definite_in_the_free_directions() {
    for (depth, stiffness) in [(0.0, 0.0), (0.11, 1.0), (0.3, 1e4)] {
        let springs = if stiffness > 0.0 { vec![spring(stiffness)] } else { Vec::new() };
        let mut p = problem(depth, &mixed_holds(), springs);
        let M = p.inverse();
        let asymmetry = (&M - M.transpose()).amax();
        assert!(asymmetry < 1e-5 * M.amax(), "depth {depth}: {asymmetry:e} of {:e}", M.amax());
        let mut eigenvalues: Vec<f64> = symmetric(&M).symmetric_eigenvalues().iter().copied().collect();
        eigenvalues.sort_by(f64::total_cmp);
        let held: usize = p.fixed.iter().map(|f| f.held.count()).sum();
        // The others are at least those of block-Jacobi.
        let largest = M.amax();
        assert!(eigenvalues[..held].iter().all(|l| l.abs() < 1e-5 * largest), "depth {depth}");
        let least = eigenvalues[held];
        let mut alone = f64::INFINITY;
        for inverse in p.jacobi.inverses() {
            let columns = inverse.columns();
            let block = nalgebra::Matrix3::from_fn(|i, j| f64::from(columns[j][i]));
            let free = block.symmetric_eigenvalues();
            alone = free.iter().filter(|l| **l > 1e-6 * free.amax()).copied().fold(alone, f64::min);
        }
        assert!(least > 0.9 * alone, "depth {depth}: {least:e}, block-Jacobi {alone:e}");
    }
}

#[test]
fn it_bounds_the_eigenvalues_through_cuts_holds_and_springs() {
    for (depth, held, stiffness) in [
        (0.0, &[Held::FULLY][..], 0.0),
        (0.11, &[Held::FULLY], 0.0),
        (0.3, &[Held::FULLY], 0.0),
        (0.11, &mixed_holds(), 1e4),
        (0.0, &[], 0.0),
    ] {
        let springs = if stiffness > 0.0 { vec![spring(stiffness)] } else { Vec::new() };
        let mut p = problem(depth, held, springs);
        let M = p.inverse();
        let [least, most] = spectrum(&mut p, &M);
        let D = p.matrix(|p, r, z| {
            let mut partial = vec![0.0; r.len().div_ceil(BLOCK)];
            p.jacobi.apply(&mut p.team, &mut p.elastic, r, z, &mut partial);
        });
        let [least_alone, most_alone] = spectrum(&mut p, &D);
        let case = format!("depth {depth}, {} kinds of holds, spring {stiffness}", held.len());
        assert!(least > 0.02 && most < 8.0, "{case}: {least} … {most}");
        let (condition, alone) = (most / least, most_alone / least_alone);
        assert!(condition < 0.25 * alone, "{case}: {condition}, block-Jacobi alone {alone}");
    }
}

fn interpolation(tets: &Tets, edge: f64) -> Interpolation {
    let rest = tets.0.rest_positions();
    let groups = |visit: &mut dyn FnMut(&[u32])| tets.for_points(&rest, &mut |point| visit(point.nodes));
    Interpolation::new(&Lattice::over(&rest, edge), &rest, (&groups, &|_| false))
}

/// The coarse unknowns that move the copies on each side of the plane of the blade.
fn sides(tets: &Tets, P: &Interpolation) -> [Vec<u32>; 2] {
    let mut of = [Vec::new(), Vec::new()];
    let rest = tets.0.rest_positions();
    tets.for_points(&rest, &mut |point| {
        let centre: f64 = point.nodes.iter().map(|&c| rest[c as usize].x).sum::<f64>() / 4.0;
        let side = usize::from(centre > 0.155);
        // Elements far from the blade are on one side for sure.
        if (centre - 0.155).abs() > 0.05 {
            point.nodes.iter().for_each(|&c| of[side].extend(P.corners_of_node(c)));
        }
    });
    of
}

#[test]
fn parts_that_a_cut_separates_share_no_unknowns() {
    // One cell along the body: every unknown would reach both sides.
    for (depth, apart) in [(0.0, false), (0.11, false), (0.3, true)] {
        let tets = block(depth);
        let P = interpolation(&tets, 0.3);
        let [left, right] = sides(&tets, &P);
        assert_eq!(left.iter().all(|unknown| !right.contains(unknown)), apart, "depth {depth}");
        assert_eq!(P.n_coarse() > 8, apart, "depth {depth}: {}", P.n_coarse());
    }
}

#[test]
fn linear_fields_are_reproduced_and_forces_are_the_transpose() {
    let mut team = Team::new(2).unwrap();
    for (depth, edge) in [(0.0, 0.09), (0.11, 0.09), (0.3, 0.07)] {
        let tets = block(depth);
        let (rest, mut P) = (tets.0.rest_positions(), interpolation(&tets, edge));
        let n = P.n_coarse();
        // Forces r restricted to b, against any u: bᵀu = rᵀP u.
        let wave =
            |k: usize| -> Padded { [(k as f32).sin(), (1.7 * k as f32).cos(), (0.3 * k as f32).sin(), 0.0] };
        let (u, r): (Vec<_>, Vec<_>) = ((0..n).map(wave).collect(), (0..rest.len()).map(wave).collect());
        let mut b = vec![[0.0; 4]; n];
        P.restrict(&mut team, &r, &mut b);
        P.set(&u);
        let dot = |a: &Padded, b: &Padded| -> f64 { (0..3).map(|k| f64::from(a[k] * b[k])).sum() };
        let coarse: f64 = b.iter().zip(&u).map(|(b, u)| dot(b, u)).sum();
        let fine: f64 = r.iter().enumerate().map(|(c, r)| dot(r, &P.displacement(c))).sum();
        assert!((coarse - fine).abs() < 1e-3 * (1.0 + fine.abs()), "{coarse} {fine}");
        // Weights add up to 1, so translations are reproduced.
        P.set(&vec![[1.0, -2.0, 0.5, 0.0]; n]);
        for c in 0..rest.len() {
            let u = P.displacement(c);
            assert!((u[0] - 1.0).abs() + (u[1] + 2.0).abs() + (u[2] - 0.5).abs() < 1e-5);
        }
        // So are linear fields: the coarse values follow from the copies by least squares.
        let mut W = DMatrix::<f64>::zeros(rest.len(), n);
        for c in 0..rest.len() {
            for (&i, w) in P.corners_of_node(c as u32).iter().zip(P.weights(c)) {
                W[(c, i as usize)] += f64::from(w);
            }
        }
        let field = DMatrix::from_fn(rest.len(), 1, |c, _| rest[c].x + 2.0 * rest[c].y - 3.0 * rest[c].z);
        let values = W.clone().svd(true, true).solve(&field, 1e-6).unwrap();
        assert!((W * values - &field).amax() < 1e-6, "depth {depth}");
    }
}

#[test]
fn it_follows_turns_only_where_they_matter() {
    let tets = block(0.0);
    let rest = tets.0.rest_positions();
    let masses = tets.masses();
    let mut coarse = CoarseSpace::new((&tets, &MATERIAL), (&rest, &masses), &|_| false).unwrap();
    let diagonal = vec![[1.0; 8]; rest.len()];
    let mut turned = |angle: f64, springs: &[Spring]| {
        let turn = nalgebra::Rotation3::new(Vector3::z() * angle);
        let x: Vec<_> = rest.iter().map(|X| turn * X).collect();
        coarse.follow(&CoarseSystem {
            x: &x,
            rotates: true,
            scale: SCALE,
            mass_factor: 1.0,
            diagonal: &diagonal,
            fixed: &[],
            springs,
        });
        coarse.n_updates()
    };
    assert_eq!(turned(0.0, &[]), 1);
    assert_eq!(turned(0.05, &[]), 1);
    assert_eq!(turned(0.15, &[]), 2);
    assert_eq!(turned(0.2, &[]), 2);
    assert_eq!(turned(0.2, &[spring(1.0)]), 3);
    assert_eq!(turned(0.2, &[spring(1.0)]), 3);
    assert_eq!(turned(0.2, &[]), 4);
}
