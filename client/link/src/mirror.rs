//! A body's surface, as the server has it.
//!
//! A topology has an epoch, and every frame names its epoch. The mirror starts with a keyframe (one query).
//! Then it applies frames of its epoch, and new topologies as they arrive. When something does not fit, it
//! asks for the keyframe again, at most every [`RETRY`]. That happens with a frame of another epoch or size,
//! or a new server. Every surface that it returns is complete: triangles and positions belong to one epoch.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use scindo_proto::messages::{SurfaceFrame, SurfaceKeyframe, SurfaceTopology};
use scindo_proto::{Chunk, Topic};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use crate::error::LinkError;
use crate::link::{Link, decode_sample};

/// Pause between two keyframe queries.
pub const RETRY: Duration = Duration::from_millis(100);

/// Triangles and positions of one epoch.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Triangles and tags; the same `Arc` until the topology changes.
    pub topology: Arc<SurfaceTopology>,
    /// Positions of the vertices of [`Self::topology`].
    pub frame: SurfaceFrame,
}

/// The effect of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It gave a newer surface.
    Applied,
    /// It is older than the present surface.
    Stale,
    /// It does not fit; a keyframe is needed.
    Gap,
}

/// The rules of epochs, independent of any transport.
#[derive(Debug, Default)]
pub struct Assembly {
    surface: Option<Arc<Surface>>,
    /// A topology whose first frame has not arrived yet.
    pending: Option<Arc<SurfaceTopology>>,
}

impl Assembly {
    /// The newest complete surface.
    pub fn surface(&self) -> Option<&Arc<Surface>> {
        self.surface.as_ref()
    }

    /// Applies a keyframe. It is the server's present state, so it always replaces the surface.
    pub fn keyframe(&mut self, keyframe: SurfaceKeyframe) -> Outcome {
        let (Some(topology), Some(frame)) = (keyframe.topology, keyframe.frame) else {
            return Outcome::Gap;
        };
        self.pending = None;
        self.surface = Some(Arc::new(Surface { topology: Arc::new(topology), frame }));
        Outcome::Applied
    }

    /// Takes a topology, which waits for the first frame of its epoch.
    pub fn topology(&mut self, topology: SurfaceTopology) -> Outcome {
        let held = self.surface.as_ref().map(|s| s.topology.epoch);
        if held.is_some_and(|epoch| topology.epoch <= epoch) {
            return Outcome::Stale;
        }
        self.pending = Some(Arc::new(topology));
        Outcome::Applied
    }

    /// Applies a frame, which moves the surface of its epoch.
    pub fn frame(&mut self, frame: SurfaceFrame) -> Outcome {
        let fits = |t: &SurfaceTopology| t.epoch == frame.epoch && t.vertex_count == frame.vertex_count;
        if let Some(topology) = self.pending.take_if(|t| fits(t)) {
            self.surface = Some(Arc::new(Surface { topology, frame }));
            return Outcome::Applied;
        }
        match &self.surface {
            Some(held) if fits(&held.topology) => {
                if frame.sim_step < held.frame.sim_step && frame.seq < held.frame.seq {
                    return Outcome::Stale;
                }
                let topology = held.topology.clone();
                self.surface = Some(Arc::new(Surface { topology, frame }));
                Outcome::Applied
            }
            _ => Outcome::Gap,
        }
    }
}

/// Follows the surface of one body until dropped.
pub struct BodyMirror {
    surfaces: watch::Receiver<Option<Arc<Surface>>>,
    task: JoinHandle<()>,
}

impl BodyMirror {
    /// The newest surface; `None` before the first keyframe.
    pub fn latest(&self) -> Option<Arc<Surface>> {
        self.surfaces.borrow().clone()
    }

    /// Waits for a surface newer than the last one returned. A slow caller misses the surfaces in between.
    pub async fn next(&mut self) -> Result<Arc<Surface>, LinkError> {
        loop {
            self.surfaces.changed().await.map_err(|_| LinkError::Closed)?;
            if let Some(surface) = self.surfaces.borrow_and_update().clone() {
                return Ok(surface);
            }
        }
    }
}

impl Drop for BodyMirror {
    fn drop(&mut self) {
        self.task.abort();
    }
}

type Newest = Subscriber<RingChannelHandler<Sample>>;

impl Link {
    /// Starts to follow the surface of `body`. It repeats the query until a server has the keyframe.
    pub async fn mirror(&self, body: &str) -> Result<BodyMirror, LinkError> {
        let id = Chunk::new("body id", body)?;
        let keys = self.keys();
        let newest = |topic: Topic| {
            let builder = self.bulk().declare_subscriber(keys.key(&topic));
            async { builder.with(RingChannel::new(1)).await.map_err(LinkError::zenoh("follow a surface")) }
        };
        let topologies = newest(Topic::SurfaceTopology(id.clone())).await?;
        let frames = newest(Topic::SurfaceFrame(id.clone())).await?;
        let keyframe_key = keys.key(&Topic::SurfaceKeyframe(id));
        let (sender, surfaces) = watch::channel(None);
        let link = self.clone();
        let follow = follow(link, keyframe_key, topologies, frames, sender);
        Ok(BodyMirror { surfaces, task: tokio::spawn(follow) })
    }
}

