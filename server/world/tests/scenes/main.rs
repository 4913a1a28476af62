//! The world as its callers use it: from the text of a scene to what a step leaves behind.

#![allow(clippy::unwrap_used)]

mod adaptation;
mod bad_scenes;
mod checkpoint;
mod contact_allocation;
mod converges;
mod cutting_force;
mod fibres;
mod forceps;
mod forces;
mod forecast;
mod live;
mod materials;
mod mistakes;
mod obstacles;
mod octree;
mod phases;
mod readme;
mod reference;
mod results;
mod rubbing;
mod shipped;
mod shown;
mod side_by_side;
mod simulation;
mod skin;
mod sleeping;
mod spans;
mod stabbed_blade;
mod steady;
mod texture;
#[cfg(target_os = "linux")]
mod threads;
mod touching;
mod undo;
mod viscoelastic;

use std::path::Path;
use std::process::Command;

use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

#[global_allocator]
static ALLOCATOR: scindo_allocations::Counting = scindo_allocations::Counting;

/// The simulation of a scene that needs no files.
fn start(text: &str) -> Simulation {
    Simulation::new(&Scene::from_toml(text).unwrap(), Path::new("")).unwrap()
}

/// The same on so many threads.
fn start_with(text: &str, threads: usize) -> Simulation {
    let options = BuildOptions { threads, portable: false };
    Simulation::with_options(&Scene::from_toml(text).unwrap(), Path::new(""), options).unwrap()
}

/// Steps without input.
fn run(sim: &mut Simulation, steps: usize) {
    for _ in 0..steps {
        sim.step(&Inputs::default());
    }
}

/// What somebody sees who wants the surfaces.
fn shown(sim: &mut Simulation) -> Snapshot {
    let mut snapshot = Snapshot::default();
    sim.snapshot_into(&Wants { surface: vec![true], ..Wants::default() }, &mut snapshot);
    snapshot
}

/// Whether this process runs nothing but the test `name`; if not, the test is run in a process of its own. For tests of
/// what all tests of a process share: its threads, and which places in the code are logged.
fn is_alone(name: &str) -> bool {
    const MARK: &str = "SCINDO_TEST_IS_ALONE";
    if std::env::var_os(MARK).is_some() {
        return true;
    }
    let itself = std::env::current_exe().unwrap();
    let run =
        Command::new(itself).args(["--exact", name, "--test-threads=1"]).env(MARK, "1").output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(
        run.status.success() && said.contains(" 1 passed;"),
        "{said}{}",
        String::from_utf8_lossy(&run.stderr)
    );
    false
}
