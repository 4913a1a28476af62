//! Measures multigrid on octree cells: `cargo bench -p scindo-physics --bench multigrid`. `-- --quick` makes a short
//! run. Times of building, updates and a cycle, V(2,2) with the Chebyshev smoother.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // a bench times
#![allow(non_snake_case)] // the symbols of the field: A, D

use std::time::Instant;

use nalgebra::{Matrix3, Rotation3, Vector3};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::FixedCopy;
use scindo_physics::element::Simd;
use scindo_physics::material::{Lame, Law};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings, Shape};
use scindo_physics::operator::cells::CellStiffness;
use scindo_physics::operator::{BLOCK, BlockJacobi, ElasticUpdate, Stiffness};
use scindo_physics::solver::multigrid::{
    CellMaterial, Coefficients, Hierarchy, Multigrid, MultigridSettings,
};
use scindo_physics::space::OctreeSpace;
use scindo_physics::space::Space;
use scindo_physics::team::{Team, blocks};

const LAME: Lame = Lame { mu: 4e5, lambda: 6e5 };

fn main() {
    let quick = std::env::args().any(|a| a == "--quick" || a == "--test");
    let sizes: &[(u32, u8)] = if quick { &[(16, 2)] } else { &[(32, 0), (64, 0), (24, 3), (80, 4)] };
    let settings = OctreeSettings { cells: if quick { 24 } else { 150 }, levels: if quick { 2 } else { 4 } };
    let shell = Octree::fill(&Shell, settings, &|_| 0).unwrap();
    println!("a shell:");
    for threads in [1, 2] {
        measure(&shell, threads);
    }
    println!("cubes:");
    for &(cells, levels) in sizes {
        let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
        let octree = Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap();
        for threads in [1, 2] {
            measure(&octree, threads);
        }
        if levels > 0 {
            println!("the same, cut by a grid of blades to half its depth:");
            let cut = cut_by_a_grid(octree);
            for threads in [1, 2] {
                measure(&cut, threads);
            }
        }
    }
}

/// A body whose cells are mostly at its boundary: the space between two spheres and two planes.
struct Shell;

impl Shape for Shell {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        [Vector3::new(-1.0, -1.0, -0.6), Vector3::new(1.0, 1.0, 0.6)]
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        p.z.abs() <= 0.6 && (0.5..=1.0).contains(&p.norm())
    }

    fn crossing(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let inside = self.contains(a);
        (inside != self.contains(b)).then(|| {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..30 {
                let middle = 0.5 * (low + high);
                if self.contains(&a.lerp(b, middle)) == inside { low = middle } else { high = middle }
            }
            let p = a.lerp(b, low);
            let out = if p.z.abs() > 0.599 {
                Vector3::z() * p.z.signum()
            } else {
                p.normalize() * (p.norm() - 0.75).signum()
            };
            (low, out)
        })
    }
}

/// A cube divided into rods that are some cells wide, from its top to half its depth.
fn cut_by_a_grid(octree: Octree) -> Octree {
    let x = octree.rest_positions();
    let cells = f64::from(octree.lattice().size[0]);
    let mut space = OctreeSpace::new(octree);
    let mut at = x;
    let planes = [0.09, 0.16, 0.26, 0.34, 0.41, 0.51, 0.59, 0.66, 0.76, 0.84, 0.91];
    for (incision, (axis, p)) in (1..).zip([0, 1].into_iter().flat_map(|axis| planes.map(|p| (axis, p)))) {
        let p = (p * cells).round() / cells;
        let point = |along: f64, z: f64| {
            if axis == 0 { Vector3::new(p, along, z) } else { Vector3::new(along, p, z) }
        };
        let blade = BladeSweep { segments: [1.1, 0.5].map(|z| [point(-0.1, z), point(1.1, z)]).to_vec() };
        let report = space.cut(&mut Team::alone(), &at, &blade, incision).unwrap();
        report.new_copies.iter().for_each(|new| at.push(new.inherited(&at)));
    }
    space.octree().clone()
}

