//! Topics that are published only while somebody subscribes: stress on surfaces, probes and energies, forces of
//! contact. A subscriber raises a flag, and the next snapshot of the simulation holds what is flagged.

use std::sync::Arc;
use std::time::{Duration, Instant};

use scindo_proto::messages::{Forces, Measures, SurfaceField};
use scindo_proto::{Chunk, KeySpace, Topic, encode, encoding};
use scindo_world::snapshot::Snapshot;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::{Session, Wait as _};

use crate::error::{RuntimeError, words};
use crate::exchange::Exchange;
use crate::wire::convert::{ProbeName, STRESS, to_measures, to_stress};
use crate::wire::forces::to_forces;

/// Shortest time between two messages of a topic: colours and curves need a lower rate than motion. Forces are
/// published with every frame.
const PERIOD: Duration = Duration::from_millis(50);

/// Publishers of the topics.
pub struct OnDemand {
    /// Per body: publisher of its stress, and number of messages so far.
    stress: Vec<(Publisher<'static>, u64)>,
    measures: (Publisher<'static>, u64),
    probes: Vec<ProbeName>,
    forces: (Publisher<'static>, u64),
    obstacles: Vec<String>,
    /// Step of the forces that were published last.
    forces_step: Option<u64>,
    next: Instant,
}

impl OnDemand {
    /// Declares the topics of all `bodies`.
    pub fn declare(
        keys: &KeySpace,
        bulk: &Session,
        exchange: &Arc<Exchange>,
        bodies: &[String],
        (probes, obstacles): (Vec<ProbeName>, Vec<String>),
    ) -> Result<Self, RuntimeError> {
        let stress = bodies.iter().enumerate().map(|(index, id)| {
            let topic = Topic::SurfaceField(Chunk::new("body id", id)?, Chunk::new("field name", STRESS)?);
            let watcher = exchange.clone();
            let asked = move |wanted| watcher.want_stress(index, wanted);
            Ok((declare(bulk, keys.key(&topic), encoding::<SurfaceField>(), asked)?, 0))
        });
        let stress = stress.collect::<Result<_, RuntimeError>>()?;
        let watcher = exchange.clone();
        let asked = move |wanted| watcher.want_measures(wanted);
        let measures = declare(bulk, keys.key(&Topic::Measures), encoding::<Measures>(), asked)?;
        let watcher = exchange.clone();
        let asked = move |wanted| watcher.want_forces(wanted);
        let forces = declare(bulk, keys.key(&Topic::Forces), encoding::<Forces>(), asked)?;
        Ok(Self {
            stress,
            measures: (measures, 0),
            probes,
            forces: (forces, 0),
            obstacles,
            forces_step: None,
            next: Instant::now(),
        })
    }

    /// Publishes the flagged parts of the snapshot. There are none while nobody subscribes.
    pub fn publish(&mut self, snapshot: &Snapshot) {
        self.publish_forces(snapshot);
        if Instant::now() < self.next {
            return;
        }
        self.next = Instant::now() + PERIOD;
        for ((publisher, seq), body) in self.stress.iter_mut().zip(&snapshot.bodies) {
            if !body.stress.is_empty() {
                *seq += 1;
                put(publisher, encode(&to_stress(snapshot, body, *seq)));
            }
        }
        if !snapshot.probes.is_empty() || snapshot.bodies.iter().any(|body| body.energy.is_some()) {
            self.measures.1 += 1;
            put(&self.measures.0, encode(&to_measures(snapshot, &self.probes, self.measures.1)));
        }
    }
}

impl OnDemand {
    /// Publishes the forces of a step once.
    fn publish_forces(&mut self, snapshot: &Snapshot) {
        if !snapshot.forces.asked {
            self.forces_step = None;
        } else if self.forces_step != Some(snapshot.step) {
            self.forces_step = Some(snapshot.step);
            self.forces.1 += 1;
            put(&self.forces.0, encode(&to_forces(snapshot, &self.obstacles, self.forces.1)));
        }
    }
}

fn declare(
    bulk: &Session,
    key: String,
    encoding: String,
    asked: impl Fn(bool) + Send + Sync + 'static,
) -> Result<Publisher<'static>, RuntimeError> {
    let publisher = bulk
        .declare_publisher(key)
        .encoding(encoding)
        .priority(Priority::DataLow)
        .congestion_control(CongestionControl::Drop)
        .reliability(Reliability::BestEffort)
        .wait()
        .map_err(failed)?;
    let listener = publisher.matching_listener().callback(move |status| asked(status.matching()));
    listener.background().wait().map_err(failed)?;
    Ok(publisher)
}

fn put(publisher: &Publisher<'static>, payload: bytes::Bytes) {
    if let Err(error) = publisher.put(payload).wait() {
        tracing::debug!(key = %publisher.key_expr(), %error, "not published");
    }
}

fn failed(error: zenoh::Error) -> RuntimeError {
    RuntimeError::Zenoh { what: "declaring topics".to_owned(), reason: words(&error) }
}
