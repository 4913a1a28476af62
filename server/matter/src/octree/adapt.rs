//! Which leaves should be divided or joined: fine where something happens, coarse behind.
//!
//! A leaf is divided as soon as one criterion asks for it, and eight are joined when every criterion has let go of
//! all of them. Each criterion lets go later than it grips, so a leaf does not change back and forth. One call
//! changes the level of a leaf by one at most.
//!
//! # Source
//! Bangerth, Rannacher 2003: Adaptive finite element methods for differential equations, §4 (refine and coarsen by
//! indicator). Popinet 2003: Gerris, §2.3 (octrees that follow the flow).

use nalgebra::Vector3;

use super::cells::Octree;
use super::coarsen::Family;
use super::lattice::At;

/// Where interior leaves are fine. A criterion that is `None` is off; without any, nothing changes.
///
/// Both values of a criterion: where leaves begin to be divided, and where they begin to be joined again.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AdaptSettings {
    /// Distance of a tool from the box around the deformed leaf [m]: below the first it is divided, above the
    /// second joined. The first is smaller.
    pub distance_m: Option<[f64; 2]>,
    /// Speed of the material, as the mean over the leaf [m/s]: above the first it is divided, below the second
    /// joined. The first is larger.
    pub speed_m_s: Option<[f64; 2]>,
    /// Estimated error of the leaf in the energy norm [√J]: above the first it is divided. Eight leaves are joined
    /// if the error expected of the joined leaf is below the second. The first is larger.
    pub error: Option<[f64; 2]>,
    /// Finest level that interior leaves are divided to; 0 has the size of those at the boundary.
    pub level: u8,
}

/// A criterion out of range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptError {
    /// The setting, as scenes write it.
    pub name: &'static str,
    /// Its two values.
    pub found: [f64; 2],
    /// Its range, in words.
    pub allowed: &'static str,
}

impl AdaptSettings {
    /// Whether no criterion is on.
    pub fn is_off(&self) -> bool {
        self.distance_m.is_none() && self.speed_m_s.is_none() && self.error.is_none()
    }

    /// # Errors
    /// Values that are not finite, negative, or without hysteresis.
    pub fn check(&self) -> Result<(), AdaptError> {
        let near = "two distances, 0 <= first < second";
        let large = "two numbers, first > second >= 0";
        for (name, pair, rises, allowed) in [
            ("distance_m", self.distance_m, true, near),
            ("speed_m_s", self.speed_m_s, false, large),
            ("error", self.error, false, large),
        ] {
            let Some(found) = pair else { continue };
            let [low, high] = if rises { found } else { [found[1], found[0]] };
            if !(0.0 <= low && low < high && high.is_finite()) {
                return Err(AdaptError { name, found, allowed });
            }
        }
        Ok(())
    }
}

/// What to change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Leaves to divide, ascending.
    pub refine: Vec<u32>,
    /// Families to join, in the order of their first leaves.
    pub coarsen: Vec<Family>,
}

impl Plan {
    /// Whether nothing is to change.
    pub fn is_empty(&self) -> bool {
        self.refine.is_empty() && self.coarsen.is_empty()
    }
}

/// The motion that decides.
#[derive(Clone, Copy, Debug)]
pub struct Activity<'a> {
    /// Position of every vertex [m].
    pub x: &'a [Vector3<f64>],
    /// Velocity of every vertex [m/s].
    pub v: &'a [Vector3<f64>],
    /// Places of tools [m].
    pub tools: &'a [Vector3<f64>],
    /// Estimated error of every leaf in the energy norm [√J]. While it is not known, nothing is divided for it,
    /// and nothing is joined.
    pub error: Option<&'a [f64]>,
}

impl Octree {
    /// What to change by `settings`. Only coarse leaves, and families that [may be
    /// joined](Self::can_join), are looked at. Nothing is allocated if nothing is to change.
    pub fn plan(&self, settings: &AdaptSettings, activity: &Activity<'_>) -> Plan {
        let mut plan = Plan::default();
        if settings.is_off() {
            return plan;
        }
        for (id, cell) in (0u32..).zip(&self.cells) {
            if cell.level > settings.level && self.is_active(id, settings, activity) {
                plan.refine.push(id);
            }
        }
        for cell in self.cells.iter().filter(|cell| cell.cut == 0 && cell.octant() == 0) {
            let family = Family { level: cell.level + 1, at: cell.at };
            if self.can_join(family) && self.is_quiet(family, settings, activity) {
                plan.coarsen.push(family);
            }
        }
        plan
    }

    fn is_active(&self, id: u32, settings: &AdaptSettings, activity: &Activity<'_>) -> bool {
        let AdaptSettings { distance_m, speed_m_s, error, .. } = settings;
        distance_m.is_some_and(|[near, _]| self.distance(&[id], activity) < near)
            || speed_m_s.is_some_and(|[fast, _]| self.mean(id, activity.v).norm() > fast)
            || error.is_some_and(|[large, _]| activity.error.is_some_and(|eta| eta[id as usize] > large))
    }

    fn is_quiet(&self, family: Family, settings: &AdaptSettings, activity: &Activity<'_>) -> bool {
        let AdaptSettings { distance_m, speed_m_s, error, .. } = settings;
        let half = 1 << (family.level - 1);
        let parts = [0, 1, 2, 3, 4, 5, 6, 7].map(|c: i32| {
            let at: At = [0, 1, 2].map(|k| family.at[k] + half * (c >> k & 1));
            self.map.leaf(at)
        });
        let slow = |slow: f64| parts.iter().all(|&id| self.mean(id, activity.v).norm() < slow);
        // The error of trilinear cells is of first order: twice that of its parts together.
        let expected =
            |eta: &[f64]| 2.0 * parts.iter().map(|&id| eta[id as usize].powi(2)).sum::<f64>().sqrt();
        distance_m.is_none_or(|[_, far]| self.distance(&parts, activity) > far)
            && speed_m_s.is_none_or(|[_, calm]| slow(calm))
            && error.is_none_or(|[_, small]| activity.error.is_some_and(|eta| expected(eta) < small))
    }

    /// Least distance of a tool from the box around these leaves in the deformed body [m].
    fn distance(&self, leaves: &[u32], activity: &Activity<'_>) -> f64 {
        if activity.tools.is_empty() {
            return f64::INFINITY;
        }
        let none = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
        let corners = leaves.iter().flat_map(|&id| self.corners(id, activity.x));
        let [low, high] = corners.fold(none, |[low, high], p| [low.inf(&p), high.sup(&p)]);
        let beyond = |p: &Vector3<f64>| (low - p).sup(&(p - high)).sup(&Vector3::zeros()).norm();
        activity.tools.iter().map(beyond).fold(f64::INFINITY, f64::min)
    }

    /// Mean of a field over a leaf.
    fn mean(&self, id: u32, values: &[Vector3<f64>]) -> Vector3<f64> {
        let integrals = self.shape_integrals(id as usize);
        let sum: Vector3<f64> =
            self.vertices[id as usize].iter().zip(integrals).map(|(&v, N)| N * values[v as usize]).sum();
        sum / self.cell_volume(id as usize)
    }
}
