//! Cases that need parts which are not built yet. They are listed and never passed.

use crate::stress::case::Case;

const NOT_YET: Case =
    Case { number: None, name: "", title: "", set_up: "", rule: "", source: "", quick: true, run: None };

/// Case 25.
pub const PACKETS: Case = Case {
    number: Some(25),
    name: "packet-loss",
    title: "A tool's packets get lost",
    set_up: "30 % of the poses are lost, gaps last 200 ms, others come late or twice. Needs the haptic suite.",
    rule: "No force step above the slew limit; the passivity observer never falls below zero.",
    source: "contract of the haptic client",
    ..NOT_YET
};

/// Case 27.
pub const WALL: Case = Case {
    number: Some(27),
    name: "haptic-wall",
    title: "A wall at the limit of passivity",
    set_up: "Stiffness 0.9 and 1.5 times the passivity limit, 1 ms ticks, 10 ms latency. Needs the haptic suite.",
    rule: "The first is passive; the second is damped by the controller and stays bounded.",
    source: "Colgate, Schenkel 1994",
    ..NOT_YET
};
