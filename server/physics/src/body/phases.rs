//! Who is told of the phases of a step.

use super::Body;
use crate::team::phase::PhaseMark;

impl Body {
    /// Calls `mark` with each [`Phase`](crate::team::phase::Phase) of a step when it begins, on the thread that
    /// steps; `None` ends that. The last phase ends when [`step`](Self::step) returns. Results do not
    /// change.
    ///
    /// Static solves announce some of the phases as well.
    pub fn set_phase_mark(&mut self, mark: Option<PhaseMark>) {
        self.team.set_phase_mark(mark);
    }
}
