//! Cells, vertices and prolongation of the levels.

use std::collections::BTreeMap;

use scindo_matter::octree::Octree;

use super::support::{V3, blade_grid, cube, cut_at, noise};
use crate::solver::multigrid::Hierarchy;
use crate::solver::multigrid::transfer::carriers;

/// An adaptive body with cuts along random links.
pub(super) fn random_cuts(cells: u32, levels: u8, share: f64, seed: usize) -> Octree {
    let mut octree = cube(cells, levels);
    let n = cells as i32;
    let mut cuts = Vec::new();
    for i in 0..(n * n * n) {
        let at = [i % n, i / n % n, i / (n * n)];
        for axis in 0..3 {
            if noise(3 * i as usize + axis, seed) < 2.0 * share - 1.0 && at[axis] + 1 < n {
                cuts.push(cut_at(at, axis as u8));
            }
        }
    }
    octree.cut(&cuts);
    octree
}

fn bodies() -> Vec<Octree> {
    let mut grid = cube(16, 2);
    blade_grid(&mut grid, &[3, 8, 13]);
    let mut slit = cube(32, 3);
    blade_grid(&mut slit, &[16]);
    vec![
        cube(16, 3),
        cube(13, 2),
        grid,
        slit,
        random_cuts(8, 0, 0.4, 1),
        random_cuts(16, 2, 0.002, 2),
        random_cuts(16, 3, 0.02, 3),
    ]
}

#[test]
fn cells_that_share_a_vertex_agree_on_its_prolongation() {
    for (b, octree) in bodies().iter().enumerate() {
        let hierarchy = Hierarchy::with(octree, 100, true);
        assert!(hierarchy.n_levels() > 2, "body {b}");
        for (l, step) in hierarchy.steps.iter().enumerate() {
            let (fine, coarse) = (&hierarchy.levels[l], &hierarchy.levels[l + 1]);
            for id in 0..fine.cells.len() {
                for c in 0..8 {
                    let own: BTreeMap<u32, f32> = carriers(fine, coarse, step.parent[id], (id, c)).collect();
                    let row = step.transfer.row(fine.vertices[id][c] as usize);
                    assert!(row.len() <= 8);
                    let shared: BTreeMap<u32, f32> = row.collect();
                    assert_eq!(own, shared, "body {b}, level {l}, cell {id}, corner {c}");
                }
            }
        }
    }
}

#[test]
fn levels_rest_on_eight_vertices_and_prolong_linear_fields() {
    for octree in bodies() {
        let hierarchy = Hierarchy::with(&octree, 100, true);
        for level in &hierarchy.levels {
            for (id, vertices) in level.vertices.iter().enumerate() {
                let mut distinct = vertices.to_vec();
                distinct.sort_unstable();
                distinct.dedup();
                assert!(distinct.len() == 8 && distinct[7] < level.n_vertices as u32);
                assert!(level.leaf[id] || level.hanging[id] == 0);
            }
        }
        for (l, step) in hierarchy.steps.iter().enumerate() {
            let points = |l: usize| {
                let level = &hierarchy.levels[l];
                let mut at = vec![V3::repeat(f64::NAN); level.n_vertices];
                for id in 0..level.cells.len() {
                    for c in 0..8 {
                        at[level.vertices[id][c] as usize] =
                            V3::from(level.vertex_point(id, c).map(f64::from));
                    }
                }
                at
            };
            let (fine, coarse) = (points(l), points(l + 1));
            for (v, at) in fine.iter().enumerate() {
                let row = step.transfer.row(v);
                let sum: V3 = row.map(|(c, w)| f64::from(w) * coarse[c as usize]).sum();
                assert!((sum - at).norm() < 1e-6, "level {l}, vertex {v}: {sum} {at}");
            }
        }
    }
}

/// A body cut apart stays apart on every level.
#[test]
fn parts_have_no_vertex_in_common_on_any_level() {
    let mut octree = cube(16, 2);
    let whole: Vec<_> =
        (0..256).flat_map(|i| [cut_at([6, i % 16, i / 16], 0), cut_at([i % 16, 8, i / 16], 1)]).collect();
    octree.cut(&whole);
    let parts = octree.components();
    assert_eq!(parts.volume.len(), 4);
    let hierarchy = Hierarchy::with(&octree, 1, true);
    let mut part: Vec<u32> = parts.of_piece.clone();
    for (l, level) in hierarchy.levels.iter().enumerate() {
        let mut of_vertex = vec![None; level.n_vertices];
        for (id, vertices) in level.vertices.iter().enumerate() {
            for &v in vertices {
                assert!(of_vertex[v as usize].is_none_or(|p| p == part[id]), "level {l}");
                of_vertex[v as usize] = Some(part[id]);
            }
        }
        if let Some(step) = hierarchy.steps.get(l) {
            let mut coarse = vec![0; hierarchy.levels[l + 1].cells.len()];
            step.parent.iter().zip(&part).for_each(|(&p, &of)| coarse[p as usize] = of);
            part = coarse;
        }
    }
    // Four cells at last, one for each part.
    assert!(hierarchy.levels[hierarchy.n_levels() - 1].cells.len() >= 4);
}
