//! Refinement and coarsening of cells: structure, fields, momentum, and when they happen.

use fastrand::Rng;
use nalgebra::Vector3;

use super::surface::OctreeSurface;
use super::tests::{Odd, check_numbering, check_vertices, cube, link};
use super::*;
use crate::element::MaterialPoint;

fn free(_: u32, _: &MaterialPoint) -> bool {
    false
}

/// All families whose first leaf is there.
fn families(octree: &Octree) -> Vec<Family> {
    let first = octree.cells().iter().filter(|cell| cell.octant() == 0);
    first.map(|cell| Family { level: cell.level + 1, at: cell.at }).collect()
}

/// Leaves of a random part of the interior.
fn some_leaves(octree: &Octree, random: &mut Rng, part: f64) -> Vec<u32> {
    (0..octree.cells().len() as u32)
        .filter(|&id| octree.cells()[id as usize].level > 0 && random.f64() < part)
        .collect()
}

fn assert_same(a: &Octree, b: &Octree) {
    assert_eq!(a.cells(), b.cells());
    assert_eq!(a.vertices(), b.vertices());
    assert_eq!(a.hanging(), b.hanging());
    assert_eq!(a.points(), b.points());
    let size = a.lattice().size.map(|n| n as i32);
    for k in 0..size[2] {
        for j in 0..size[1] {
            (0..size[0]).for_each(|i| assert_eq!(a.leaf([i, j, k]), b.leaf([i, j, k])));
        }
    }
}

#[test]
fn an_octree_that_is_refined_and_coarsened_back_is_the_one_it_was() {
    let mut random = Rng::with_seed(5);
    for levels in 1..4 {
        let mut octree = cube(32, levels);
        let start = octree.clone();
        assert_eq!(octree.coarsen(&families(&octree), &free).joined, 0, "the start is as coarse as can be");
        assert_same(&octree, &start);
        for _ in 0..3 {
            let mut divided = 0;
            for _ in 0..levels {
                divided += octree.divide_leaves(&some_leaves(&octree, &mut random, 0.4)).divided;
                check_vertices(&octree);
            }
            assert!(divided > 0);
            let mut joined = 0;
            while joined < divided {
                let change = octree.coarsen(&families(&octree), &free);
                check_vertices(&octree);
                check_numbering(&octree);
                assert!(change.joined > 0, "{joined} of {divided}");
                joined += change.joined;
            }
            assert_same(&octree, &start);
        }
    }
}

