use std::collections::BTreeSet;

use fastrand::Rng;
use nalgebra::Vector3;

use super::super::*;
use super::*;
use crate::testing::Vectors as _;

pub(super) struct Ball(pub f64);

impl Shape for Ball {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        [Vector3::repeat(-self.0), Vector3::repeat(self.0)]
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        p.norm() < self.0
    }

    fn crossing(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let (d, r2) = (b - a, self.0 * self.0);
        let (A, B, C) = (d.norm_squared(), a.dot(&d), a.norm_squared() - r2);
        let root = (B * B - A * C).sqrt();
        let t = [(-B - root) / A, (-B + root) / A].into_iter().find(|t| (0.0..=1.0).contains(t))?;
        Some((t, (a + t * d).normalize()))
    }
}

/// A body of single cells taken at random: many touch only in edges and points.
fn crumbs(random: &mut Rng, n: u32, density: f64) -> Octree {
    let lattice = Lattice { origin: Vector3::new(0.3, -0.2, 0.1), h: 0.25, size: [n; 3], levels: 0 };
    let mut inside = Bits::new(lattice.size);
    for i in 0..(n * n * n) as i32 {
        let n = n as i32;
        if random.f64() < density {
            inside.insert([i % n, i / n % n, i / n / n]);
        }
    }
    inside.insert([0; 3]);
    Octree::of_cells(lattice, &inside, &|_| 0).unwrap()
}

fn cube(cells: u32, levels: u8) -> Octree {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap()
}

fn volume(octree: &Octree) -> f64 {
    (0..octree.cells().len()).map(|id| octree.cell_volume(id)).sum()
}

/// A plane through `at` across `normal`, within `radius` of `at` [m].
#[derive(Clone, Copy)]
pub(super) struct Disc {
    pub at: Vector3<f64>,
    pub normal: Vector3<f64>,
    pub radius: f64,
}

impl Disc {
    /// The links that it crosses and that nothing has cut.
    pub(super) fn links(&self, octree: &Octree, incision: u32) -> Vec<(LinkKey, CutLink)> {
        let lattice = octree.lattice();
        let mut found = Vec::new();
        let [nx, ny, nz] = lattice.size.map(|n| n as i32);
        for i in 0..nx * ny * nz {
            let at = [i % nx, i / nx % ny, i / nx / ny];
            for axis in 0..3 {
                let mut upper = at;
                upper[axis] += 1;
                if octree.leaf(at) == OUTSIDE || octree.leaf(upper) == OUTSIDE {
                    continue;
                }
                let (a, b) = (lattice.centre(at), lattice.centre(upper));
                let (s, t) = ((a - self.at).dot(&self.normal), (b - self.at).dot(&self.normal));
                if (s >= 0.0) == (t >= 0.0) {
                    continue;
                }
                let along = s / (s - t);
                let is_known = octree.cut_links().contains_key(&(at, axis as u8));
                if !is_known && (a + along * (b - a) - self.at).norm() < self.radius {
                    let cut = CutLink { at: [along; 2], normal: [self.normal; 2], incision };
                    found.push(((at, axis as u8), cut));
                }
            }
        }
        found
    }
}

/// Triangles by position and tag, each from its smallest corner on.
pub(super) fn triangles(octree: &Octree, surface: &Surface) -> BTreeSet<([[u64; 3]; 3], u32)> {
    let rest = octree.rest_positions();
    let at: Vec<[u64; 3]> = surface
        .vertices
        .iter()
        .map(|v| <[f64; 3]>::from(v.position(&rest)).map(|c| (c + 0.0).to_bits()))
        .collect();
    let mut found = BTreeSet::new();
    for (t, tag) in surface.triangles.iter().zip(&surface.tags) {
        let mut t = t.map(|v| at[v as usize]);
        let first = (0..3).min_by_key(|k| t[*k]).unwrap();
        t.rotate_left(first);
        found.insert((t, *tag));
    }
    found
}

