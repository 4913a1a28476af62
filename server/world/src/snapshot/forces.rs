//! Forces of contact as other threads see them.

use std::ops::Range;

use nalgebra::Vector3;

/// Most pairs that are listed; those with the largest forces.
pub const MAX_FORCE_PAIRS: usize = 64;

/// Most points of a pair that are listed; those with the largest forces.
pub const MAX_FORCE_POINTS: usize = 32;

/// All contacts of a step; empty when nobody asked. The buffers are reused.
#[derive(Debug, Clone, Default)]
pub struct Forces {
    /// Whether somebody asked.
    pub asked: bool,
    /// What touches what.
    pub pairs: Vec<ForcePair>,
    /// Points of contact, those of a pair together.
    pub points: Vec<ForcePoint>,
}

/// What a body is touched by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ForceKind {
    /// A tool.
    #[default]
    Tool,
    /// A fixed obstacle of the scene.
    Obstacle,
    /// Another body.
    Body,
    /// Another part of the same body.
    Itself,
}

/// Contact of a body with one other thing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ForcePair {
    /// What touches it.
    pub kind: ForceKind,
    /// The body, by its place in the scene.
    pub on: u32,
    /// The tool, obstacle or body that touches it, by its place among its kind.
    pub by: u32,
    /// Points that are pushed or held.
    pub contacts: u32,
    /// Largest depth [m].
    pub deepest_m: f64,
    /// Sum of the forces on the body `on` [N].
    pub force_n: Vector3<f64>,
    /// Sum of the normal forces [N].
    pub normal_n: f64,
    /// Its points in [`Forces::points`]: first and count.
    pub(crate) points: (u32, u32),
}

/// One point of contact.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ForcePoint {
    /// Where [m].
    pub point_m: Vector3<f64>,
    /// Unit vector in which the body `on` is pushed; that of the force where a tool holds it.
    pub normal: Vector3<f64>,
    /// Depth that the solve has left [m]; 0 where a tool holds it.
    pub depth_m: f64,
    /// Force along the normal [N].
    pub normal_n: f64,
    /// Force across it: friction [N].
    pub tangential_n: Vector3<f64>,
}

impl ForcePoint {
    /// Size of the force [N].
    pub fn size_n(&self) -> f64 {
        self.normal_n.hypot(self.tangential_n.norm())
    }

    /// The force on the body `on` [N].
    pub fn force_n(&self) -> Vector3<f64> {
        self.normal_n * self.normal + self.tangential_n
    }
}

impl Forces {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.asked = false;
        self.pairs.clear();
        self.points.clear();
    }

    /// The points of a pair.
    pub fn points_of(&self, pair: &ForcePair) -> &[ForcePoint] {
        self.points.get(pair.range()).unwrap_or_default()
    }

    /// Adds a pair, whose points are those that `points` adds. The strongest of them are kept.
    pub(crate) fn add(&mut self, pair: ForcePair, points: impl Iterator<Item = ForcePoint>) {
        let first = self.points.len();
        self.points.extend(points);
        let own = &mut self.points[first..];
        own.sort_unstable_by(|a, b| b.size_n().total_cmp(&a.size_n()));
        self.points.truncate(first + MAX_FORCE_POINTS);
        let count = self.points.len() - first;
        self.pairs.push(ForcePair { points: (first as u32, count as u32), ..pair });
    }

    /// Keeps the pairs with the largest forces.
    pub(crate) fn keep_strongest(&mut self) {
        if self.pairs.len() > MAX_FORCE_PAIRS {
            self.pairs.sort_by(|a, b| b.force_n.norm().total_cmp(&a.force_n.norm()));
            self.pairs.truncate(MAX_FORCE_PAIRS);
        }
    }
}

impl ForcePair {
    fn range(&self) -> Range<usize> {
        let (first, count) = (self.points.0 as usize, self.points.1 as usize);
        first..first + count
    }
}
