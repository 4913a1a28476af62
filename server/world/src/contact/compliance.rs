//! Estimates the compliance of the tissue under a tool from the steps themselves.
//!
//! A one-sided spring with force f after a step is at depth f / k. A step therefore tells how far the tissue
//! moved (depth before minus depth after) for how much more force. The ratio is the compliance that a
//! prediction over one step needs. Inertia and damping are included.

/// Least change of force from which a step tells anything [N], and the same relative to the force.
const LEAST_CHANGE_N: f64 = 1e-3;
const LEAST_CHANGE: f64 = 0.02;
/// Weight of a new sample in the running mean.
const LEARNING: f64 = 0.2;
/// Largest factor, up or down, between the estimate and the first guess.
const LIMIT: f64 = 20.0;

/// Running estimate of the compliance under one tool [m/N].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compliance {
    guess: f64,
    estimate: f64,
    force_before: f64,
}

impl Compliance {
    /// Starts from the stiffness `E a` of tissue with Young's modulus `E` [Pa] under a patch of radius `a`
    /// [m]. That is within a factor of two of Boussinesq's punch, and the same for every mesh.
    pub fn new(young_pa: f64, patch_radius_m: f64) -> Self {
        let guess = 1.0 / (young_pa * patch_radius_m).clamp(1.0, 1e6);
        Self { guess, estimate: guess, force_before: 0.0 }
    }

    /// The present estimate [m/N].
    pub fn value(&self) -> f64 {
        self.estimate
    }

    /// Learns from one step: depths before and after [m], and the normal force after [N].
    pub fn learn(&mut self, depth_before: f64, depth_after: f64, force: f64) {
        let change = force - self.force_before;
        self.force_before = force;
        let sample = (depth_before - depth_after) / change;
        let least = LEAST_CHANGE_N.max(LEAST_CHANGE * force.abs());
        if change.abs() < least || !sample.is_finite() || sample <= 0.0 {
            return;
        }
        let sample = sample.clamp(self.guess / LIMIT, self.guess * LIMIT);
        self.estimate += LEARNING * (sample - self.estimate);
    }

    /// Ends the contact. The next one begins without force, but with the present estimate.
    pub fn release(&mut self) {
        self.force_before = 0.0;
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
        let mut compliance = Compliance::new(3e5, 0.005);
        let (mut indentation, mut force) = (0.0, 0.0);
        for step in 1..40 {
            let device = 1e-4 * f64::from(step);
            let depth_before = device - indentation;
            force = device / (1.0 / k_tool + 1.0 / k_tissue);
            indentation = force / k_tissue;
            compliance.learn(depth_before, device - indentation, force);
        }
        assert!(force > 0.8);
        // The tissue also yielded in the step before, so the sample is that of the tissue alone.
        assert!((compliance.value() * k_tissue - 1.0).abs() < 0.01);
        compliance.learn(1.0, 0.0, force + 0.1);
        assert!(compliance.value() <= 20.0 / 1500.0);
        compliance.learn(f64::NAN, 0.0, 5.0);
        assert!(compliance.value().is_finite());
    }
}
