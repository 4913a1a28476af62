//! The first impact of a moving capsule on a moving surface.
//!
//! Each triangle near the path is treated by conservative advancement. The closest points give a direction
//! that separates the two convex shapes. Along it they close the gap no faster than their fastest vertices,
//! so time advances by gap / speed until the gap is gone. A sphere on a plane takes one step, a capsule on an
//! edge a few.
//!
//! # Source
//! Mirtich, Impulse-based dynamic simulation of rigid body systems (1996), §2.3.2; the
//! directional speed bound as in Zhang et al., Continuous collision detection for articulated
//! models using Taylor models and temporal culling (2007).

use crate::broad::BroadPhase;
use crate::broad::aabb::Aabb;
use crate::broad::ball::Ball;
use crate::broad::probe::Probe;
use crate::distance::{SegmentTriangle, closest_segment_triangle};
use crate::surface_bvh::SurfaceBvh;
use nalgebra::Vector3;

type V = Vector3<f64>;

/// Gap at which two shapes count as touching [m]. One micrometre: far below any tissue feature,
/// far above the rounding of `f32` positions within a metre of the origin.
pub const SWEEP_TOLERANCE_M: f64 = 1e-6;

/// Largest approach that still counts as sliding along a touched triangle [m per sweep].
const SLIDING_M: f64 = 1e-9;

/// Most advancement steps per triangle. What has not converged by then counts as hit, which is safe.
const MAX_ADVANCES: usize = 512;

/// A moving capsule. Both ends of its core move along straight lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CapsuleMotion {
    /// Core at time 0 [m].
    pub start: [V; 2],
    /// Core at time 1 [m].
    pub end: [V; 2],
    /// Radius around the core [m].
    pub radius: f64,
}

impl CapsuleMotion {
    /// The core at `time` in 0..=1 [m].
    pub fn core_at(&self, time: f64) -> [V; 2] {
        [0, 1].map(|i| self.start[i] + (self.end[i] - self.start[i]) * time)
    }
}

/// First contact of a moving capsule with a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// Time of the impact, as a fraction of the motion, 0..=1.
    pub time: f64,
    /// The triangle that was hit.
    pub triangle: u32,
    /// Barycentric coordinates on that triangle.
    pub barycentric: [f64; 3],
    /// Place of the impact in space, at that time [m].
    pub point: V,
    /// Unit direction from the surface to the capsule.
    pub normal: V,
    /// Position along the core, 0..=1.
    pub parameter: f64,
}

/// The corners of a triangle at time 0 and their displacement until time 1.
type TriangleMotion = ([V; 3], [V; 3]);

impl SurfaceBvh {
    /// First impact of the moving capsule on the surface at rest in its present state.
    ///
    /// A capsule that already touches a triangle hits it at time 0 if it moves into it, and not at all if it
    /// moves away. Triangles seen from behind never stop anything, so a capsule that started inside can
    /// leave.
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use scindo_collision::{CapsuleMotion, SurfaceBvh};
    ///
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let surface = SurfaceBvh::new(&positions, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?;
    ///
    /// // A sphere of 10 cm rises by 1 m from 60 cm below.
    /// let (from, to) = (Vector3::new(0.2, 0.2, -0.6), Vector3::new(0.2, 0.2, 0.4));
    /// let motion = CapsuleMotion { start: [from; 2], end: [to; 2], radius: 0.1 };
    /// let impact = surface.sweep(&motion).expect("it hits");
    /// assert!((impact.time - 0.5).abs() < 1e-5);
    /// assert!((impact.normal + Vector3::z()).norm() < 1e-9);
    /// # Ok::<(), scindo_collision::SurfaceError>(())
    /// ```
    pub fn sweep(&self, motion: &CapsuleMotion) -> Option<Impact> {
        self.sweep_triangles(motion, |t| (self.triangle(t), [V::zeros(); 3]))
    }

    /// First impact of the moving capsule on the surface while the surface makes its last motion, from before
    /// the last refit to the present state.
    pub fn sweep_moving(&self, motion: &CapsuleMotion) -> Option<Impact> {
        self.sweep_triangles(motion, |t| {
            let (from, to) = (self.previous_triangle(t), self.triangle(t));
            (from, [to[0] - from[0], to[1] - from[1], to[2] - from[2]])
        })
    }

    fn sweep_triangles(
        &self,
        motion: &CapsuleMotion,
        triangle_motion: impl Fn(u32) -> TriangleMotion,
    ) -> Option<Impact> {
        let mut first: Option<Impact> = None;
        self.index().search(self.boxes(), &Path::of(motion), 1.0, |triangle, limit| {
            let Some(found) = impact(motion, triangle, &triangle_motion(triangle), *limit) else { return };
            let earlier = |best: &Impact| (found.time, triangle) < (best.time, best.triangle);
            if first.as_ref().is_none_or(earlier) {
                *limit = limit.min(found.time);
                first = Some(found);
            }
        });
        first
    }
}

/// A box around the capsule that moves along a line. The triangles are searched with it.
struct Path {
    from: V,
    along: V,
    half: V,
}

impl Path {
    fn of(motion: &CapsuleMotion) -> Self {
        let middle = |core: [V; 2]| (core[0] + core[1]) * 0.5;
        let half = |core: [V; 2]| (core[1] - core[0]).abs() * 0.5;
        let margin = V::repeat(motion.radius + SWEEP_TOLERANCE_M);
        Self {
            from: middle(motion.start),
            along: middle(motion.end) - middle(motion.start),
            half: half(motion.start).sup(&half(motion.end)) + margin,
        }
    }
}

impl Probe for Path {
    const NEAREST: bool = true;