/// Applies messages as they arrive, and asks for the keyframe when one does not fit.
async fn follow(
    link: Link,
    keyframe_key: String,
    topologies: Newest,
    frames: Newest,
    surfaces: watch::Sender<Option<Arc<Surface>>>,
) {
    let mut presence = link.presence();
    let mut assembly = Assembly::default();
    let mut query_at = Some(Instant::now());
    loop {
        let query_due = async {
            match query_at {
                Some(at) => sleep_until(at).await,
                None => std::future::pending().await,
            }
        };
        let outcome = tokio::select! {
            biased;
            () = query_due => {
                let keyframe = link.ask::<SurfaceKeyframe>(keyframe_key.clone(), Bytes::new(), None).await;
                query_at = None;
                keyframe.map_or(Outcome::Gap, |k| assembly.keyframe(k))
            }
            changed = presence.changed() => match changed {
                Ok(()) if presence.borrow_and_update().servers > 0 => Outcome::Gap,
                Ok(()) => Outcome::Stale,
                Err(_) => return,
            },
            sample = topologies.recv_async() => match sample {
                Ok(sample) => decode_sample(&sample).map_or(Outcome::Gap, |t| assembly.topology(t)),
                Err(_) => return,
            },
            sample = frames.recv_async() => match sample {
                Ok(sample) => decode_sample(&sample).map_or(Outcome::Stale, |f| assembly.frame(f)),
                Err(_) => return,
            },
        };
        match outcome {
            Outcome::Gap if query_at.is_none() => query_at = Some(Instant::now() + RETRY),
            Outcome::Applied => {
                let newest = assembly.surface().cloned();
                surfaces.send_if_modified(|held| replace_if_newer(held, newest));
            }
            Outcome::Gap | Outcome::Stale => {}
        }
    }
}

fn replace_if_newer(held: &mut Option<Arc<Surface>>, newest: Option<Arc<Surface>>) -> bool {
    let same = match (&*held, &newest) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    };
    if !same {
        *held = newest;
    }
    !same
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topology(epoch: u32, vertices: u32) -> SurfaceTopology {
        SurfaceTopology { epoch, vertex_count: vertices, ..SurfaceTopology::default() }
    }

    fn frame(epoch: u32, vertices: u32, step: u64) -> SurfaceFrame {
        SurfaceFrame { epoch, vertex_count: vertices, sim_step: step, seq: step, ..SurfaceFrame::default() }
    }

    fn keyframe(epoch: u32, vertices: u32, step: u64) -> SurfaceKeyframe {
        SurfaceKeyframe {
            topology: Some(topology(epoch, vertices)),
            frame: Some(frame(epoch, vertices, step)),
        }
    }

    #[test]
    fn a_frame_before_the_keyframe_is_a_gap() {
        let mut assembly = Assembly::default();
        assert_eq!(assembly.frame(frame(0, 4, 1)), Outcome::Gap);
        assert_eq!(assembly.keyframe(keyframe(0, 4, 1)), Outcome::Applied);
        assert_eq!(assembly.frame(frame(0, 4, 2)), Outcome::Applied);
        assert_eq!(assembly.frame(frame(0, 4, 1)), Outcome::Stale);
    }

    #[test]
    fn a_surface_is_shown_only_whole() {
        let mut assembly = Assembly::default();
        assembly.keyframe(keyframe(0, 4, 1));
        assert_eq!(assembly.topology(topology(1, 6)), Outcome::Applied);
        let shown = assembly.surface().expect("keyframe");
        assert_eq!((shown.topology.epoch, shown.frame.epoch), (0, 0));
        assert_eq!(assembly.frame(frame(1, 6, 2)), Outcome::Applied);
        let shown = assembly.surface().expect("keyframe");
        assert_eq!((shown.topology.epoch, shown.frame.epoch, shown.topology.vertex_count), (1, 1, 6));
    }

    #[test]
    fn a_lost_topology_is_a_gap_until_the_keyframe() {
        let mut assembly = Assembly::default();
        assembly.keyframe(keyframe(0, 4, 1));
        assert_eq!(assembly.frame(frame(2, 8, 5)), Outcome::Gap);
        assert_eq!(assembly.keyframe(keyframe(2, 8, 6)), Outcome::Applied);
        assert_eq!(assembly.topology(topology(1, 6)), Outcome::Stale);
        assert_eq!(assembly.frame(frame(2, 8, 7)), Outcome::Applied);
    }

    #[test]
    fn a_restarted_server_begins_again_at_epoch_zero() {
        let mut assembly = Assembly::default();
        assembly.keyframe(keyframe(3, 9, 500));
        assert_eq!(assembly.frame(frame(0, 4, 1)), Outcome::Gap);
        assert_eq!(assembly.keyframe(keyframe(0, 4, 2)), Outcome::Applied);
        assert_eq!(assembly.frame(frame(0, 4, 3)), Outcome::Applied);
    }
}
