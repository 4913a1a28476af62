//! Whether steps solve the equations of their scheme, judged by energy.
//!
//! The internal forces at the end of a step, −∂Ψ/∂x⁺, do no more work in it than the elastic energy Ψ that they release,
//! because Ψ curves upwards along the step; damping takes some of that. How much work they do, if the step solves its
//! equations, follows from everything else: accelerations, loads, springs. More work than was released is done by forces
//! that exist nowhere: by what one linear solve leaves of the equations. In a body that is stretched this may shake it for
//! ever, with every linear solve converged.
//!
//! Every excess is told, and several solves follow. Where material snaps through, that ends it. What shakes gains energy
//! again and again, and only this counts as trouble of the body.

/// Steps between two looks at the elastic energy.
const WINDOW: u32 = 16;
/// Steps that are solved until their equations hold after energy came from nowhere.
const CAREFUL: u32 = 64;
/// An excess that comes back within so many steps is known.
const AGAIN: u32 = 256;
/// Part of the energies that take part which may come from nowhere in so many steps.
const TOLERANCE: f64 = 0.01;

/// The work of the internal forces since the elastic energy was last computed.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Balance {
    steps: u32,
    work_j: f64,
    /// Elastic energy at the start of the window [J].
    stored_j: Option<f64>,
    /// Steps left that are solved with care.
    careful: u32,
    /// Steps left in which another excess is known.
    suspected: u32,
}

impl Balance {
    /// Begins anew: the energy has changed from outside.
    pub(super) fn forget(&mut self) {
        *self = Self { careful: self.careful, suspected: self.suspected, ..Self::default() };
    }

    /// Books a step in which the internal forces did `work_j` [J]. `energies` are elastic and kinetic energy [J] at its end,
    /// and the least one that is told from rounding. Returns the energy [J] that came from nowhere in the last steps, if it
    /// is notable, and whether that is known.
    pub(super) fn book(&mut self, work_j: f64, energies: impl FnOnce() -> [f64; 3]) -> Option<(f64, bool)> {
        self.steps += 1;
        self.careful = self.careful.saturating_sub(1);
        self.suspected = self.suspected.saturating_sub(1);
        self.work_j += work_j;
        if self.stored_j.is_some() && self.steps < WINDOW {
            return None;
        }
        let [stored_j, kinetic_j, least_j] = energies();
        let released_j = self.stored_j.map_or(self.work_j, |before| before - stored_j);
        let excess_j = self.work_j - released_j;
        let size_j = stored_j.max(released_j + stored_j) + kinetic_j;
        (self.steps, self.work_j, self.stored_j) = (0, 0.0, Some(stored_j));
        if excess_j <= (TOLERANCE * size_j).max(least_j) {
            return None;
        }
        let again = self.suspected > 0;
        (self.careful, self.suspected) = (CAREFUL, AGAIN);
        Some((excess_j, again))
    }

    /// Whether steps are to be solved until their equations hold.
    pub(super) fn is_careful(&self) -> bool {
        self.careful > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Books `steps` with 10 J of each kind of energy, which change by nothing.
    fn book(balance: &mut Balance, steps: u32, work_j: f64) -> Vec<(f64, bool)> {
        (0..steps).filter_map(|_| balance.book(work_j, || [10.0, 10.0, 1e-6])).collect()
    }

    #[test]
    fn rounding_is_no_excess() {
        let mut balance = Balance::default();
        let mut told = |work_j: f64| {
            let steps = 0..=WINDOW;
            steps.filter_map(|_| balance.book(work_j, || [1e-9, 0.0, 1e-6])).count()
        };
        assert_eq!([told(1e-8), told(1e-7)], [0, 1]);
    }

    #[test]
    fn every_excess_is_told_and_one_that_comes_back_is_known() {
        let mut balance = Balance::default();
        // The first step only notes the energy.
        assert!(book(&mut balance, 1 + WINDOW, 0.01).is_empty() && !balance.is_careful());
        for (known, calm) in [(false, AGAIN), (false, CAREFUL), (true, AGAIN), (false, 0)] {
            let told = book(&mut balance, WINDOW, 0.02);
            assert!(
                matches!(told[..], [(j, again)] if (j - 0.32).abs() < 1e-12 && again == known),
                "{told:?}"
            );
            assert!(balance.is_careful() && book(&mut balance, calm, 0.0).is_empty());
        }
        // Work that releases energy is none from nowhere, and what changes from outside is not judged.
        balance.forget();
        assert!(book(&mut balance, 1 + WINDOW, -0.02).is_empty());
    }
}
