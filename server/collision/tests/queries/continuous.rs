//! Adversarial queries of continuous collision detection, as in public benchmarks: a vertex against a face and an
//! edge against an edge, whose paths are built so that they meet. None may be missed.
//!
//! The four kinds of query are general position, contact at an edge or corner of the face, motion in the plane of the
//! face, and faces so thin that they have hardly an area. Speeds span five orders of magnitude.
//!
//! # Source
//! Wang et al. 2021, A large-scale benchmark and an inclusion-based algorithm for continuous collision detection:
//! kinds of queries.

use fastrand::Rng;
use nalgebra::Vector3;
use scindo_collision::{CapsuleMotion, SWEEP_TOLERANCE_M, SurfaceBvh, closest_segment_triangle};

use crate::shapes::vector;

type V = Vector3<f64>;

const QUERIES: u64 = 20_000;
const RADIUS_M: f64 = 1e-5;

/// A size between 10⁻⁵ and 1, uniform in its logarithm.
fn size(random: &mut Rng) -> f64 {
    10f64.powf(-5.0 * random.f64())
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    General,
    OnTheRim,
    InThePlane,
    Thin,
}

const KINDS: [Kind; 4] = [Kind::General, Kind::OnTheRim, Kind::InThePlane, Kind::Thin];

/// A moving triangle in single precision, as surfaces arrive.
struct Face {
    start: [[f32; 3]; 3],
    end: [[f32; 3]; 3],
}

impl Face {
    fn random(random: &mut Rng, kind: Kind) -> Self {
        let width = 0.1 * size(random).max(1e-3);
        let mut start = [(); 3].map(|()| vector(random, width));
        if kind == Kind::Thin {
            start[2] = start[1] + (start[0] - start[1]) * random.f64() + vector(random, 1e-9);
        }
        let speed = 0.1 * size(random);
        let (all, each) = (vector(random, speed), if kind == Kind::InThePlane { 0.0 } else { 0.2 * speed });
        let end = start.map(|p| p + all + vector(random, each));
        let single = |p: V| [p.x as f32, p.y as f32, p.z as f32];
        Self { start: start.map(single), end: end.map(single) }
    }

    fn at(&self, time: f64) -> [V; 3] {
        let wide = |p: [f32; 3]| V::from(p.map(f64::from));
        [0, 1, 2].map(|i| wide(self.start[i]) * (1.0 - time) + wide(self.end[i]) * time)
    }

    /// The face with both sides, for a surface stops only what comes from outside.
    fn surface(&self) -> SurfaceBvh {
        let mut surface = SurfaceBvh::new(&self.start, &[[0, 1, 2], [0, 2, 1]]).unwrap();
        surface.refit(&self.end).unwrap();
        surface
    }
}

/// Coordinates of a point of the face.
fn place(random: &mut Rng, kind: Kind) -> [f64; 3] {
    let (a, b) = (random.f64(), random.f64());
    match kind {
        Kind::OnTheRim if a < 0.3 => [1.0, 0.0, 0.0],
        Kind::OnTheRim => [b, 1.0 - b, 0.0],
        _ => [1.0 - a.sqrt(), a.sqrt() * (1.0 - b), a.sqrt() * b],
    }
}

fn point(face: &[V; 3], [a, b, c]: [f64; 3]) -> V {
    face[0] * a + face[1] * b + face[2] * c
}

/// A velocity of the kind [m per step].
fn velocity(random: &mut Rng, face: &[V; 3], kind: Kind) -> V {
    let speed = 0.1 * size(random);
    if kind == Kind::InThePlane {
        let (u, v) = (face[1] - face[0], face[2] - face[0]);
        let along = u * (2.0 * random.f64() - 1.0) + v * (2.0 * random.f64() - 1.0);
        return along.try_normalize(1e-12).unwrap_or_else(V::x) * speed;
    }
    vector(random, speed)
}

/// The gap between capsule and face at `time` [m].
fn gap(motion: &CapsuleMotion, face: &Face, time: f64) -> f64 {
    let core = [0, 1].map(|i| motion.start[i] * (1.0 - time) + motion.end[i] * time);
    closest_segment_triangle(core, &face.at(time)).distance_squared.sqrt() - motion.radius
}

/// What became of the queries of a kind.
#[derive(Debug, Default)]
struct Count {
    /// Free at the start, which a query has to be to count.
    free: usize,
    /// Stopped before capsule and face touch. This is safe, but should be rare.
    early: usize,
}

impl Count {
    /// Asserts that the sweep finds the meeting at `meets` or an earlier one.
    fn sweep(&mut self, motion: &CapsuleMotion, face: &Face, meets: f64, what: &str) {
        if gap(motion, face, 0.0) <= 2.0 * SWEEP_TOLERANCE_M {
            return;
        }
        self.free += 1;
        let hit = face.surface().sweep_moving(motion).unwrap_or_else(|| panic!("{what}: missed"));
        assert!(hit.time <= meets + 1e-9, "{what}: at {} instead of {meets}", hit.time);
        self.early += usize::from(gap(motion, face, hit.time) > 2.0 * SWEEP_TOLERANCE_M);
    }

    fn assert_enough(&self, kind: Kind) {
        let Self { free, early } = *self;
        assert!(free > QUERIES as usize / 10 && early * 50 < free, "{kind:?}: {self:?}");
    }
}

#[test]
fn no_vertex_passes_a_face() {
    for kind in KINDS {
        let mut count = Count::default();
        for seed in 0..QUERIES {
            let mut random = Rng::with_seed(seed);
            let face = Face::random(&mut random, kind);
            let meets = random.f64();
            let at = face.at(meets);
            let (p, v) = (point(&at, place(&mut random, kind)), velocity(&mut random, &at, kind));
            let (start, end) = (p - v * meets, p + v * (1.0 - meets));
            let motion = CapsuleMotion { start: [start; 2], end: [end; 2], radius: RADIUS_M };
            count.sweep(&motion, &face, meets, &format!("{kind:?}, query {seed}"));
        }
        count.assert_enough(kind);
    }
}

#[test]
fn no_edge_passes_an_edge() {
    for kind in [Kind::General, Kind::InThePlane, Kind::Thin] {
        let mut count = Count::default();
        for seed in 0..QUERIES {
            let mut random = Rng::with_seed(seed);
            let face = Face::random(&mut random, kind);
            let meets = random.f64();
            let at = face.at(meets);
            let p = point(&at, place(&mut random, Kind::OnTheRim));
            let along = vector(&mut random, 0.05);
            let share = random.f64();
            let ends = [p - along * share, p + along * (1.0 - share)];
            let velocities = [velocity(&mut random, &at, kind), velocity(&mut random, &at, kind)];
            // The point of the edge that meets moves by the weighted mean of both, so the edge passes `p`.
            let motion = CapsuleMotion {
                start: [0, 1].map(|i| ends[i] - velocities[i] * meets),
                end: [0, 1].map(|i| ends[i] + velocities[i] * (1.0 - meets)),
                radius: RADIUS_M,
            };
            count.sweep(&motion, &face, meets, &format!("{kind:?}, query {seed}"));
        }
        count.assert_enough(kind);
    }
}
