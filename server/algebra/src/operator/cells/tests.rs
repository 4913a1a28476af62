//! The kernels against dense matrices in double precision.

use nalgebra::{Matrix3, Rotation3, Vector3};
use scindo_matter::element::{Simd, polar_rotation};
use scindo_matter::material::{Corotational, Lame, Law};
use scindo_matter::octree::{
    BoxShape, CutLink, LinkKey, OUTSIDE, Octree, OctreeSettings, Shape, corner_weights,
};
use scindo_matter::team::{Team, blocks};

use super::sectors::{diagonal_blocks, unit_stiffness};
use super::*;
use crate::operator::tet_batch::Block6;
use crate::operator::{BLOCK, ElasticUpdate, LinearOperator, Padded, Stiffness, Tension};

const SOFT: Lame = Lame { mu: 4e4, lambda: 9e4 };
/// Another Poisson's ratio, and the same with another modulus.
const HARD: Lame = Lame { mu: 3e5, lambda: 2e5 };
const HARDER: Lame = Lame { mu: 6e5, lambda: 4e5 };
const SCALE: f64 = 1e-4;

fn cube(cells: u32, levels: u8) -> Octree {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap()
}

/// A ring with a thin sheet, of three materials.
struct Odd;

impl Shape for Odd {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        [Vector3::new(-1.0, -1.0, -0.5), Vector3::new(1.0, 1.0, 0.5)]
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        let ring = (p.xy().norm() - 0.65).hypot(p.z) < 0.33;
        ring || p.z.abs() < 0.03 && p.xy().norm() < 0.9
    }

    fn crossing(&self, _: &Vector3<f64>, _: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        None
    }
}

/// The ring cut along the plane x = 0 on one side.
fn odd() -> Octree {
    let material = |p: &Vector3<f64>| u16::from(p.x > 0.2) + u16::from(p.y > 0.1);
    let mut octree = Octree::fill(&Odd, OctreeSettings { cells: 32, levels: 3 }, &material).unwrap();
    let change = octree.cut(&links(&octree));
    assert!(change.links > 20 && change.divided > 0);
    octree
}

fn links(octree: &Octree) -> Vec<(LinkKey, CutLink)> {
    let cut = CutLink { at: [0.5; 2], normal: [Vector3::x(); 2], incision: 1 };
    let [nx, ny, nz] = octree.lattice().size.map(|n| n as i32);
    let plane = (0..nz).flat_map(|k| (ny / 2..ny).map(move |j| ([nx / 2 - 1, j, k], 0)));
    plane.map(|key| (key, cut)).collect()
}

fn octrees() -> [Octree; 3] {
    [cube(16, 2), cube(8, 0), odd()]
}

/// A large rotation, a stretch, noise of `noise` finest cells, and a shift of `far` [m] along x.
fn deformed(octree: &Octree, noise: f64, far: f64) -> Vec<Vector3<f64>> {
    let turn = Rotation3::new(Vector3::new(1.0, -0.7, 0.4));
    let stretch = Matrix3::from_diagonal(&Vector3::new(1.2, 0.9, 1.05));
    let place = |(n, X): (usize, &Vector3<f64>)| {
        let t = n as f64;
        let jitter = Vector3::new((12.9 * t).sin(), (78.2 * t).sin(), (37.7 * t).sin());
        turn * (stretch * X) + octree.lattice().h * noise * jitter + Vector3::new(far, 0.0, 0.0)
    };
    octree.rest_positions().iter().enumerate().map(place).collect()
}

fn direction(n: usize) -> Vec<Padded> {
    (0..n as u32)
        .map(|n| [0x9e37_79b9_u32, 0x85eb_ca6b, 0xc2b2_ae35].map(|odd| n.wrapping_mul(odd) >> 8))
        .map(|[x, y, z]| [x, y, z].map(|x| x as f32 / (1 << 23) as f32 - 1.0))
        .map(|[x, y, z]| [x, y, z, 0.0])
        .collect()
}

fn with(law: Law) -> ElasticUpdate {
    ElasticUpdate { lame: SOFT, law, scale: SCALE }
}

struct Updated {
    stiffness: CellStiffness,
    f: Vec<Padded>,
    diagonal: Vec<Block6>,
    inverted: usize,
}

