//! A surface that looks for itself: which of its triangles a vertex can meet.
//!
//! Every vertex keeps a list of what is near it, and the distance beyond which nothing else was. No distance shrinks
//! by more than both sides move, so the list is good until they have moved by what is left of that distance. As long as
//! that holds for every vertex, the body is apart from itself, and a step only has to find how far it has moved.
//!
//! # Source
//! Verlet, Computer "experiments" on classical fluids I (1967): lists of neighbours.

use nalgebra::Vector3;
use scindo_collision::{ClosestPoint, SurfaceBvh};
use smallvec::SmallVec;

use super::watch::longest;

/// A triangle faces a vertex if their unit normals have at most this scalar product, which is negative.
const FACING: f64 = -0.2;
/// Most triangles in the list of a vertex, and those for which it has room without memory of its own.
const MOST: usize = 96;
const ROOM: usize = 16;
/// How far vertices look around, so that they need not look again soon, in cells; those that nothing faced, and others.
const LOOKOUT_CELLS: [f64; 2] = [1.0, 0.5];
/// An edge of the surface this sharp is the rim of a lip: scalar product of its normal and that of the lip.
const RIM: f64 = 0.9;
/// Distance beyond a rim over which the direction of contact turns from the normal of the lip to that of the rim, in
/// cells.
const TURN_CELLS: f64 = 0.05;
/// Distance to spare that vertices of a body apart from itself look for, in cells, and how much of it they may be losing
/// in a step. Where they move faster, it would not last.
const SPARE_CELLS: f64 = 0.15;
const SPARE_LOSS: f64 = 0.2;
/// Rounding of positions and distances to single precision, in cells.
const ROUNDING_CELLS: f64 = 1e-4;

/// Triangles with their distances [m], ascending.
type List = SmallVec<[(f32, u32); ROOM]>;

/// What one body knows about itself.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct OwnSurface {
    /// Normals of triangles and vertices, as long as twice their area [m²].
    triangles: Vec<Vector3<f64>>,
    vertices: Vec<Vector3<f64>>,
    /// The same of vertices over the triangles of lips alone.
    lips: Vec<Vector3<f64>>,
    /// Positions of the vertices and of the nodes that carry them at the last update [m].
    positions: Vec<[f32; 3]>,
    nodes: Vec<Vector3<f64>>,
    /// Per vertex the triangles near it to which it is not joined, with their distances when they were listed [m].
    lists: Vec<List>,
    /// All triangles count as facing; only for a mutation test.
    meets_joined: bool,
    /// Per vertex a lower bound of the distance to all others [m], and the same when they were listed.
    known_m: Vec<f64>,
    listed_m: Vec<f64>,
    /// The same to any triangle to which it is not joined, and the least of them when the body was found to be apart
    /// from itself.
    free_m: Vec<f64>,
    least_free_m: f64,
}

impl OwnSurface {
    /// Lets vertices meet all triangles; only for a mutation test.
    pub(super) fn meet_the_joined(&mut self, on: bool) {
        self.meets_joined = on;
    }

    /// Whether the body with its nodes at `x` [m] is still apart from itself: no vertex that did not touch can be within
    /// `reach` [m] of a triangle to which it is not joined. It need not be updated then. No point of the surface moves
    /// farther than `spread` times the farthest node. `same` is as for [`update`](Self::update).
    pub(super) fn is_apart(
        &self,
        (x, spread): (&[Vector3<f64>], f64),
        same: bool,
        (reach, cell_m): (f64, f64),
    ) -> bool {
        let needed = reach + ROUNDING_CELLS * cell_m;
        let known = same && !self.meets_joined && x.len() == self.nodes.len();
        if !known || self.least_free_m <= needed {
            return false;
        }
        let farthest = longest(x.iter().zip(&self.nodes).map(|(now, before)| now - before));
        self.least_free_m - 2.0 * spread * farthest > needed
    }

    /// Takes note of a step in which all vertices were looked at: whether the body touched itself.
    pub(super) fn has_looked(&mut self, touched: bool) {
        let least = || self.free_m.iter().copied().fold(f64::INFINITY, f64::min);
        self.least_free_m = if touched { 0.0 } else { least() };
    }

    /// Distance to spare that the vertices of a body look for which loses `loss` [m] of it in a step [m].
    pub(super) fn spare_m(loss: f64, cell_m: f64) -> f64 {
        if loss < SPARE_LOSS * SPARE_CELLS * cell_m { SPARE_CELLS * cell_m } else { 0.0 }
    }

