//! `scindo reliability` runs the simulator of the network and prints what scindo promises and what was tried.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use scindo::command::cli::ReliabilityArgs;
use scindo::command::signals::listen;
use scindo::command::study_progress::bar;
use scindo::error::RuntimeError;
use scindo_drill::campaign::{self, Extent, Totals};
use scindo_drill::drill;
use scindo_drill::episode::{self, EpisodeError};
use scindo_drill::guarantees::{Found, GUARANTEES, Noticed, markdown, text};
use scindo_drill::table::Mutant;
use scindo_program::say;

use crate::error::PapersError;

/// Seeds with which each safeguard is taken out.
const MUTANT_SEEDS: u64 = 100;

/// Runs the campaign. Ctrl-C ends it after the seeds that are under way.
pub(super) fn reliability(args: &ReliabilityArgs) -> Result<ExitCode, PapersError> {
    let stop = Arc::new(AtomicBool::new(false));
    listen(&stop)?;
    let failed = |error: EpisodeError| RuntimeError::System {
        what: "setting up an episode".to_owned(),
        reason: error.to_string(),
    };
    let time = args.minutes.map(|minutes| Duration::from_secs_f64(60.0 * minutes));
    let seeds = args.seeds.or(if time.is_some() { None } else { Some(1000) });
    let extent = Extent { first: args.first, seeds, time, threads: usize::from(args.threads) };
    let bar = bar(args.json);
    bar.set_length(seeds.unwrap_or(0));
    let network =
        campaign::run(episode::run, &extent, None, &stop, &|done| bar.set_position(done)).map_err(failed)?;
    let drills = Extent { seeds: Some(args.drill_ticks.div_ceil(drill::TICKS)), time: None, ..extent };
    bar.set_length(drills.seeds.unwrap_or(0));
    let hands =
        campaign::run(drill::run, &drills, None, &stop, &|done| bar.set_position(done)).map_err(failed)?;
    let mut mutants = Vec::new();
    if args.mutants {
        let some = Extent { first: 1, seeds: Some(MUTANT_SEEDS), time: None, ..extent };
        for mutant in Mutant::ALL {
            bar.set_message(format!("{mutant:?}"));
            let Totals { seeds, violations, .. } =
                campaign::run(episode::run, &some, Some(mutant), &stop, &|_| ()).map_err(failed)?;
            mutants.push(Noticed { mutant, seeds, violations });
        }
    }
    bar.finish_and_clear();
    let found = Found { network, hands, mutants };
    let interrupted = stop.load(Ordering::Relaxed);
    if let Some(path) = &args.write {
        std::fs::write(path, markdown(&found)).map_err(|error| RuntimeError::System {
            what: format!("writing {}", path.display()),
            reason: format!("{error}; choose another file with --write"),
        })?;
    }
    if args.json {
        let report = serde_json::json!({
            "interrupted": interrupted, "totals": found.network, "drill": found.hands, "mutants": found.mutants,
            "guarantees": GUARANTEES,
        });
        say!("{report}");
    } else {
        say!("{}", text(&found).trim_end());
    }
    let unnoticed = found.mutants.iter().any(|noticed| noticed.violations == 0);
    let ok = found.violations() == 0 && !unnoticed && !interrupted;
    Ok(if ok { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
