//! What scindo promises to a laboratory, and what holds each promise.

use serde::Serialize;

use crate::campaign::Totals;
use crate::table::Mutant;

/// A promise.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Guarantee {
    /// Its number in the list of guarantees.
    pub number: &'static str,
    /// What is promised, in one sentence.
    pub promise: &'static str,
    /// What tries to break it.
    pub tried_by: &'static str,
    /// Whether the simulator of the network tries it.
    pub simulated: bool,
}

/// All promises.
pub const GUARANTEES: [Guarantee; 13] = [
    Guarantee {
        number: "G1",
        promise: "No input from the network crashes, blocks or corrupts the server",
        tried_by: "simulator (spoiled messages, lies); `proto/tests/codec.rs`; `tests/run hostile`",
        simulated: true,
    },
    Guarantee {
        number: "G2",
        promise: "A cut is made exactly once, or refused with a reason, whatever the network does",
        tried_by: "simulator (all faults); `server/runtime/tests/server/wire.rs`",
        simulated: true,
    },
    Guarantee {
        number: "G3",
        promise: "A tool has one owner at a time and stands where that owner has put it; it is free when the owner is gone",
        tried_by: "simulator (partitions, restarts, lies); `server/runtime/src/inbox/tests.rs`",
        simulated: true,
    },
    Guarantee {
        number: "G4",
        promise: "The force on a hand is finite, within its limits of size and slew, and zero 200 ms after silence",
        tried_by: "simulator (spoiled contacts, freezes, jumps of clocks; hands under made-up contacts); `client/haptic/src/tick/tests.rs`",
        simulated: true,
    },
    Guarantee {
        number: "G5",
        promise: "A hand gets at most 2 mJ more than it has stored",
        tried_by: "`scindo haptics`; `scindo stress --case haptic-wall --case packet-loss`",
        simulated: false,
    },
    Guarantee {
        number: "G6",
        promise: "The same input gives the same bits on any number of threads",
        tried_by: "`server/world/tests/scenes/side_by_side.rs`, and a test per effect; `tests/schedules` for the orders of its threads",
        simulated: false,
    },
    Guarantee {
        number: "G7",
        promise: "A step that diverges is rolled back, and nothing that is not finite leaves the server",
        tried_by: "`scindo stress`; `tests/tests/programs/random_scenes.rs`",
        simulated: false,
    },
    Guarantee {
        number: "G8",
        promise: "Memory and time stay bounded under abuse",
        tried_by: "`tests/run hostile`",
        simulated: false,
    },
    Guarantee {
        number: "G9",
        promise: "When faults stop, everybody can work again within two seconds",
        tried_by: "simulator (second part of every episode); `tests/run haptic` (killed clients and servers)",
        simulated: true,
    },
    Guarantee {
        number: "G10",
        promise: "A session lasts",
        tried_by: "`tests/run soak`: a recorded session with hands, cuts, killed clients and a restart, repeated bit for bit; an hour with `SCINDO_SOAK_SECONDS=3600`",
        simulated: false,
    },
    Guarantee {
        number: "G11",
        promise: "Another version of the wire is refused politely",
        tried_by: "`proto/tests/codec.rs`; keys carry the version of the wire",
        simulated: false,
    },
    Guarantee {
        number: "G12",
        promise: "Access control does what its table says",
        tried_by: "`server/runtime/tests/server/access.rs`: 792 cells of role, key and verb, each by a real client with a certificate",
        simulated: false,
    },
    Guarantee {
        number: "G13",
        promise: "No dependency has a known vulnerability without a written reason",
        tried_by: "`tests/run deny`",
        simulated: false,
    },
];

/// A safeguard that was taken out, and the seeds that noticed it.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Noticed {
    /// What was taken out.
    pub mutant: Mutant,
    /// Seeds that were run.
    pub seeds: u64,
    /// Seeds that broke a rule.
    pub violations: u64,
}

/// What a campaign found.
#[derive(Debug)]
pub struct Found {
    /// Episodes of the network.
    pub network: Totals,
    /// Drills of hands.
    pub hands: Totals,
    /// Safeguards that were taken out.
    pub mutants: Vec<Noticed>,
}

