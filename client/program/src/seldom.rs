//! A log that cannot be flooded: one line per place in the code and per second.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::{Event, Metadata};
use tracing_subscriber::layer::{Context, Filter};

/// Shortest time between two lines of one place in the code.
const EVERY: Duration = Duration::from_secs(1);

/// Target of lines that are already limited where they are written. They are let through.
pub(crate) const COUNTED: &str = "scindo::exchange";

/// A filter that lets one line through per place in the code and per second.
#[derive(Debug, Default)]
pub(crate) struct Seldom {
    /// Time of the last line of each place, by module and line number.
    written: Mutex<BTreeMap<(&'static str, u32), Instant>>,
}

impl Seldom {
    fn is_due(&self, metadata: &'static Metadata<'static>, now: Instant) -> bool {
        if metadata.target() == COUNTED {
            return true;
        }
        // A place without a line number is identified by its name, which holds file and line.
        let place = metadata.line().map_or((metadata.name(), 0), |line| (metadata.target(), line));
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        match written.get_mut(&place) {
            Some(last) if now.duration_since(*last) < EVERY => false,
            Some(last) => {
                *last = now;
                true
            }
            None => {
                written.insert(place, now);
                true
            }
        }
    }
}

impl<S> Filter<S> for Seldom {
    fn enabled(&self, _: &Metadata<'_>, _: &Context<'_, S>) -> bool {
        true
    }

    fn event_enabled(&self, event: &Event<'_>, _: &Context<'_, S>) -> bool {
        self.is_due(event.metadata(), Instant::now())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use tracing_subscriber::Layer;
    use tracing_subscriber::layer::SubscriberExt as _;

    #[derive(Clone, Default)]
    struct Count(Arc<AtomicUsize>);

    impl<S: tracing::Subscriber> Layer<S> for Count {
        fn on_event(&self, _: &Event<'_>, _: Context<'_, S>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn a_flood_from_one_place_leaves_a_line_and_other_places_are_heard() {
        let count = Count::default();
        let log = tracing_subscriber::registry().with(count.clone().with_filter(Seldom::default()));
        let started = Instant::now();
        tracing::subscriber::with_default(log, || {
            for _ in 0..1000 {
                tracing::error!("again");
            }
            tracing::error!("something else");
        });
        let allowed = 2 + started.elapsed().as_secs() as usize;
        let lines = count.0.load(Ordering::Relaxed);
        assert!((2..=allowed).contains(&lines), "{lines} lines, {allowed} allowed");
    }
}
