//! The clock beside the phases of a step, and a span of the log for each of them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use scindo_physics::body::Body;
use scindo_physics::team::phase::{Phase, PhaseMark};
use tracing::{Level, Span, trace_span};

use crate::report::PhaseSeconds;

/// Measures the phases of the bodies that it was given to, each by itself because they may step side by side.
/// Off, it is one comparison per body and step.
#[derive(Debug, Default)]
pub(crate) struct PhaseClock(Vec<Arc<Mutex<Times>>>);

#[derive(Debug, Default)]
struct Times {
    seconds: PhaseSeconds,
    under_way: Option<UnderWay>,
}

/// The phase under way; its span ends when this is dropped.
#[derive(Debug)]
struct UnderWay {
    phase: Phase,
    since: Instant,
    span: Span,
}

impl PhaseClock {
    /// Whether the log asks for the spans of phases.
    pub(super) fn is_traced() -> bool {
        tracing::enabled!(Level::TRACE)
    }

    /// Begins or ends to measure `bodies`.
    pub(super) fn set<'a>(&mut self, on: bool, bodies: impl Iterator<Item = &'a mut Body>) {
        self.0.clear();
        for body in bodies {
            let mark = on.then(|| -> PhaseMark {
                let times: Arc<Mutex<Times>> = Arc::default();
                self.0.push(Arc::clone(&times));
                Box::new(move |phase| lock(&times).begin(phase))
            });
            body.set_phase_mark(mark);
        }
    }

    /// Called before the step of body `i`: forgets a phase that something else than a step announced.
    pub(super) fn start(&self, i: usize) {
        if let Some(times) = self.0.get(i) {
            lock(times).under_way = None;
        }
    }

    /// Called after the step of body `i`: ends its last phase.
    pub(super) fn end(&self, i: usize) {
        if let Some(times) = self.0.get(i) {
            lock(times).end();
        }
    }

    /// Returns the times since the last call, of all bodies together.
    pub(super) fn take(&self) -> PhaseSeconds {
        let mut sum = PhaseSeconds::default();
        for times in &self.0 {
            sum.add(&std::mem::take(&mut lock(times).seconds));
        }
        sum
    }
}

impl Times {
    fn begin(&mut self, phase: Phase) {
        let now = Instant::now();
        // A phase announced again goes on.
        if self.under_way.as_ref().is_some_and(|under_way| under_way.phase == phase) {
            return;
        }
        self.end_at(now);
        self.under_way = Some(UnderWay::new(phase, now));
    }

    fn end(&mut self) {
        self.end_at(Instant::now());
    }

    fn end_at(&mut self, now: Instant) {
        if let Some(UnderWay { phase, since, .. }) = self.under_way.take().as_ref() {
            self.seconds.book(*phase, (now - *since).as_secs_f64());
        }
    }
}

impl UnderWay {
    /// Enters the span of `phase`. A guard could not be kept here: it must not leave the thread, while this
    /// may, between steps.
    fn new(phase: Phase, since: Instant) -> Self {
        let span = span_of(phase);
        span.with_subscriber(|(id, log)| log.enter(id));
        Self { phase, since, span }
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        self.span.with_subscriber(|(id, log)| log.exit(id));
    }
}

/// The span of a phase. Its name has to be known where it is compiled.
fn span_of(phase: Phase) -> Span {
    match phase {
        Phase::Guards => trace_span!("guards"),
        Phase::Predict => trace_span!("predict"),
        Phase::Operator => trace_span!("operator"),
        Phase::Residual => trace_span!("residual"),
        Phase::Solve => trace_span!("solve"),
        Phase::Search => trace_span!("search"),
        Phase::Commit => trace_span!("commit"),
    }
}

fn lock(times: &Mutex<Times>) -> MutexGuard<'_, Times> {
    times.lock().unwrap_or_else(PoisonError::into_inner)
}
