//! Continuity of the rendered force: a new model replaces the last one without a step in force, and a touched
//! feature keeps its number while the tool slides.

use nalgebra::Vector3;

use super::plane::{BLEND_FEATURE, ContactMode, ContactPlane, LocalContact, MAX_CONTACTS};

/// Difference of force too small to be felt, below which nothing is blended [N].
const UNFELT_N: f64 = 1e-6;
/// Least cosine between the normals of two planes that may be the same feature.
const ALIKE: f64 = 0.9;

/// Source of feature numbers.
#[derive(Debug, Clone, Default)]
pub struct FeatureNumbers {
    last: u64,
}

impl FeatureNumbers {
    /// Numbers the planes of `new`. A plane close to one of `old` with a similar normal keeps its number.
    pub fn carry_over(&mut self, old: &LocalContact, new: &mut LocalContact) {
        let mut taken = [false; MAX_CONTACTS];
        for plane in &mut new.planes {
            let same = |candidate: &ContactPlane| {
                candidate.feature_id != BLEND_FEATURE
                    && candidate.edge_of == plane.edge_of
                    && candidate.normal.dot(&plane.normal) > ALIKE
                    && (candidate.point_m - plane.point_m).norm() < 2.0 * plane.patch_radius_m
            };
            let known = old.planes.iter().enumerate().position(|(i, p)| !taken[i] && same(p));
            plane.feature_id = match known {
                Some(i) => {
                    taken[i] = true;
                    old.planes[i].feature_id
                }
                None => {
                    self.last += 1;
                    self.last
                }
            };
        }
    }
}

/// Limits the change of force between two models at the pose of `new` to `limit_n` [N]. It adds a plane of
/// constant force to `new` that compensates the excess. Every model is compared with the one before, so a
/// larger change is spread over several models, `limit_n` each.
pub fn limit_step(old: &LocalContact, new: &mut LocalContact, limit_n: f64) {
    let before = old.force_at(new.pose_used.translation.vector);
    let now = new.force_at(new.pose_used.translation.vector);
    let change = now - before;
    let excess = change.norm() - limit_n;
    if excess <= UNFELT_N {
        return;
    }
    let made_up: Vector3<f64> = change * (-excess / change.norm());
    // The blend needs a plane of its own. The last plane matters least.
    new.planes.truncate(MAX_CONTACTS - 1);
    new.planes.push(ContactPlane {
        point_m: new.pose_used.translation.vector,
        normal: made_up.normalize(),
        force_n: made_up,
        feature_id: BLEND_FEATURE,
        ..ContactPlane::NONE
    });
    if new.mode == ContactMode::Free {
        new.mode = ContactMode::Contact;
    }
}