fn updated(simd: Simd, threads: usize, octree: &Octree, law: Law, x: &[Vector3<f64>]) -> Updated {
    let mut stiffness = CellStiffness::new(simd, octree, &[HARD, HARDER]);
    let mut team = Team::new(threads).unwrap();
    let inverted = stiffness.update(&mut team, &with(law), x, None);
    let (f, diagonal) = read(&stiffness, x.len());
    Updated { stiffness, f, diagonal, inverted }
}

/// The same under the tension of the positions `at`, whose share of the stiffness is half.
fn tense(simd: Simd, octree: &Octree, [x, at]: [&[Vector3<f64>]; 2], density_kg_m3: f64) -> Updated {
    let mut stiffness = CellStiffness::new(simd, octree, &[HARD, HARDER]);
    let tension = Tension { at, start: at, s: 0.5 * SCALE, density_kg_m3, damping: 0.0, definite: true };
    let inverted = stiffness.update(&mut Team::new(2).unwrap(), &with(Law::Corotational), x, Some(&tension));
    let (f, diagonal) = read(&stiffness, x.len());
    Updated { stiffness, f, diagonal, inverted }
}

fn read(stiffness: &CellStiffness, n: usize) -> (Vec<Padded>, Vec<Block6>) {
    let (mut f, mut diagonal) = (vec![[1.0; 4]; n], vec![[1.0; 8]; n]);
    f.chunks_mut(BLOCK).enumerate().for_each(|(b, f)| stiffness.forces(b, f));
    diagonal.chunks_mut(BLOCK).enumerate().for_each(|(b, d)| stiffness.diagonals(b, d));
    (f, diagonal)
}

fn wide(v: &Padded) -> Vector3<f64> {
    Vector3::new(v[0], v[1], v[2]).map(f64::from)
}

fn largest(v: impl Iterator<Item = Vector3<f64>>) -> f64 {
    v.map(|v| v.norm()).fold(0.0, f64::max)
}

/// Difference of `found` from `exact` over the largest entry of `exact`.
fn error(found: &[Padded], exact: &[Vector3<f64>]) -> f64 {
    let size = largest(exact.iter().copied());
    assert!(size > 0.0);
    largest(found.iter().zip(exact).map(|(f, e)| wide(f) - e)) / size
}

/// Cells by their definition, in double precision.
struct Dense<'a> {
    octree: &'a Octree,
    rotations: Vec<Matrix3<f64>>,
}

