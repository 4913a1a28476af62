//! What tells that a scheme is out of its depth.

/// Book-keeping of energy: H = kinetic + elastic + loads and springs, which a step conserves.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ledger {
    /// H at the start of the run, plus what changes of loads and springs have put in since [J].
    reference: Option<f64>,
    /// H at the end of the last step, with its loads [J].
    end: f64,
}

/// Part of the energy that may appear from nowhere before a guard steps in: with schemes that should
/// keep it, and with implicit Euler, which should lose some.
pub(crate) const GAIN_CONSERVING: f64 = 0.01;
pub(crate) const GAIN_DISSIPATING: f64 = 1e-4;

impl Ledger {
    pub fn forget(&mut self) {
        self.reference = None;
    }

    /// A step begins with energy `H` [J] under its own loads.
    pub fn begin(&mut self, H: f64) {
        self.reference = Some(match self.reference {
            Some(reference) => reference + H - self.end,
            None => H,
        });
    }

    /// Energy [J] above what there should be at most, if a state with energy `H` has more of it
    /// than the `allowed` gain [J].
    pub fn excess(&self, H: f64, allowed: f64) -> Option<f64> {
        let excess = H - self.reference.unwrap_or(H);
        (excess.is_nan() || excess > allowed).then_some(excess)
    }

    /// The step ended with energy `H` [J]. Where prescribed nodes moved they put energy in.
    pub fn end(&mut self, H: f64, driven: bool) {
        self.end = H;
        if driven {
            self.reference = Some(H.max(self.reference.unwrap_or(H)));
        }
    }
}

/// BDF2 serves while a body turns by less than this in one step [rad]. Up to 1.6 no energy is gained,
/// from 2 on it is.
pub(crate) const LARGEST_TURN: f64 = 0.8;
