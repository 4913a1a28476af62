//! The directions in which a point is held: world axes, or any direction of space.

use nalgebra::{Matrix3, RealField, Vector3};

use crate::storage::padded::Padded;

/// Directions closer than this (sine of the angle between them) count as the same one.
const SAME_DIRECTION: f64 = 1e-6;

/// A distance below this part of a coordinate is rounding: three products, their sum, and the sums before them.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The directions in which a point is held; it is free in all others.
///
/// They span a subspace. H is the projection onto it and P = 1 − H the filter, which leaves what is free: P = 1 − n nᵀ
/// for a roller on a plane with the normal n, and P = t tᵀ for a rail along t. Both are symmetric, so that P A P is.
///
/// # Source
/// Baraff, Witkin 1998, *Large steps in cloth simulation*, §5.1 and §5.3.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Held {
    /// Along some of x, y, z. Such components are set, not projected, so they have no rounding.
    Axes([bool; 3]),
    /// Along this unit vector n: the point moves in a plane.
    Along([f64; 3]),
    /// Across this unit vector t: the point moves along a line.
    Across([f64; 3]),
}

impl From<[bool; 3]> for Held {
    fn from(axes: [bool; 3]) -> Self {
        Self::Axes(axes)
    }
}

impl Held {
    /// Free in all directions.
    pub const NOT: Self = Self::Axes([false; 3]);
    /// Held in all directions.
    pub const FULLY: Self = Self::Axes([true; 3]);

    /// Held along `normal`, of any length: a roller. `None` if it has no direction.
    pub fn along(normal: Vector3<f64>) -> Option<Self> {
        let n = unit(normal)?;
        Some(match axis_of(&n) {
            Some(axis) => Self::Axes([0, 1, 2].map(|k| k == axis)),
            None => Self::Along(n.into()),
        })
    }

    /// Held across `rail`, of any length: free along it only. `None` if it has no direction.
    pub fn across(rail: Vector3<f64>) -> Option<Self> {
        let t = unit(rail)?;
        Some(match axis_of(&t) {
            Some(axis) => Self::Axes([0, 1, 2].map(|k| k != axis)),
            None => Self::Across(t.into()),
        })
    }

    /// The held axes, if it is held along world axes only.
    pub fn axes(&self) -> Option<[bool; 3]> {
        match self {
            Self::Axes(axes) => Some(*axes),
            Self::Along(_) | Self::Across(_) => None,
        }
    }

    /// Whether a held direction is not a world axis.
    pub fn is_inclined(&self) -> bool {
        self.axes().is_none()
    }

    /// Whether it is held in any direction.
    pub fn any(&self) -> bool {
        *self != Self::NOT
    }

    /// Number of held directions.
    pub fn count(&self) -> usize {
        match self {
            Self::Axes(axes) => axes.iter().filter(|held| **held).count(),
            Self::Along(_) => 1,
            Self::Across(_) => 2,
        }
    }

    /// Orthonormal held directions.
    pub fn directions(&self) -> impl Iterator<Item = Vector3<f64>> {
        let found = match self {
            Self::Axes(axes) => [0, 1, 2].map(|k| axes[k].then(|| Vector3::ith(k, 1.0))),
            Self::Along(n) => [Some(Vector3::from(*n)), None, None],
            Self::Across(t) => {
                let t = Vector3::from(*t);
                let a = t.cross(&Vector3::ith(t.iamin(), 1.0)).normalize();
                [Some(a), Some(t.cross(&a)), None]
            }
        };
        found.into_iter().flatten()
    }

    /// H, the projection onto the held directions.
    pub fn projection(&self) -> Matrix3<f64> {
        match self {
            Self::Axes(axes) => {
                Matrix3::from_diagonal(&Vector3::from_fn(|k, _| f64::from(u8::from(axes[k]))))
            }
            Self::Along(n) => Vector3::from(*n) * Vector3::from(*n).transpose(),
            Self::Across(t) => Matrix3::identity() - Vector3::from(*t) * Vector3::from(*t).transpose(),
        }
    }

    /// P, the filter: the projection onto the free directions.
    pub fn filter(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.projection()
    }

    /// v ← P v.
    #[inline]
    pub fn clear<T: RealField + Copy>(&self, v: &mut Vector3<T>) {
        match self {
            Self::Axes(axes) => (0..3).filter(|&k| axes[k]).for_each(|k| v[k] = T::zero()),
            Self::Along(n) => {
                let n = Vector3::from(*n).map(nalgebra::convert::<f64, T>);
                *v -= n * n.dot(v);
            }
            Self::Across(t) => {
                let t = Vector3::from(*t).map(nalgebra::convert::<f64, T>);
                *v = t * t.dot(v);
            }
        }
    }

