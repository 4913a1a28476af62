//! Schedules of a thread team: `SCINDO_SCHEDULES=1000000 cargo test -p scindo-schedules` tries more of them.
//!
//! In every schedule each task runs exactly once and before its phase ends, no two tasks touch one block, and
//! nobody waits for ever, which the scheduler reports as a deadlock.

#![allow(clippy::unwrap_used)]

use std::panic::{AssertUnwindSafe, catch_unwind};

use scindo_schedules::storage::sync::{Arc, AtomicBool, AtomicUsize, Ordering};
use scindo_schedules::team::{Team, blocks};

/// Tries a scene by two ways of scheduling: threads in random order, and random priorities that change a few
/// times, which finds rare orders sooner (Burckhardt et al. 2010).
fn try_schedules(scene: fn()) {
    let number = std::env::var("SCINDO_SCHEDULES").map_or(10_000, |n| n.parse().unwrap());
    shuttle::check_random(scene, number);
    shuttle::check_pct(scene, number, 3);
}

/// Adds 1 to every value in one phase. A task asserts that its phase has not ended and that it is alone.
fn add_one(team: &mut Team, values: &mut [u32]) {
    let runs = Arc::new(AtomicBool::new(true));
    let inside: Arc<Vec<AtomicUsize>> = Arc::new(values.iter().map(|_| AtomicUsize::new(0)).collect());
    // Not borrowed from here, so that a task after the end of its phase would find them and complain.
    let (seen, busy) = (Arc::clone(&runs), Arc::clone(&inside));
    team.for_blocks(blocks(values, 1), move |t, part| {
        assert!(seen.load(Ordering::SeqCst), "task {t} ran after its phase");
        assert_eq!(busy[t].fetch_add(1, Ordering::SeqCst), 0, "task {t} ran twice");
        part[0] += 1;
        assert!(seen.load(Ordering::SeqCst), "task {t} was not waited for");
    });
    runs.store(false, Ordering::SeqCst);
    assert!(inside.iter().all(|count| count.load(Ordering::SeqCst) == 1), "every task once");
}

#[test]
fn phases_of_one_team() {
    try_schedules(|| {
        let mut team = Team::new(3).unwrap();
        let mut values = [0; 4];
        (0..3).for_each(|_| add_one(&mut team, &mut values));
        assert_eq!(values, [3; 4]);
    });
}

#[test]
fn teams_side_by_side() {
    try_schedules(|| {
        let (mut lead, teams) = Team::sharing(2, &[2, 3]).unwrap();
        let mut work: Vec<(Team, Vec<u32>)> = teams.into_iter().zip([vec![0; 2], vec![0; 3]]).collect();
        for _ in 0..2 {
            lead.side_by_side(blocks(&mut work, 1), |_, part| {
                let (team, values) = &mut part[0];
                add_one(team, values);
            });
        }
        assert!(work.iter().all(|(_, values)| values.iter().all(|&v| v == 2)));
    });
}

#[test]
fn more_threads_than_teams() {
    try_schedules(|| {
        let (mut lead, teams) = Team::sharing(3, &[1, 1]).unwrap();
        let mut work: Vec<(Team, Vec<u32>)> = teams.into_iter().map(|team| (team, vec![0; 2])).collect();
        lead.side_by_side(blocks(&mut work, 1), |_, part| {
            let (team, values) = &mut part[0];
            (0..2).for_each(|_| add_one(team, values));
        });
        // A team goes on alone when the lead is gone.
        drop(lead);
        let (team, values) = &mut work[1];
        add_one(team, values);
        assert_eq!((&work[0].1[..], &work[1].1[..]), (&[2, 2][..], &[3, 3][..]));
    });
}

#[test]
fn a_panic_in_a_task() {
    // Only the message of the task is expected; the default hook would print it thousands of times.
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if info.payload().downcast_ref() != Some(&"expected") {
            print(info);
        }
    }));
    try_schedules(|| {
        let mut team = Team::new(2).unwrap();
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            team.for_blocks(blocks(&mut [0; 3], 1), |t, _| assert!(t != 1, "expected"));
        }));
        assert!(panicked.is_err(), "the panic reaches the caller");
        let mut values = [0; 3];
        add_one(&mut team, &mut values);
        assert_eq!(values, [1; 3]);
    });
}
