//! What a forecast says is what the run then does.

use std::sync::LazyLock;

use scindo_tests::scene::{WORLD, block, cut, held};
use scindo_world::forecast::{Effort, Ending, Forecast, forecast};
use scindo_world::inputs::Inputs;

use crate::start;

/// A block that hangs sideways from a wall.
static BLOCK: LazyLock<String> = LazyLock::new(|| {
    let keys = "young_pa = 1e5\nsolver = { iterations = 400, tolerance = 1e-4 }\n".to_owned() + &held("x");
    WORLD.replace("0.01", "0.02") + &block("block", [[0.0; 3], [0.1, 0.04, 0.04]], [10, 4, 4], &keys)
});

fn foretold(text: &str, processor_s: f64, end_s: f64) -> Forecast {
    let effort = Effort { processor_s, end_s: Some(end_s) };
    forecast(&mut start(text), effort, &mut |_| ()).unwrap()
}

/// Largest displacement [m] and mean processor time of a step [ms] of the run.
fn seen(text: &str, end_s: f64) -> (f64, f64) {
    let mut simulation = start(text);
    let (mut largest_m, mut processor_s) = (0.0, 0.0);
    while simulation.time_s() < end_s - 0.5 * simulation.step_s() {
        processor_s += simulation.step(&Inputs::default()).processor_s;
        largest_m = f64::max(largest_m, simulation.bodies()[0].displacement_m());
    }
    (largest_m, 1e3 * processor_s / simulation.steps() as f64)
}

#[test]
fn a_body_that_comes_to_rest_is_foretold_without_its_whole_run() {
    let text = BLOCK.replace("solver =", "rayleigh = { stiffness_s = 0.02 }\nsolver =");
    let said = foretold(&text, 60.0, 30.0);
    assert_eq!(said.ending, Ending::Rest, "{said}");
    assert!(said.steps < 500 && said.bodies[0].converges && said.warnings.is_empty(), "{said}");
    let (largest_m, _) = seen(&text, 2.0);
    assert!((said.bodies[0].largest_displacement_m / largest_m - 1.0).abs() < 0.01, "{said} {largest_m}");
}

#[test]
fn substeps_of_an_explicit_integrator_are_part_of_its_price() {
    let text = BLOCK
        .replace("solver = { iterations = 400, tolerance = 1e-4 }", "integrator = \"rk4\"")
        .replace("[10, 4, 4]", "[5, 2, 2]");
    let said = foretold(&text, 2.0, 0.4);
    let (_, mean_ms) = seen(&text, 0.4);
    let ratio = said.cost.mean_ms / mean_ms;
    assert!((0.5..2.0).contains(&ratio), "{said}, seen: {mean_ms} ms");
}

#[test]
fn what_a_cut_frees_and_what_stands_still_until_then_is_foretold() {
    let sweep = [[[0.05, -0.1, -0.5], [0.05, -0.1, 0.5]], [[0.05, 0.5, -0.5], [0.05, 0.5, 0.5]]];
    let text =
        BLOCK.replace("solver =", "rayleigh = { stiffness_s = 0.02 }\nsolver =") + &cut("block", 6.0, sweep);
    let said = foretold(&text, 60.0, 6.5);
    assert!(said.steps < 200, "six seconds are 300 steps: {said}");
    assert_eq!(said.bodies[0].free_parts, 1);
    assert!(
        said.warnings.iter().any(|w| w.contains("nothing holds a part after the scheduled cuts")),
        "{said:?}"
    );
}

#[test]
fn a_solver_that_stops_early_is_told_how_many_iterations_it_needs() {
    let said = foretold(&BLOCK.replace("iterations = 400", "iterations = 5"), 2.0, 0.4);
    let body = &said.bodies[0];
    assert!(!body.converges && body.needed_iterations.unwrap() > 5, "{said:?}");
    let enough = format!("iterations = {}", 2 * body.needed_iterations.unwrap());
    let then = foretold(&BLOCK.replace("iterations = 400", &enough), 2.0, 0.4);
    assert!(then.bodies[0].converges, "{then:?}");
}
