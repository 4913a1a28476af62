//! Tools that one peer moves: transforms in, poses out at a bounded rate.
//!
//! Only the newest transform of a tool counts. A tool whose transforms stop hovers: it touches nothing until the next
//! one. A peer that vanishes takes its link, and with it the tools, away.

use std::collections::BTreeMap;
use std::time::Duration;

use scindo_client::messages::tool_sample::Mode;
use scindo_client::messages::{Pose, ToolSample, ToolShape};
use scindo_client::{Link, LinkError, PoseSender};
use tokio::time::Instant;

use crate::axes::Axes;
use crate::names::{Assigned, id_of};
use crate::wire::content::Transform;

/// Most tools of a peer.
pub const MAX_HANDS: usize = 8;

/// How transforms become poses.
#[derive(Debug, Clone)]
pub struct HandSettings {
    /// Devices that move tools. Empty: every device, under its own name.
    pub assigned: Vec<Assigned>,
    /// What the axes of the scene mean to the peer.
    pub axes: Axes,
    /// Shape of a tool that the scene does not declare.
    pub shape: ToolShape,
    /// Shortest time between two poses of a tool.
    pub period: Duration,
    /// A tool hovers after this time without a transform.
    pub patience: Duration,
}

impl HandSettings {
    /// The tool that a device moves.
    fn tool_of(&self, device: &str) -> Option<String> {
        if self.assigned.is_empty() {
            return id_of(device);
        }
        self.assigned.iter().find(|known| known.device == device).map(|known| known.tool.clone())
    }
}

/// What became of a transform.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Moved {
    /// It is on its way, or waits for its turn.
    Taken,
    /// No tool goes with the device.
    Ignored,
    /// It cannot be used; why.
    Refused(String),
}

struct Hand {
    tool: String,
    poses: PoseSender,
    timing: Timing,
    newest: Option<Pose>,
    mode: Mode,
}

/// When a pose goes.
#[derive(Debug, Clone, Copy)]
struct Timing {
    moved: Instant,
    sent: Option<Instant>,
    /// The newest pose or mode has not been sent.
    is_due: bool,
    hovers: bool,
}

/// What a tool should do now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    Nothing,
    Send,
    Hover,
}

impl Timing {
    fn new(now: Instant) -> Self {
        Self { moved: now, sent: None, is_due: false, hovers: false }
    }

    fn moved(&mut self, now: Instant) {
        (self.moved, self.is_due) = (now, true);
    }

    /// Decides, and counts what it decides as done.
    fn turn(&mut self, now: Instant, settings: &HandSettings) -> Turn {
        let turn = if self.is_due && self.sent.is_none_or(|sent| now - sent >= settings.period) {
            Turn::Send
        } else if !self.hovers && now - self.moved >= settings.patience {
            Turn::Hover
        } else {
            return Turn::Nothing;
        };
        (self.sent, self.is_due, self.hovers) = (Some(now), false, turn == Turn::Hover);
        turn
    }
}

/// The tools of one peer.
pub struct Hands {
    link: Link,
    settings: HandSettings,
    hands: BTreeMap<String, Hand>,
    sent: u64,
}

impl Hands {
    /// No tools yet.
    pub fn new(link: Link, settings: HandSettings) -> Self {
        Self { link, settings, hands: BTreeMap::new(), sent: 0 }
    }

    /// Poses sent so far.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Takes a transform of a device.
    ///
    /// # Errors
    /// The network failed.
    pub async fn moved(&mut self, device: &str, to: &Transform, now: Instant) -> Result<Moved, LinkError> {
        let pose = match self.settings.axes.pose(to) {
            Ok(pose) => pose,
            Err(error) => return Ok(Moved::Refused(error.to_string())),
        };
        if !self.hands.contains_key(device) {
            let Some(tool) = self.settings.tool_of(device) else { return Ok(Moved::Ignored) };
            if self.hands.len() >= MAX_HANDS {
                let reason =
                    format!("a peer moves at most {MAX_HANDS} tools; name those that matter with --tool");
                return Ok(Moved::Refused(reason));
            }
            if let Some((other, _)) = self.hands.iter().find(|(_, hand)| hand.tool == tool) {
                return Ok(Moved::Refused(format!("device '{other}' moves tool '{tool}' already")));
            }
            let poses = self.link.poses(&tool).await?;
            tracing::info!(device, tool, "a device moves a tool");
            let (timing, mode) = (Timing::new(now), Mode::Touch);
            self.hands.insert(device.to_owned(), Hand { tool, poses, timing, newest: None, mode });
        }
        if let Some(hand) = self.hands.get_mut(device) {
            hand.newest = Some(pose);
            hand.timing.moved(now);
        }
        Ok(Moved::Taken)
    }

