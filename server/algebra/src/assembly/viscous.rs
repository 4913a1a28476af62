//! The springs of a Prony series during a step.

use scindo_matter::material::{Prony, PronySpring, Strain};

/// Terms of a Prony series, and the springs that stand for them in the present step.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Viscous {
    pub prony: Prony,
    /// G, the stiffness of the springs over that of the body.
    pub stiffness: f64,
    /// ē per element and point; empty without terms.
    pub start: Vec<Strain>,
}

impl Viscous {
    /// Whether there are no terms, so that nothing is computed for them.
    #[inline]
    pub(super) fn is_off(&self) -> bool {
        self.start.is_empty()
    }

    /// The spring at point number `point`, counted through all elements, where the shear modulus is `mu` [Pa].
    #[inline]
    pub(super) fn spring(&self, point: usize, mu: f64) -> PronySpring {
        PronySpring { modulus: mu * self.stiffness, start: self.start[point] }
    }
}
