//! The tree over the triangles of one surface: built once per topology, refitted after every motion.

use crate::convert::{aabb_of, from_parry, widen};
use nalgebra::Vector3;
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

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
        "refit with {found} vertices on a surface of {expected}; after a change of topology build \
         a new tree"
    )]
    VertexCount {
        /// Vertices given.
        found: usize,
        /// Vertices of the topology.
        expected: usize,
    },
}

/// Bounding volume hierarchy over the triangles of one closed surface.
///
/// It holds the surface twice: before the last [`refit`](Self::refit) and at present. Every leaf box covers
/// both, so the same tree serves swept queries on the motion in between. Triangles are counter-clockwise seen
/// from outside.
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
#[derive(Debug, Clone)]
pub struct SurfaceBvh {
    triangles: Vec<[u32; 3]>,
    positions: Vec<[f32; 3]>,
    previous: Vec<[f32; 3]>,
    star_offsets: Vec<u32>,
    star: Vec<u32>,
    /// Box of each triangle, before the last refit and at present.
    boxes: Vec<Aabb>,
    tree: Bvh,
    /// Leaves in the order of the tree's memory. Refitting in this order is fast, since it walks the memory
    /// forward.
    order: Vec<u32>,
    kept_vertices: u64,
}

impl SurfaceBvh {
    /// Builds the tree. `positions` are in metres; a non-finite one is replaced by the origin and counted.
    ///
    /// # Errors
    /// If a triangle names a vertex that does not exist.
    pub fn new(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Self, SurfaceError> {
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= positions.len()) {
                let vertices = positions.len();
                return Err(SurfaceError::VertexOutOfRange { triangle, vertex, vertices });
            }
        }
        let mut kept_vertices = 0;
        let mut positions = positions.to_vec();
        for p in &mut positions {
            if !p.iter().all(|x| x.is_finite()) {
                *p = [0.0; 3];
                kept_vertices += 1;
            }
        }
        let boxes: Vec<_> = triangles.iter().map(|t| aabb_of(t.map(|v| positions[v as usize]))).collect();
        let (star_offsets, star) = stars(positions.len(), triangles);
        let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        let order = tree.leaves(|_| true).collect();
        Ok(Self {
            triangles: triangles.to_vec(),
            previous: positions.clone(),
            positions,
            star_offsets,
            star,
            boxes,
            tree,
            order,
            kept_vertices,
        })
    }

    /// Moves the surface to `positions` [m] and refits the tree in place. The positions so far become the
    /// [previous](Self::previous_triangle) ones. A non-finite vertex keeps its position and is counted. The
    /// cost is linear in the number of triangles, without allocation.
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

    /// Forgets the last motion, e.g. after a reset: swept queries see a surface at rest.
    pub fn forget_motion(&mut self) {
        self.previous.copy_from_slice(&self.positions);
        self.refit_boxes();
    }

    fn refit_boxes(&mut self) {
        for &leaf in &self.order {
            let [a, b, c] = self.triangles[leaf as usize].map(|v| v as usize);
            let corners = [self.positions[a], self.positions[b], self.positions[c]];
            let before = [self.previous[a], self.previous[b], self.previous[c]];
            let aabb = aabb_of(corners.into_iter().chain(before));
            self.boxes[leaf as usize] = aabb;
            // No margin: the leaf takes the box as it is. Every leaf exists since `new`.
            let _ = self.tree.update_partially_if_present(aabb, leaf, 0.0);
        }
        self.tree.refit_without_opt();
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
        (!self.triangles.is_empty()).then(|| {
            let aabb = self.tree.root_aabb();
            [from_parry(aabb.mins), from_parry(aabb.maxs)]
        })
    }

    /// Number of non-finite vertex positions refused so far.
    pub fn refused_vertices(&self) -> u64 {
        self.kept_vertices
    }

    /// Triangles around vertex `vertex`.
    pub(crate) fn star(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.star[self.star_offsets[v] as usize..self.star_offsets[v + 1] as usize]
    }

    /// Box of each triangle, before the last refit and at present.
    pub(crate) fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// The tree. Its leaf `i` is triangle `i`.
    pub(crate) fn tree(&self) -> &Bvh {
        &self.tree
    }
}

/// Lower and upper corner of a node [m].
pub(crate) fn node_bounds(node: &BvhNode) -> [Vector3<f64>; 2] {
    [from_parry(node.mins()), from_parry(node.maxs())]
}

/// Triangles around each vertex, in compressed rows.
fn stars(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; vertices + 1];
    for &v in triangles.iter().flatten() {
        offsets[v as usize + 1] += 1;
    }
    for i in 0..vertices {
        offsets[i + 1] += offsets[i];
    }
    let mut next = offsets.clone();
    let mut star = vec![0; triangles.len() * 3];
    for (t, corners) in (0u32..).zip(triangles) {
        for &v in corners {
            star[next[v as usize] as usize] = t;
            next[v as usize] += 1;
        }
    }
    (offsets, star)
}
