//! Distance of a run from the reference, in three relative measures.

use serde::{Deserialize, Serialize};

use crate::trial::series::Series;

/// The one number that the user of a case wants to know.
#[derive(Debug, Clone, PartialEq)]
pub struct Goal {
    /// Description, such as `deflection of the tip`.
    pub words: String,
    /// Index of the probe; `None` for the probe that moves furthest.
    pub probe: Option<usize>,
    /// Direction in which the displacement is measured; `None` for its magnitude.
    pub direction: Option<[f64; 3]>,
}

impl Goal {
    /// The displacement of probe `probe` in `direction`.
    pub fn new(words: &str, probe: usize, direction: [f64; 3]) -> Self {
        Self { words: words.to_owned(), probe: Some(probe), direction: Some(direction) }
    }

    /// The goal at one instant [m].
    fn at(&self, displacement_m: &[f64]) -> f64 {
        let probes = displacement_m.chunks_exact(3).enumerate();
        let wanted = probes.filter(|(i, _)| self.probe.is_none_or(|probe| probe == *i));
        wanted.map(|(_, u)| self.measure(u)).fold(0.0, larger)
    }

    fn measure(&self, u: &[f64]) -> f64 {
        match self.direction {
            Some(direction) => u.iter().zip(direction).map(|(u, d)| u * d).sum(),
            None => u.iter().map(|u| u * u).sum::<f64>().sqrt(),
        }
    }

    /// The goal [m]: its value in a static solution, or its value of largest magnitude over a motion.
    pub fn of(&self, series: &Series) -> f64 {
        (0..series.frames.len()).map(|i| self.at(series.at(i))).fold(0.0, larger)
    }
}

/// The number of larger magnitude.
fn larger(a: f64, b: f64) -> f64 {
    if b.abs() > a.abs() { b } else { a }
}

/// Relative errors of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// ‖u − u*‖ / ‖u*‖ over all probes and instants.
    pub l2: f64,
    /// |Ψ − Ψ*| / Ψ*, or √Σ(Ψ−Ψ*)² / √ΣΨ*² for a motion; Ψ is the elastic energy.
    pub energy: f64,
    /// |J − J*| / |J*|; J is the goal.
    pub goal: f64,
}

impl Errors {
    /// Compares two series at their common instants. `goal_reference` replaces the goal of `reference` where
    /// it is known better.
    pub fn of(series: &Series, reference: &Series, goal: &Goal, goal_reference: Option<f64>) -> Self {
        let difference = series.minus(reference);
        let right = reference.at_instants_of(series);
        let known = goal_reference.unwrap_or_else(|| goal.of(&right));
        Self {
            l2: difference.norm() / right.norm(),
            energy: difference.energy_norm() / right.energy_norm(),
            goal: (goal.of(&series.at_instants_of(reference)) - known).abs() / known.abs(),
        }
    }

    /// Estimates the relative error in the energy norm from the energy: √(|Ψ − Ψ*| / Ψ*). For linear statics
    /// under given loads it equals ‖u − u*‖_E / ‖u*‖_E; otherwise it is an indicator.
    pub fn energy_norm(&self) -> f64 {
        self.energy.sqrt()
    }

    /// Whether all three errors are finite.
    pub fn is_finite(&self) -> bool {
        self.l2.is_finite() && self.energy.is_finite() && self.goal.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_errors_of_a_static_solution() {
        let of =
            |u: f64, e: f64| Series { frames: vec![0], displacement_m: vec![0.0, u, 0.0], energy_j: vec![e] };
        let goal = Goal::new("", 0, [0.0, -1.0, 0.0]);
        let errors = Errors::of(&of(-0.9, 1.9), &of(-1.0, 2.0), &goal, None);
        assert!((errors.l2 - 0.1).abs() < 1e-12 && (errors.goal - 0.1).abs() < 1e-12);
        assert!((errors.energy - 0.05).abs() < 1e-12);
        let errors = Errors::of(&of(-0.9, 1.9), &of(-1.0, 2.0), &goal, Some(0.8));
        assert!((errors.goal - 0.125).abs() < 1e-12);
    }

    #[test]
    fn the_goal_of_a_motion_is_its_largest_amount() {
        let motion = Series {
            frames: vec![1, 2, 3],
            displacement_m: vec![0.0, -0.2, 0.0, 0.0, -0.7, 0.0, 0.0, 0.1, 0.0],
            energy_j: vec![0.0; 3],
        };
        let goal = Goal::new("", 0, [0.0, 1.0, 0.0]);
        assert!((goal.of(&motion) + 0.7).abs() < 1e-12);
    }
}
