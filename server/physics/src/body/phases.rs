//! Who is told of the phases of a step.

use scindo_matter::team::phase::PhaseMark;

use super::Body;

impl Body {
    /// Calls `mark` with each [`Phase`](scindo_matter::team::phase::Phase) of a step when it begins, on the thread that
    /// steps; `None` ends that. The last phase ends when [`step`](Self::step) returns. Results do not
    /// change.
    ///
    /// Static solves announce some of the phases as well.
    pub fn set_phase_mark(&mut self, mark: Option<PhaseMark>) {
        self.team.set_phase_mark(mark);
    }
}