/// Closed, 2-manifold, every shell carried by one component and placed in the dual cells.
fn check(octree: &Octree, whole: &OctreeSurface) {
    let (surface, rest) = (whole.surface(), octree.rest_positions());
    assert_eq!(surface.n_defects(), 0);
    assert_eq!(surface.triangles.len(), surface.tags.len());
    assert!(surface.triangles.as_flattened().iter().all(|v| (*v as usize) < surface.vertices.len()));
    for (at, point) in whole.rest.iter().zip(&surface.vertices) {
        assert!((at - point.position(&rest)).norm() < 1e-12 * (1.0 + at.norm()));
    }
    check_parts(octree, surface);
}

/// Every triangle is carried by one part.
pub(super) fn check_parts(octree: &Octree, surface: &Surface) {
    let components = octree.components();
    let mut of_vertex = vec![u32::MAX; octree.n_vertices()];
    for (id, vertices) in octree.vertices().iter().enumerate() {
        vertices.iter().for_each(|v| of_vertex[*v as usize] = components.of_piece[id]);
    }
    let of = |v: u32| {
        let mut parts = surface.vertices[v as usize].copies().iter().map(|c| of_vertex[*c as usize]);
        let first = parts.next().unwrap();
        assert!(parts.all(|part| part == first), "a vertex between parts");
        first
    };
    for t in &surface.triangles {
        assert!(of(t[0]) == of(t[1]) && of(t[1]) == of(t[2]), "a triangle between parts");
    }
}

#[test]
fn uncut_boxes_have_their_volume_and_sharp_edges() {
    for (cells, levels) in [(1, 0), (2, 0), (5, 0), (8, 2), (13, 2), (16, 3)] {
        let octree = cube(cells, levels);
        let surface = OctreeSurface::build(&octree);
        check(&octree, &surface);
        let (rest, surface) = (octree.rest_positions(), surface.surface());
        assert!((surface.volume(&rest) - 1.0).abs() < 1e-12, "{cells} {levels}");
        assert_eq!(surface.triangles.len(), (12 * cells * cells) as usize);
        assert_eq!((surface.n_shells(), surface.tags.iter().max()), (1, Some(&0)));
        let at: Vec<Vector3<f64>> = surface.vertices.iter().map(|v| v.position(&rest)).collect();
        let on_faces = |p: &Vector3<f64>| p.iter().filter(|c| c.abs().min((*c - 1.0).abs()) < 1e-12).count();
        assert!(at.iter().all(|p| on_faces(p) >= 1));
        assert_eq!(at.iter().filter(|p| on_faces(p) == 3).count(), 8);
        assert_eq!(at.iter().filter(|p| on_faces(p) == 2).count(), 12 * (cells as usize - 1));
    }
    // Sides that are no whole number of cells.
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::new(1.0, 0.73, 0.41) };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 11, levels: 1 }, &|_| 0).unwrap();
    let surface = OctreeSurface::build(&octree);
    check(&octree, &surface);
    let found = surface.surface().volume(&octree.rest_positions());
    assert!((found / (0.73 * 0.41) - 1.0).abs() < 1e-12, "{found}");
}

#[test]
fn a_ball_is_round() {
    let mut errors = Vec::new();
    for cells in [12, 24, 48] {
        let octree = Octree::fill(&Ball(1.0), OctreeSettings { cells, levels: 2 }, &|_| 0).unwrap();
        let surface = OctreeSurface::build(&octree);
        check(&octree, &surface);
        let (rest, surface) = (octree.rest_positions(), surface.surface());
        let exact = 4.0 / 3.0 * std::f64::consts::PI;
        errors.push((surface.volume(&rest) / exact - 1.0).abs());
        for v in &surface.vertices {
            let off = (v.position(&rest).norm() - 1.0).abs();
            assert!(off < 0.1 * octree.lattice().h, "{cells}: {off}");
        }
    }
    assert!(errors[0] < 0.02 && errors[1] < 0.4 * errors[0] && errors[2] < 0.4 * errors[1], "{errors:?}");
}

