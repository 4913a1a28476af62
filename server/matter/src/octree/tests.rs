use std::collections::{BTreeMap, BTreeSet};

use fastrand::Rng;
use nalgebra::Vector3;

use super::*;
use crate::cut::BladeSweep;
use crate::team::Team;

pub(super) fn cube(cells: u32, levels: u8) -> Octree {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap()
}

/// A torus-like solid with a spike and a thin sheet.
pub(super) struct Odd;

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
pub(super) fn check_vertices(octree: &Octree) {
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
        (0..8)
            .map(|c| u[c] * (0..3).map(|k| if c >> k & 1 == 1 { x[k] } else { 1.0 - x[k] }).product::<f64>())
            .sum::<f64>()
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
    let octree =
        Octree::fill(&shape, OctreeSettings { cells: 32, levels: 3 }, &|p| u16::from(p.z > 0.5)).unwrap();
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

pub(super) fn link(incision: u32) -> CutLink {
    CutLink { at: [0.5; 2], normal: [Vector3::x(); 2], incision }
}

/// Mass per vertex, for unit density and h = 1: an eighth of each cell to each corner.
fn masses(octree: &Octree) -> Vec<f64> {
    let mut mass = vec![0.0; octree.n_vertices()];
    for (id, cell) in octree.cells().iter().enumerate() {
        let W = corner_weights(cell, octree.hanging()[id]);
        for row in W {
            for (v, w) in octree.vertices()[id].iter().zip(row) {
                mass[*v as usize] += w * f64::from(cell.side().pow(3)) / 8.0;
            }
        }
    }
    mass
}

#[test]
fn random_cuts_keep_eight_vertices_per_cell_and_the_field_and_momentum() {
    let mut random = Rng::with_seed(3);
    for round in 0..40 {
        let levels = (round % 4) as u8;
        let mut octree = if round % 2 == 0 {
            cube(16, levels)
        } else {
            Octree::fill(&Odd, OctreeSettings { cells: 24, levels }, &|_| 0).unwrap()
        };
        let mut value: Vec<f64> = (0..octree.n_vertices()).map(|_| random.f64()).collect();
        for incision in 1..4 {
            let before = octree.clone();
            let moment = |octree: &Octree, value: &[f64]| {
                masses(octree).iter().zip(value).map(|(m, v)| m * v).sum::<f64>()
            };
            let earlier = (moment(&octree, &value), masses(&octree).iter().sum::<f64>());
            // A patch of links across one plane, and some links at random.
            let axis = random.i32(0..3) as u8;
            let size = octree.lattice().size.map(|n| n as i32);
            let plane = random.i32(0..size[usize::from(axis)]);
            let corner = [0, 1, 2].map(|k| random.i32(0..size[k]));
            let mut cuts = Vec::new();
            for s in 0..size.into_iter().max().unwrap() / 2 {
                for t in 0..7 {
                    let mut at = corner;
                    at[usize::from(axis)] = plane;
                    at[usize::from(axis + 1) % 3] += s;
                    at[usize::from(axis + 2) % 3] += t;
                    cuts.push(((at, axis), link(incision)));
                }
            }
            for _ in 0..3 {
                let at = [0, 1, 2].map(|k| random.i32(0..size[k]));
                cuts.push(((at, random.i32(0..3) as u8), link(incision)));
            }
            let change = octree.cut(&cuts);
            check_vertices(&octree);
            value.extend(
                change
                    .new_vertices
                    .iter()
                    .map(|p| p.carriers().map(|(v, w)| w * value[v]).sum::<f64>())
                    .collect::<Vec<_>>(),
            );
            assert_eq!(value.len(), octree.n_vertices());
            // The field is the same at every corner of every finest cell.
            let at = |octree: &Octree, value: &[f64], at: At, c: usize| {
                let id = octree.leaf(at);
                let cell = octree.cells()[id as usize];
                let xi = [0, 1, 2]
                    .map(|k| f64::from(at[k] + (c >> k & 1) as i32 - cell.at[k]) / f64::from(cell.side()));
                octree.point_in(id, xi).carriers().map(|(v, w)| w * value[v]).sum::<f64>()
            };
            for cell in octree.cells() {
                for c in 0..8 {
                    let (new, old) = (at(&octree, &value, cell.at, c), at(&before, &value, cell.at, c));
                    assert!((new - old).abs() < 1e-12, "{:?} corner {c}: {new} {old}", cell.at);
                }
            }
            let later = (moment(&octree, &value), masses(&octree).iter().sum::<f64>());
            assert!((later.0 / earlier.0 - 1.0).abs() < 1e-12 && (later.1 / earlier.1 - 1.0).abs() < 1e-12);
            assert!(masses(&octree).iter().all(|&m| m > 0.0), "every vertex has mass");
            // What was not told of has not changed.
            for id in
                (0..before.cells().len()).filter(|&id| change.cells.binary_search(&(id as u32)).is_err())
            {
                assert_eq!(octree.cells()[id], before.cells()[id]);
                assert_eq!(octree.vertices()[id], before.vertices()[id]);
                assert_eq!(octree.hanging()[id], before.hanging()[id]);
            }
            check_numbering(&octree);
        }
    }
}

/// The vertices are those that numbering from scratch finds, up to their numbers.
pub(super) fn check_numbering(octree: &Octree) {
    let mut anew = octree.clone();
    anew.points.clear();
    anew.vertices.iter_mut().for_each(|v| *v = [OUTSIDE; 8]);
    anew.hanging.iter_mut().for_each(|h| *h = 0);
    anew.number_vertices();
    assert_eq!((anew.hanging(), anew.n_vertices()), (octree.hanging(), octree.n_vertices()));
    let mut other = BTreeMap::new();
    for (a, b) in octree.vertices().as_flattened().iter().zip(anew.vertices().as_flattened()) {
        assert_eq!(other.entry(*a).or_insert(*b), b);
    }
}

#[test]
fn a_stroke_in_parts_equals_the_stroke_whole() {
    let cuts: Vec<(LinkKey, CutLink)> =
        (0..12).flat_map(|y| (0..9).map(move |z| (([7, y, z], 0), link(1)))).collect();
    let mut whole = cube(16, 3);
    whole.cut(&cuts);
    let mut parts = cube(16, 3);
    for part in cuts.chunks(5) {
        parts.cut(part);
    }
    let leaves =
        |octree: &Octree| octree.cells().iter().map(|c| (c.at, c.level, c.cut)).collect::<BTreeSet<_>>();
    assert_eq!(leaves(&whole), leaves(&parts));
    assert_eq!(whole.n_vertices(), parts.n_vertices());
    check_numbering(&parts);
}

#[test]
fn the_cube_of_the_paper_cut_by_aligned_blades_has_its_number_of_cells() {
    let mut octree = cube(80, 4);
    let mut cuts = Vec::new();
    for p in [7, 13, 21, 27, 33, 41, 47, 53, 61, 67, 73] {
        for s in 0..80 {
            for z in 0..40 {
                cuts.push((([p - 1, s, z], 0), link(1)));
                cuts.push((([s, p - 1, z], 1), link(1)));
            }
        }
    }
    octree.cut(&cuts);
    assert_eq!(octree.cells().len(), 203_503);
}

/// Triangles of a sweep of a straight blade between two positions.
fn swept(from: [Vector3<f64>; 2], to: [Vector3<f64>; 2]) -> Vec<crate::cut::SweepTriangle> {
    let blade = crate::cut::BladeSweep { segments: vec![from, to] };
    crate::cut::sweep_triangles(None, &blade, &[])
}

/// A plane through `p` across `normal`, far larger than the unit cube.
fn plane(p: Vector3<f64>, normal: Vector3<f64>) -> Vec<crate::cut::SweepTriangle> {
    let normal = normal.normalize();
    let u = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize() * 5.0;
    let v = normal.cross(&u);
    swept([p - u - v, p - u + v], [p + u - v, p + u + v])
}

#[test]
fn a_plane_divides_a_deformed_body_into_two() {
    let mut random = Rng::with_seed(11);
    for round in 0..30 {
        let mut octree = if round % 3 == 0 {
            Octree::fill(&Odd, OctreeSettings { cells: 30, levels: 2 }, &|_| 0).unwrap()
        } else {
            cube(16, 1 + round as u8 % 3)
        };
        let loose = octree.components().len();
        // Bent, sheared and moved.
        let bend = 0.4 * random.f64();
        let place = |X: Vector3<f64>| {
            Vector3::new(X.x + bend * X.z * X.z + 0.1, X.y - 0.2 * X.x, X.z + 0.1 * (3.0 * X.y).sin())
        };
        let x: Vec<Vector3<f64>> = octree.rest_positions().into_iter().map(place).collect();
        let normal = Vector3::new(random.f64() - 0.5, random.f64() - 0.5, random.f64() - 0.5);
        let middle = place(
            Vector3::repeat(if round % 3 == 0 { 0.0 } else { 0.5 })
                + 0.2 * Vector3::new(random.f64(), random.f64(), random.f64()),
        );
        let triangles = plane(middle, normal);
        let cuts = octree.crossed_links(&x, &triangles, 1);
        assert!(!cuts.is_empty());
        octree.cut(&cuts);
        check_vertices(&octree);
        let parts = octree.components();
        assert!(parts.len() > loose, "round {round}: {} parts", parts.len());
        // All of a part is on one side: the centre of every finest cell, and the sides differ over cut links.
        let side = |at: At| {
            let id = octree.leaf(at);
            let cell = octree.cells()[id as usize];
            let xi = [0, 1, 2].map(|k| (f64::from(at[k] - cell.at[k]) + 0.5) / f64::from(cell.side()));
            let X = octree.point_in(id, xi).position(&octree.rest_positions());
            (place(X) - middle).dot(&normal)
        };
        for ((at, axis), cut) in octree.cut_links() {
            let mut upper = *at;
            upper[usize::from(*axis)] += 1;
            // The trilinear cell and the smooth map differ by a little.
            assert!(side(*at) * side(upper) < 1e-4, "{at:?} {axis}");
            assert!((0.0..=1.0).contains(&cut.at[0]) && cut.at[0] <= cut.at[1]);
            assert!((cut.normal[0].norm() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn a_blade_through_the_middles_of_cells_opens_one_layer_of_links() {
    let mut octree = cube(8, 2);
    let x = octree.rest_positions();
    let triangles = plane(Vector3::repeat(0.5 + 0.5 / 8.0), Vector3::z());
    let cuts = octree.crossed_links(&x, &triangles, 1);
    assert_eq!(cuts.len(), 64);
    octree.cut(&cuts);
    let parts = octree.components();
    assert_eq!(parts.len(), 2);
    let mut volume = parts.volume.clone();
    volume.sort_by(f64::total_cmp);
    assert!((volume[0] - 3.0 / 8.0).abs() < 1e-12 || (volume[0] - 0.5).abs() < 1e-12, "{volume:?}");
    // Between cells the two halves of a link end in one point.
    let mut octree = cube(8, 2);
    let cuts = octree.crossed_links(&x, &plane(Vector3::repeat(0.5), Vector3::x()), 1);
    assert_eq!(cuts.len(), 64);
    assert!(
        cuts.iter()
            .all(|(_, cut)| (cut.at[0] - 0.5).abs() < 1e-12 && (cut.normal[0].x.abs() - 1.0).abs() < 1e-12)
    );
    octree.cut(&cuts);
    assert_eq!(octree.components().len(), 2);
}

#[test]
fn a_moving_blade_opens_the_same_links_in_many_parts() {
    let edge = |s: f64| [Vector3::new(s, 0.31 + 0.2 * s, -0.1), Vector3::new(s, 0.42 + 0.2 * s, 0.63)];
    let mut whole = cube(16, 3);
    let x = whole.rest_positions();
    let cuts = whole.crossed_links(&x, &swept(edge(-0.1), edge(0.87)), 1);
    whole.cut(&cuts);
    let mut parts = cube(16, 3);
    let mut x = parts.rest_positions();
    for k in 0..200 {
        let at = |k: i32| -0.1 + 0.97 * f64::from(k) / 200.0;
        let cuts = parts.crossed_links(&x, &swept(edge(at(k)), edge(at(k + 1))), 1);
        parts.cut(&cuts);
        x = parts.rest_positions();
    }
    let links = |octree: &Octree| octree.cut_links().keys().copied().collect::<BTreeSet<_>>();
    assert_eq!(links(&whole), links(&parts));
    let leaves =
        |octree: &Octree| octree.cells().iter().map(|c| (c.at, c.level, c.cut)).collect::<BTreeSet<_>>();
    assert_eq!(leaves(&whole), leaves(&parts));
}

#[test]
fn volumes_areas_and_quadrature_points_fill_the_body() {
    for levels in 0..4 {
        let octree = cube(16, levels);
        let rest = octree.rest_positions();
        assert!((octree.vertex_volumes().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let top: Vec<bool> = rest.iter().map(|X| X.z > 1.0 - 1e-9).collect();
        let area = octree.areas(&top);
        assert!((area.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let (mut volume, mut points) = (0.0, 0);
        crate::element::Points::for_points(&octree, &rest, &mut |point| {
            volume += point.weight;
            points += 1;
            assert!((point.F - nalgebra::Matrix3::identity()).norm() < 1e-12);
        });
        assert!((volume - 1.0).abs() < 1e-12 && points == 8 * octree.cells().len());
        for p in [Vector3::new(0.3, 0.71, 0.2), Vector3::new(1.0, 1.0, 1.0), Vector3::zeros()] {
            let (leaf, xi) = octree.locate(&p).unwrap();
            assert!((octree.point_in(leaf, xi).position(&rest) - p).norm() < 1e-12);
        }
        assert!(octree.locate(&Vector3::repeat(1.3)).is_none());
    }
}

#[test]
fn volumes_follow_cuts_and_refinement_to_the_bit() {
    let mut random = Rng::with_seed(5);
    for round in 0..12 {
        let mut octree = if round % 3 == 0 {
            Octree::fill(&Odd, OctreeSettings { cells: 30, levels: 2 }, &|_| 0).unwrap()
        } else {
            cube(16, 1 + round as u8 % 3)
        };
        let mut volumes = octree.vertex_volumes();
        let mut hung = false;
        for step in 0..6 {
            let change = if step % 3 == 2 {
                let at = [0, 1, 2].map(|_| (16.0 * random.f64()) as i32);
                octree.refine(&[at], 0)
            } else {
                let x = octree.rest_positions();
                let normal = Vector3::new(random.f64() - 0.5, random.f64() - 0.5, random.f64() - 0.5);
                let p = x[(random.f64() * x.len() as f64) as usize];
                octree.cut(&octree.crossed_links(&x, &plane(p, normal), 1 + step))
            };
            let before = volumes.clone();
            octree.follow_volumes(&change, &mut volumes);
            assert!(volumes == octree.vertex_volumes(), "round {round}, step {step}");
            assert!(change.divided == 0 || volumes != before);
            hung |= octree.hanging().iter().any(|&hanging| hanging != 0);
        }
        assert!(hung, "round {round}");
    }
}

/// Blades that cut at once cut the links that they cut one after the other, also along faces of coarse leaves, where
/// rounding decides which half of a link a blade crosses.
#[test]
fn blades_at_once_cut_as_one_after_the_other() {
    for (n, turn) in [(48, 0.0_f64), (48, 0.6), (80, 0.0)] {
        let along = Vector3::new(turn.cos(), turn.sin(), 0.0);
        let across = Vector3::new(-turn.sin(), turn.cos(), 0.0);
        let blade = |place: f64, of: &Vector3<f64>, along: &Vector3<f64>| {
            let middle = Vector3::new(0.5, 0.5, 0.0) + (place - 0.5) * of;
            let edge = |z: f64| [-2.0, 2.0].map(|t| middle + t * along + Vector3::new(0.0, 0.0, z));
            BladeSweep { segments: vec![edge(1.5), edge(0.5)] }
        };
        let places = [7.0, 13.0, 21.0, 27.0, 33.0, 41.0].map(|p| p / f64::from(n));
        let blades: Vec<BladeSweep> = places
            .iter()
            .map(|&p| blade(p, &along, &across))
            .chain(places.iter().map(|&p| blade(p, &across, &along)))
            .collect();
        let (mut once, mut one_by_one) = (cube(n, 4), cube(n, 4));
        let x = once.rest_positions();
        once.cut_along(&mut Team::alone(), &x, &blades).unwrap();
        for (incision, blade) in (1..).zip(&blades) {
            let x = one_by_one.rest_positions();
            let triangles = crate::cut::sweep_triangles(None, blade, &x);
            let cuts = one_by_one.crossed_links(&x, &triangles, incision);
            one_by_one.cut(&cuts);
        }
        check_vertices(&once);
        let keys = |octree: &Octree| -> BTreeMap<LinkKey, u32> {
            octree.links.iter().map(|(key, cut)| (*key, cut.incision)).collect()
        };
        let (a, b) = (keys(&once), keys(&one_by_one));
        assert_eq!(a, b);
        let leaves = |octree: &Octree| {
            octree.cells().iter().map(|cell| (cell.at, cell.level)).collect::<BTreeSet<_>>()
        };
        assert_eq!(leaves(&once), leaves(&one_by_one));
    }
}
