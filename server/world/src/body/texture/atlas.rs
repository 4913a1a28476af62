//! A surface with texture coordinates, and where triangles near it lie on the image.
//!
//! Islands of an image end at seams, where the coordinates on both sides of an edge differ. A triangle across a seam
//! must not join coordinates from both sides: it would show all that lies between them on the image, and an island may
//! even meet itself, as the side of a cylinder does. Such a triangle takes its coordinates from the side that its centre
//! lies on: from the triangles that can be reached from there without crossing a seam.

use std::collections::{HashMap, HashSet};

use nalgebra::Vector3;
use scindo_collision::{
    ClosestPoint, SurfaceBvh, SurfaceError, barycentric_point, closest_point_on_triangle,
};

use super::Corners;
use crate::format::TexturedSurface;

type V = Vector3<f64>;

/// No triangle without a seam in between.
const SEAM: u32 = u32::MAX;
/// How far coordinates of one corner may lie from those that another corner's triangle extrapolates, relative to their
/// distance. Larger differences are looked at more closely.
const BENT: f64 = 0.5;
/// How far points in single precision may lie off a triangle that they are on, relative to their coordinates.
const SINGLE: f64 = 1e-6;
/// Most triangles around a centre that are looked at.
const MOST: usize = 4096;

/// A place on the surface.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    triangle: u32,
    at: [f32; 2],
}

/// A surface with texture coordinates.
#[derive(Debug)]
pub struct Atlas {
    tree: SurfaceBvh,
    corners: Vec<[V; 3]>,
    coordinates: Vec<Corners>,
    /// Across every side of every triangle, from its first corner on: the triangle whose coordinates go on there, or
    /// [`SEAM`].
    across: Vec<[u32; 3]>,
    /// Whether the skin consists of parts of its triangles.
    worn: bool,
}

impl Atlas {
    /// Arranges a surface, whose unit of length has `scale` metres.
    ///
    /// # Errors
    /// A triangle that names a vertex that does not exist.
    pub fn new(surface: &TexturedSurface, scale: f64) -> Result<Self, SurfaceError> {
        // A sum with zero has no negative zero, so equal numbers have equal bits.
        let single = |v: &V| [v.x, v.y, v.z].map(|c| (c * scale) as f32 + 0.0);
        let positions: Vec<[f32; 3]> = surface.vertices.iter().map(single).collect();
        let tree = SurfaceBvh::new(&positions, &surface.triangles)?;
        let point = |v: u32| V::from(positions[v as usize].map(f64::from));
        let corners = surface.triangles.iter().map(|triangle| triangle.map(point)).collect();
        let bits = |v: u32| positions[v as usize].map(f32::to_bits);
        let across = across(surface, bits);
        Ok(Self { tree, corners, coordinates: surface.coordinates.clone(), across, worn: false })
    }

    /// The same surface for a skin that consists of parts of its triangles. Every part that lies on one triangle has
    /// exactly the coordinates of that.
    pub fn worn(self) -> Self {
        Self { worn: true, ..self }
    }

    /// The place closest to a point [m].
    pub fn place(&self, x: V) -> Place {
        self.place_of(self.tree.closest_point(x, f64::MAX))
    }

    fn place_of(&self, closest: Option<ClosestPoint>) -> Place {
        let Some(closest) = closest else { return Place { triangle: SEAM, at: [0.0; 2] } };
        Place { triangle: closest.triangle, at: self.at(closest.triangle, closest.barycentric) }
    }

    /// Texture coordinates of a triangle of these corners [m], whose places are known.
    pub fn corners(&self, x: [V; 3], places: [Place; 3]) -> Corners {
        if places[0].triangle == SEAM {
            return Corners::default();
        }
        if let Some(corners) = self.worn.then(|| self.on_one(&x, &places)).flatten() {
            return corners;
        }
        if self.goes_on(&x, &places) {
            return places.map(|place| place.at);
        }
        let centre = (x[0] + x[1] + x[2]) / 3.0;
        let radius = x.iter().map(|x| (x - centre).norm()).fold(0.0, f64::max);
        let around = self.around(self.place(centre).triangle, centre, radius);
        let among = || around.iter().map(|&triangle| (0.0, triangle));
        x.map(|x| self.place_of(self.tree.closest_point_among(x, f64::MAX, among())).at)
    }

    /// Texture coordinates on the triangle that all of these corners [m] lie on, if there is one.
    fn on_one(&self, x: &[V; 3], places: &[Place; 3]) -> Option<Corners> {
        let [first, ..] = places;
        if places.iter().all(|place| place.triangle == first.triangle) {
            return Some(places.map(|place| place.at));
        }
        let beside = |place: &Place| {
            let across = self.across[place.triangle as usize];
            [place.triangle, across[0], across[1], across[2]]
        };
        let near = places.iter().flat_map(beside).filter(|t| *t != SEAM);
        let at_centre = || self.place((x[0] + x[1] + x[2]) / 3.0).triangle;
        near.chain(std::iter::once_with(at_centre)).find_map(|t| self.all_on(t, x))
    }