#[test]
fn cells_that_touch_in_edges_and_points_have_a_closed_surface() {
    let mut random = Rng::with_seed(5);
    let mut doubled = 0;
    for round in 0..200 {
        let density = [0.1, 0.3, 0.5, 0.7, 0.9][round % 5];
        let octree = crumbs(&mut random, 5, density);
        let surface = OctreeSurface::build(&octree);
        check(&octree, &surface);
        doubled += usize::from(surface.surface().triangles.len() > 2 * surface.faces.len());
        let found = surface.surface().volume(&octree.rest_positions());
        assert!((found / volume(&octree) - 1.0).abs() < 1e-12, "round {round}: {found}");
    }
    assert!(doubled > 10, "doubled edges in {doubled} rounds");
}

/// A box turned about the origin.
struct Turned(nalgebra::Rotation3<f64>, Vector3<f64>);

impl Shape for Turned {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        let reach = self.0.matrix().abs() * self.1;
        [-reach, reach]
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        BoxShape { min: -self.1, max: self.1 }.contains(&self.0.inverse_transform_vector(p))
    }

    fn crossing(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let [a, b] = [a, b].map(|p| self.0.inverse_transform_vector(p));
        let (fraction, normal) = BoxShape { min: -self.1, max: self.1 }.crossing(&a, &b)?;
        Some((fraction, self.0 * normal))
    }
}

#[test]
fn a_turned_box_keeps_sharp_edges() {
    let mut random = Rng::with_seed(21);
    for round in 0..10 {
        let [roll, pitch, yaw] = (Vector3::from_fn(|_, _| random.f64()) * 3.0).into();
        let half = Vector3::new(0.6, 0.5, 0.35);
        let shape = Turned(nalgebra::Rotation3::from_euler_angles(roll, pitch, yaw), half);
        let octree = Octree::fill(&shape, OctreeSettings { cells: 24, levels: 2 }, &|_| 0).unwrap();
        let surface = OctreeSurface::build(&octree);
        check(&octree, &surface);
        let found = surface.surface().volume(&octree.rest_positions());
        let error = found / (8.0 * half.product()) - 1.0;
        assert!(error.abs() < 5e-4, "round {round}: {error}");
    }
}

/// The tags around every vertex.
fn tags_around(whole: &OctreeSurface) -> Vec<BTreeSet<u32>> {
    let mut tags = vec![BTreeSet::new(); whole.rest.len()];
    for c in 0..4 * whole.faces.len() as u32 {
        tags[whole.patches.vertex(c) as usize].insert(whole.surface.tags[2 * (c / 4) as usize]);
    }
    tags
}

/// The most that was found for a surface with lips.
#[derive(Debug, Default)]
struct Worst {
    /// Vertices and triangles with nothing but one lip around them.
    vertices: usize,
    triangles: usize,
    /// Distance of the former from the plane of the cut [h], angle between the latter and the plane [°].
    off: f64,
    angle: f64,
    /// Change of volume [h³] for every vertex of a rim.
    volume: f64,
}

impl Worst {
    /// Compares the lips with the discs that cut them; `discs` are those of incisions 1, 2, ….
    fn add(&mut self, whole: &OctreeSurface, discs: &[Disc], h: f64) -> usize {
        let tags = tags_around(whole);
        let only = |v: u32| tags.get(v as usize).filter(|t| t.len() == 1).and_then(|t| t.first().copied());
        for (v, at) in (0..).zip(&whole.rest) {
            if let Some(disc) = only(v).and_then(|tag| discs.get((tag as usize).wrapping_sub(1))) {
                self.vertices += 1;
                self.off = self.off.max((at - disc.at).dot(&disc.normal).abs() / h);
            }
        }
        for (t, tag) in whole.surface.triangles.iter().zip(&whole.surface.tags) {
            if *tag == 0 || !t.iter().all(|v| only(*v) == Some(*tag)) {
                continue;
            }
            let [p, q, r] = t.map(|v| whole.rest[v as usize]);
            let normal = (q - p).cross(&(r - p));
            if normal.norm() > 1e-3 * h * h {
                self.triangles += 1;
                let cos = normal.normalize().dot(&discs[*tag as usize - 1].normal).abs().min(1.0);
                self.angle = self.angle.max(cos.acos().to_degrees());
            }
        }
        tags.iter().filter(|tags| tags.len() > 1).count()
    }
}