    /// Time at which the moving box touches `aabb`.
    fn to_box(&self, aabb: &Aabb) -> f64 {
        let [lower, upper] = aabb.corners();
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let (low, high) = (lower[axis] - self.half[axis], upper[axis] + self.half[axis]);
            let (x, v) = (self.from[axis], self.along[axis]);
            if v == 0.0 {
                if x < low || x > high {
                    return f64::INFINITY;
                }
                continue;
            }
            let (t0, t1) = ((low - x) / v, (high - x) / v);
            enter = enter.max(t0.min(t1));
            leave = leave.min(t0.max(t1));
        }
        if enter <= leave { enter } else { f64::INFINITY }
    }

    fn to_ball(&self, ball: &Ball) -> f64 {
        self.to_box(&ball.aabb())
    }

    fn region(&self, limit: f64) -> [V; 2] {
        let to = self.from + self.along * limit.min(1.0);
        [self.from.inf(&to) - self.half, self.from.sup(&to) + self.half]
    }

    fn limit_at(&self, distance: f64) -> f64 {
        distance / self.along.norm()
    }
}

/// Conservative advancement of one capsule against one triangle, up to time `limit`.
fn impact(
    motion: &CapsuleMotion,
    triangle: u32,
    (corners, displacement): &TriangleMotion,
    limit: f64,
) -> Option<Impact> {
    let core_motion = [motion.end[0] - motion.start[0], motion.end[1] - motion.start[1]];
    let mut time = 0.0;
    for advance in 0.. {
        let core = motion.core_at(time);
        let at = [0, 1, 2].map(|i| corners[i] + displacement[i] * time);
        let closest = closest_segment_triangle(core, &at);
        let face = (at[1] - at[0]).cross(&(at[2] - at[0]));
        let (normal, distance) = separation(&closest, face)?;
        let gap = distance - motion.radius;
        let approach = approach_speed(normal, core_motion, displacement);
        // A normal along which the shapes do not approach separates them for the rest of the motion.
        if approach <= 0.0 {
            return None;
        }
        if gap <= SWEEP_TOLERANCE_M || advance == MAX_ADVANCES {
            let behind = normal.dot(&face) < 0.0;
            let sliding = approach * (1.0 - time) <= SLIDING_M;
            return (!behind && !sliding).then_some(Impact {
                time,
                triangle,
                barycentric: closest.barycentric,
                point: closest.on_triangle,
                normal,
                parameter: closest.parameter,
            });
        }
        // Half the tolerance ahead of contact, so that the next step ends within the tolerance.
        time += (gap - 0.5 * SWEEP_TOLERANCE_M) / approach;
        if time > limit {
            return None;
        }
    }
    None
}

/// Unit direction from the triangle to the core, and their distance [m]. Where the core passes through the
/// triangle, the direction is the face normal. `None` where there is neither.
fn separation(closest: &SegmentTriangle, face: V) -> Option<(V, f64)> {
    let apart = closest.on_segment - closest.on_triangle;
    let distance = apart.norm();
    if distance > 1e-12 {
        Some((apart / distance, distance))
    } else {
        Some((face.try_normalize(f64::MIN_POSITIVE.sqrt())?, 0.0))
    }
}

/// Upper bound of the speed at which core and triangle approach each other along `normal` [m per unit of
/// time].
fn approach_speed(normal: V, core: [V; 2], triangle: &[V; 3]) -> f64 {
    let core = (-normal.dot(&core[0])).max(-normal.dot(&core[1]));
    let triangle = triangle.iter().map(|v| normal.dot(v)).fold(f64::NEG_INFINITY, f64::max);
    core + triangle
}
