//! How fast the connected parts of a body turn.

use nalgebra::{Matrix3, Vector3};

use super::parts::LooseParts;
use super::state::State;

/// Measures how fast connected parts turn, and slows free ones.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct SpinGuard {
    parts: Vec<Spin>,
    /// Smallest radius of gyration of a free part at rest about any of its axes [m]; infinite if none is
    /// free.
    least_radius: f64,
}

#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Spin {
    mass: f64,
    /// Σ m x, Σ m v.
    moment: Vector3<f64>,
    momentum: Vector3<f64>,
    /// Angular momentum and inertia about the centre of mass.
    angular: Vector3<f64>,
    inertia: Matrix3<f64>,
}

impl Spin {
    fn centre(&self) -> Vector3<f64> {
        self.moment / self.mass
    }

    /// J⁻¹ L [rad/s].
    fn velocity(&self) -> Vector3<f64> {
        let floor = 1e-9 * self.inertia.trace();
        let J = self.inertia + Matrix3::from_diagonal_element(floor);
        J.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * self.angular)
    }
}

impl SpinGuard {
    /// Makes room for `parts` parts.
    pub fn resize(&mut self, parts: usize) {
        self.parts.resize(parts, Spin::default());
    }

    /// Adapts to the present parts, whose copies rest at `rest` [m].
    pub fn follow(&mut self, rest: &[Vector3<f64>], mass: &[f64], parts: &LooseParts) {
        self.resize(parts.len());
        self.least_radius = f64::INFINITY;
        if !parts.any_free() {
            return;
        }
        self.measure(rest, rest, mass, parts);
        for (spin, _) in self.parts.iter().zip(&parts.free).filter(|(spin, free)| **free && spin.mass > 0.0) {
            let least = spin.inertia.symmetric_eigenvalues().min().max(0.0);
            self.least_radius = self.least_radius.min((least / spin.mass).sqrt());
        }
    }

    /// Computes masses, momenta and inertia of all parts.
    fn measure(&mut self, x: &[Vector3<f64>], v: &[Vector3<f64>], mass: &[f64], parts: &LooseParts) {
        self.parts.fill(Spin::default());
        for (c, &m) in mass.iter().enumerate() {
            let part = &mut self.parts[parts.of_copy[c] as usize];
            part.mass += m;
            part.moment += m * x[c];
            part.momentum += m * v[c];
        }
        for (c, &m) in mass.iter().enumerate() {
            let part = &mut self.parts[parts.of_copy[c] as usize];
            if part.mass > 0.0 {
                let d = x[c] - part.centre();
                part.angular += m * d.cross(&(v[c] - part.momentum / part.mass));
                part.inertia += m * (Matrix3::from_diagonal_element(d.norm_squared()) - d * d.transpose());
            }
        }
    }

    /// Largest angular velocity |J⁻¹ L| of a part [rad/s].
    pub fn fastest(&mut self, state: &State, mass: &[f64], parts: &LooseParts) -> f64 {
        self.measure(&state.x, &state.v, mass, parts);
        self.parts.iter().map(|part| part.velocity().norm()).fold(0.0, f64::max)
    }

    /// Whether a free part turns by more than `angle` [rad] in a step of `h` [s]. Parts with less than a
    /// thousandth of the mass do not count. If no copy is fast enough, nothing is measured.
    pub fn exceeds(
        &mut self,
        state: &State,
        mass: &[f64],
        parts: &LooseParts,
        (h, angle): (f64, f64),
    ) -> bool {
        if self.too_slow(state, angle / h) {
            return false;
        }
        self.measure(&state.x, &state.v, mass, parts);
        let least = 1e-3 * mass.iter().sum::<f64>();
        let counted = self.parts.iter().zip(&parts.free).filter(|(part, free)| **free && part.mass >= least);
        counted.into_iter().any(|(part, _)| h * part.velocity().norm() > angle)
    }

    /// Whether no copy is fast enough for a free part to turn at `omega` [rad/s].
    fn too_slow(&self, state: &State, omega: f64) -> bool {
        // Half the radius at rest, because a part may be crushed.
        let slow = 0.5 * self.least_radius * omega;
        state.v.iter().all(|v| v.norm_squared() <= slow * slow)
    }

    /// Slows the spin of free parts that turn by more than `largest` [rad] in a step of `h` [s] to that;
    /// momentum and deformation stay. Returns the largest angle [rad] of a part that was slowed.
    ///
    /// If no copy is fast enough for such a turn, nothing is measured.
    pub fn limit(
        &mut self,
        state: &mut State,
        mass: &[f64],
        parts: &LooseParts,
        (h, largest): (f64, f64),
    ) -> Option<f64> {
        if self.too_slow(state, largest / h) {
            return None;
        }
        self.measure(&state.x, &state.v, mass, parts);
        let mut most = None;
        for part in (0..parts.len()).filter(|&part| parts.free[part]) {
            let spin = self.parts[part];
            let omega = spin.velocity();
            let angle = h * omega.norm();
            if angle > largest {
                most = Some(angle.max(most.unwrap_or(0.0)));
                let away = (1.0 - largest / angle) * omega;
                for (c, _) in parts.of_copy.iter().enumerate().filter(|(_, p)| **p as usize == part) {
                    state.v[c] -= away.cross(&(state.x[c] - spin.centre()));
                }
            }
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron that turns with `omega` and moves on, and one that is held.
    fn state(omega: Vector3<f64>) -> (State, Vec<f64>, LooseParts) {
        let corners = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
        let x: Vec<Vector3<f64>> = corners.iter().chain(&corners).copied().collect();
        let v = x.iter().map(|x| omega.cross(x) + Vector3::new(1.0, 2.0, 3.0)).collect();
        let parts =
            LooseParts { of_copy: [[0; 4], [1; 4]].concat(), mass: vec![4.0; 2], free: vec![true, false] };
        (State { x, v, ..State::default() }, vec![1.0; 8], parts)
    }

    #[test]
    fn slows_a_free_spin_and_nothing_else() {
        let omega = Vector3::new(3.0, -2.0, 6.0); // 7 rad/s
        let (mut state, mass, parts) = state(omega);
        let mut guard = SpinGuard::default();
        guard.follow(&state.x.clone(), &mass, &parts);
        assert!((guard.fastest(&state, &mass, &parts) - 7.0).abs() < 1e-6);
        let before = state.clone();
        assert_eq!(guard.limit(&mut state, &mass, &parts, (1.0, 7.1)), None);
        assert_eq!(state, before);
        let angle = guard.limit(&mut state, &mass, &parts, (2.0, 7.0)).unwrap_or(0.0);
        assert!((angle - 14.0).abs() < 1e-6);
        let momentum = |state: &State| state.v[..4].iter().sum::<Vector3<f64>>();
        assert!((momentum(&state) - momentum(&before)).norm() < 1e-12);
        let turn = (state.v[1] - state.v[0]).dot(&Vector3::y());
        assert!((turn - 0.5 * omega.z).abs() < 1e-6, "{turn}");
        assert_eq!(state.v[4..], before.v[4..]);
    }
}
