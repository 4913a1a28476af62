//! Skins that consist of the triangles of a surface.

use fastrand::Rng;

use super::super::super::*;
use super::super::tests::{Ball, Disc, check_parts, triangles};
use super::*;
use crate::cut::{BladeSweep, sweep_triangles};
use crate::skin::Landing;
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
    fn worn(&self, cells: u32, levels: u8) -> Worn {
        let octree = Octree::fill(&Ball(1.0), OctreeSettings { cells, levels }, &|_| 0).unwrap();
        let dual = OctreeSurface::build(&octree);
        let landings = self.landings(dual.rest(), &dual.ground());
        assert!(landings.iter().all(Option::is_some));
        let own = OwnSurface { vertices: &self.vertices, triangles: &self.triangles, landings: &landings };
        let skin = OwnSkin::new(&octree, &dual, &own, &mut |p, _| *p).unwrap();
        Worn { octree, dual, skin }
    }
}

/// Cells with their surface, and a skin on it.
struct Worn {
    octree: Octree,
    dual: OctreeSurface,
    skin: OwnSkin,
}

impl Worn {
    /// Follows a change that adds cells and opens links.
    fn follow(&mut self, change: &OctreeChange) {
        self.dual.follow(&self.octree, &change.cells, &change.moved);
        self.skin.follow(&self.octree, &self.dual, &change.cells);
        self.check();
    }

    fn cut(&mut self, cuts: &[(LinkKey, CutLink)]) {
        let change = self.octree.cut(cuts);
        self.follow(&change);
    }

    fn triangles(&self) -> BTreeSet<([[u64; 3]; 3], u32)> {
        triangles(&self.octree, self.skin.surface())
    }

    fn check(&self) {
        check_worn(&self.octree, &self.skin);
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
        let worn = shell.worn(cells, 2);
        let (kept, n) = (worn.skin.kept(), shell.triangles.len());
        assert_eq!((kept.of, kept.triangles), (n, n), "{rings} {cells}");
        assert!((kept.area - 1.0).abs() < 1e-12);
        worn.check();
        let (rest, surface) = (worn.octree.rest_positions(), worn.skin.surface());
        assert!((surface.volume(&rest) / shell.volume() - 1.0).abs() < 1e-12);
        assert_eq!((surface.n_shells(), surface.n_defects()), (1, 0));
        // The surface of the cells has another volume.
        assert!((worn.dual.surface().volume(&rest) / shell.volume() - 1.0).abs() > 1e-5);
    }
}

#[test]
fn random_cuts_leave_it_closed_and_far_from_them_as_it_was() {
    let mut random = Rng::with_seed(11);
    let shell = Shell::ball(14, 28, &mut random);
    for round in 0..30 {
        let mut worn = shell.worn(11, 2 * (round % 2));
        let whole = worn.skin.surface().triangles.len();
        let h = worn.octree.lattice().h;
        let mut links: Vec<Vector3<f64>> = Vec::new();
        for incision in 1..=5 {
            let disc = Disc {
                at: random.direction() * random.f64(),
                normal: random.direction(),
                radius: 0.2 + 1.2 * random.f64(),
            };
            let cuts = disc.links(&worn.octree, incision);
            links.extend(cuts.iter().map(|((at, _), _)| worn.octree.lattice().centre(*at)));
            worn.cut(&cuts);
            let Worn { octree, dual, skin } = &worn;
            let anew = anew(octree, dual, skin);
            assert_eq!(worn.triangles(), triangles(octree, anew.surface()), "round {round}");
            assert_eq!(skin.surface().n_shells(), dual.surface().n_shells());
            let places = |triangle: &[u32; 3]| triangle.map(|p| skin.uncut.laid.points[p as usize].rest);
            let shown = worn.triangles();
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
        assert!(worn.skin.surface().triangles.len() != whole);
    }
}

#[test]
fn a_body_that_is_refined_and_cut_keeps_it_and_returns_to_it() {
    let mut random = Rng::with_seed(5);
    let shell = Shell::ball(16, 32, &mut random);
    let mut worn = shell.worn(24, 2);
    let uncut = worn.octree.clone();
    let start = worn.triangles();
    let cells = uncut.cells();
    let large: Vec<u32> = (0..cells.len() as u32).filter(|&id| cells[id as usize].level > 0).collect();
    let change = worn.octree.divide_leaves(&large);
    worn.follow(&change);
    assert_eq!(worn.triangles().len(), start.len());
    let first = worn.octree.cells().iter().filter(|cell| cell.octant() == 0);
    let families: Vec<Family> = first.map(|cell| Family { level: cell.level + 1, at: cell.at }).collect();
    let blade = |y: f64| [Vector3::new(-2.0, y, 2.0), Vector3::new(2.0, y, -1.3)];
    let blade = BladeSweep { segments: vec![blade(-2.0), blade(2.0)] };
    let x = worn.octree.rest_positions();
    let known = worn.octree.n_vertices() as u32;
    worn.cut(&worn.octree.crossed_links(&x, &sweep_triangles(None, &blade, &x), 1));
    assert!(worn.skin.surface().tags.contains(&1));
    // Vertices at which the cut made another stay.
    let split: Vec<bool> = (0..known).map(|v| worn.octree.vertices_at(v).len() > 1).collect();
    let stays = |v: u32| v >= known || split[v as usize];
    let change = worn.octree.coarsen(&families, &|vertex, _| stays(vertex));
    assert!(change.joined > 0);
    worn.dual.follow_coarsening(&worn.octree, &change);
    worn.skin.follow_coarsening(&worn.octree, &worn.dual, &change);
    worn.check();
    worn.octree = uncut;
    worn.dual = OctreeSurface::build(&worn.octree);
    worn.skin.begin_anew(&worn.octree, &worn.dual);
    assert_eq!(worn.triangles(), start);
}
