//! A tool that moves farther between two poses than the tissue is thick.

use super::super::case::{Case, Setting};
use super::super::evidence::Evidence;
use super::touch::{Run, WORLD};
use crate::lab::Trouble;

/// Case 24.
pub(super) const CASE: Case = Case {
    number: Some(24),
    name: "tool-jab",
    title: "A tool jabs at 10 m/s",
    set_up: "A sheet of tissue, 1 cm thick, held at two sides. A sphere of 5 mm radius is driven through its plane at 10 m/s: \
             its poses are 5 ms and 5 cm apart. It stays 4 cm below for 0.3 s, and is drawn back as fast.",
    rule: "Every step advances. The sphere stays above the tissue: as long as the hand is below, the tissue pushes it up. \
           The force never exceeds the largest force of the tool. 1 s after it was drawn back the sheet is where it was \
           before, to 0.1 mm.",
    source: "Jeřábková 2007, §4.1",
    quick: true,
    run: jab,
};

/// Largest force of the tool [N].
const MOST_N: f64 = 2.0;

fn jab(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let world = WORLD.replace("step_s = 0.01", "step_s = 0.005");
    let sheet = "[[body]]\nid = \"sheet\"\nyoung_pa = 5e4\npoisson = 0.4\ndensity_kg_m3 = 1000\n\
                 rayleigh = { stiffness_s = 0.01 }\n\
                 mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.01], cells = [12, 12, 2] } }\n\
                 fix = [{ where = { slab = { axis = \"x\", from = 0, to = 0.01 } } }, \
                 { where = { slab = { axis = \"x\", from = 0.99, to = 1 } } }]\n";
    let at = |time: f64, z: f64| format!("{{ at_s = {time:?}, tip_m = [0.05, 0.05, {z:?}] }}");
    // The sheet has sagged by then, and come to rest.
    let path = [at(0.0, 0.2), at(1.0, 0.2), at(1.024, -0.04), at(1.3, -0.04), at(1.324, 0.2)].join(", ");
    let tool = format!(
        "[[tool]]\nid = \"tip\"\nshape = {{ sphere = {{ radius_m = 0.005 }} }}\nstiffness_n_m = 400\n\
         max_force_n = {MOST_N:?}\npath = [{path}]\n"
    );
    let mut run = Run::new(&[&*world, sheet, &tool].concat(), setting)?;
    run.steps(200);
    let before = run.sim.bodies()[0].body.positions().to_vec();
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for _ in 200..264 {
        run.steps(1);
        let Some(tool) = run.sim.tools().iter().next() else { continue };
        most = most.max(tool.force_n.norm());
        if tool.pose.translation.z <= -0.04 + 1e-9 {
            least = least.min(tool.force_n.z);
        }
    }
    evidence.at_least("least force upwards while the hand is below", least, 0.5 * MOST_N, "N");
    evidence.at_most("largest force", most, MOST_N * (1.0 + 1e-6), "N");
    run.steps(200);
    let now = run.sim.bodies()[0].body.positions();
    let away = now.iter().zip(&before).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max);
    evidence.at_most("distance from where it was, 1 s after", away, 1e-4, "m");
    run.tell("", 1.0, &mut evidence);
    Ok(evidence)
}
