//! A scene starts as many threads as it may use, however many bodies it has.

#![cfg(target_os = "linux")]
use std::path::Path;

use crate::is_alone;
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

fn scene(bodies: usize) -> Scene {
    let body = |k: usize| {
        format!(
            "[[body]]\nid = \"b{k}\"\nmesh = {{ box = {{ min_m = [{k}, 0, 0], max_m = [{k}.5, 0.1, 0.1], \
             cells = [5, 1, 1] }} }}\nyoung_pa = 1e4\npoisson = 0.3\ndensity_kg_m3 = 1000\n"
        )
    };
    let bodies: String = (0..bodies).map(body).collect();
    Scene::from_toml(&format!("schema = 1\nworld = {{ step_s = 0.01 }}\n{bodies}")).unwrap()
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
        let options = BuildOptions { threads, portable: false };
        let mut sim = Simulation::with_options(&scene(bodies), Path::new(""), options).unwrap();
        for _ in 0..3 {
            sim.step(&Inputs::default());
        }
        assert!(comes_to(others + threads - 1), "{bodies} bodies on {threads} threads");
        drop(sim);
        assert!(comes_to(others), "threads end with their scene");
    }
}