fn sweep_random_bodies(bodies: u64, sweeps: u32) {
    let mut worst = Worst::default();
    for body in 0..bodies {
        let mut random = Rng::with_seed(100 + body);
        let mut octree = match body % 4 {
            0 => crumbs(&mut random, 8, 0.85),
            1 => cube(8, (body / 4 % 3) as u8),
            2 => Octree::fill(&Ball(1.0), OctreeSettings { cells: 11, levels: 2 }, &|_| 0).unwrap(),
            _ => crumbs(&mut random, 6, 0.55),
        };
        let h = octree.lattice().h;
        let mut local = OctreeSurface::build(&octree);
        check(&octree, &local);
        let skin = local.surface().volume(&octree.rest_positions());
        let size = Vector3::from(octree.lattice().size.map(f64::from)) * h;
        let mut discs = Vec::new();
        for incision in 1..=sweeps {
            let disc = Disc {
                at: octree.lattice().origin + size.component_mul(&Vector3::from_fn(|_, _| random.f64())),
                normal: random.direction(),
                radius: size.x * (0.1 + 0.5 * random.f64()),
            };
            discs.push(disc);
            let change = octree.cut(&disc.links(&octree, incision));
            local.follow(&octree, &change.cells, &[]);
            let whole = OctreeSurface::build(&octree);
            check(&octree, &local);
            check(&octree, &whole);
            let (ours, anew) = (triangles(&octree, local.surface()), triangles(&octree, whole.surface()));
            assert!(ours == anew, "body {body} incision {incision}");
            // The two lips lie in one plane and enclose nothing; only rims differ.
            let rims = worst.add(&whole, &discs, h);
            let lost = whole.surface().volume(&octree.rest_positions()) - skin;
            worst.volume = worst.volume.max(lost.abs() / h.powi(3) / rims.max(1) as f64);
        }
    }
    assert!(worst.vertices > 10_000 && worst.triangles > 10_000, "{worst:?}");
    assert!(worst.off < 1e-9 && worst.angle < 1e-3, "{worst:?}");
    assert!(worst.volume < 0.2, "{worst:?}");
}

/// 2,000 sweeps.
#[test]
fn random_sweeps_leave_a_closed_surface_with_plane_lips() {
    sweep_random_bodies(100, 20);
}

#[test]
fn a_link_that_is_cut_again_moves_its_lips_apart() {
    let mut octree = cube(8, 1);
    let disc = |x: f64| Disc { at: Vector3::new(x, 0.4, 0.6), normal: Vector3::x(), radius: 0.3 };
    let cuts = disc(0.45).links(&octree, 1);
    let again: Vec<(LinkKey, CutLink)> =
        cuts.iter().map(|(key, cut)| (*key, CutLink { at: cut.at.map(|at| at + 0.4), ..*cut })).collect();
    let change = octree.cut(&cuts);
    let mut surface = OctreeSurface::build(&octree);
    assert!((surface.surface().volume(&octree.rest_positions()) - 1.0).abs() < 1e-12);
    assert!(change.links > 9);
    let change = octree.cut(&again);
    let links: Vec<LinkKey> = again.iter().map(|(key, _)| *key).collect();
    surface.follow(&octree, &change.cells, &links);
    check(&octree, &surface);
    assert_eq!(
        triangles(&octree, surface.surface()),
        triangles(&octree, OctreeSurface::build(&octree).surface())
    );
    // What is between the lips is gone.
    let lost = 1.0 - surface.surface().volume(&octree.rest_positions());
    assert!(lost > 0.0 && lost < 0.05 * 0.3f64.powi(2) * 4.0, "{lost}");
}

#[test]
fn a_slit_of_one_link_is_closed() {
    let mut octree = cube(4, 1);
    let cut = CutLink { at: [0.5; 2], normal: [Vector3::y(); 2], incision: 7 };
    let mut surface = OctreeSurface::build(&octree);
    let skin = surface.surface().triangles.len();
    let change = octree.cut(&[(([1, 1, 2], 1), cut)]);
    surface.follow(&octree, &change.cells, &[]);
    check(&octree, &surface);
    let surface = surface.surface();
    assert_eq!(surface.n_shells(), 2);
    assert_eq!(surface.triangles.len(), skin + 4);
    assert_eq!(surface.tags.iter().filter(|tag| **tag == 7).count(), 4);
}
