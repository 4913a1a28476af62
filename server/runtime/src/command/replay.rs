//! `scindo replay`: computes a recording again, and says where it comes out otherwise.

use std::process::ExitCode;
use std::time::Instant;

use scindo_program::say;
use serde_json::json;

use super::cli::ReplayArgs;
use super::progress::Progress;
use crate::error::RuntimeError;
use crate::record::replay::Replay;

/// Runs the command. Exit codes: 0 all is the same, 1 a step differs or cannot be made, 2 no recording.
pub fn replay(args: &ReplayArgs) -> Result<ExitCode, RuntimeError> {
    let started = Instant::now();
    let mut replay = Replay::open(&args.file, usize::from(args.threads), from_s(args.from)?)?;
    let progress = Progress::begin("steps", None, args.json);
    while let Some(number) = replay.step()? {
        progress.at(number);
        if args.verify && replay.found().first_difference.is_some() {
            break;
        }
    }
    progress.end();
    let found = replay.found();
    let differs = args.verify && found.first_difference.is_some();
    let simulation = replay.simulation();
    if args.json {
        let report = json!({ "replayed": {
            "file": args.file, "verified": args.verify, "differs": differs, "found": found,
            "step": simulation.steps(), "cuts_applied": simulation.cuts_applied(),
            "hash": format!("{:032x}", simulation.state_hash()), "wall_s": started.elapsed().as_secs_f64(),
        }});
        say!("{report}");
    } else {
        let from = if found.from > 0 { format!(" after step {}", found.from) } else { String::new() };
        say!("replayed {} steps{from}, {} cuts", found.steps, simulation.cuts_applied());
        if let Some(why) = &found.truncated {
            say!("  the file has no end: {why}");
        }
        for jump in &found.jumps {
            say!("  went on from a checkpoint {jump}");
        }
        match (&found.first_difference, args.verify) {
            (_, false) => {}
            (None, true) => say!("  the states after {} steps are the same, bit for bit", found.compared),
            (Some(first), true) => say!(
                "  differs first after step {} of the recording (step {} of the scene): hash {} now, {} recorded",
                first.number,
                first.step,
                first.found,
                first.recorded
            ),
        }
    }
    Ok(if differs { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn from_s(from: Option<f64>) -> Result<Option<f64>, RuntimeError> {
    match from {
        Some(seconds) if !seconds.is_finite() || seconds < 0.0 => Err(RuntimeError::Option {
            option: "--from",
            value: seconds.to_string(),
            reason: "a simulated time must be 0 or more".to_owned(),
            next: "Leave it out to begin at the start".to_owned(),
        }),
        from => Ok(from),
    }
}