impl Dense<'_> {
    /// For every cell calls `visit` with its corners' values of `x`, W, K [N/m] and R.
    fn for_cells(&self, mut visit: impl FnMut(usize, &[[f64; 8]; 8], &Matrix24, &Matrix3<f64>)) {
        let units = [SOFT, HARD, HARDER].map(unit_stiffness);
        for (id, cell) in self.octree.cells().iter().enumerate() {
            let side = f64::from(cell.side()) * self.octree.lattice().h;
            let K = units[usize::from(cell.material)].map(|row| row.map(|k| side * k));
            visit(id, &corner_weights(cell, self.octree.hanging()[id]), &K, &self.rotations[id]);
        }
    }

    /// Σ Wᵀ R K (Rᵀ W x − X) with X the corners of the cell about its centre, times `rest`.
    fn sum(&self, x: &[Vector3<f64>], rest: f64) -> Vec<Vector3<f64>> {
        self.sum_with(x, rest, &self.rotations)
    }

    /// Σ Wᵀ R₁ K (Rᵀ W x − X) with other rotations R₁ of the forces.
    fn sum_turned(&self, x: &[Vector3<f64>], to: &[Matrix3<f64>]) -> Vec<Vector3<f64>> {
        self.sum_with(x, 1.0, to)
    }

    fn sum_with(&self, x: &[Vector3<f64>], rest: f64, to: &[Matrix3<f64>]) -> Vec<Vector3<f64>> {
        let mut y = vec![Vector3::zeros(); x.len()];
        self.for_cells(|id, W, K, R| {
            let (vertices, cell) = (self.octree.vertices()[id], &self.octree.cells()[id]);
            let origin = x[vertices[0] as usize] * rest;
            let half = 0.5 * f64::from(cell.side()) * self.octree.lattice().h;
            let local: [Vector3<f64>; 8] = std::array::from_fn(|c| {
                let at: Vector3<f64> = (0..8).map(|v| W[c][v] * (x[vertices[v] as usize] - origin)).sum();
                let sign = |k: usize| if c >> k & 1 == 1 { half } else { -half };
                R.transpose() * at - rest * Vector3::new(sign(0), sign(1), sign(2))
            });
            for c in 0..8 {
                let mut f = Vector3::zeros();
                for i in 0..3 {
                    f[i] = (0..24).map(|s| K[3 * c + i][s] * local[s / 3][s % 3]).sum();
                }
                for v in 0..8 {
                    y[vertices[v] as usize] += W[c][v] * (to[id] * f);
                }
            }
        });
        y
    }

    /// For every cell calls `visit` with its vertices, the mean gradients of their shape functions turned with the cell,
    /// and Q̂ times half the volume, of stretches at the positions `at`.
    fn for_twists(
        &self,
        at: &[Vector3<f64>],
        mut visit: impl FnMut(&[u32; 8], &[Vector3<f64>; 8], Matrix3<f64>),
    ) {
        self.for_cells(|id, W, _, R| {
            let (vertices, cell) = (&self.octree.vertices()[id], &self.octree.cells()[id]);
            let side = f64::from(cell.side()) * self.octree.lattice().h;
            let sign = |c: usize, k: usize| if c >> k & 1 == 1 { 0.25 / side } else { -0.25 / side };
            let corner = |c: usize| Vector3::new(sign(c, 0), sign(c, 1), sign(c, 2));
            let g: [Vector3<f64>; 8] = std::array::from_fn(|v| (0..8).map(|c| W[c][v] * corner(c)).sum());
            let F: Matrix3<f64> = vertices.iter().zip(&g).map(|(&v, g)| at[v as usize] * g.transpose()).sum();
            let law = Corotational([SOFT, HARD, HARDER][usize::from(cell.material)]);
            let Q = 0.5 * side.powi(3) * R * law.twists(&F) * R.transpose();
            visit(vertices, &g.map(|g| R * g), Q);
        });
    }

    /// Half of Σ V (Q̂ w) × ĝ.
    fn twists(&self, at: &[Vector3<f64>], u: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut y = vec![Vector3::zeros(); u.len()];
        self.for_twists(at, |vertices, g, Q| {
            let curl = vertices.iter().zip(g).map(|(&v, g)| g.cross(&u[v as usize]));
            let w: Vector3<f64> = 0.5 * curl.sum::<Vector3<f64>>();
            vertices.iter().zip(g).for_each(|(&v, g)| y[v as usize] += (Q * w).cross(g));
        });
        y
    }

    fn diagonals(&self) -> Vec<Matrix3<f64>> {
        let mut diagonal = vec![Matrix3::zeros(); self.octree.n_vertices()];
        self.for_cells(|id, W, K, R| {
            for (v, &vertex) in self.octree.vertices()[id].iter().enumerate() {
                let mut block = Matrix3::zeros();
                for (a, b) in (0..8).flat_map(|a| (0..8).map(move |b| (a, b))) {
                    block += W[a][v] * W[b][v] * Matrix3::from_fn(|i, j| K[3 * a + i][3 * b + j]);
                }
                diagonal[vertex as usize] += R * block * R.transpose();
            }
        });
        diagonal
    }
}

fn dense<'a>(octree: &'a Octree, stiffness: &CellStiffness) -> Dense<'a> {
    let rotations =
        stiffness.places().iter().copied().map(|p| stiffness.rotation(p).map(f64::from)).collect();
    Dense { octree, rotations }
}

#[test]
fn sectors_hold_all_of_the_stiffness_of_a_cube() {
    for lame in [SOFT, HARD, Lame { mu: 1.0, lambda: 0.0 }] {
        let K = unit_stiffness(lame);
        let (table, rest) = SectorTable::of_matrix(&K);
        assert!(rest < 1e-15 * lame.mu, "{rest:e}");
        let again = table.matrix();
        for (a, b) in K.as_flattened().iter().zip(again.as_flattened()) {
            assert!((a - b).abs() < 1e-14 * (lame.mu + lame.lambda), "{a} {b}");
        }
        // Translations are in the first component of sectors 1, 2 and 4.
        assert!([1, 2, 4].iter().zip([0, 3, 5]).all(|(&q, e)| table.sectors[q][e] == 0.0));
        let mut sum = table.clone();
        sum.add(0.5, &table);
        assert_eq!(sum.sectors[0][0], 1.5 * table.sectors[0][0]);
        let plain = diagonal_blocks(&K, 0)[5];
        assert!((0..3).all(|i| (plain[[0, 3, 5][i]] - K[15 + i][15 + i]).abs() < 1e-12 * lame.mu));
    }
    // Any matrix has sectors, but not only these.
    let K = unit_stiffness(SOFT).map(|row| row.map(|k| k * (1.0 + 1e-3 * k.sin())));
    let mut crooked = K;
    crooked[0][4] *= 1.1;
    assert!(SectorTable::of_matrix(&crooked).1 > 1.0);
}

