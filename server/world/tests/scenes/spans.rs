//! Spans of a step in the log. Alone in its process: a place in the code that another thread reaches first counts as
//! not logged, as long as that thread has no log.

use std::path::Path;
use std::sync::{Arc, Mutex};

use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use tracing::{Subscriber, span};
use tracing_subscriber::layer::{Context, SubscriberExt as _};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::{EnvFilter, Layer};

use crate::is_alone;

const SCENE: &str = include_str!("fast_and_nonlinear.toml");

/// Writes down the name of every span that is entered, after those around it.
#[derive(Clone, Default)]
struct Entered(Arc<Mutex<Vec<String>>>);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Entered {
    fn on_enter(&self, id: &span::Id, log: Context<'_, S>) {
        let path: Vec<&str> = log.span_scope(id).unwrap().from_root().map(|span| span.name()).collect();
        self.0.lock().unwrap().push(path.join(" "));
    }
}

/// Spans entered in one step, where the log takes what `filter` lets through.
fn spans(filter: &str) -> Vec<String> {
    let entered = Entered::default();
    let log = tracing_subscriber::registry().with(EnvFilter::new(filter)).with(entered.clone());
    tracing::subscriber::with_default(log, || {
        let scene = Scene::from_toml(SCENE).unwrap();
        Simulation::new(&scene, Path::new("")).unwrap().step(&Inputs::default());
    });
    entered.0.lock().unwrap().clone()
}

#[test]
fn a_log_at_trace_level_has_a_span_for_each_phase_of_each_body() {
    if !is_alone("spans::a_log_at_trace_level_has_a_span_for_each_phase_of_each_body") {
        return;
    }
    let entered = spans("scindo_world=trace");
    let fast = ["guards", "predict", "operator", "residual", "solve", "commit", "guards"];
    assert_eq!(entered[..2], ["step", "step deform"]);
    let of_fast: Vec<String> = fast.iter().map(|name| format!("step deform {name}")).collect();
    assert_eq!(entered[2..9], of_fast);
    assert_eq!(entered[9], "step deform");
    assert!(entered[10..].contains(&"step deform search".to_owned()), "{entered:?}");
    assert_eq!(spans("scindo_world=debug"), Vec::<String>::new());
}
