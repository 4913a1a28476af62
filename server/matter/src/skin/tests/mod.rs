//! Skins of any resolution on bodies cut in every way, checked from the triangle list alone.

mod marks;
mod own;

use std::collections::BTreeSet;

use fastrand::Rng;
use nalgebra::Vector3;

use super::{Misfit, Penetration, Skin, SkinSettings, incision};
use crate::cut::{BladeSweep, CutMesh, CutReport, Surface};
use crate::mesh::{BoxPattern, box_mesh};
use crate::testing::{Vectors as _, square, surface_is_closed_and_manifold, v};

/// A body under test with its skin and the position of every copy.
struct Body {
    cut: CutMesh,
    skin: Skin,
    x: Vec<Vector3<f64>>,
    volume: f64,
}

impl Body {
    /// The unit box; its skin bulges by `bulge` [m].
    fn new(cells: usize, pattern: BoxPattern, settings: SkinSettings, bulge: f64) -> Self {
        let cut =
            CutMesh::new(box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [cells; 3], pattern)).unwrap();
        let centre = Vector3::repeat(0.5);
        let skin = Skin::new(&cut, settings, None, &mut |p, _| p + (p - centre).normalize() * bulge).unwrap();
        let x = cut.rest_positions();
        let volume = skin.surface().volume(&x);
        Self { cut, skin, x, volume }
    }

    fn sweep(&mut self, segments: &[[Vector3<f64>; 2]], incision: u32) -> CutReport {
        let blade = BladeSweep { segments: segments.to_vec() };
        let report = self.cut.sweep(&self.x, &blade, incision).unwrap();
        for new in &report.new_copies {
            self.x.push(self.x[new.parent as usize]);
        }
        self.skin.follow(&self.cut);
        report
    }

    fn cut_plane(
        &mut self,
        point: Vector3<f64>,
        normal: Vector3<f64>,
        reach: f64,
        incision: u32,
    ) -> CutReport {
        self.sweep(&square(point, normal, reach), incision)
    }

    /// Closed, 2-manifold, fitting, and enclosing the volume of the uncut body within the tolerance.
    fn check(&self, tolerance: f64) {
        assert!(self.skin.fits(), "skin and lips do not fit");
        surface_is_closed_and_manifold(self.skin.surface());
        let rest = self.cut.rest_positions();
        let found = self.skin.surface().volume(&rest);
        assert!((found - self.volume).abs() <= tolerance * self.volume, "{found} instead of {}", self.volume);
        bound_to_pieces(&self.cut, self.skin.surface());
        let anew = self.skin.sewn_anew(&self.cut);
        assert!(anew.fits());
        assert_eq!(self.skin.sizes(), anew.sizes(), "triangles, vertices and doubled edges");
        let again = anew.surface().volume(&rest);
        assert!((found - again).abs() <= 1e-12 * self.volume, "{found}, sewn anew {again}");
    }
}