#[test]
fn random_changes_keep_structure_mass_momentum_and_surface() {
    let mut random = Rng::with_seed(11);
    let (mut n_joined, mut n_vanished) = (0, 0);
    for round in 0..12 {
        let levels = 1 + (round % 3) as u8;
        let material = |p: &Vector3<f64>| u16::from(p.x + 0.3 * p.y > 0.4);
        let settings = OctreeSettings { cells: 32, levels };
        let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
        let mut octree = match round % 2 {
            0 => Octree::fill(&shape, settings, &material).unwrap(),
            _ => Octree::fill(&Odd, OctreeSettings { cells: 48, levels }, &|_| 0).unwrap(),
        };
        let mut surface = OctreeSurface::build(&octree);
        let vector = |random: &mut Rng| Vector3::new(random.f64(), random.f64(), random.f64());
        let mut v: Vec<Vector3<f64>> = octree.points().iter().map(|_| vector(&mut random)).collect();
        let mut x = octree.rest_positions();
        x.iter_mut().for_each(|x| *x += 0.01 * vector(&mut random));
        for incision in 1..5 {
            let size = octree.lattice().size.map(|n| n as i32);
            let mut refined = octree.divide_leaves(&some_leaves(&octree, &mut random, 0.2));
            surface.follow(&octree, &refined.cells, &[]);
            let extend = |values: &mut Vec<Vector3<f64>>, change: &OctreeChange| {
                change.new_vertices.iter().for_each(|p| values.push(p.position(values)));
            };
            [&mut x, &mut v].into_iter().for_each(|values| extend(values, &refined));
            let axis = random.i32(0..3) as u8;
            let at = [0, 1, 2].map(|k| random.i32(0..size[k]));
            let cuts: Vec<(LinkKey, CutLink)> = (0..36)
                .map(|k| {
                    let mut at = at;
                    at[usize::from(axis + 1) % 3] += k % 6;
                    at[usize::from(axis + 2) % 3] += k / 6;
                    ((at, axis), link(incision))
                })
                .collect();
            refined = octree.cut(&cuts);
            let keys: Vec<LinkKey> = cuts.iter().map(|(key, _)| *key).collect();
            surface.follow(&octree, &refined.cells, &keys);
            [&mut x, &mut v].into_iter().for_each(|values| extend(values, &refined));

            let before = octree.clone();
            let mass = octree.vertex_masses(1000.0);
            let chosen: Vec<Family> = families(&octree).into_iter().filter(|_| random.f64() < 0.7).collect();
            let change = octree.coarsen(&chosen, &free);
            (n_joined, n_vanished) = (n_joined + change.joined, n_vanished + change.vanished.len());
            check_vertices(&octree);
            check_numbering(&octree);
            // Cells with cut links, at the boundary and beside another material are as they were.
            for (cell, &now) in before.cells().iter().zip(&change.cell_of).filter(|(cell, _)| cell.level == 0)
            {
                let other = |near: At| {
                    let leaf = before.leaf(near);
                    leaf == OUTSIDE || before.cells()[leaf as usize].material != cell.material
                };
                if cell.cut != 0 || (0..6).any(|d| other(Octree::across(cell.at, d))) {
                    assert_eq!(octree.cells()[now as usize], *cell);
                }
            }
            // What was not told of is as it was, up to numbers.
            for (id, &now) in change.cell_of.iter().enumerate() {
                if now != OUTSIDE && change.cells.binary_search(&now).is_err() {
                    assert_eq!(octree.cells()[now as usize], before.cells()[id]);
                    assert_eq!(octree.hanging()[now as usize], before.hanging()[id]);
                    let renamed = before.vertices()[id].map(|v| change.vertex_of[v as usize]);
                    assert_eq!(octree.vertices()[now as usize], renamed);
                }
            }
            let after = octree.vertex_masses(1000.0);
            let total = |m: &[f64]| m.iter().sum::<f64>();
            assert!((total(&after) / total(&mass) - 1.0).abs() < 1e-12);
            let momentum =
                |m: &[f64], v: &[Vector3<f64>]| m.iter().zip(v).map(|(m, v)| *m * v).sum::<Vector3<f64>>();
            let p = momentum(&mass, &v);
            let restriction = Restriction::new(&change, &mass, &[]);
            restriction.sample(&mut x);
            restriction.project(&mut v);
            assert_eq!((x.len(), v.len()), (octree.n_vertices(), octree.n_vertices()));
            assert!((momentum(&after, &v) - p).norm() < 1e-12 * p.norm());

            surface.follow_coarsening(&octree, &change);
            let rest = octree.rest_positions();
            let fresh = OctreeSurface::build(&octree);
            let places = |surface: &OctreeSurface, rest: &[Vector3<f64>]| {
                let key = |p: Vector3<f64>| [p.x, p.y, p.z].map(|c| (c * 1e9).round() as i64);
                let corner = |v: &u32| key(surface.surface().vertices[*v as usize].position(rest));
                let mut all: Vec<[[i64; 3]; 3]> = surface
                    .surface()
                    .triangles
                    .iter()
                    .map(|t| {
                        let first = (0..3).min_by_key(|&k| corner(&t[k])).unwrap();
                        [0, 1, 2].map(|k| corner(&t[(first + k) % 3]))
                    })
                    .collect();
                all.sort_unstable();
                all
            };
            assert_eq!(surface.surface().n_defects(), 0);
            assert_eq!(places(&surface, &rest), places(&fresh, &rest));
        }
    }
    assert!(n_joined > 300 && n_vanished > 3_000, "{n_joined} {n_vanished}");
}

#[test]
fn projection_keeps_what_coarse_cells_can_represent_and_vetoes_count() {
    let mut octree = cube(16, 2);
    let coarse = octree.clone();
    let linear = |p: &Vector3<f64>| Vector3::new(1.0 + 2.0 * p.y, p.x - p.z, 0.5 * p.z);
    octree.divide_leaves(&some_leaves(&octree, &mut Rng::with_seed(1), 1.0));
    let mut v: Vec<Vector3<f64>> = octree.rest_positions().iter().map(linear).collect();
    let mass = octree.vertex_masses(1.0);
    let none = octree.clone().coarsen(&families(&octree), &|_, _| true);
    assert_eq!((none.joined, none.vanished.len()), (0, 0));
    let change = octree.coarsen(&families(&octree), &free);
    assert!(change.joined > 0);
    Restriction::new(&change, &mass, &[]).project(&mut v);
    assert_same(&octree, &coarse);
    for (v, p) in v.iter().zip(octree.rest_positions()) {
        assert!((v - linear(&p)).norm() < 1e-14);
    }
}

