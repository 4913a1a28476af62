//! Poses that arrive before the liveliness token of their client.
//!
//! A pose is sent at once. A token waits up to a millisecond to share a packet with other messages. A pose
//! can therefore overtake a token that was declared before it, and more poses do so on a busy machine. The
//! newest of these poses waits here for the token. If the token has not come after [`PATIENCE`], the client
//! is refused.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use scindo_proto::limits::MAX_TOOLS;
use scindo_proto::messages::ToolSample;

/// How long a pose waits for the token of its client.
pub const PATIENCE: Duration = Duration::from_secs(2);

/// The newest pose that one client sent with one tool.
#[derive(Debug)]
struct Early {
    newest: ToolSample,
    /// When the first pose arrived.
    since: Instant,
}

impl Early {
    fn is_waited_for(&self, now: Instant) -> bool {
        now.duration_since(self.since) < PATIENCE
    }
}

/// Poses that wait for the token of their client.
#[derive(Debug, Default)]
pub struct EarlyPoses {
    waiting: BTreeMap<(String, String), Early>,
}

impl EarlyPoses {
    /// Keeps `sample` until the token of its client arrives. Returns false if the client has had long enough
    /// to send the token, or if too many others wait.
    pub fn keep(&mut self, sample: &ToolSample, now: Instant) -> bool {
        let whose = (sample.client_id.clone(), sample.tool_id.clone());
        if let Some(early) = self.waiting.get_mut(&whose) {
            if sample.seq > early.newest.seq || sample.client_time_ns > early.newest.client_time_ns {
                early.newest.clone_from(sample);
            }
            return early.is_waited_for(now);
        }
        if self.waiting.len() >= MAX_TOOLS {
            self.waiting.retain(|_, early| early.is_waited_for(now));
        }
        let room = self.waiting.len() < MAX_TOOLS;
        if room {
            self.waiting.insert(whose, Early { newest: sample.clone(), since: now });
        }
        room
    }

    /// Returns the poses of `client` when its token arrives: one per tool, unless it is too old to matter.
    pub fn take(&mut self, client: &str, now: Instant) -> Vec<ToolSample> {
        let its = self.waiting.extract_if(.., |(owner, _), _| owner == client);
        its.filter(|(_, early)| early.is_waited_for(now)).map(|(_, early)| early.newest).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(client: &str, tool: &str, seq: u64) -> ToolSample {
        ToolSample { client_id: client.into(), tool_id: tool.into(), seq, ..ToolSample::default() }
    }

    #[test]
    fn the_newest_pose_per_tool_waits_for_the_token() {
        let (mut early, now) = (EarlyPoses::default(), Instant::now());
        for (tool, seq) in [("probe", 1), ("probe", 3), ("probe", 2), ("scalpel", 7)] {
            assert!(early.keep(&sample("a", tool, seq), now));
        }
        assert!(early.keep(&sample("b", "probe", 9), now));
        let taken = early.take("a", now + PATIENCE / 2);
        assert_eq!(taken, [sample("a", "probe", 3), sample("a", "scalpel", 7)]);
        assert_eq!(early.take("a", now), []);
        assert_eq!(early.take("b", now), [sample("b", "probe", 9)]);
    }

    #[test]
    fn who_never_declares_a_token_is_waited_for_once() {
        let (mut early, start) = (EarlyPoses::default(), Instant::now());
        assert!(early.keep(&sample("a", "probe", 1), start));
        let later = start + PATIENCE;
        assert!(!early.keep(&sample("a", "probe", 2), later));
        assert!(!early.keep(&sample("a", "probe", 3), later + PATIENCE));
        assert_eq!(early.take("a", later), []);
    }

    #[test]
    fn as_many_wait_as_there_may_be_tools() {
        let (mut early, start) = (EarlyPoses::default(), Instant::now());
        for i in 0..MAX_TOOLS {
            assert!(early.keep(&sample(&format!("c{i}"), "probe", 1), start));
        }
        assert!(!early.keep(&sample("late", "probe", 1), start));
        assert!(early.keep(&sample("late", "probe", 2), start + PATIENCE), "the others have waited too long");
    }
}
