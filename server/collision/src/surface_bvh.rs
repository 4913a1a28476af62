//! The triangles of one surface, arranged for queries: refitted after every motion, and changed where a cut
//! changed them.

use crate::broad::aabb::{Aabb, lower, upper};
use crate::broad::{BroadPhase, Index, Method, WORN};
use crate::convert::widen;
use crate::stars::Stars;
use nalgebra::Vector3;

/// Why a surface was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SurfaceError {
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} of the surface names vertex {vertex}, but there are only {vertices} \
         vertices; rebuild the surface from its topology"
    )]
    VertexOutOfRange {
        /// The offending triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of vertices given.
        vertices: usize,
    },
    /// A refit has another number of vertices, so the topology has changed.
    #[error(
        "refit with {found} vertices on a surface of {expected}; give \
         the triangles too after a change of topology"
    )]
    VertexCount {
        /// Vertices given.
        found: usize,
        /// Vertices of the topology.
        expected: usize,
    },
}

/// The triangles of one closed surface, arranged by a [method of broad phase](Method).
///
/// It holds the surface twice: before the last [`refit`](Self::refit) and at present. The box of every triangle
/// covers both, so the same arrangement serves swept queries on the motion in between. Triangles are
/// counter-clockwise seen from outside.
///
/// ```
/// use nalgebra::Vector3;
/// use scindo_collision::SurfaceBvh;
///
/// // A tetrahedron: the origin and the three unit points.
/// let mut positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let mut surface = SurfaceBvh::new(&positions, &triangles)?;
///
/// let below = Vector3::new(0.2, 0.2, -0.5); // m
/// let nearest = surface.closest_point(below, 1.0).expect("within 1 m");
/// assert!((nearest.point - Vector3::new(0.2, 0.2, 0.0)).norm() < 1e-6);
/// assert_eq!(nearest.normal, -Vector3::z());
/// assert!((nearest.signed_distance - 0.5).abs() < 1e-6);
///
/// // The surface moves up by 1 m: the same point is out of reach now.
/// positions.iter_mut().for_each(|x| x[2] += 1.0);
/// surface.refit(&positions)?;
/// assert_eq!(surface.closest_point(below, 1.0), None);
/// # Ok::<(), scindo_collision::SurfaceError>(())
/// ```
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct SurfaceBvh {
    triangles: Vec<[u32; 3]>,
    positions: Vec<[f32; 3]>,
    previous: Vec<[f32; 3]>,
    stars: Stars,
    /// Box of each vertex and of each triangle, before the last refit and at present.
    paths: Vec<Aabb>,
    boxes: Vec<Aabb>,
    bounds: Aabb,
    index: Index,
    /// Triangles of the last change of topology.
    removed: Vec<u32>,
    inserted: Vec<u32>,
    kept_vertices: u64,
    rebuilds: u64,
}

/// A surface of which more than one triangle in this number changed is arranged anew.
const REBUILT_SHARE: usize = 4;

