//! Skins that consist of the triangles of a surface.

use fastrand::Rng;

use super::super::super::*;
use super::super::tests::{Ball, Disc, check_parts, triangles};
use super::*;
use crate::cut::BladeSweep;
use crate::skin::{Landing, SkinSettings};
use crate::space::{OctreeSpace, Space};
use crate::team::Team;
use crate::testing::Vectors as _;

/// A surface with its vertices [m].
struct Shell {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
}

impl Shell {
    /// The unit ball: `rings` rings of `sectors` squares, of two triangles each.
    fn ball(rings: u32, sectors: u32, random: &mut Rng) -> Self {
        let mut vertices = vec![Vector3::z(), -Vector3::z()];
        for i in 1..rings {
            for j in 0..sectors {
                let [off, turn] = [0.3 * (random.f64() - 0.5), 0.3 * (random.f64() - 0.5)];
                let polar = std::f64::consts::PI * (f64::from(i) + off) / f64::from(rings);
                let azimuth = std::f64::consts::TAU * (f64::from(j) + turn) / f64::from(sectors);
                let (s, c) = azimuth.sin_cos();
                vertices.push(Vector3::new(polar.sin() * c, polar.sin() * s, polar.cos()));
            }
        }
        let at = |i: u32, j: u32| match i {
            0 => 0,
            _ if i == rings => 1,
            _ => 2 + (i - 1) * sectors + j % sectors,
        };
        let mut triangles = Vec::new();
        for (i, j) in (0..rings).flat_map(|i| (0..sectors).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles
                .extend([[a, b, c], [a, c, d]].into_iter().filter(|[p, q, r]| p != q && q != r && r != p));
        }
        Self { vertices, triangles }
    }

