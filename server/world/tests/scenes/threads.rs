//! A scene starts as many threads as it may use, however many bodies it has.

use scindo_tests::scene::{WORLD, block};

use crate::{is_alone, run, start_with};

fn scene(bodies: usize) -> String {
    let bar = |x: f64| block(&format!("b{x}"), [[x, 0.0, 0.0], [x + 0.5, 0.1, 0.1]], [5, 1, 1], "");
    WORLD.to_owned() + &(0..bodies).map(|k| bar(k as f64)).collect::<String>()
}

/// Whether this process comes to have so many threads. One that has ended may stay in the list for a moment.
fn comes_to(threads: usize) -> bool {
    (0..10_000).any(|_| {
        let there = std::fs::read_dir("/proc/self/task").unwrap().count() == threads;
        if !there {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        there
    })
}

#[test]
fn bodies_share_their_threads() {
    if !is_alone("threads::bodies_share_their_threads") {
        return;
    }
    let others = std::fs::read_dir("/proc/self/task").unwrap().count();
    for (bodies, threads) in [(1, 1), (1, 3), (4, 1), (4, 3), (2, 5)] {
        let mut sim = start_with(&scene(bodies), threads);
        run(&mut sim, 3);
        assert!(comes_to(others + threads - 1), "{bodies} bodies on {threads} threads");
        drop(sim);
        assert!(comes_to(others), "threads end with their scene");
    }
}