    /// Follows a motion of the surface and of the nodes that carry it, now at `x` [m]. `same` tells whether vertices and
    /// triangles are still those of the last update, `is_lip` which triangles are of a lip.
    pub(super) fn update(
        &mut self,
        tree: &SurfaceBvh,
        x: &[Vector3<f64>],
        same: bool,
        is_lip: impl Fn(u32) -> bool,
    ) {
        self.follow(tree, same);
        self.nodes.clear();
        self.nodes.extend_from_slice(x);
        let Self { triangles, vertices, lips, .. } = self;
        triangles.clear();
        for normals in [&mut *vertices, &mut *lips] {
            normals.clear();
            normals.resize(tree.positions().len(), Vector3::zeros());
        }
        triangles.extend((0..tree.triangle_count() as u32).map(|t| {
            let normal = tree.area_normal(t);
            tree.corners(t).iter().for_each(|&v| vertices[v as usize] += normal);
            if is_lip(t) {
                tree.corners(t).iter().for_each(|&v| lips[v as usize] += normal);
            }
            normal
        }));
    }

    /// No distance has shrunk by more than both sides have moved.
    fn follow(&mut self, tree: &SurfaceBvh, same: bool) {
        self.least_free_m = 0.0;
        let Self { positions, lists, known_m, listed_m, free_m, .. } = self;
        let now = tree.positions();
        if same && positions.len() == now.len() {
            let moved = |(now, before): (&[f32; 3], &[f32; 3])| (point(now) - point(before)).norm_squared();
            let each = || now.iter().zip(positions.iter()).map(moved);
            let farthest = each().fold(0.0, f64::max).sqrt();
            for ((known, free), own) in known_m.iter_mut().zip(free_m.iter_mut()).zip(each()) {
                let shrunk = farthest + own.sqrt();
                *known -= shrunk;
                *free -= shrunk;
            }
        } else {
            known_m.clear();
            known_m.resize(now.len(), 0.0);
            for distances in [free_m, listed_m] {
                distances.clear();
                distances.resize(now.len(), 0.0);
            }
            lists.resize_with(now.len(), SmallVec::new);
        }
        positions.clear();
        positions.extend_from_slice(now);
    }

    /// Whether triangle `t` faces a vertex.
    pub(super) fn faces(&self, t: u32, vertex: u32) -> bool {
        if self.meets_joined {
            return true;
        }
        let [triangle, vertex] = [&self.triangles[t as usize], &self.vertices[vertex as usize]];
        let product = triangle.dot(vertex);
        product < 0.0
            && product * product >= FACING * FACING * triangle.norm_squared() * vertex.norm_squared()
    }

    /// The direction in which the surface at `near` pushes a vertex at `from` [m].
    ///
    /// The normal on the rim of a lip is the mean of the lip's and the skin's. A vertex of the other rim lies opposite
    /// to it, a few micrometres below or above, and would be pushed in another direction in every step. So a rim
    /// pushes along the normal of its lip, and turns as the vertex passes beyond it.
    pub(super) fn push(
        &self,
        near: &ClosestPoint,
        from: Vector3<f64>,
        tree: &SurfaceBvh,
        cell_m: f64,
    ) -> Vector3<f64> {
        let corners = tree.corners(near.triangle).into_iter().zip(near.barycentric);
        let lip = unit(&corners.map(|(v, w)| w * unit(&self.lips[v as usize])).sum());
        if lip == Vector3::zeros() || lip.dot(&near.normal) > RIM {
            return near.normal;
        }
        let away = from - near.point;
        let beyond = (away - lip.dot(&away) * lip).norm() / (TURN_CELLS * cell_m);
        let normal = lip + beyond.min(1.0) * (near.normal - lip);
        normal.try_normalize(0.1).unwrap_or(near.normal)
    }

    /// Whether no triangle to which it is not joined can be within `reach` [m] of a vertex.
    pub(super) fn is_free(&self, vertex: u32, (reach, cell_m): (f64, f64)) -> bool {
        self.free_m[vertex as usize] > reach + ROUNDING_CELLS * cell_m
    }

    /// The closest of the triangles that face a vertex at `from` [m], of those no farther than `reach` [m] that it is
    /// not joined to. What is known of the vertex after that reaches `spare` [m] farther.
    pub(super) fn closest(
        &mut self,
        (vertex, from): (u32, Vector3<f64>),
        (reach, spare, cell_m): (f64, f64, f64),
        tree: &SurfaceBvh,
        joined: impl Fn(u32) -> bool,
    ) -> Option<ClosestPoint> {
        let (v, needed) = (vertex as usize, reach + ROUNDING_CELLS * cell_m);
        if self.known_m[v] <= needed + spare {
            let faced = self.lists[v].iter().any(|&(_, t)| self.faces(t, vertex));
            let lookout = (LOOKOUT_CELLS[usize::from(faced)] * cell_m).max(1.5 * (needed + spare));
            self.known_m[v] = look_around(&mut self.lists[v], from, lookout, tree, &joined);
            self.listed_m[v] = self.known_m[v];
            self.free_m[v] =
                self.lists[v].first().map_or(self.known_m[v], |(nearest, _)| f64::from(*nearest));
        }
        if self.known_m[v] > needed {
            // Both sides have moved since they were listed.
            let moved = self.listed_m[v] - self.known_m[v] + ROUNDING_CELLS * cell_m;
            let near = || self.lists[v].iter().map(|&(listed, t)| (f64::from(listed) - moved, t));
            if spare > 0.0 && self.free_m[v] <= needed + spare {
                let nearest = tree.closest_point_among(from, self.known_m[v], near());
                self.free_m[v] = nearest.map_or(self.known_m[v], |near| near.signed_distance.abs());
            }
            if self.free_m[v] > needed {
                return None;
            }
            let near = near();
            let facing =
                near.take_while(|(bound, _)| *bound <= needed).filter(|(_, t)| self.faces(*t, vertex));
            return tree.closest_point_among(from, reach, facing);
        }
        tree.closest_point_where(from, reach, |t| self.faces(t, vertex) && !joined(t))
    }
}

