use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::*;

fn cube(cells: u32, levels: u8) -> Octree {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap()
}

/// A torus-like solid with a spike and a thin sheet.
struct Odd;

impl Shape for Odd {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        [Vector3::new(-1.0, -1.0, -0.5), Vector3::new(1.0, 1.0, 0.5)]
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        let ring = (p.xy().norm() - 0.65).hypot(p.z) < 0.33;
        let sheet = p.z.abs() < 0.03 && p.xy().norm() < 0.9;
        ring || sheet
    }

    fn crossing(&self, _: &Vector3<f64>, _: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        None
    }
}

/// The vertices of an octree by their definition: slots of cells joined over faces, without the shortcut of octants.
fn check_vertices(octree: &Octree) {
    let cells = octree.cells();
    for (id, cell) in cells.iter().enumerate() {
        let W = corner_weights(cell, octree.hanging()[id]);
        let vertices = octree.vertices()[id];
        let distinct: BTreeSet<u32> = vertices.into_iter().collect();
        assert_eq!(distinct.len(), 8, "cell {id} rests on eight vertices");
        for c in 0..8 {
            // Trilinear interpolation reproduces the corner.
            let mut at = Vector3::zeros();
            for (v, w) in vertices.iter().zip(W[c]) {
                let p = octree.points()[*v as usize].map(f64::from);
                at += w * Vector3::from(p);
            }
            let corner = Vector3::from(cell.corner(c).map(f64::from));
            assert!((at - corner).norm() < 1e-12, "cell {id} corner {c}: {at} {corner}");
        }
        // 2:1 balance across faces, edges and corners.
        let side = cell.side();
        for d in 0..27 {
            let d = [d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1];
            let near = [0, 1, 2].map(|k| cell.at[k] + if d[k] > 0 { side } else { d[k] });
            let near = octree.leaf(near);
            if near != OUTSIDE {
                assert!(cells[near as usize].level.abs_diff(cell.level) <= 1, "cell {id}");
            }
        }
    }
    // Where two linked cells meet, both see the same displacement: their corners on the face agree as fields.
    let value = |v: u32| f64::from(v.wrapping_mul(2_654_435_761) >> 8) / 1e6;
    let field = |id: u32| {
        let W = corner_weights(&cells[id as usize], octree.hanging()[id as usize]);
        let u = octree.vertices()[id as usize].map(value);
        W.map(|row| row.iter().zip(u).map(|(w, u)| w * u).sum::<f64>())
    };
    let at = |id: u32, p: [f64; 3]| {
        let (cell, u) = (&cells[id as usize], field(id));
        let x = [0, 1, 2].map(|k| (p[k] - f64::from(cell.at[k])) / f64::from(cell.side()));
        (0..8).map(|c| u[c] * (0..3).map(|k| if c >> k & 1 == 1 { x[k] } else { 1.0 - x[k] }).product::<f64>()).sum::<f64>()
    };
    octree.for_links(|a, b, axis| {
        let small = if cells[a as usize].level <= cells[b as usize].level { a } else { b };
        let cell = &cells[small as usize];
        let upper = small == a;
        for (s, t) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.6), (1.0, 1.0)] {
            let mut p = cell.at.map(f64::from);
            p[axis] += if upper { f64::from(cell.side()) } else { 0.0 };
            p[(axis + 1) % 3] += s * f64::from(cell.side());
            p[(axis + 2) % 3] += t * f64::from(cell.side());
            let (ua, ub) = (at(a, p), at(b, p));
            assert!((ua - ub).abs() < 1e-9 * (1.0 + ua.abs()), "link {a} {b}: {ua} {ub}");
        }
    });
}

#[test]
fn the_cube_of_the_paper_has_its_number_of_cells() {
    let octree = cube(80, 4);
    let mut sizes = BTreeMap::new();
    octree.cells().iter().for_each(|cell| *sizes.entry(cell.level).or_insert(0) += 1);
    assert_eq!(sizes.into_iter().collect::<Vec<_>>(), [(0, 73_024), (1, 8216), (2, 1736), (3, 296), (4, 27)]);
    assert_eq!(octree.cells().len(), 83_299);
}

#[test]
fn cells_rest_on_eight_vertices_and_agree_on_common_faces() {
    for (cells, levels) in [(1, 0), (4, 0), (7, 3), (16, 2), (24, 3)] {
        check_vertices(&cube(cells, levels));
    }
    let odd = Octree::fill(&Odd, OctreeSettings { cells: 48, levels: 3 }, &|_| 0).unwrap();
    check_vertices(&odd);
    assert!(odd.cells().iter().any(|cell| cell.level > 0));
}

#[test]
fn a_uniform_grid_has_the_vertices_of_its_lattice() {
    let octree = cube(6, 0);
    assert_eq!((octree.cells().len(), octree.n_vertices()), (216, 343));
    assert!(octree.hanging().iter().all(|&hanging| hanging == 0));
    let points: BTreeSet<At> = octree.points().iter().copied().collect();
    assert_eq!(points.len(), 343);
}

#[test]
fn two_materials_are_separated_by_finest_cells() {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 32, levels: 3 }, &|p| u16::from(p.z > 0.5)).unwrap();
    check_vertices(&octree);
    for cell in octree.cells() {
        for d in [15, 16] {
            assert!(!(cell.at[2]..cell.at[2] + cell.side()).contains(&d) || cell.level == 0);
        }
    }
}

#[test]
fn a_solid_that_no_cell_can_fill_is_refused() {
    let thin = BoxShape { min: Vector3::zeros(), max: Vector3::new(1.0, 1.0, 0.0) };
    let settings = OctreeSettings { cells: 4, levels: 0 };
    assert!(Octree::fill(&thin, settings, &|_| 0).is_ok(), "a sheet in the middle of its cells");
    let nothing = BoxShape { min: Vector3::zeros(), max: Vector3::zeros() };
    assert_eq!(Octree::fill(&nothing, settings, &|_| 0).unwrap_err(), OctreeError::Empty);
    let settings = OctreeSettings { cells: 0, levels: 0 };
    assert!(matches!(Octree::fill(&thin, settings, &|_| 0), Err(OctreeError::Settings(_))));
    let settings = OctreeSettings { cells: 4096, levels: 0 };
    let cube = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    assert!(matches!(Octree::fill(&cube, settings, &|_| 0), Err(OctreeError::TooMany { .. })));
}