impl Found {
    /// Seeds that broke a rule.
    pub fn violations(&self) -> u64 {
        self.network.violations + self.hands.violations
    }
}

/// The page `deploy/RELIABILITY.md`: all promises, and the figures of a campaign.
pub fn markdown(found: &Found) -> String {
    let Found { network: totals, hands, mutants } = found;
    let mut out = String::from(HEAD);
    for guarantee in GUARANTEES {
        out.push_str(&row(&guarantee));
    }
    let Totals { seeds, messages, ticks, touched, cuts, refused, violations, .. } = totals;
    out.push_str(&format!(
        "\n## What the simulator found last\n\n\
         {seeds} seeds: {messages} messages, {ticks} ticks of hands ({touched} of them felt something), {cuts} cuts \
         made, {refused} messages refused. **Broken rules: {violations}.**\n\n| fault | times |\n|---|---|\n"
    ));
    for (class, count) in totals.hits.classes() {
        out.push_str(&format!("| {class} | {count} |\n"));
    }
    if hands.seeds > 0 {
        out.push_str(&format!(
            "\nHands alone, under contacts that are made up: {} ticks ({} of them felt something), {} contacts. \
             **Broken rules: {}.**\n",
            hands.ticks, hands.touched, hands.messages, hands.violations
        ));
    }
    if !mutants.is_empty() {
        out.push_str("\nThe rules notice when a safeguard is taken out:\n\n| without | seeds that notice |\n|---|---|\n");
    }
    for Noticed { mutant, seeds, violations } in mutants {
        out.push_str(&format!("| {} | {violations} of {seeds} |\n", mutant.name()));
    }
    out
}

/// A line of the table of promises.
pub fn row(guarantee: &Guarantee) -> String {
    let Guarantee { number, promise, tried_by, .. } = guarantee;
    format!("| {number} | {promise} | {tried_by} |\n")
}

const HEAD: &str = "\
# What a laboratory can rely on

`scindo reliability --write FILE` writes this page. It runs server and haptic clients in a simulated network, whose
links lose, repeat, delay, reorder and spoil messages, and whose partners freeze, vanish and lie. A seed decides
everything, so a broken rule can be repeated.

| | promise | tried by |
|---|---|---|
";

/// The table for people, with the figures of a campaign.
pub fn text(found: &Found) -> String {
    let Found { network: totals, hands, mutants } = found;
    let mut out = String::new();
    let hits = &totals.hits;
    let mut line = |text: String| {
        out.push_str(&text);
        out.push('\n');
    };
    line(format!(
        "{} seeds: {} messages, {} ticks of hands ({} of them felt something), {} cuts made, {} messages refused",
        totals.seeds, totals.messages, totals.ticks, totals.touched, totals.cuts, totals.refused
    ));
    let classes = hits.classes().map(|(class, count)| format!("{count} {class}"));
    line(format!("faults: {}", classes.join(", ")));
    line(format!("broken rules: {}", totals.violations));
    for (seed, violation) in &totals.broken {
        line(format!("  seed {seed} (scindo reliability --first {seed} --seeds 1): {violation}"));
    }
    if hands.seeds > 0 {
        line(format!(
            "hands under made-up contacts: {} ticks ({} of them felt something), {} contacts, broken rules: {}",
            hands.ticks, hands.touched, hands.messages, hands.violations
        ));
    }
    for (seed, violation) in &hands.broken {
        line(format!(
            "  seed {seed} (scindo reliability --first {seed} --seeds 1 --drill-ticks 1): {violation}"
        ));
    }
    for noticed in mutants {
        let Noticed { mutant, seeds, violations } = noticed;
        line(format!("without {}: noticed by {violations} of {seeds} seeds", mutant.name()));
    }
    for Guarantee { number, promise, tried_by, simulated } in GUARANTEES {
        let found = match (simulated, found.violations()) {
            (true, 0) => "held",
            (true, _) => "see above",
            (false, _) => "not run here",
        };
        line(format!("{number:<4} {promise}. {found}. Tried by {tried_by}"));
    }
    out
}
