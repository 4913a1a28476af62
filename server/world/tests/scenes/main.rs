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
mod threads;
mod touching;
mod undo;
mod viscoelastic;

use std::process::Command;

#[global_allocator]
static ALLOCATOR: scindo_allocations::Counting = scindo_allocations::Counting;

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
