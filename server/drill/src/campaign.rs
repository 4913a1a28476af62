//! Many seeds on several threads, for a time or a number.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;
use tracing::subscriber::{NoSubscriber, with_default};

use crate::episode::{EpisodeError, Outcome};
use crate::network::Hits;
use crate::table::Mutant;

/// Most broken seeds that are kept.
const MOST_BROKEN: usize = 20;

/// What a seed does: an episode of the network, or a drill of hands.
pub type Play = fn(u64, Option<Mutant>) -> Result<Outcome, EpisodeError>;

/// How much to run.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// The first seed.
    pub first: u64,
    /// The number of seeds; `None`: as many as fit into the time.
    pub seeds: Option<u64>,
    /// Time after which no seed begins any more; `None`: no limit.
    pub time: Option<Duration>,
    /// Threads. What a seed does does not depend on them.
    pub threads: usize,
}

/// What all seeds were together.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Totals {
    /// Episodes.
    pub seeds: u64,
    /// Messages on all links.
    pub messages: u64,
    /// Ticks of all hands.
    pub ticks: u64,
    /// Ticks in which a hand felt something.
    pub touched: u64,
    /// Cuts that were made.
    pub cuts: u64,
    /// Messages that servers refused.
    pub refused: u64,
    /// Faults by class.
    pub hits: Hits,
    /// Seeds that broke a rule, and which: at most twenty.
    pub broken: Vec<(u64, String)>,
    /// Seeds that broke a rule.
    pub violations: u64,
}

impl Totals {
    fn add(&mut self, one: &Outcome) {
        self.seeds += 1;
        self.messages += one.messages;
        self.ticks += one.ticks;
        self.touched += one.touched;
        self.cuts += one.cuts;
        self.refused += one.refused;
        self.hits.add(&one.hits);
        if let Some(violation) = &one.violation {
            self.violations += 1;
            if self.broken.len() < MOST_BROKEN {
                self.broken.push((one.seed, violation.clone()));
            }
        }
    }
}

/// Plays seeds and adds up what they were. `on_seed` is called with the number of finished ones.
///
/// # Errors
/// If one cannot be set up.
pub fn run(
    play: Play,
    extent: &Extent,
    mutant: Option<Mutant>,
    stop: &AtomicBool,
    on_seed: &(dyn Fn(u64) + Sync),
) -> Result<Totals, EpisodeError> {
    let (next, started) = (AtomicU64::new(0), Instant::now());
    let totals = Mutex::new(Totals::default());
    let lock = || totals.lock().unwrap_or_else(PoisonError::into_inner);
    let work = || -> Result<(), EpisodeError> {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let enough = extent.seeds.is_some_and(|seeds| number >= seeds)
                || extent.time.is_some_and(|time| started.elapsed() >= time)
                || stop.load(Ordering::Relaxed);
            if enough {
                return Ok(());
            }
            let outcome = with_default(NoSubscriber::default(), || play(extent.first + number, mutant))?;
            let mut totals = lock();
            totals.add(&outcome);
            on_seed(totals.seeds);
        }
    };
    std::thread::scope(|scope| -> Result<(), EpisodeError> {
        let workers: Vec<_> = (0..extent.threads.max(1)).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        }
        Ok(())
    })?;
    let mut totals = totals.into_inner().unwrap_or_else(PoisonError::into_inner);
    totals.broken.sort();
    Ok(totals)
}
