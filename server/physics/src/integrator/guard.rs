//! Signs that a time integration scheme fails: energy from nowhere, and large turns.

/// Energy balance of H = kinetic + elastic + loads and springs, which a step conserves.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Ledger {
    /// H at the start of the run, plus what changes of loads and springs have put in since [J].
    reference: Option<f64>,
    /// H at the end of the last step, with its loads [J].
    end: f64,
}

/// Relative gain of energy at which a guard steps in: for schemes that should conserve energy, for generalised-α, which
/// conserves none in single steps, and for implicit Euler, which should lose some.
pub(crate) const GAIN_CONSERVING: f64 = 0.01;
pub(crate) const GAIN_ALPHA: f64 = 0.5;
pub(crate) const GAIN_DISSIPATING: f64 = 1e-4;

impl Ledger {
    pub(super) fn forget(&mut self) {
        self.reference = None;
    }

    /// Begins a step with energy `H` [J] under its own loads; a jump since the last step is work of these.
    pub(super) fn begin(&mut self, H: f64) {
        self.reference = Some(match self.reference {
            Some(reference) => reference + H - self.end,
            None => H,
        });
    }

    /// Excess of the energy `H` [J] over the reference, if it is more than the `allowed` gain [J].
    pub(super) fn excess(&self, H: f64, allowed: f64) -> Option<f64> {
        let excess = H - self.reference.unwrap_or(H);
        (excess.is_nan() || excess > allowed).then_some(excess)
    }

    /// Ends the step with energy `H` [J]. If `driven`, prescribed nodes moved and put energy in.
    pub(super) fn end(&mut self, H: f64, driven: bool) {
        self.end = H;
        if driven {
            self.reference = Some(H.max(self.reference.unwrap_or(H)));
        }
    }
}

/// BDF2 is used while a body turns by less than this in one step [rad]. Up to 1.6 it gains no energy;
/// from 2 on it does.
pub(crate) const LARGEST_TURN: f64 = 0.8;
