//! Skins that consist of the triangles of a surface.

use std::collections::BTreeMap;

use fastrand::Rng;
use nalgebra::Vector3;

use super::super::{Kept, Landing, OwnSurface, Skin, SkinSettings};
use super::{Body, bound_to_pieces};
use crate::cut::CutMesh;
use crate::mesh::{BoxPattern, TetMesh, box_mesh};
use crate::testing::{Vectors as _, surface_is_closed_and_manifold, v};

const PLAIN: SkinSettings = SkinSettings { divisions: 4, snapping: 0.0 };

/// A surface over the unit box: `n`² squares of two triangles on each side.
struct Surface {
    /// Its vertices on the box [m].
    flat: Vec<Vector3<f64>>,
    /// Its vertices [m].
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// A surface whose vertices lie off those of a regular grid by up to `jitter` of a square, but on the same side or
    /// edge of the box, and `bulge` [m] farther from its centre than they.
    fn new(n: usize, jitter: f64, bulge: f64, random: &mut Rng) -> Self {
        let mut numbers: BTreeMap<[usize; 3], u32> = BTreeMap::new();
        let mut surface = Self { flat: Vec::new(), vertices: Vec::new(), triangles: Vec::new() };
        let mut number = |at: [usize; 3]| {
            *numbers.entry(at).or_insert_with(|| {
                let off = random.vector(jitter);
                let moved = |k: usize| if at[k] == 0 || at[k] == n { 0.0 } else { off[k] };
                let flat = Vector3::from_fn(|k, _| (at[k] as f64 + moved(k)) / n as f64);
                surface.flat.push(flat);
                surface.vertices.push(flat + (flat - Vector3::repeat(0.5)).normalize() * bulge);
                surface.flat.len() as u32 - 1
            })
        };
        for axis in 0..3 {
            for side in [0, n] {
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    let mut corner = |a: usize, b: usize| {
                        let mut at = [side; 3];
                        (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (i + a, j + b);
                        number(at)
                    };
                    let [p, q, r, s] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    let two = if (i + j) % 2 == 0 { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] };
                    let turn = |[a, b, c]: [u32; 3]| if side == 0 { [a, c, b] } else { [a, b, c] };
                    surface.triangles.extend(two.map(turn));
                }
            }
        }
        surface
    }

    fn landings(&self, mesh: &TetMesh) -> Vec<Option<Landing>> {
        let faces = mesh.boundary_faces();
        let on = |x: &Vector3<f64>| {
            let weights = |face: &crate::mesh::BoundaryFace| {
                let [a, b, c] = face.nodes.map(|node| mesh.nodes[node as usize]);
                let n = (b - a).cross(&(c - a));
                let part =
                    |p: Vector3<f64>, q: Vector3<f64>| (p - x).cross(&(q - x)).dot(&n) / n.norm_squared();
                let weights = [part(b, c), part(c, a), part(a, b)];
                let inside = weights.iter().all(|w| *w >= -1e-12) && (x - a).dot(&n).abs() < 1e-12;
                inside.then(|| Landing { nodes: face.nodes, weights: weights.map(|w| w.max(0.0)) })
            };
            faces.iter().find_map(weights)
        };
        self.flat.iter().map(on).collect()
    }

    fn volume(&self) -> f64 {
        let part = |t: &[u32; 3]| {
            let [p, q, r] = t.map(|v| self.vertices[v as usize]);
            p.dot(&q.cross(&r)) / 6.0
        };
        self.triangles.iter().map(part).sum()
    }

    /// The box in `cells`³ cubes with this surface as its skin.
    fn worn(&self, cells: usize, pattern: BoxPattern, settings: SkinSettings) -> (Body, Kept) {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [cells; 3], pattern);
        let landings = self.landings(&mesh);
        assert!(landings.iter().all(Option::is_some));
        let own = OwnSurface { vertices: &self.vertices, triangles: &self.triangles, landings: &landings };
        let cut = CutMesh::new(mesh).unwrap();
        let skin = Skin::new(&cut, settings, Some(&own), &mut |p, _| *p).unwrap();
        let kept = skin.kept().unwrap();
        let x = cut.rest_positions();
        let volume = skin.surface().volume(&x);
        (Body { cut, skin, x, volume }, kept)
    }
}