#[test]
fn products_diagonals_and_forces_are_those_of_dense_matrices() {
    let mut team = Team::new(1).unwrap();
    for octree in octrees() {
        let n = octree.n_vertices();
        let x = direction(n);
        let precise: Vec<Vector3<f64>> = x.iter().map(wide).collect();
        for law in [Law::Corotational, Law::Linear] {
            // Far away and noisy.
            let positions = deformed(&octree, 0.1, 30.0);
            for simd in [Simd::Baseline, Simd::detect()] {
                let Updated { mut stiffness, f, diagonal, inverted } =
                    updated(simd, 1, &octree, law, &positions);
                assert_eq!(inverted, 0);
                let dense = dense(&octree, &stiffness);
                let mut y = vec![[0.0; 4]; n];
                stiffness.apply(&mut team, &x, &mut y);
                let exact: Vec<_> = dense.sum(&precise, 0.0).iter().map(|y| SCALE * y).collect();
                let wrong = error(&y, &exact);
                assert!(wrong < 2e-6, "{law:?} {simd:?}: product {wrong:e}");
                let wrong = error(&f, &dense.sum(&positions, 1.0));
                assert!(wrong < 1e-5, "{law:?} {simd:?}: force {wrong:e}");
                for (v, (found, exact)) in diagonal.iter().zip(dense.diagonals()).enumerate() {
                    let exact = SCALE * exact;
                    let found =
                        Matrix3::from_fn(|i, j| f64::from(found[[[0, 1, 2], [1, 4, 5], [2, 5, 6]][i][j]]));
                    let wrong = (found - exact).norm() / exact.norm();
                    assert!(wrong < 2e-6, "{law:?} {simd:?}: block {v} {wrong:e}\n{found}\n{exact}");
                }
            }
        }
    }
}

#[test]
fn rotations_are_polar_and_inverted_cells_are_counted() {
    for octree in octrees() {
        for noise in [0.1, 0.8] {
            let positions = deformed(&octree, noise, 0.0);
            let Updated { stiffness, inverted, .. } =
                updated(Simd::detect(), 1, &octree, Law::Corotational, &positions);
            let mut expected = 0;
            for (id, place) in stiffness.places().iter().copied().enumerate() {
                let (cell, W) =
                    (&octree.cells()[id], corner_weights(&octree.cells()[id], octree.hanging()[id]));
                let mut F = Matrix3::zeros();
                for (c, row) in W.iter().enumerate() {
                    let x: Vector3<f64> =
                        octree.vertices()[id].iter().zip(row).map(|(&v, w)| *w * positions[v as usize]).sum();
                    let sign = |k: usize| if c >> k & 1 == 1 { 1.0 } else { -1.0 };
                    F += x * Vector3::new(sign(0), sign(1), sign(2)).transpose();
                }
                F /= 4.0 * f64::from(cell.side()) * octree.lattice().h;
                expected += usize::from(F.determinant() <= 0.0);
                let R = polar_rotation(&F, &Matrix3::identity());
                if F.determinant() > 0.05 {
                    let wrong = (stiffness.rotation(place).map(f64::from) - R).norm();
                    assert!(wrong < 1e-5, "cell {id}: {wrong:e}");
                }
            }
            assert_eq!(inverted, expected);
            assert_eq!(inverted > 0, noise == 0.8);
        }
    }
}