#[test]
fn tools_speed_and_error_decide_with_hysteresis_one_level_at_a_time() {
    let mut octree = cube(32, 3);
    let start = octree.clone();
    let settings = AdaptSettings { distance_m: Some([0.1, 0.2]), level: 1, ..AdaptSettings::default() };
    let step = |octree: &mut Octree, tools: &[Vector3<f64>]| {
        let x = octree.rest_positions();
        let v = vec![Vector3::zeros(); x.len()];
        let plan = octree.plan(&settings, &Activity { x: &x, v: &v, tools, error: None });
        assert_eq!(plan, octree.plan(&settings, &Activity { x: &x, v: &v, tools, error: None }));
        let levels: Vec<u8> = start_levels(octree);
        let (divided, joined) =
            (octree.divide_leaves(&plan.refine).divided, octree.coarsen(&plan.coarsen, &free).joined);
        let now = start_levels(octree);
        assert!(levels.iter().zip(&now).all(|(a, b)| a.abs_diff(*b) <= 1), "one level per call");
        check_vertices(octree);
        (divided, joined)
    };
    let centre = Vector3::repeat(0.5);
    assert_eq!(step(&mut octree, &[]), (0, 0));
    assert!(step(&mut octree, &[centre]).0 > 0);
    assert!(step(&mut octree, &[centre]).0 > 0);
    assert_eq!(step(&mut octree, &[centre]), (0, 0), "it comes to rest");
    assert_eq!(octree.cells()[octree.leaf([16; 3]) as usize].level, 1);
    // A tool that trembles within the hysteresis changes nothing.
    let fine = octree.clone();
    for k in 0..6 {
        step(&mut octree, &[centre + Vector3::repeat(0.002 * f64::from(k % 2))]);
    }
    assert_same(&octree, &fine);
    // Gone, it leaves what was there before.
    let mut joined = 0;
    for _ in 0..4 {
        joined += step(&mut octree, &[Vector3::repeat(5.0)]).1;
    }
    assert!(joined > 0);
    assert_same(&octree, &start);

    // Fast material, and cells with a large error.
    let x = octree.rest_positions();
    let v: Vec<Vector3<f64>> = x.iter().map(|p| Vector3::new(0.0, p.x, 0.0)).collect();
    let of = |speed, error| AdaptSettings { speed_m_s: speed, error, ..AdaptSettings::default() };
    let activity = |error| Activity { x: &x, v: &v, tools: &[], error };
    let fast = octree.plan(&of(Some([0.6, 0.3]), None), &activity(None)).refine;
    assert!(!fast.is_empty());
    assert!(fast.iter().all(|&id| {
        let cell = octree.cells()[id as usize];
        f64::from(cell.at[0]) + 0.5 * f64::from(cell.side()) > 0.6 * 32.0
    }));
    let coarse = (0..octree.cells().len()).find(|&id| octree.cells()[id].level > 0).unwrap();
    let eta: Vec<f64> = (0..octree.cells().len()).map(|id| f64::from(u8::from(id == coarse))).collect();
    let wrong = octree.plan(&of(None, Some([0.5, 0.1])), &activity(Some(&eta)));
    assert_eq!(wrong, Plan { refine: vec![coarse as u32], coarsen: Vec::new() });
    assert!(
        octree.plan(&of(None, Some([0.5, 0.1])), &activity(None)).is_empty(),
        "unknown errors change nothing"
    );
}

/// Level of the leaf of every finest cell.
fn start_levels(octree: &Octree) -> Vec<u8> {
    let mut levels = Vec::new();
    let size = octree.lattice().size.map(|n| n as i32);
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let leaf = octree.leaf([i, j, k]);
                levels.push(if leaf == OUTSIDE { 0 } else { octree.cells()[leaf as usize].level });
            }
        }
    }
    levels
}

#[test]
fn settings_without_hysteresis_are_refused() {
    let of = |distance_m, speed_m_s, error| AdaptSettings { distance_m, speed_m_s, error, level: 0 };
    assert_eq!(of(Some([0.1, 0.2]), Some([2.0, 1.0]), Some([1e-3, 1e-4])).check(), Ok(()));
    assert_eq!(of(Some([0.2, 0.2]), None, None).check().unwrap_err().name, "distance_m");
    assert_eq!(of(None, Some([1.0, 2.0]), None).check().unwrap_err().name, "speed_m_s");
    assert_eq!(of(None, None, Some([f64::NAN, 0.0])).check().unwrap_err().name, "error");
    assert!(AdaptSettings::default().is_off());
}