/// Every triangle of the skin lies in one triangle of the surface, and together they cover it.
fn covers(body: &Body, surface: &Surface) {
    let mut covered = vec![0.0; surface.triangles.len()];
    let shown = body.skin.surface();
    for triangle in &shown.triangles {
        let x = triangle.map(|v| shown.vertices[v as usize].position(&body.x));
        let area = (x[1] - x[0]).cross(&(x[2] - x[0]));
        let inside = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| surface.vertices[v as usize]);
            let n = (b - a).cross(&(c - a));
            let part = |x: &Vector3<f64>, p: Vector3<f64>, q: Vector3<f64>| {
                (p - x).cross(&(q - x)).dot(&n) / n.norm_squared()
            };
            let within = |x: &Vector3<f64>| {
                let off = (x - a).dot(&n).abs() / n.norm().powf(1.5);
                off < 1e-9 && [part(x, b, c), part(x, c, a), part(x, a, b)].iter().all(|w| *w > -1e-9)
            };
            x.iter().all(within).then(|| area.dot(&n) / n.norm_squared())
        };
        let mut found =
            surface.triangles.iter().map(inside).enumerate().filter_map(|(t, share)| Some((t, share?)));
        let (t, share) = found.next().expect("a triangle of the skin lies across the surface");
        assert!(share > -1e-12, "a part of a triangle is turned over: {share}");
        covered[t] += share;
    }
    // Triangles without area on an edge may be taken for parts of either side.
    for share in covered {
        assert!((share - 1.0).abs() < 1e-9, "{share} of a triangle is covered");
    }
}

#[test]
fn a_skin_consists_of_the_triangles_of_its_surface() {
    // Grids that share edges with the mesh, that are coarser and finer than it, and that have nothing in common.
    for (n, jitter) in [(1, 0.0), (2, 0.0), (4, 0.0), (3, 0.0), (1, 0.3), (3, 0.3), (7, 0.3)] {
        for (cells, pattern) in [(2, BoxPattern::Tet6), (3, BoxPattern::Tet5 { parity: false })] {
            let surface = Surface::new(n, jitter, 0.05, &mut Rng::with_seed(n as u64));
            let (body, kept) = surface.worn(cells, pattern, PLAIN);
            assert_eq!(kept.triangles, kept.of, "n = {n}, jitter = {jitter}, {cells} cells");
            assert!((kept.area - 1.0).abs() < 1e-12);
            body.check(1e-12);
            assert!((body.volume - surface.volume()).abs() < 1e-12);
            covers(&body, &surface);
        }
    }
}

#[test]
fn random_sweeps_cut_skins_of_their_own_triangles() {
    for (seed, snapping) in (0..24u64).flat_map(|s| [(s, 0.0), (s, 0.25)]) {
        let mut random = Rng::with_seed(seed);
        let bulge = if seed % 3 == 0 { 0.0 } else { 0.02 };
        let surface = Surface::new(2 + (seed % 4) as usize, 0.3, bulge, &mut random);
        let (mut body, kept) = surface.worn(2, BoxPattern::Tet6, SkinSettings { divisions: 4, snapping });
        assert_eq!(kept.triangles, kept.of);
        for incision in 1..=6 {
            let a = v(0.5, 0.5, 0.5) + random.vector(0.8);
            let b = a + random.vector(0.9);
            let step = random.vector(0.9);
            body.sweep(&[[a, b], [a + step, b + step]], incision);
            body.check(if bulge == 0.0 && snapping == 0.0 { 1e-10 } else { 0.02 });
        }
    }
}

#[test]
fn a_plane_between_two_halves_cuts_the_skin_straight_and_a_reset_restores_it() {
    let surface = Surface::new(5, 0.3, 0.03, &mut Rng::with_seed(3));
    let (mut body, _) = surface.worn(3, BoxPattern::Tet6, PLAIN);
    let before = body.skin.surface().clone();
    body.cut_plane(v(0.47, 0.5, 0.5), v(1.0, 0.1, 0.05), 3.0, 1);
    body.check(1e-12);
    assert_eq!(body.cut.components().len(), 2);
    body.cut.reset().unwrap();
    body.skin.follow(&body.cut);
    assert_eq!(body.skin.surface().triangles, before.triangles);
}

#[test]
fn parts_that_do_not_go_together_rest_on_the_boundary() {
    let surface = Surface::new(4, 0.2, 0.05, &mut Rng::with_seed(5));
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [3; 3], BoxPattern::Tet6);
    // One vertex lands nowhere, one where another does, and two have changed places.
    let mut landings = surface.landings(&mesh);
    landings[10] = None;
    landings[20] = landings[21];
    landings.swap(60, 61);
    let own = OwnSurface { vertices: &surface.vertices, triangles: &surface.triangles, landings: &landings };
    let cut = CutMesh::new(mesh).unwrap();
    let skin = Skin::new(&cut, PLAIN, Some(&own), &mut |p, _| *p).unwrap();
    let kept = skin.kept().unwrap();
    assert!(kept.triangles < kept.of && kept.triangles > kept.of / 2, "{kept:?}");
    assert!(kept.area < 1.0 && kept.area > 0.5, "{kept:?}");
    surface_is_closed_and_manifold(skin.surface());
    bound_to_pieces(&cut, skin.surface());
    let volume = skin.surface().volume(&cut.rest_positions());
    assert!(volume > 1.0 && volume < surface.volume(), "{volume}");
}