#[test]
fn rigid_motions_give_no_force_and_the_operator_is_symmetric() {
    let mut team = Team::new(1).unwrap();
    for octree in octrees() {
        let n = octree.n_vertices();
        let turn = Rotation3::new(Vector3::new(2.0, -0.7, 1.4));
        let x: Vec<_> =
            octree.rest_positions().iter().map(|X| turn * X + Vector3::new(50.0, 3.0, -9.0)).collect();
        let Updated { mut stiffness, f, .. } = updated(Simd::detect(), 1, &octree, Law::Corotational, &x);
        let scale = HARDER.lambda * octree.lattice().h.powi(2);
        assert!(largest(f.iter().map(wide)) < 1e-5 * scale, "{:e}", largest(f.iter().map(wide)) / scale);
        // K of a translation, and of a rotation about the first vertex, in the rotated frame.
        let size = largest(read(&stiffness, n).1.iter().map(|d| wide(&[d[0], d[4], d[6], 0.0])));
        let mut y = vec![[0.0; 4]; n];
        stiffness.apply(&mut team, &vec![[1.0, 2.0, -3.0, 0.0]; n], &mut y);
        assert!(largest(y.iter().map(wide)) < 1e-6 * size);
        let spin = Vector3::new(0.3, -0.2, 0.9);
        let spun: Vec<Padded> = x.iter().map(|p| crate::operator::padded(&spin.cross(&(p - x[0])))).collect();
        stiffness.apply(&mut team, &spun, &mut y);
        assert!(largest(y.iter().map(wide)) < 2e-6 * size, "{:e}", largest(y.iter().map(wide)) / size);
        let (a, mut b) = (direction(n), direction(n));
        b.reverse();
        let dot =
            |a: &[Padded], b: &[Padded]| a.iter().zip(b).map(|(a, b)| wide(a).dot(&wide(b))).sum::<f64>();
        let mut Ab = y.clone();
        stiffness.apply(&mut team, &a, &mut y);
        stiffness.apply(&mut team, &b, &mut Ab);
        let (ab, ba, aa) = (dot(&a, &Ab), dot(&b, &y), dot(&a, &y));
        assert!(aa > 0.0 && (ab - ba).abs() < 1e-6 * aa, "{ab} {ba} {aa}");
    }
}