fn measure(octree: &Octree, threads: usize) {
    let mut team = Team::new(threads).unwrap();
    let low = (0_u32..).zip(octree.points()).filter(|(_, p)| p[2] == 0);
    let fixed: Vec<FixedCopy> =
        low.map(|(copy, _)| FixedCopy { copy, held: [true; 3].into(), position_m: [0.0; 3] }).collect();
    let mut A = CellStiffness::new(Simd::detect(), octree, &[]);
    let x = octree.rest_positions();
    A.update(&mut team, &ElasticUpdate { lame: LAME, law: Law::Linear, scale: 1.0 }, &x, None);
    let mut diagonal = vec![[0.0; 8]; x.len()];
    let K = &A;
    team.for_blocks(blocks(&mut diagonal, BLOCK), |block, d| K.diagonals(block, d));
    let mut D = BlockJacobi::default();
    D.resize(x.len());
    D.update(&mut team, &diagonal, &fixed);

    let begin = Instant::now();
    let mut multigrid = Multigrid::new(Hierarchy::new(octree), MultigridSettings::default());
    let built = begin.elapsed();
    let materials = vec![CellMaterial { lame: LAME, density_kg_m3: 1000.0 }];
    let with = Coefficients { materials, scale: 1.0, mass_factor: 0.0 };
    let begin = Instant::now();
    multigrid.update(&mut team, (&with, &fixed), &|_| Matrix3::identity());
    let first = begin.elapsed();
    let begin = Instant::now();
    multigrid.estimate_eigenvalues(&mut team, &mut A, D.inverses());
    let estimated = begin.elapsed();
    let turned = Rotation3::new(Vector3::new(0.2, 0.3, 0.1)).into_inner();
    let begin = Instant::now();
    multigrid.update(&mut team, (&with, &fixed), &|_| turned);
    let followed = begin.elapsed();
    // Other constants: all matrices are new, and their memory is in use.
    let other = Coefficients { scale: 2.0, ..with.clone() };
    let mut renewed = f64::INFINITY;
    for with in [&other, &with, &other, &with] {
        let begin = Instant::now();
        multigrid.update(&mut team, (with, &fixed), &|_| Matrix3::identity());
        renewed = renewed.min(begin.elapsed().as_secs_f64());
    }
    // A body that bends on: every cell has a rotation of its own, and most coarse cells a matrix of theirs.
    let centres: Vec<f64> = octree.cells().iter().map(|cell| f64::from(cell.at[2])).collect();
    let height = centres.iter().fold(0.0, |height: f64, z| height.max(*z));
    let mut bent = f64::INFINITY;
    for angle in [0.8, 1.0, 0.8, 1.0] {
        let bend = |id: u32| {
            let angle = angle * centres[id as usize] / height;
            Rotation3::new(Vector3::new(angle, 0.3 * angle * angle, 0.0)).into_inner().cast()
        };
        let begin = Instant::now();
        multigrid.update(&mut team, (&with, &fixed), &bend);
        bent = bent.min(begin.elapsed().as_secs_f64());
    }
    multigrid.update(&mut team, (&with, &fixed), &|_| Matrix3::identity());

    let r = vec![[1.0, -0.5, 0.25, 0.0]; x.len()];
    let mut z = r.clone();
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let begin = Instant::now();
        multigrid.cycle(&mut team, &mut A, (D.inverses(), 0.0), &r, &mut z);
        best = best.min(begin.elapsed().as_secs_f64());
    }
    let cells = octree.cells().len();
    let ms = |t: std::time::Duration| 1e3 * t.as_secs_f64();
    println!(
        "{cells} cells, {threads} threads: built in {:.0} ms, first update {:.0} ms, again {:.0} ms, eigenvalues {:.0} ms, \
         rigid rotation {:.0} ms, bending {:.0} ms, cycle {:.1} ms ({:.2} M cells/s)",
        ms(built),
        ms(first),
        1e3 * renewed,
        ms(estimated),
        ms(followed),
        1e3 * bent,
        1e3 * best,
        cells as f64 / best / 1e6,
    );
    if threads == 1 {
        let (levels, coarsest) = multigrid.report();
        levels.iter().for_each(|level| println!("    {level:?}"));
        println!("    {coarsest:?}");
    }
}