impl SurfaceBvh {
    /// Arranges a surface by the default method. `positions` are in metres; a non-finite one is replaced by the
    /// origin and counted.
    ///
    /// # Errors
    /// If a triangle names a vertex that does not exist.
    pub fn new(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Self, SurfaceError> {
        Self::with_method(Method::default(), positions, triangles)
    }

    /// Like [`new`](Self::new), with a method of choice. Queries give the same results with every method.
    ///
    /// # Errors
    /// If a triangle names a vertex that does not exist.
    pub fn with_method(
        method: Method,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Self, SurfaceError> {
        check(positions.len(), triangles)?;
        let mut surface = Self {
            triangles: triangles.to_vec(),
            previous: Vec::new(),
            positions: positions.to_vec(),
            stars: Stars::new(positions.len(), triangles),
            paths: Vec::new(),
            boxes: Vec::new(),
            bounds: Aabb::EMPTY,
            index: Index::new(method, &[]),
            removed: Vec::new(),
            inserted: Vec::new(),
            kept_vertices: 0,
            rebuilds: 0,
        };
        surface.keep_finite();
        surface.previous.clone_from(&surface.positions);
        surface.update_boxes();
        surface.index.rebuild(&surface.boxes);
        Ok(surface)
    }

    /// Moves the surface to `positions` [m] and refits it in place. The positions so far become the
    /// [previous](Self::previous_triangle) ones. A non-finite vertex keeps its position and is counted. The
    /// cost is linear in the number of triangles, without allocation.
    ///
    /// A surface that has deformed so much that queries take far longer is arranged anew, which takes as long
    /// as some ten refits.
    ///
    /// # Errors
    /// If the number of vertices changed. The surface is not changed then.
    pub fn refit(&mut self, positions: &[[f32; 3]]) -> Result<(), SurfaceError> {
        if positions.len() != self.positions.len() {
            return Err(SurfaceError::VertexCount { found: positions.len(), expected: self.positions.len() });
        }
        std::mem::swap(&mut self.previous, &mut self.positions);
        for ((now, &new), &before) in self.positions.iter_mut().zip(positions).zip(&self.previous) {
            let finite = new.iter().all(|x| x.is_finite());
            self.kept_vertices += u64::from(!finite);
            *now = if finite { new } else { before };
        }
        self.refit_boxes();
        Ok(())
    }

    /// Takes over a changed topology, as after a cut, at the given positions [m]. It forgets the last motion. A
    /// non-finite position is replaced by the origin and counted. Returns the number of triangles that changed.
    ///
    /// Triangles are compared by their number, so those that a cut did not touch should keep it. What did not
    /// change is only refitted. If more than a quarter changed, the surface is arranged anew.
    ///
    /// # Errors
    /// If a triangle names a vertex that does not exist. The surface is not changed then.
    ///
    /// ```
    /// use scindo_collision::SurfaceBvh;
    ///
    /// let mut positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let mut triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    /// let mut surface = SurfaceBvh::new(&positions, &triangles)?;
    ///
    /// // The last triangle is divided into three.
    /// positions.push([0.4, 0.4, 0.4]);
    /// triangles[3] = [1, 2, 4];
    /// triangles.extend([[2, 3, 4], [3, 1, 4]]);
    /// assert_eq!(surface.change_topology(&positions, &triangles)?, 3);
    /// assert_eq!(surface.triangle_count(), 6);
    /// # Ok::<(), scindo_collision::SurfaceError>(())
    /// ```
    pub fn change_topology(
        &mut self,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<usize, SurfaceError> {
        check(positions.len(), triangles)?;
        let (before, now) = (self.triangles.len(), triangles.len());
        let both = before.min(now);
        let differs = |t: &u32| self.triangles[*t as usize] != triangles[*t as usize];
        self.inserted.clear();
        self.inserted.extend((0..both as u32).filter(differs));
        self.removed.clone_from(&self.inserted);
        self.removed.extend(both as u32..before as u32);
        self.inserted.extend(both as u32..now as u32);
        let changed = self.inserted.len().max(self.removed.len());
        let anew = changed * REBUILT_SHARE > now;

        self.positions.clear();
        self.positions.extend_from_slice(positions);
        self.keep_finite();
        self.previous.clone_from(&self.positions);
        if anew {
            self.triangles.clear();
            self.triangles.extend_from_slice(triangles);
            self.stars = Stars::new(positions.len(), triangles);
            self.update_boxes();
            self.rebuild();
            return Ok(changed);
        }
        for &t in &self.removed {
            self.stars.remove(t, self.triangles[t as usize]);
        }
        self.stars.resize(positions.len(), now);
        self.triangles.resize(now, [0; 3]);
        for &t in &self.inserted {
            self.triangles[t as usize] = triangles[t as usize];
            self.stars.insert(t, triangles[t as usize]);
        }
        self.update_boxes();
        self.index.replace(&self.removed, &self.inserted, &self.boxes);
        self.refit_index();
        Ok(changed)
    }

    /// Forgets the last motion, e.g. after a reset: swept queries see a surface at rest.
    pub fn forget_motion(&mut self) {
        self.previous.copy_from_slice(&self.positions);
        self.refit_boxes();
    }

    /// Arranges the surface anew, in the memory that it has.
    pub fn rebuild(&mut self) {
        self.index.rebuild(&self.boxes);
        self.rebuilds += 1;
    }

    fn refit_boxes(&mut self) {
        self.update_boxes();
        self.refit_index();
    }

    fn refit_index(&mut self) {
        self.index.refit(&self.boxes);
        if self.index.quality() > WORN {
            self.rebuild();
        }
    }

    /// Replaces vertices that are not finite by the origin.
    fn keep_finite(&mut self) {
        for p in &mut self.positions {
            if !p.iter().all(|x| x.is_finite()) {
                *p = [0.0; 3];
                self.kept_vertices += 1;
            }
        }
    }

    /// Boxes of vertices and triangles, before the last refit and at present.
    fn update_boxes(&mut self) {
        let path = |(&a, &b): (&[f32; 3], &[f32; 3])| Aabb { min: lower(a, b), max: upper(a, b) };
        self.paths.clear();
        self.paths.extend(self.positions.iter().zip(&self.previous).map(path));
        self.boxes.clear();
        let paths = &self.paths;
        self.boxes.extend(self.triangles.iter().map(|t| {
            let [a, b, c] = t.map(|v| &paths[v as usize]);
            a.merged(b).merged(c)
        }));
        self.bounds = self.boxes.iter().fold(Aabb::EMPTY, |sum, aabb| sum.merged(aabb));
    }

    /// The method of broad phase.
    pub fn method(&self) -> Method {
        self.index.method()
    }

    /// How much more work a query takes than on a fresh arrangement, as far as bounding volumes tell: the areas
    /// of all volumes over those of the triangles' boxes, compared to the same after the last build. Above 1.5 the surface
    /// is arranged anew. Always 1 for the spatial hash.
    pub fn quality(&self) -> f64 {
        self.index.quality()
    }

    /// How often the surface was arranged anew since it was made.
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Present position of every vertex [m].
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Vertices of all triangles, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Vertices of triangle `index`, counter-clockwise seen from outside.
    pub fn corners(&self, index: u32) -> [u32; 3] {
        self.triangles[index as usize]
    }

    /// Present corner positions of triangle `index` [m].
    pub fn triangle(&self, index: u32) -> [Vector3<f64>; 3] {
        self.triangles[index as usize].map(|v| widen(self.positions[v as usize]))
    }

    /// Corner positions of triangle `index` before the last refit [m].
    pub fn previous_triangle(&self, index: u32) -> [Vector3<f64>; 3] {
        self.triangles[index as usize].map(|v| widen(self.previous[v as usize]))
    }

    /// Lower and upper corner of a box around the surface, at present and before the last refit [m]; `None`
    /// without triangles.
    pub fn bounds(&self) -> Option<[Vector3<f64>; 2]> {
        (!self.triangles.is_empty()).then(|| self.bounds.corners())
    }

    /// Number of non-finite vertex positions refused so far.
    pub fn refused_vertices(&self) -> u64 {
        self.kept_vertices
    }

    /// Triangles around vertex `vertex`, ascending.
    pub(crate) fn star(&self, vertex: u32) -> impl Iterator<Item = u32> {
        self.stars.around(vertex)
    }

    /// Box of each triangle, before the last refit and at present.
    pub(crate) fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// Box around all triangles, before the last refit and at present.
    pub(crate) fn bounding_box(&self) -> &Aabb {
        &self.bounds
    }

    /// The arrangement of the [boxes](Self::boxes).
    pub(crate) fn index(&self) -> &Index {
        &self.index
    }
}

/// Whether all triangles name vertices that exist.
fn check(vertices: usize, triangles: &[[u32; 3]]) -> Result<(), SurfaceError> {
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
            return Err(SurfaceError::VertexOutOfRange { triangle, vertex, vertices });
        }
    }
    Ok(())
}