#[test]
fn a_linear_displacement_gives_no_force_inside() {
    let octrees = [cube(16, 2), cube(24, 3), {
        // Refined in the middle, so that levels change inside the body.
        let mut octree = cube(16, 3);
        octree.refine(&[[7, 8, 6]], 0);
        octree
    }];
    let turn = Rotation3::new(Vector3::new(1.0, -0.7, 0.4));
    let stretch = Matrix3::new(1.2, 0.1, 0.05, 0.1, 0.9, -0.1, 0.05, -0.1, 1.05);
    for octree in octrees {
        let inside: Vec<bool> = octree
            .points()
            .iter()
            .map(|&p| octree.octants(p).leaf.iter().all(|&leaf| leaf != OUTSIDE))
            .collect();
        assert!(octree.hanging().iter().any(|&h| h != 0) && inside.iter().filter(|i| **i).count() > 100);
        for (law, A) in [(Law::Linear, stretch), (Law::Corotational, turn * stretch)] {
            let x: Vec<_> = octree.rest_positions().iter().map(|X| A * X).collect();
            let Updated { mut stiffness, f, .. } = updated(Simd::detect(), 1, &octree, law, &x);
            // Rounding errors are relative to the forces of single cells, the largest here.
            let side = octree.cells().iter().map(|cell| cell.side()).max().unwrap();
            let size = SOFT.lambda * (f64::from(side) * octree.lattice().h).powi(2);
            let within = |f: &[Padded]| {
                largest(f.iter().zip(&inside).filter(|(_, inside)| **inside).map(|(f, _)| wide(f))) / size
            };
            assert!(
                largest(f.iter().map(wide)) > 1e-3 * size && within(&f) < 1e-6,
                "{law:?}: {:e}",
                within(&f)
            );
            let place = |X: &Vector3<f64>| crate::operator::padded(&(A * X));
            let u: Vec<Padded> = octree.rest_positions().iter().map(place).collect();
            let mut y = vec![[0.0; 4]; u.len()];
            stiffness.apply(&mut Team::new(1).unwrap(), &u, &mut y);
            assert!(largest(y.iter().map(wide)) > 1e-3 * SCALE * size);
            assert!(within(&y) < 1e-5 * SCALE, "{law:?}: {:e}", within(&y));
        }
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let octree = odd();
    let x = deformed(&octree, 0.3, 0.0);
    let results = [1, 2, 3].map(|threads| {
        let Updated { mut stiffness, f, diagonal, .. } =
            updated(Simd::detect(), threads, &octree, Law::Corotational, &x);
        let mut y = vec![[0.0; 4]; x.len()];
        stiffness.apply(&mut Team::new(threads).unwrap(), &direction(x.len()), &mut y);
        (f, diagonal, y)
    });
    assert!(results.iter().all(|r| *r == results[0]));
}

#[test]
fn stored_matrices_do_what_tables_do() {
    let octree = odd();
    let n = octree.n_vertices();
    let mut team = Team::new(1).unwrap();
    let Updated { mut stiffness, diagonal, .. } =
        updated(Simd::detect(), 1, &octree, Law::Linear, &octree.rest_positions());
    // Every third cell keeps a table; the others are stored.
    let units = [SOFT, HARD, HARDER].map(unit_stiffness);
    let tables = [SOFT, HARD, HARDER].map(SectorTable::elastic);
    let stored = |id: usize| !id.is_multiple_of(3);
    let factor = |id: usize| SCALE * f64::from(octree.cells()[id].side()) * octree.lattice().h;
    let lanes = |own: CellMatrix| -> Vec<CellLane> {
        let lane = |id: usize| {
            let table = CellMatrix::Table(octree.cells()[id].material);
            let matrix = if stored(id) { own } else { table };
            CellLane { factor: factor(id) as f32, ..CellLane::of_leaf(&octree, id, matrix) }
        };
        (0..octree.cells().len()).map(lane).collect()
    };
    let order = morton_order(octree.cells());
    // In half precision entries are rounded to eleven bits.
    let kinds = [(CellMatrix::Stored, 2e-6, 1e-5), (CellMatrix::Half, 3e-4, 5e-4)];
    for ((own, accuracy, of_blocks), simd) in
        kinds.into_iter().flat_map(|kind| [Simd::Baseline, Simd::detect()].map(|simd| (kind, simd)))
    {
        let lanes = lanes(own);
        let mut operator = CellOperator::new(simd, &tables, &lanes, &order, n);
        let triangle = |id: usize| -> [f32; STORED] {
            let (mut entries, mut at) = ([0.0; STORED], 0);
            let K = &units[usize::from(octree.cells()[id].material)];
            let own = octree.cells()[id].octant();
            for r in 0..24 {
                for s in r..24 {
                    let row = |r: usize| 3 * ((r / 3) ^ own) + r % 3;
                    entries[at] = (factor(id) * K[row(r)][row(s)]) as f32;
                    at += 1;
                }
            }
            entries
        };
        let triangles: Vec<_> = (0..octree.cells().len()).map(triangle).collect();
        let order = std::array::from_fn(|k| k as u16);
        let given = |id: u32| Given { entries: &triangles[id as usize], changed: true };
        operator.set_stored(&mut team, &order, given);
        let (x, mut y, mut expected) = (direction(n), vec![[0.0; 4]; n], vec![[0.0; 4]; n]);
        operator.apply(&mut team, &x, &mut y);
        stiffness.apply(&mut team, &x, &mut expected);
        let expected: Vec<_> = expected.iter().map(wide).collect();
        assert!(error(&y, &expected) < accuracy, "{own:?}, {simd:?}: {:e}", error(&y, &expected));
        operator.update_diagonals(&mut team);
        let mut found = vec![[0.0; 8]; n];
        team.for_blocks(blocks(&mut found, BLOCK), |b, d| operator.add_diagonals(b, d));
        for (a, b) in found.iter().zip(&diagonal) {
            assert!(a.iter().zip(b).all(|(a, c)| (a - c).abs() < of_blocks * b[0]), "{own:?}: {a:?} {b:?}");
        }
    }
}

#[test]
fn the_stiffness_follows_a_cut_and_cells_keep_their_rotations() {
    let mut octree = cube(16, 3);
    let mut team = Team::new(1).unwrap();
    let x = deformed(&octree, 0.1, 0.0);
    let mut stiffness = updated(Simd::detect(), 1, &octree, Law::Corotational, &x).stiffness;
    let before: Vec<_> = stiffness.places().iter().copied().map(|p| stiffness.rotation(p)).collect();
    let cells = octree.cells().to_vec();
    assert!(octree.cut(&links(&octree)).divided > 0);
    stiffness.follow(&octree);
    for (id, place) in stiffness.places().iter().copied().enumerate() {
        let cell = &octree.cells()[id];
        let holds = |old: &scindo_matter::octree::Cell| {
            (0..3).all(|k| (old.at[k]..old.at[k] + old.side()).contains(&cell.at[k]))
        };
        let source = cells.iter().position(holds).unwrap();
        assert!((stiffness.rotation(place) - before[source]).norm() < 1e-6, "cell {id}");
    }
    let x = deformed(&octree, 0.1, 0.0);
    let version = stiffness.version();
    let inverted = stiffness.update(&mut team, &with(Law::Corotational), &x, None);
    let fresh = updated(Simd::detect(), 1, &octree, Law::Corotational, &x);
    assert_eq!(inverted, fresh.inverted);
    assert!(stiffness.version() > version);
    assert_eq!(read(&stiffness, x.len()), (fresh.f, fresh.diagonal));
    // The linear stiffness is made once.
    stiffness.update(&mut team, &with(Law::Linear), &x, None);
    let version = stiffness.version();
    let first = read(&stiffness, x.len());
    stiffness.update(&mut team, &with(Law::Linear), &x, None);
    assert_eq!((stiffness.version(), read(&stiffness, x.len())), (version, first));
    assert!(stiffness.places().iter().copied().all(|p| stiffness.rotation(p) == Matrix3::identity()));
}

#[test]
fn tension_adds_the_twists_of_the_mean_gradient_but_not_to_damping() {
    let mut team = Team::new(2).unwrap();
    for octree in octrees() {
        let (x, at) = (deformed(&octree, 0.1, 0.0), deformed(&octree, 0.05, 2.0));
        let u = direction(x.len());
        for simd in [Simd::Baseline, Simd::detect()] {
            let plain = updated(simd, 1, &octree, Law::Corotational, &x);
            let found = tense(simd, &octree, [&x, &at], 1e-3);
            assert_eq!((plain.f, plain.inverted), (found.f, found.inverted));
            let rotation = |place| plain.stiffness.rotation(place).map(f64::from);
            let rotations = plain.stiffness.places().iter().copied().map(rotation).collect();
            let dense = Dense { octree: &octree, rotations };
            let wide_u: Vec<_> = u.iter().map(wide).collect();
            let (mut exact, twists) = (dense.sum(&wide_u, 0.0), dense.twists(&at, &wide_u));
            assert!(largest(twists.iter().copied()) > 0.01 * largest(exact.iter().copied()));
            exact.iter_mut().zip(&twists).for_each(|(y, twist)| *y = SCALE * (*y + twist));
            let mut y = vec![[0.0; 4]; x.len()];
            let mut stiffness = found.stiffness;
            stiffness.apply(&mut team, &u, &mut y);
            assert!(error(&y, &exact) < 1e-5, "{simd:?}: {:e}", error(&y, &exact));
            let (mut plain, mut damping) = (plain.stiffness, y.clone());
            plain.apply(&mut team, &u, &mut y);
            crate::operator::apply_damping(&mut stiffness, &mut team, &u, &mut damping);
            assert_eq!(y, damping, "{simd:?}");
            let mut blocks = dense.diagonals();
            dense.for_twists(&at, |vertices, g, Q| {
                for (&v, g) in vertices.iter().zip(g) {
                    let cross = g.cross_matrix();
                    blocks[v as usize] += 0.5 * cross.transpose() * Q * cross;
                }
            });
            for (found, exact) in found.diagonal.iter().zip(&blocks) {
                let [xx, xy, xz, _, yy, yz, zz, _] = found.map(f64::from);
                let missing = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - SCALE * exact;
                assert!(missing.norm() < 1e-5 * SCALE * exact.norm(), "{simd:?}: {missing}");
            }
            // Heavy material does not need them.
            let heavy = tense(simd, &octree, [&x, &at], 1e9);
            assert_eq!(heavy.diagonal, read(&plain, x.len()).1);
            assert_eq!(heavy.stiffness.operator().bytes(), plain.operator().bytes());
        }
    }
}

#[test]
fn forces_of_damping_are_those_of_the_rate_of_strain_and_rotations_cause_none() {
    let turn = Rotation3::new(Vector3::new(0.4, 1.1, -0.6));
    for octree in octrees() {
        let (x, start) = (deformed(&octree, 0.1, 0.0), deformed(&octree, 0.05, 2.0));
        let turned: Vec<_> = x.iter().map(|x| turn * x).collect();
        for simd in [Simd::Baseline, Simd::detect()] {
            let damped = |start: &[Vector3<f64>]| {
                let mut stiffness = CellStiffness::new(simd, &octree, &[HARD, HARDER]);
                let tension =
                    Tension { at: start, start, s: SCALE, density_kg_m3: 1e9, damping: 2.5, definite: true };
                stiffness.update(&mut Team::new(2).unwrap(), &with(Law::Corotational), &x, Some(&tension));
                read(&stiffness, x.len()).0
            };
            let rotations = |of: &CellStiffness| -> Vec<Matrix3<f64>> {
                of.places().iter().copied().map(|place| of.rotation(place).map(f64::from)).collect()
            };
            let [now, before] = [&x, &start].map(|x| updated(simd, 1, &octree, Law::Corotational, x));
            let dense = Dense { octree: &octree, rotations: rotations(&now.stiffness) };
            // K (R₀ᵀ x₀ − X) of the start, turned by R instead of R₀.
            let rigid = Dense { octree: &octree, rotations: rotations(&before.stiffness) };
            let mut exact = dense.sum(&x, 1.0);
            let of_start = rigid.sum_turned(&start, &dense.rotations);
            exact.iter_mut().zip(of_start).for_each(|(f, start)| *f += 2.5 * (*f - start));
            assert!(error(&damped(&start), &exact) < 2e-5, "{simd:?}: {:e}", error(&damped(&start), &exact));
            let exact: Vec<_> = now.f.iter().map(wide).collect();
            assert!(error(&damped(&turned), &exact) < 1e-5, "{simd:?}, turned");
        }
    }
}

#[test]
fn a_cut_that_is_followed_gives_the_stiffness_of_a_new_arrangement() {
    for law in [Law::Corotational, Law::Linear] {
        follow_cuts(law);
    }
}

fn follow_cuts(law: Law) {
    let mut octree = cube(32, 3);
    let mut team = Team::new(2).unwrap();
    let mut stiffness = CellStiffness::new(Simd::detect(), &octree, &[]);
    let bend = |X: &Vector3<f64>| X + 0.1 * Vector3::new((3.0 * X.y).sin(), X.z * X.z, (2.0 * X.x).cos());
    let x: Vec<_> = octree.rest_positions().iter().map(bend).collect();
    stiffness.update(&mut team, &with(law), &x, None);
    let cut = CutLink { at: [0.5; 2], normal: [Vector3::x(); 2], incision: 1 };
    for (axis, plane) in [(0, 9), (1, 20), (2, 15)] {
        let links = (0..20).flat_map(|s| {
            (4..29).map(move |t| {
                let mut at = [0; 3];
                (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (plane, s, t);
                ((at, axis as u8), cut)
            })
        });
        let change = octree.cut(&links.collect::<Vec<_>>());
        assert!(change.links > 400 && change.divided > 50);
        stiffness.follow_cut(&octree, &change.cells);
        let x: Vec<_> = octree.rest_positions().iter().map(bend).collect();
        // Rotations of cells that were there are kept until the next update.
        let places = stiffness.places();
        assert_eq!(places.len(), octree.cells().len());
        let turned = (stiffness.rotation(places[0]) - Matrix3::identity()).norm();
        assert!((turned > 1e-2) == law.rotates());
        stiffness.update(&mut team, &with(law), &x, None);
        let anew = updated(Simd::detect(), 1, &octree, law, &x);
        let (f, diagonal) = read(&stiffness, x.len());
        let exact: Vec<_> = anew.f.iter().map(wide).collect();
        assert!(error(&f, &exact) < 1e-5, "{:e}", error(&f, &exact));
        let of = |d: &[Block6]| d.iter().map(|d| [d[0], d[4], d[6], 0.0]).collect::<Vec<Padded>>();
        let exact: Vec<_> = of(&anew.diagonal).iter().map(wide).collect();
        assert!(error(&of(&diagonal), &exact) < 1e-5);
        let p = direction(x.len());
        let [mut y, mut expected] = [vec![[0.0; 4]; x.len()], vec![[0.0; 4]; x.len()]];
        stiffness.apply(&mut team, &p, &mut y);
        let mut anew = anew.stiffness;
        anew.apply(&mut team, &p, &mut expected);
        let expected: Vec<_> = expected.iter().map(wide).collect();
        assert!(error(&y, &expected) < 1e-5);
    }
}
