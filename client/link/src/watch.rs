//! Tool states, statistics, events and the plan, as they arrive.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use scindo_proto::messages::{Event, Forces, Measures, Plan, Stats, SurfaceField, ToolState};
use scindo_proto::{Chunk, Topic, WireMessage};
use tokio::sync::{mpsc, watch};
use zenoh::pubsub::Subscriber;

use crate::error::LinkError;
use crate::link::Link;

/// Most events kept for a slow reader; the server sends a handful per second.
const EVENT_QUEUE: usize = 256;

/// The newest message of one topic. Dropping it unsubscribes.
pub struct Latest<M> {
    receiver: watch::Receiver<Option<Arc<M>>>,
    _subscriber: Subscriber<()>,
}

impl<M> Latest<M> {
    /// The newest message, if one has come.
    pub fn get(&self) -> Option<Arc<M>> {
        self.receiver.borrow().clone()
    }

    /// Waits for the next message.
    pub async fn next(&mut self) -> Result<Arc<M>, LinkError> {
        loop {
            self.receiver.changed().await.map_err(|_| LinkError::Closed)?;
            if let Some(message) = self.receiver.borrow_and_update().clone() {
                return Ok(message);
            }
        }
    }
}

/// The newest state of every tool, by tool id. Dropping it unsubscribes.
pub struct ToolStates {
    receiver: watch::Receiver<Arc<BTreeMap<String, Arc<ToolState>>>>,
    _subscriber: Subscriber<()>,
}

impl ToolStates {
    /// The newest states.
    pub fn get(&self) -> Arc<BTreeMap<String, Arc<ToolState>>> {
        self.receiver.borrow().clone()
    }

    /// Waits until the state of any tool changes.
    pub async fn next(&mut self) -> Result<Arc<BTreeMap<String, Arc<ToolState>>>, LinkError> {
        self.receiver.changed().await.map_err(|_| LinkError::Closed)?;
        Ok(self.receiver.borrow_and_update().clone())
    }
}

/// Events in their order. Dropping it unsubscribes.
pub struct EventStream {
    receiver: mpsc::Receiver<Event>,
    dropped: Arc<AtomicU64>,
    _subscriber: Subscriber<()>,
}

impl EventStream {
    /// Waits for the next event.
    pub async fn next(&mut self) -> Result<Event, LinkError> {
        self.receiver.recv().await.ok_or(LinkError::Closed)
    }

    /// Number of events lost because the reader was too slow.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

impl Link {
    /// Rates, costs and health of the server.
    pub async fn stats(&self) -> Result<Latest<Stats>, LinkError> {
        self.latest(Topic::Stats).await
    }

    /// Active and inactive effects, with reasons.
    pub async fn plan(&self) -> Result<Latest<Plan>, LinkError> {
        self.latest(Topic::Plan).await
    }

    /// Von Mises stress on the surface of `body`. The server computes it while this subscription exists.
    pub async fn stress(&self, body: &str) -> Result<Latest<SurfaceField>, LinkError> {
        let (body, name) = (Chunk::new("body id", body)?, Chunk::new("field name", "von-mises")?);
        self.latest(Topic::SurfaceField(body, name)).await
    }

    /// Positions of the probes, and energies. The server computes them while this subscription exists.
    pub async fn measures(&self) -> Result<Latest<Measures>, LinkError> {
        self.latest(Topic::Measures).await
    }

    /// Forces of contact: what touches each body, and where. The server gathers them while this subscription exists.
    pub async fn forces(&self) -> Result<Latest<Forces>, LinkError> {
        self.latest(Topic::Forces).await
    }

    /// Events of the server, from now on.
    pub async fn events(&self) -> Result<EventStream, LinkError> {
        let (sender, receiver) = mpsc::channel(EVENT_QUEUE);
        let dropped = Arc::new(AtomicU64::new(0));
        let counter = dropped.clone();
        let on_event = move |event| {
            if sender.try_send(event).is_err() {
                counter.fetch_add(1, Ordering::Relaxed);
            }
        };
        let key = self.keys().key(&Topic::Event);
        let subscriber = self.subscribe::<Event>(self.bulk(), key, on_event).await?;
        Ok(EventStream { receiver, dropped, _subscriber: subscriber })
    }

    /// States of all tools of the session.
    pub async fn tool_states(&self) -> Result<ToolStates, LinkError> {
        let (sender, receiver) = watch::channel(Arc::default());
        let on_state = move |state: ToolState| {
            sender.send_modify(|states: &mut Arc<BTreeMap<String, Arc<ToolState>>>| {
                Arc::make_mut(states).insert(state.tool_id.clone(), Arc::new(state));
            });
        };
        let key = self.keys().every_tool_state();
        let subscriber = self.subscribe(self.bulk(), key, on_state).await?;
        Ok(ToolStates { receiver, _subscriber: subscriber })
    }

    async fn latest<M: WireMessage + 'static>(&self, topic: Topic) -> Result<Latest<M>, LinkError> {
        let (sender, receiver) = watch::channel(None);
        let on_message = move |message| {
            sender.send_replace(Some(Arc::new(message)));
        };
        let subscriber = self.subscribe(self.bulk(), self.keys().key(&topic), on_message).await?;
        Ok(Latest { receiver, _subscriber: subscriber })
    }
}
