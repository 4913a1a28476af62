//! The phases of a step, announced to whoever measures them.
//!
//! The mechanics read no clock. Each step announces every phase where it begins, and the caller's function
//! looks at the clock. Without such a function an announcement is one comparison.

use std::fmt;

/// A phase of a step. A step may return to an earlier one, such as to [`Operator`](Self::Operator) in
/// every step of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Phase {
    /// Checks before and after the solve: scheme, spin, energy, critical step, range.
    Guards,
    /// Predictor from positions and velocities.
    Predict,
    /// Rotations, tangent, preconditioner and factors at the present positions.
    Operator,
    /// Forces and their imbalance.
    Residual,
    /// Linear solves; in explicit schemes those with the mass matrix.
    Solve,
    /// Line search of Newton's method.
    Search,
    /// New positions and velocities.
    Commit,
}

impl Phase {
    /// All phases.
    pub const ALL: [Self; 7] = [
        Self::Guards,
        Self::Predict,
        Self::Operator,
        Self::Residual,
        Self::Solve,
        Self::Search,
        Self::Commit,
    ];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Guards => "guards",
            Self::Predict => "predict",
            Self::Operator => "operator",
            Self::Residual => "residual",
            Self::Solve => "solve",
            Self::Search => "search",
            Self::Commit => "commit",
        }
    }
}

/// A function that is called with each phase when it begins. It must not panic.
pub type PhaseMark = Box<dyn FnMut(Phase) + Send + Sync>;

/// The function to call, if there is one.
#[derive(Default)]
pub(crate) struct Marks(Option<PhaseMark>);

impl Marks {
    /// Calls `mark` from now on, or nobody.
    pub(crate) fn set(&mut self, mark: Option<PhaseMark>) {
        self.0 = mark;
    }

    /// Announces that `phase` begins.
    pub(crate) fn begin(&mut self, phase: Phase) {
        if let Some(mark) = &mut self.0 {
            mark(phase);
        }
    }
}

impl fmt::Debug for Marks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Marks(set)" } else { "Marks(none)" })
    }
}
