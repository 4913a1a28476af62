//! Cases that need parts which are not built yet. They are listed and never passed.

use crate::stress::case::Case;

const NOT_YET: Case =
    Case { number: None, name: "", title: "", set_up: "", rule: "", source: "", quick: true, run: None };

/// Case 24.
pub const JAB: Case = Case {
    number: Some(24),
    name: "tool-jab",
    title: "A tool jabs at 10 m/s",
    set_up: "A rigid tip, its pose known every 5 ms, is driven into the body. Needs continuous contact of haptic \
        tools.",
    rule: "Nothing tunnels, the force stays below its cap, the tissue recovers within 1 s.",
    source: "Jeřábková 2007, §4.1",
    ..NOT_YET
};

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

/// Case 30.
pub const SOAK: Case = Case {
    number: Some(30),
    name: "soak",
    title: "An hour of random tools and cuts",
    set_up: "One hour of simulated time with random tools, cuts, sleep and wake-up under a memory cap. Needs \
        sleep and replay.",
    rule: "Rule C; memory bounded; the 99th percentile of steps in budget; a replay has the same bits.",
    source: "own",
    ..NOT_YET
};

/// Case 31.
pub const OVERLOAD: Case = Case {
    number: Some(31),
    name: "overload",
    title: "A scene five times too slow",
    set_up: "A scene whose steps cost five times their budget. Needs the budget governor.",
    rule: "Simulated time slows down, and the slowdown is reported; the residual stays below 1e-2.",
    source: "own",
    ..NOT_YET
};
