//! All cells of the table, on several threads. The figures do not depend on their number.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use scindo_drill::device::HANDS;
use scindo_world::scene::SceneError;

use super::trial::{self, Cell, Trial};

/// Round trips of the link [ms].
pub const DELAYS_MS: [u64; 6] = [0, 5, 20, 50, 100, 200];
/// Shares of messages lost.
pub const LOSSES: [f64; 3] = [0.0, 0.01, 0.1];

/// The cells: all of them, or the pen at three delays.
pub fn cells(quick: bool) -> Vec<Cell> {
    let mut cells = Vec::new();
    for hand in HANDS {
        for delay_ms in DELAYS_MS {
            for loss in LOSSES {
                let chosen = hand.name == "pen" && matches!(delay_ms, 0 | 20 | 100) && loss != 0.01;
                if !quick || chosen {
                    cells.push(Cell { hand, delay_ms, loss });
                }
            }
        }
    }
    cells
}

/// Runs `cells` on `threads` threads, until `stop` is raised. `done` is called after each with the number of
/// finished cells.
///
/// # Errors
/// If the tissue cannot be built.
pub fn run(
    cells: &[Cell],
    threads: usize,
    stop: &AtomicBool,
    done: &(dyn Fn(usize, &Trial) + Sync),
) -> Result<Vec<Trial>, SceneError> {
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Vec<Mutex<Option<Result<Trial, SceneError>>>> =
        cells.iter().map(|_| Mutex::new(None)).collect();
    let work = || {
        while !stop.load(Ordering::Relaxed) {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(cell) = cells.get(number) else { return };
            let result = trial::run(*cell);
            if let Ok(trial) = &result {
                done(finished.fetch_add(1, Ordering::Relaxed) + 1, trial);
            }
            *results[number].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        }
    };
    std::thread::scope(|scope| {
        (1..threads.max(1)).for_each(|_| drop(scope.spawn(work)));
        work();
    });
    results.into_iter().filter_map(|cell| cell.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// The promise of the table, for one hand: errors, steps, energy and limit cycles stay within their bounds.
    #[test]
    fn a_pen_feels_the_truth_at_every_delay_that_is_promised() {
        let stop = AtomicBool::new(false);
        let chosen = cells(true);
        let trials = run(&chosen, 2, &stop, &|_, _| {}).unwrap();
        for trial in &trials {
            let (cell, figures) = (trial.cell, trial.figures);
            assert!(trial.failures().is_empty(), "{cell:?} {figures:?}");
            assert!(figures.peak_n > 0.3, "the hand must press: {figures:?}");
        }
        let one = run(&chosen[2..3], 1, &stop, &|_, _| {}).unwrap();
        assert_eq!(one[0].figures, trials[2].figures, "threads change nothing");
    }

    #[test]
    fn the_table_has_every_hand_delay_and_loss_once() {
        assert_eq!(cells(false).len(), HANDS.len() * DELAYS_MS.len() * LOSSES.len());
        assert_eq!(cells(true).len(), 6);
    }
}
