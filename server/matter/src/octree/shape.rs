//! What a solid must answer so that cells can fill it.

use nalgebra::Vector3;

/// A solid whose cells an octree fills.
pub trait Shape: Sync {
    /// Lowest and highest corner of a box around it [m].
    fn bounds(&self) -> [Vector3<f64>; 2];

    /// Whether `p` [m] is inside.
    fn contains(&self, p: &Vector3<f64>) -> bool;

    /// Whether the points of a row are inside. They lie on a line at equal distances, `point` gives them by
    /// number. An implementation may share work between them, but its answers are those of
    /// [`contains`](Self::contains).
    fn contains_row(&self, point: &dyn Fn(usize) -> Vector3<f64>, inside: &mut [bool]) {
        inside.iter_mut().enumerate().for_each(|(i, inside)| *inside = self.contains(&point(i)));
    }

    /// The first crossing of the boundary on the way from `a` to `b` [m]: its fraction of the way in 0 … 1 and
    /// the outward unit normal there.
    fn crossing(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)>;
}

/// A box with faces across the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxShape {
    /// Lowest corner [m].
    pub min: Vector3<f64>,
    /// Highest corner [m].
    pub max: Vector3<f64>,
}

impl Shape for BoxShape {
    fn bounds(&self) -> [Vector3<f64>; 2] {
        [self.min, self.max]
    }

    fn contains(&self, p: &Vector3<f64>) -> bool {
        (0..3).all(|k| self.min[k] <= p[k] && p[k] <= self.max[k])
    }

    fn crossing(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        if self.contains(a) == self.contains(b) {
            return None;
        }
        // From inside, the way ends at the nearest plane ahead; from outside, it begins at the farthest.
        let leaves = self.contains(a);
        let mut found: Option<(f64, Vector3<f64>)> = None;
        for k in 0..3 {
            for (plane, sign) in [(self.min[k], -1.0), (self.max[k], 1.0)] {
                let outward = sign * (b[k] - a[k]);
                if outward == 0.0 || (outward > 0.0) != leaves {
                    continue;
                }
                let t = ((plane - a[k]) / (b[k] - a[k])).clamp(0.0, 1.0);
                if found.is_none_or(|(best, _)| if leaves { t < best } else { t > best }) {
                    found = Some((t, Vector3::ith(k, sign)));
                }
            }
        }
        found
    }
}
