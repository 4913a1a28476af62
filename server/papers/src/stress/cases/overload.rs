//! A scene that costs more than there is time.

use scindo_study::report::chart::{Chart, Line};
use scindo_world::inputs::Inputs;

use super::super::case::{Case, Setting};
use super::super::evidence::Evidence;
use super::touch::{WORLD, block};
use crate::lab::Trouble;

/// Case 31.
pub(super) const CASE: Case = Case {
    number: Some(31),
    name: "overload",
    title: "A scene five times too slow",
    set_up: "A block with a tolerance of 1e-6 that a tool shakes, with `effects.governor`. The time of a step is set to its \
             iterations, scaled so that the first steps cost five times what is due. Later it is set to a tenth of what \
             is due.",
    rule: "The governor gives up tolerances, and says so; no residual is above 1e-2; then simulated time slows down, and that \
           is reported. When steps are cheap again, everything is taken back.",
    source: "own",
    quick: true,
    run: overload,
};

/// Length of a step [s].
const STEP_S: f64 = 0.01;

fn overload(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let lines = "solver = { tolerance = 1e-6 }\n[[body.fix]]\nwhere = { slab = { axis = \"z\", from = 0, to = 0.01 } }";
    let tool = "[[tool]]\nid = \"shaker\"\nshape = { sphere = { radius_m = 0.005 } }\nstiffness_n_m = 400\nrepeat_s = 0.4\n\
                path = [{ at_s = 0.0, tip_m = [0.03, 0.03, 0.06], mode = \"grab\" }, \
                { at_s = 0.2, tip_m = [0.04, 0.03, 0.06], mode = \"grab\" }, \
                { at_s = 0.4, tip_m = [0.03, 0.03, 0.06], mode = \"grab\" }]\n";
    let body = block("jelly", [0.0; 3], [0.06; 3], [6, 6, 6], lines);
    let text = [WORLD, "effects = { governor = true }\n", &body, tool].concat();
    let mut sim = setting.scene(&text, 1)?;
    let (mut per_iteration, mut iterations) = (0.0, 0u32);
    let mut told: Vec<(&str, u64)> = Vec::new();
    let (mut worst, mut unconverged) = (0.0f64, 0);
    let mut tolerance = Vec::new();
    for step in 0..800 {
        let report = sim.step(&Inputs::default());
        told.extend(report.events.iter().map(|event| (event.name, report.step)));
        let solve = report.bodies[0].solve;
        worst = worst.max(solve.residual);
        unconverged += usize::from(solve.is_unconverged());
        tolerance.push([f64::from(step) * STEP_S, solve.tolerance]);
        iterations += solve.iterations;
        if step == 9 {
            per_iteration = 5.0 * STEP_S * 10.0 / f64::from(iterations);
        }
        match step {
            0..=9 => {}
            10..=399 => sim.govern(per_iteration * f64::from(solve.iterations)),
            _ => sim.govern(0.1 * STEP_S),
        }
    }
    let first =
        |name: &str| told.iter().find(|(told, _)| *told == name).map_or(f64::INFINITY, |(_, at)| *at as f64);
    evidence.at_most("step at which it first gives something up", first("gave-up"), 30.0, "");
    evidence.at_most("step at which it reports slow motion", first("slow-motion"), 60.0, "");
    evidence.at_most("largest residual", worst, 1e-2, "");
    evidence.exactly("steps above their tolerance", unconverged, 0);
    let report = sim.governor_report().unwrap_or_default();
    evidence.at_least("steps in slow motion", report.slow_steps as f64, 100.0, "");
    evidence.at_least("steps at the floor", report.floor_steps as f64, 100.0, "");
    let last = tolerance.last().map_or(f64::NAN, |[_, tolerance]| *tolerance);
    evidence.at_most("tolerance at the end", last, 1e-6, "");
    evidence.at_most("step at which it keeps up again", first("real-time"), 450.0, "");
    evidence.charts.push(Chart {
        title: "Tolerance".into(),
        x_label: "time [s]".into(),
        y_label: "relative residual".into(),
        logarithmic: true,
        lines: vec![Line { name: String::new(), points: tolerance }],
    });
    Ok(evidence)
}
