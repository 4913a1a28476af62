//! Estimates the compliance of the tissue under a tool from the steps themselves.
//!
//! A one-sided spring with force f after a step is at depth f / k. A step therefore tells how far the tissue
//! moved (depth before minus depth after) for how much more force. For tissue of compliance c and viscosity β, a step of
//! implicit Euler of length h ends with
//!
//! (u + b Δu) / c = f, b = β/h.
//!
//! u is the sum of all Δu since the touch began, so the step gives c, and c / (1 + b) is the compliance that a prediction
//! over one step needs. Where the tool has slid on to other tissue, u is not known.

use nalgebra::Vector3;

/// Least force from which a step tells anything [N].
const LEAST_FORCE_N: f64 = 0.02;
/// Way along the surface after which the tissue is another one, in radii of the patch.
const SLID_RADII: f64 = 0.3;
/// Weight of a new sample in the running mean.
const LEARNING: f64 = 0.2;
/// Largest factor, up or down, between the estimate and the first guess.
const LIMIT: f64 = 20.0;

/// Stiffness of a contact over E a. A rigid punch of radius a has 2 / (1 − ν²), 2.5 for soft tissue (Boussinesq), and a
/// ball bears on about two thirds of its radius.
const PUNCH: f64 = 5.0 / 3.0;

/// Running estimate of the compliance under one tool in a step [m/N].
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Compliance {
    guess: f64,
    estimate: f64,
    /// b = β/h.
    viscous: f64,
    radius_m: f64,
    /// Motion of the tissue since the touch began [m].
    moved_m: f64,
    /// Where the tool was then [m]; none while nothing is touched.
    began_m: Option<Vector3<f64>>,
}

impl Compliance {
    /// Starts from the stiffness of tissue with Young's modulus `young_pa` [Pa] under a punch of radius
    /// `patch_radius_m` [m]. `viscous` is b = β/h, the viscosity over the length of a step.
    pub fn new(young_pa: f64, patch_radius_m: f64, viscous: f64) -> Self {
        let guess = 1.0 / ((PUNCH * young_pa * patch_radius_m).clamp(1.0, 1e6) * (1.0 + viscous));
        Self { guess, estimate: guess, viscous, radius_m: patch_radius_m, moved_m: 0.0, began_m: None }
    }

    /// The present estimate for one step [m/N].
    pub fn value(&self) -> f64 {
        self.estimate
    }

    /// Learns from one step: depths before and after [m], the normal force after [N], and where the tool is [m], which
    /// the tissue pushes along `normal`.
    pub fn learn(
        &mut self,
        [before, after]: [f64; 2],
        force: f64,
        (at, normal): (Vector3<f64>, Vector3<f64>),
    ) {
        let way = at - *self.began_m.get_or_insert(at);
        let slid = (way - normal * normal.dot(&way)).norm();
        let moved = before - after;
        self.moved_m += moved;
        let sample = (self.moved_m + self.viscous * moved) / force / (1.0 + self.viscous);
        let told = force >= LEAST_FORCE_N && slid <= SLID_RADII * self.radius_m;
        if !told || !sample.is_finite() || sample <= 0.0 {
            return;
        }
        let sample = sample.clamp(self.guess / LIMIT, self.guess * LIMIT);
        self.estimate += LEARNING * (sample - self.estimate);
    }

    /// Ends the contact. The next one begins without force, but with the present estimate.
    pub fn release(&mut self) {
        (self.moved_m, self.began_m) = (0.0, None);
    }

    /// Stiffness of tool and tissue in series [N/m].
    pub fn in_series_with(&self, tool_stiffness: f64) -> f64 {
        1.0 / (1.0 / tool_stiffness + self.estimate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn learns_the_stiffness_of_a_spring_and_stays_within_limits() {
        let (k_tool, k_tissue) = (800.0, 300.0);
        let still = (Vector3::zeros(), Vector3::z());
        for b in [0.0, 1.0, 5.0] {
            let mut compliance = Compliance::new(3e5, 0.005, b);
            let (mut indentation, mut force) = (0.0, 0.0);
            for step in 1..40 {
                let device = 1e-4 * f64::from(step);
                let depth_before = device - indentation;
                // k_tissue (u + b Δu) = k_tool (device − u).
                let moved =
                    (k_tool * depth_before - k_tissue * indentation) / (k_tool + k_tissue * (1.0 + b));
                indentation += moved;
                force = k_tool * (device - indentation);
                compliance.learn([depth_before, device - indentation], force, still);
            }
            assert!(force > 0.5);
            assert!((compliance.value() * k_tissue * (1.0 + b) - 1.0).abs() < 0.01, "{b}");
            compliance.learn([1.0, 0.0], force + 0.1, still);
            assert!(compliance.value() <= 20.0 / 2500.0);
        }
        let mut compliance = Compliance::new(3e5, 0.005, 0.0);
        compliance.learn([f64::NAN, 0.0], 5.0, still);
        assert!(compliance.value().is_finite());
    }
}