/// Lists the triangles nearest to a point, no farther than `lookout` [m], by their distance. Returns the distance up
/// to which the list is complete [m].
fn look_around(
    list: &mut List,
    from: Vector3<f64>,
    lookout: f64,
    tree: &SurfaceBvh,
    joined: &impl Fn(u32) -> bool,
) -> f64 {
    let mut complete_m = lookout as f32;
    list.clear();
    tree.triangles_near_point(
        from,
        lookout,
        |t| !joined(t),
        |triangle, distance| {
            let distance = distance as f32;
            if distance >= complete_m {
                return;
            }
            if let Some(&(farthest, _)) = list.get(MOST - 1) {
                complete_m = farthest.max(distance);
                if distance >= farthest {
                    return;
                }
                list.pop();
            }
            let place = list.partition_point(|(nearer, _)| *nearer < distance);
            list.insert(place, (distance, triangle));
        },
    );
    list.retain(|(distance, _)| *distance < complete_m);
    f64::from(complete_m)
}

fn point(p: &[f32; 3]) -> Vector3<f64> {
    Vector3::from(p.map(f64::from))
}

fn unit(normal: &Vector3<f64>) -> Vector3<f64> {
    normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_default()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A strip of 2 × 40 triangles, folded in the middle by `angle` [rad].
    fn strip(angle: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let (half, size) = (20, 0.01f32);
        let place = |i: i32, y: f32| {
            let (before, after) = (i.min(half) as f32, (i - half).max(0) as f32);
            [size * (before + after * angle.cos()), y, size * after * angle.sin()]
        };
        let points = (0..=2 * half).flat_map(|i| [place(i, 0.0), place(i, size)]).collect();
        let of = |t: u32| if t.is_multiple_of(2) { [t, t + 2, t + 1] } else { [t, t + 1, t + 2] };
        (points, (0..4 * half as u32).map(of).collect())
    }

    #[test]
    fn lists_hold_what_is_near() {
        let (points, triangles) = strip(0.0);
        let mut tree = SurfaceBvh::new(&points, &triangles).unwrap();
        let mut own = OwnSurface::default();
        let (mut listed, mut looked, mut met, mut apart) = (0, 0, 0, 0);
        for step in 0..3000 {
            // Folded shut and opened again, with a jerk in between.
            let angle = 3.1 * (0.0015 * step as f32).sin().abs() + if step % 500 == 7 { 0.3 } else { 0.0 };
            tree.refit(&strip(angle).0).unwrap();
            let nodes: Vec<_> = tree.positions().iter().map(point).collect();
            let (reach, spare) = (0.002, if step < 1000 { 0.0 } else { 0.0015 });
            let begin = met;
            if own.is_apart((&nodes, 1.0), step > 0, (reach, 0.01)) {
                apart += 1;
                for v in 0..points.len() as u32 {
                    let from = point(&tree.positions()[v as usize]);
                    let joined = |t: u32| tree.corners(t).contains(&v);
                    assert_eq!(tree.closest_point_where(from, reach, |t| !joined(t)), None, "step {step}");
                }
                continue;
            }
            own.update(&tree, &nodes, step > 0, |_| false);
            for v in 0..points.len() as u32 {
                let from = point(&tree.positions()[v as usize]);
                let joined = |t: u32| tree.corners(t).contains(&v);
                looked += 1;
                listed += usize::from(own.known_m[v as usize] > 1.1 * reach);
                let found = own.closest((v, from), (reach, spare, 0.01), &tree, joined);
                let truth = tree.closest_point_where(from, reach, |t| own.faces(t, v) && !joined(t));
                assert_eq!(found, truth, "step {step}, vertex {v}");
                met += usize::from(truth.is_some());
            }
            own.has_looked(met > begin);
        }
        assert!(apart > 400, "steps in which nothing had to be looked at: {apart}");
        assert!(met > 20, "the halves meet: {met}");
        assert!(listed > looked / 2, "most lists are still good: {listed} of {looked}");
    }
}