    /// v ← P v.
    #[inline]
    pub fn clear_padded(&self, v: &mut Padded) {
        match self {
            Self::Axes(axes) => (0..3).filter(|&k| axes[k]).for_each(|k| v[k] = 0.0),
            // The unused component is 0 and stays so.
            _ => {
                let mut w = Vector3::new(v[0], v[1], v[2]).map(f64::from);
                self.clear(&mut w);
                (0..3).for_each(|k| v[k] = w[k] as f32);
            }
        }
    }

    /// H v.
    pub fn part_of(&self, v: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Axes(axes) => Vector3::from_fn(|k, _| if axes[k] { v[k] } else { 0.0 }),
            _ => {
                let mut free = *v;
                self.clear(&mut free);
                v - free
            }
        }
    }

    /// The way H (target − x) that is left to the held position; 0 if it is rounding.
    pub fn gap(&self, x: &Vector3<f64>, target: &[f64; 3]) -> Vector3<f64> {
        let target = Vector3::from(*target);
        let gap = self.part_of(&(target - x));
        let rounding = ROUNDING * (x.amax() + target.amax());
        if self.is_inclined() && gap.amax() <= rounding { Vector3::zeros() } else { gap }
    }

    /// x ← P x + H target. A point that is there already keeps its bits.
    #[inline]
    pub fn place(&self, x: &mut Vector3<f64>, target: &[f64; 3]) {
        match self {
            Self::Axes(axes) => (0..3).filter(|&k| axes[k]).for_each(|k| x[k] = target[k]),
            _ => *x += self.gap(x, target),
        }
    }

    /// Held in the directions of both, and the vector with the held parts of both: `ours` is that of `self`, and where
    /// the two disagree, `theirs` counts.
    pub fn with(&self, ours: &Vector3<f64>, other: &Self, theirs: &Vector3<f64>) -> (Self, Vector3<f64>) {
        if let (Some(mut axes), Some(new)) = (self.axes(), other.axes()) {
            (0..3).for_each(|k| axes[k] |= new[k]);
            return (Self::Axes(axes), Vector3::from_fn(|k, _| if new[k] { theirs[k] } else { ours[k] }));
        }
        let mut basis: Vec<Vector3<f64>> = other.directions().collect();
        let mut sum: Vector3<f64> = other.part_of(theirs);
        for e in self.directions() {
            let rest = basis.iter().fold(e, |rest, b| rest - b * b.dot(&e));
            if rest.norm() > SAME_DIRECTION {
                // Along `rest` the sum has to become what is missing of e · ours.
                let value = (e.dot(ours) - e.dot(&sum)) / rest.norm();
                basis.push(rest.normalize());
                sum += rest.normalize() * value;
            }
        }
        let both = match basis[..] {
            [] => Some(Self::NOT),
            [n] => Self::along(n),
            [a, b] => Self::across(a.cross(&b)),
            _ => Some(Self::FULLY),
        };
        (both.unwrap_or(Self::NOT), sum)
    }

    /// Held in the directions that both share.
    pub fn shared(&self, other: &Self) -> Self {
        if let (Some(a), Some(b)) = (self.axes(), other.axes()) {
            return Self::Axes([0, 1, 2].map(|k| a[k] && b[k]));
        }
        if self.covers(other) {
            return *other;
        }
        if other.covers(self) {
            return *self;
        }
        // Two different lines have nothing in common; two planes share a line.
        if (self.count(), other.count()) != (2, 2) {
            return Self::NOT;
        }
        let [a, b] = [self, other].map(|held| largest_column(&held.filter()));
        Self::along(a.cross(&b)).unwrap_or(Self::NOT)
    }

    /// Whether every direction that `other` holds is held here too.
    pub fn covers(&self, other: &Self) -> bool {
        other.directions().all(|e| (e - self.part_of(&e)).norm() <= SAME_DIRECTION)
    }

    /// The block A without the held directions: P A P + s H.
    pub fn filter_block(&self, A: &Matrix3<f64>, s: f64) -> Matrix3<f64> {
        let (P, H) = (self.filter(), self.projection());
        P * A * P + H * s
    }
}

/// A copy whose displacement is prescribed in some directions.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FixedCopy {
    /// Index of the copy.
    pub copy: u32,
    /// The prescribed directions.
    pub held: Held,
    /// Prescribed position [m]; only its part in the directions of `held` is used.
    pub position_m: [f64; 3],
}

fn unit(v: Vector3<f64>) -> Option<Vector3<f64>> {
    // Scaled first, so that neither tiny nor huge vectors leave the range of their squares.
    let size = v.amax();
    (size > 0.0 && size.is_finite()).then(|| (v / size).normalize())
}

fn axis_of(n: &Vector3<f64>) -> Option<usize> {
    (0..3).find(|&k| n[k].abs() == 1.0)
}

fn largest_column(A: &Matrix3<f64>) -> Vector3<f64> {
    (0..3)
        .map(|k| A.column(k).into_owned())
        .fold(Vector3::zeros(), |a, b| if b.norm_squared() > a.norm_squared() { b } else { a })
}

#[cfg(test)]
#[path = "held_tests.rs"]
mod tests;