/// Every vertex is bound to the copies of one piece, and all vertices of a triangle to one loose part.
fn bound_to_pieces(cut: &CutMesh, surface: &Surface) {
    let n = cut.n_copies();
    let mut part: Vec<usize> = (0..n).collect();
    fn root(part: &mut [usize], mut i: usize) -> usize {
        while part[i] != i {
            part[i] = part[part[i]];
            i = part[i];
        }
        i
    }
    let mut sets = BTreeSet::new();
    for piece in cut.pieces() {
        sets.insert(piece.copies.to_vec());
        for c in piece.copies {
            let (i, j) = (root(&mut part, piece.copies[0] as usize), root(&mut part, c as usize));
            part[i.max(j)] = i.min(j);
        }
    }
    for vertex in &surface.vertices {
        assert!(sets.contains(vertex.copies()), "a vertex is not on the copies of a piece");
        assert!((vertex.weights().iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
    for triangle in &surface.triangles {
        let [p, q, r] = triangle.map(|v| root(&mut part, surface.vertices[v as usize].copies()[0] as usize));
        assert!(p == q && q == r, "a triangle reaches across a cut");
    }
}

#[test]
fn an_uncut_skin_of_any_resolution_is_closed() {
    for divisions in [1, 2, 3, 7] {
        let body = Body::new(2, BoxPattern::Tet6, SkinSettings { divisions, snapping: 0.0 }, 0.0);
        body.check(1e-12);
        assert!((body.volume - 1.0).abs() < 1e-12);
        assert_eq!(body.skin.surface().triangles.len(), 6 * 2 * 2 * 2 * divisions * divisions);
    }
}

#[test]
fn a_plane_through_everything_makes_two_closed_parts() {
    for bulge in [0.0, 0.04, -0.03] {
        for divisions in [1, 2, 3, 4] {
            let mut body = Body::new(2, BoxPattern::Tet6, SkinSettings { divisions, snapping: 0.0 }, bulge);
            body.cut_plane(v(0.4, 0.45, 0.55), v(1.0, 0.2, 0.1), 3.0, 1);
            body.check(1e-12);
            assert_eq!(body.cut.components().len(), 2);
        }
    }
}

#[test]
fn cuts_along_nodes_edges_and_grid_lines_of_the_skin() {
    for divisions in [1, 2, 4] {
        let mut body = Body::new(2, BoxPattern::Tet6, SkinSettings { divisions, snapping: 0.0 }, 0.02);
        body.cut_plane(v(0.5, 0.5, 0.5), Vector3::x(), 3.0, 1);
        body.check(1e-10);
        body.cut_plane(v(0.5, 0.25, 0.5), Vector3::y(), 3.0, 2);
        body.check(1e-10);
        body.cut_plane(v(0.5, 0.5, 0.5), v(0.0, 1.0, 1.0), 3.0, 3);
        body.check(1e-10);
    }
}

#[test]
fn partial_branching_and_crossing_cuts_stay_closed() {
    for snapping in [0.0, 0.3] {
        let mut body = Body::new(3, BoxPattern::Tet6, SkinSettings { divisions: 3, snapping }, 0.0);
        body.sweep(&[[v(0.5, -0.1, 0.4), v(0.5, -0.1, 1.2)], [v(0.5, 0.62, 0.4), v(0.5, 0.62, 1.2)]], 1);
        body.check(1e-10);
        body.sweep(&[[v(0.5, 0.35, 0.3), v(0.5, 0.35, 1.2)], [v(1.2, 0.4, 0.3), v(1.2, 0.4, 1.2)]], 2);
        body.check(1e-10);
        body.sweep(&[[v(0.1, 0.2, 0.5), v(0.1, 0.2, 1.2)], [v(0.9, 0.25, 0.5), v(0.9, 0.25, 1.2)]], 3);
        body.check(1e-10);
    }
}

#[test]
fn random_sweeps_leave_every_skin_closed() {
    for (seed, snapping) in (0..12u64).flat_map(|s| [(s, 0.0), (s, 0.25)]) {
        let mut random = Rng::with_seed(seed);
        let pattern = if seed % 2 == 0 { BoxPattern::Tet6 } else { BoxPattern::Tet5 { parity: false } };
        let divisions = 1 + (seed % 4) as usize;
        let bulge = if seed % 3 == 0 { 0.0 } else { 0.02 };
        let mut body =
            Body::new(2 + (seed % 2) as usize, pattern, SkinSettings { divisions, snapping }, bulge);
        for incision in 1..=8 {
            let a = v(0.5, 0.5, 0.5) + random.vector(0.8);
            let b = a + random.vector(0.9);
            let step = random.vector(0.9);
            body.sweep(
                &[[a, b], [a + step, b + step], [a + step * 1.5, b + step + random.vector(0.3)]],
                incision,
            );
            body.check(if bulge == 0.0 && snapping == 0.0 { 1e-10 } else { 0.02 });
        }
    }
}

#[test]
fn an_incision_is_no_deeper_than_the_tool_went() {
    for snapping in [0.0, 0.3] {
        let mut body = Body::new(6, BoxPattern::Tet6, SkinSettings { divisions: 4, snapping }, 0.0);
        let depth = |s: f64| 0.4 * (std::f64::consts::PI * s).sin();
        let path: Vec<Penetration> = (0..=24)
            .map(|i| f64::from(i) / 24.0)
            .map(|s| Penetration {
                point_m: v(0.15 + 0.7 * s, 0.5 + 0.15 * (3.0 * s).sin(), 1.0),
                normal: v(0.0, 0.0, 2.0),
                depth_m: depth(s),
            })
            .collect();
        body.sweep(&incision(&path).segments, 1);
        body.check(1e-10);
        assert_eq!(body.cut.components().len(), 1);
        let rest = body.cut.rest_positions();
        let surface = body.skin.surface();
        let wound: Vec<Vector3<f64>> = (0..surface.triangles.len())
            .filter(|&t| surface.tags[t] == 1)
            .flat_map(|t| surface.triangles[t])
            .map(|v| surface.vertices[v as usize].position(&rest))
            .collect();
        let deepest = wound.iter().map(|p| 1.0 - p.z).fold(0.0, f64::max);
        assert!(deepest > 0.15 && deepest < 0.4 + 1e-9, "{deepest}");
        for p in &wound {
            let s = (p.x - 0.15) / 0.7;
            assert!(1.0 - p.z <= depth(s) + 0.02, "{p} is deeper than {}", depth(s));
            assert!((p.y - 0.5 - 0.15 * (3.0 * s).sin()).abs() < 0.03, "{p} is off the path");
        }
    }
}

#[test]
fn snapping_makes_fewer_triangles_and_no_thinner_ones() {
    let cut = |snapping: f64| {
        let mut body = Body::new(3, BoxPattern::Tet6, SkinSettings { divisions: 4, snapping }, 0.0);
        body.cut_plane(v(0.47, 0.5, 0.5), v(1.0, 0.13, 0.07), 3.0, 1);
        body.check(1e-10);
        let rest = body.cut.rest_positions();
        let surface = body.skin.surface();
        let thinnest = (0..surface.triangles.len()).filter(|&t| surface.tags[t] == 0).map(|t| {
            let [p, q, r] = surface.triangles[t].map(|v| surface.vertices[v as usize].position(&rest));
            let longest = (q - p).norm().max((r - q).norm()).max((p - r).norm());
            (q - p).cross(&(r - p)).norm() / (longest * longest)
        });
        (thinnest.fold(f64::INFINITY, f64::min), surface.tags.iter().filter(|tag| **tag == 0).count())
    };
    let (split, snapped) = (cut(0.0), cut(0.3));
    assert!(snapped.1 < split.1 && snapped.0 >= split.0, "{split:?} {snapped:?}");
}

#[test]
fn a_small_cut_renews_a_small_part_of_a_large_skin() {
    let mut renewed = Vec::new();
    for cells in [4, 8] {
        let mut body = Body::new(cells, BoxPattern::Tet6, SkinSettings { divisions: 4, snapping: 0.0 }, 0.0);
        let h = 1.0 / cells as f64;
        let [from, to] = [0.2 * h, 2.7 * h];
        body.sweep(
            &[
                [v(0.6 * h, from, 1.0 - 1.8 * h), v(0.6 * h, from, 1.1)],
                [v(0.6 * h, to, 1.0 - 1.8 * h), v(0.6 * h, to, 1.1)],
            ],
            1,
        );
        body.check(1e-10);
        renewed.push(body.skin.renewed());
        assert!(body.skin.surface().tags.contains(&1));
    }
    // The same cut, measured in elements, in bodies of 64 and 512 cells.
    assert_eq!(renewed[0], renewed[1]);
}

#[test]
fn the_last_of_many_cuts_renews_no_more_than_the_first() {
    let mut body = Body::new(10, BoxPattern::Tet6, SkinSettings { divisions: 3, snapping: 0.25 }, 0.0);
    let mut renewed = Vec::new();
    for k in 0..36u32 {
        let at = |s: f64| {
            let (x, y) = (0.1 * f64::from(k % 9) + 0.06 + 0.08 * s, 0.03 + 0.2 * f64::from(k / 9));
            [v(x, y, 0.8), v(x, y + 0.005, 1.1)]
        };
        body.sweep(&[at(0.0), at(1.0)], k + 1);
        renewed.push(body.skin.renewed());
    }
    body.check(0.01);
    let most = |part: &[usize]| part.iter().copied().max().unwrap();
    assert!(most(&renewed[27..]) <= most(&renewed[..9]), "{renewed:?}");
}

#[test]
fn a_reset_skin_is_the_uncut_one() {
    let mut body = Body::new(2, BoxPattern::Tet6, SkinSettings { divisions: 3, snapping: 0.2 }, 0.02);
    let uncut = body.skin.surface().clone();
    body.cut_plane(v(0.4, 0.45, 0.55), v(1.0, 0.2, 0.1), 3.0, 1);
    assert_ne!(*body.skin.surface(), uncut);
    body.cut.reset().unwrap();
    body.skin.follow(&body.cut);
    assert_eq!(*body.skin.surface(), uncut);
}

#[test]
fn a_skin_that_does_not_fit_leaves_the_boundary_until_the_reset() {
    let settings = SkinSettings { divisions: 3, ..SkinSettings::default() };
    let mut body = Body::new(3, BoxPattern::Tet6, settings, 0.05);
    let uncut = body.skin.surface().clone();
    body.cut_plane(v(0.4, 0.5, 0.5), v(1.0, 0.1, 0.2), 2.0, 1);
    body.check(0.05);
    body.skin.spoil();
    body.cut_plane(v(0.5, 0.45, 0.5), v(0.1, 1.0, 0.2), 2.0, 2);
    assert_eq!(body.skin.misfit(), Some(Misfit::SharedEdge));
    assert_eq!(body.skin.surface(), body.cut.surface());
    surface_is_closed_and_manifold(body.skin.surface());
    // Later cuts and marks still work, on the boundary of the elements.
    body.cut_plane(v(0.5, 0.5, 1.0), v(0.1, 0.2, 1.0), 0.3, 3);
    assert_eq!(body.skin.surface(), body.cut.surface());
    assert_eq!(body.skin.incision_marks(&body.cut).len(), body.cut.incision_marks().len());
    body.cut.reset().unwrap();
    body.skin.follow(&body.cut);
    assert!(body.skin.fits());
    assert_eq!(*body.skin.surface(), uncut);
}