    /// Texture coordinates of points [m] if all of them lie on triangle `t`, as far as single precision can tell.
    fn all_on(&self, t: u32, x: &[V; 3]) -> Option<Corners> {
        let corners = self.corners[t as usize];
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let size = corners.iter().chain(x).map(|x| x.amax()).fold(0.0, f64::max);
        let (allowed, twice) = (SINGLE * size, normal.norm());
        let mut found = Corners::default();
        for (x, found) in x.iter().zip(&mut found) {
            let mut weights = [0.0; 3];
            for k in 0..3 {
                let [p, q] = [1, 2].map(|i| corners[(k + i) % 3]);
                let part = (p - x).cross(&(q - x)).dot(&normal) / twice;
                if part < -allowed * (q - p).norm() {
                    return None;
                }
                weights[k] = part / twice;
            }
            if (x - corners[0]).dot(&normal).abs() > allowed * twice {
                return None;
            }
            *found = self.at(t, weights);
        }
        Some(found)
    }

    /// Whether the places of the other corners are where the triangle of the first one extrapolates them to.
    pub(super) fn goes_on(&self, x: &[V; 3], places: &[Place; 3]) -> bool {
        if places.iter().all(|place| place.triangle == places[0].triangle) {
            return true;
        }
        let distance = |a: [f32; 2], b: [f32; 2]| f64::from(a[0] - b[0]).hypot(f64::from(a[1] - b[1]));
        let first = places[0];
        (1..3).all(|k| {
            let expected = self.extrapolated(first.triangle, x[k]);
            distance(expected, places[k].at) <= BENT * distance(expected, first.at)
        })
    }

    /// Coordinates that a triangle has at the projection of a point [m] onto its plane.
    fn extrapolated(&self, triangle: u32, x: V) -> [f32; 2] {
        let [a, b, c] = self.corners[triangle as usize];
        let (u, v, w) = (b - a, c - a, x - a);
        let normal = u.cross(&v);
        let squared = normal.norm_squared();
        if squared == 0.0 {
            return self.coordinates[triangle as usize][0];
        }
        let (s, t) = (w.cross(&v).dot(&normal) / squared, u.cross(&w).dot(&normal) / squared);
        self.at(triangle, [1.0 - s - t, s, t])
    }

    fn at(&self, triangle: u32, weights: [f64; 3]) -> [f32; 2] {
        let corners = self.coordinates[triangle as usize];
        let along =
            |k: usize| weights.iter().zip(&corners).map(|(w, corner)| w * f64::from(corner[k])).sum::<f64>();
        [along(0) as f32, along(1) as f32]
    }

    /// Triangles that reach into a ball [m], and can be reached from `first` without crossing a seam or leaving it.
    fn around(&self, first: u32, centre: V, radius: f64) -> Vec<u32> {
        let reach = radius + self.distance(centre, first);
        let (mut around, mut known) = (vec![first], HashSet::from([first]));
        let mut next = 0;
        while next < around.len() && around.len() < MOST {
            for &other in &self.across[around[next] as usize] {
                if other != SEAM && known.insert(other) && self.distance(centre, other) <= reach {
                    around.push(other);
                }
            }
            next += 1;
        }
        around
    }

    fn distance(&self, x: V, triangle: u32) -> f64 {
        let corners = &self.corners[triangle as usize];
        (barycentric_point(corners, closest_point_on_triangle(x, corners)) - x).norm()
    }
}

/// What lies across every side of every triangle. Vertices at the same place are the same, whatever their numbers.
fn across(surface: &TexturedSurface, bits: impl Fn(u32) -> [u32; 3]) -> Vec<[u32; 3]> {
    let mut across = vec![[SEAM; 3]; surface.triangles.len()];
    let mut sides: HashMap<_, (usize, usize)> = HashMap::new();
    for (t, (triangle, coordinates)) in surface.triangles.iter().zip(&surface.coordinates).enumerate() {
        let end = |k: usize| (bits(triangle[k]), coordinates[k].map(|c| (c + 0.0).to_bits()));
        for side in 0..3 {
            let (a, b) = (end(side), end((side + 1) % 3));
            let key = if a < b { (a, b) } else { (b, a) };
            // Of three triangles at one side the first two are neighbours.
            match sides.remove(&key) {
                Some((other, its_side)) => {
                    across[t][side] = other as u32;
                    across[other][its_side] = t as u32;
                }
                None => {
                    sides.insert(key, (t, side));
                }
            }
        }
    }
    across
}
