//! Teams alone and side by side.

use std::sync::Barrier;

use super::*;
use crate::storage::sync::AtomicUsize;

#[test]
fn every_block_is_visited_once_by_any_number_of_members() {
    for threads in [1, 2, 3, 8] {
        let mut team = Team::new(threads).unwrap();
        let (mut values, mut sums) = (vec![0_u32; 1003], vec![0_u32; 101]);
        for _ in 0..200 {
            team.for_blocks((blocks(&mut values, 10), blocks(&mut sums, 1)), |i, (part, sum)| {
                part.iter_mut().for_each(|v| *v += i as u32);
                sum[0] = part.iter().sum();
            });
        }
        assert!(values.iter().enumerate().all(|(k, &v)| v == 200 * (k as u32 / 10)));
        assert_eq!(sums.iter().sum::<u32>(), values.iter().sum());
    }
}

#[test]
fn a_panic_in_a_task_reaches_the_caller_and_the_team_goes_on() {
    let mut team = Team::new(2).unwrap();
    let mut values = [0; 64];
    let panicked = catch_unwind(AssertUnwindSafe(|| {
        team.for_blocks(blocks(&mut values, 1), |i, _| assert!(i != 40, "expected"));
    }));
    assert!(panicked.is_err());
    team.for_blocks(blocks(&mut values, 1), |i, v| v[0] = i);
    assert!(values.iter().enumerate().all(|(i, v)| i == *v));
}

/// Adds 1 to every value of a list, in one phase of its team.
fn add_one(team: &mut Team, values: &mut [u32]) {
    team.for_blocks(blocks(values, 10), |_, part| part.iter_mut().for_each(|v| *v += 1));
}

#[test]
fn teams_side_by_side_visit_every_block_of_each_once() {
    for (threads, lengths) in [(1, vec![95, 40]), (2, vec![95, 40]), (3, vec![7, 950, 40, 0, 95])] {
        let (mut lead, teams) = Team::sharing(threads, &lengths).unwrap();
        let lists = lengths.iter().map(|&length| vec![0; length]);
        let mut work: Vec<(Team, Vec<u32>)> = teams.into_iter().zip(lists).collect();
        for _ in 0..100 {
            lead.side_by_side(blocks(&mut work, 1), |_, part| {
                let (team, values) = &mut part[0];
                (0..3).for_each(|_| add_one(team, values));
            });
        }
        assert!(work.iter().all(|(_, values)| values.iter().all(|&v| v == 300)), "{threads} threads");
    }
}

#[test]
fn two_teams_are_led_at_the_same_time() {
    let (mut lead, _teams) = Team::sharing(2, &[1, 1]).unwrap();
    // Whoever takes one of the two tasks waits for the other to begin.
    let (both, mut began) = (Barrier::new(2), [false; 2]);
    lead.side_by_side(blocks(&mut began, 1), |_, began| {
        both.wait();
        began[0] = true;
    });
    assert_eq!(began, [true; 2]);
}

#[test]
fn a_thread_without_a_team_to_lead_helps_the_others() {
    for leads in [0, 1] {
        let (mut lead, mut teams) = Team::sharing(2, &[1, 1]).unwrap();
        for _ in 0..20 {
            lead.side_by_side(blocks(&mut teams, 1), |t, team| {
                if t == leads {
                    // Two tasks that wait for each other need two threads inside one phase.
                    let (both, mut met) = (Barrier::new(2), [false; 2]);
                    team[0].for_blocks(blocks(&mut met, 1), |_, met| {
                        both.wait();
                        met[0] = true;
                    });
                    assert_eq!(met, [true; 2]);
                }
            });
        }
    }
}

#[test]
fn teams_on_shared_threads_also_work_on_their_own() {
    let (lead, mut teams) = Team::sharing(3, &[5, 1]).unwrap();
    drop(lead);
    let mut values = [0; 95];
    (0..50).for_each(|_| teams.iter_mut().for_each(|team| add_one(team, &mut values)));
    assert!(values.iter().all(|&v| v == 100));
}

#[test]
fn any_number_of_teams_shares_one_set_of_threads() {
    let (lead, teams) = Team::sharing(3, &[1; 5]).unwrap();
    assert!(teams.iter().all(|team| team.threads() == 3 && Arc::ptr_eq(&team.threads, &lead.team.threads)));
    assert_eq!(Arc::strong_count(&lead.team.threads), 6, "one set for the lead and five teams");
}

#[test]
fn a_panic_under_one_team_spares_the_others_and_reaches_the_caller() {
    let (mut lead, mut teams) = Team::sharing(2, &[1, 1, 1]).unwrap();
    let done = AtomicUsize::new(0);
    let panicked = catch_unwind(AssertUnwindSafe(|| {
        lead.side_by_side(blocks(&mut teams, 1), |t, team| {
            team[0].for_blocks(blocks(&mut [0; 40], 1), |i, _| assert!((t, i) != (1, 20), "expected"));
            done.fetch_add(1, Ordering::Relaxed);
        });
    }));
    assert!(panicked.is_err());
    // The thread that panicked takes no further task; the other one does.
    assert!(done.load(Ordering::Relaxed) >= 1);
    let mut values = [0; 95];
    teams.iter_mut().for_each(|team| add_one(team, &mut values));
    assert!(values.iter().all(|&v| v == 3));
}

#[test]
fn threads_are_at_home_with_the_teams_by_size() {
    let homes = |members: usize, sizes: &[usize]| -> Vec<usize> {
        (0..members).map(|member| threads::home(member, members, sizes)).collect()
    };
    assert_eq!(homes(4, &[100, 100]), [1, 1, 2, 2]);
    assert_eq!(homes(8, &[100, 600, 100]), [1, 2, 2, 2, 2, 2, 2, 3]);
    assert_eq!(homes(2, &[1, 1000, 1]), [2, 2]);
    assert_eq!(homes(3, &[0, 0]), [1, 1, 1]);
}