    /// Where the vertices lie on triangles that look the same way.
    fn landings(&self, ground: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Vec<Option<Landing>> {
        let on = |x: &Vector3<f64>| {
            let weights = |nodes: &[u32; 3]| {
                let [a, b, c] = nodes.map(|v| ground[v as usize]);
                let n = (b - a).cross(&(c - a));
                // Along the radius, which meets one of the triangles.
                let p = x * (a.dot(&n) / x.dot(&n));
                let part =
                    |q: Vector3<f64>, r: Vector3<f64>| (q - p).cross(&(r - p)).dot(&n) / n.norm_squared();
                let weights = [part(b, c), part(c, a), part(a, b)];
                let met = x.dot(&n) > 0.0 && weights.iter().all(|w| *w >= -1e-12);
                met.then(|| Landing { nodes: *nodes, weights: weights.map(|w| w.max(0.0)) })
            };
            triangles.iter().find_map(weights)
        };
        self.vertices.iter().map(on).collect()
    }

    fn volume(&self) -> f64 {
        let part = |t: &[u32; 3]| {
            let [p, q, r] = t.map(|v| self.vertices[v as usize]);
            p.dot(&q.cross(&r)) / 6.0
        };
        self.triangles.iter().map(part).sum()
    }

    /// A ball of cells with this surface as its skin.
    fn worn(&self, cells: u32, levels: u8) -> OctreeSpace {
        let octree = Octree::fill(&Ball(1.0), OctreeSettings { cells, levels }, &|_| 0).unwrap();
        let mut space = OctreeSpace::new(octree);
        let (ground, triangles) = space.skin_ground();
        let landings = self.landings(&ground, &triangles);
        assert!(landings.iter().all(Option::is_some));
        let own = OwnSurface { vertices: &self.vertices, triangles: &self.triangles, landings: &landings };
        space.put_on_skin(SkinSettings::default(), Some(&own), &mut |p, _| *p).unwrap();
        space
    }
}

/// Closed, 2-manifold, every triangle on one part, every vertex where it rests.
fn check_worn(octree: &Octree, skin: &OwnSkin) {
    let (surface, rest) = (skin.surface(), octree.rest_positions());
    assert_eq!(surface.n_defects(), 0);
    assert_eq!(surface.triangles.len(), surface.tags.len());
    let mut used = vec![false; surface.vertices.len()];
    surface.triangles.as_flattened().iter().for_each(|v| used[*v as usize] = true);
    assert!(used.iter().all(|used| *used));
    for (point, bound) in skin.uncut.laid.points.iter().zip(&skin.bound) {
        assert!((point.rest - bound.position(&rest)).norm() < 1e-12);
    }
    check_parts(octree, surface);
}

/// The same skin, with everything that cuts determine found anew.
fn anew(octree: &Octree, dual: &OctreeSurface, skin: &OwnSkin) -> OwnSkin {
    let mut other = skin.clone();
    let quads: Vec<u32> = (0..dual.faces.len() as u32).collect();
    let points = other.leaf.iter().zip(&other.uncut.laid.points);
    other.bound = points.map(|(&leaf, point)| bind(octree, leaf, point.rest).point).collect();
    (other.mosaic, other.shown, other.halved) = Default::default();
    other.look_again(dual, &quads);
    other.show(octree, dual, quads.into_iter());
    other
}

#[test]
fn an_uncut_body_shows_the_surface_as_it_is() {
    let mut random = Rng::with_seed(3);
    for (rings, cells) in [(6, 12), (24, 12), (40, 24)] {
        let shell = Shell::ball(rings, 2 * rings, &mut random);
        let space = shell.worn(cells, 2);
        let kept = space.kept().unwrap();
        assert_eq!(
            (kept.of, kept.triangles),
            (shell.triangles.len(), shell.triangles.len()),
            "{rings} {cells}"
        );
        assert!((kept.area - 1.0).abs() < 1e-12);
        check_worn(&space.octree, space.own.as_ref().unwrap());
        let rest = space.octree.rest_positions();
        assert!((space.surface().volume(&rest) / shell.volume() - 1.0).abs() < 1e-12);
        assert_eq!((space.surface().n_shells(), space.flaws().surface), (1, 0));
        // The surface of the cells has another volume.
        assert!((space.element_surface().volume(&rest) / shell.volume() - 1.0).abs() > 1e-5);
    }
}

#[test]
fn random_cuts_leave_it_closed_and_far_from_them_as_it_was() {
    let mut random = Rng::with_seed(11);
    let shell = Shell::ball(14, 28, &mut random);
    for round in 0..30 {
        let space = shell.worn(11, 2 * (round % 2));
        let (mut octree, mut dual) = (space.octree.clone(), space.surface.clone());
        let mut skin = space.own.clone().unwrap();
        let whole = skin.surface().triangles.len();
        let h = octree.lattice().h;
        let mut links: Vec<Vector3<f64>> = Vec::new();
        for incision in 1..=5 {
            let disc = Disc {
                at: random.direction() * random.f64(),
                normal: random.direction(),
                radius: 0.2 + 1.2 * random.f64(),
            };
            let cuts = disc.links(&octree, incision);
            links.extend(cuts.iter().map(|((at, _), _)| octree.lattice().centre(*at)));
            let change = octree.cut(&cuts);
            dual.follow(&octree, &change.cells, &[]);
            skin.follow(&octree, &dual, &change.cells);
            check_worn(&octree, &skin);
            let anew = anew(&octree, &dual, &skin);
            assert_eq!(
                triangles(&octree, skin.surface()),
                triangles(&octree, anew.surface()),
                "round {round}"
            );
            assert_eq!(skin.surface().n_shells(), dual.surface().n_shells());
            let places = |triangle: &[u32; 3]| triangle.map(|p| skin.uncut.laid.points[p as usize].rest);
            let shown = triangles(&octree, skin.surface());
            for triangle in &skin.uncut.laid.triangles {
                let x = places(triangle);
                let far = |link: &Vector3<f64>| (x[0] - link).norm() > 5.0 * h;
                if links.iter().all(far) {
                    let mut place = triangle.map(|p| {
                        let bound = skin.bound[p as usize].position(&octree.rest_positions());
                        <[f64; 3]>::from(bound).map(|c| (c + 0.0).to_bits())
                    });
                    let first = (0..3).min_by_key(|k| place[*k]).unwrap();
                    place.rotate_left(first);
                    assert!(shown.contains(&(place, 0)), "round {round}: {x:?}");
                }
            }
        }
        assert!(skin.surface().triangles.len() != whole);
    }
}

#[test]
fn a_body_that_is_refined_and_cut_keeps_it_and_returns_to_it() {
    let mut random = Rng::with_seed(5);
    let shell = Shell::ball(16, 32, &mut random);
    let mut space = shell.worn(24, 2);
    let start = triangles(&space.octree, space.surface());
    let large: Vec<u32> = (0..space.octree.cells().len() as u32)
        .filter(|&id| space.octree.cells()[id as usize].level > 0)
        .collect();
    space.refine(&large);
    assert_eq!(triangles(&space.octree, space.surface()).len(), start.len());
    check_worn(&space.octree, space.own.as_ref().unwrap());
    let families: Vec<Family> = space
        .octree
        .cells()
        .iter()
        .filter(|cell| cell.octant() == 0)
        .map(|cell| Family { level: cell.level + 1, at: cell.at })
        .collect();
    let blade = |y: f64| [Vector3::new(-2.0, y, 2.0), Vector3::new(2.0, y, -1.3)];
    let blade = BladeSweep { segments: vec![blade(-2.0), blade(2.0)] };
    let x = space.octree.rest_positions();
    space.cut(&mut Team::alone(), &x, &blade, 1).unwrap();
    check_worn(&space.octree, space.own.as_ref().unwrap());
    assert!(space.surface().tags.contains(&1));
    assert!(space.coarsen(&families, &|_, _| false).joined > 0);
    check_worn(&space.octree, space.own.as_ref().unwrap());
    space.reset().unwrap();
    assert_eq!(triangles(&space.octree, space.surface()), start);
}