    /// Takes a text under the name of a device: what its hand does with the tool.
    pub fn told(&mut self, device: &str, text: &str, now: Instant) -> Moved {
        let mode = match text.trim().to_ascii_lowercase().as_str() {
            "hover" => Mode::Hover,
            "touch" => Mode::Touch,
            "grab" => Mode::Grab,
            "cut" => Mode::Cut,
            "scalpel" => Mode::Scalpel,
            _ => return Moved::Refused("expected hover, touch, grab, cut or scalpel".into()),
        };
        let Some(hand) = self.hands.get_mut(device) else { return Moved::Ignored };
        if hand.mode != mode {
            hand.mode = mode;
            hand.timing.moved(now);
            // A button goes at once.
            hand.timing.sent = None;
        }
        Moved::Taken
    }

    /// Sends the poses whose turn it is.
    pub fn flush(&mut self, now: Instant) {
        for hand in self.hands.values_mut() {
            let Some(pose) = hand.newest else { continue };
            let mode = match hand.timing.turn(now, &self.settings) {
                Turn::Nothing => continue,
                Turn::Send => hand.mode,
                Turn::Hover => Mode::Hover,
            };
            let shape = Some(self.settings.shape);
            let sample = ToolSample { pose: Some(pose), mode: mode.into(), shape, ..ToolSample::default() };
            match hand.poses.send(sample) {
                Ok(_) => self.sent += 1,
                Err(error) => tracing::warn!(tool = hand.tool, %error, "pose not sent"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(assigned: &[&str]) -> HandSettings {
        HandSettings {
            assigned: assigned.iter().map(|text| crate::names::parse_assigned(text).unwrap()).collect(),
            axes: Axes::Ras,
            shape: ToolShape::default(),
            period: Duration::from_millis(4),
            patience: Duration::from_millis(500),
        }
    }

    #[test]
    fn a_device_moves_the_tool_of_its_name_or_the_assigned_one() {
        assert_eq!(settings(&[]).tool_of("Stylus Tip"), Some("stylus-tip".into()));
        let chosen = settings(&["Stylus=probe", "knife"]);
        assert_eq!(chosen.tool_of("Stylus"), Some("probe".into()));
        assert_eq!((chosen.tool_of("knife"), chosen.tool_of("other")), (Some("knife".into()), None));
    }

    #[test]
    fn a_thousand_transforms_per_second_become_the_chosen_rate_and_silence_hovers_once() {
        let (settings, start) = (settings(&[]), Instant::now());
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut timing = Timing::new(start);
        let mut turns = Vec::new();
        for ms in 0..1000 {
            timing.moved(at(ms));
            turns.push(timing.turn(at(ms), &settings));
        }
        assert_eq!(turns.iter().filter(|turn| **turn == Turn::Send).count(), 250);
        assert_eq!(timing.turn(at(1000), &settings), Turn::Send, "the newest one is not lost");
        let later: Vec<Turn> = (1001..3000).map(|ms| timing.turn(at(ms), &settings)).collect();
        assert_eq!(later.iter().filter(|turn| **turn != Turn::Nothing).count(), 1);
        assert_eq!(
            later.iter().position(|turn| *turn == Turn::Hover),
            Some(498),
            "500 ms after the last transform"
        );
        timing.moved(at(3000));
        assert_eq!(timing.turn(at(3000), &settings), Turn::Send, "it comes back");
    }
}
