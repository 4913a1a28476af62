//! Many bodies on one set of threads.

use scindo_physics::body::Outcome;
use scindo_study::trial::random::Random;
use scindo_world::inputs::Inputs;

use super::super::case::{Case, Setting};
use super::super::evidence::Evidence;
use super::touch::WORLD;
use crate::lab::Trouble;

/// Fifty bodies in a heap.
pub(super) const CASE: Case = Case {
    number: None,
    name: "fifty-bodies",
    title: "Fifty bodies fall on each other",
    set_up: "Fifty blocks of 1000 tetrahedra each, in two untidy layers over the floor. All bodies touch each other, and \
             all are stepped by one set of threads. 60 steps of 10 ms (the long form makes 600), once with one thread and \
             once with two.",
    rule: "Every step advances and is whole, all numbers stay finite, and nothing is deeper than 0.5 h in anything. Both runs \
           have the same bits.",
    source: "own",
    quick: false,
    run: fifty,
};

fn fifty(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let text = heap();
    let steps = if setting.long { 600 } else { 60 };
    let mut bits: Vec<Vec<u64>> = Vec::new();
    for threads in [1, 2] {
        let mut sim = setting.scene(&text, threads)?;
        let (mut held, mut deepest, mut touching) = (0, 0.0f64, 0);
        for _ in 0..steps {
            let report = sim.step(&Inputs::default());
            let whole = |solve: &scindo_physics::body::SolveReport| {
                solve.outcome == Outcome::Advanced && !solve.is_divided()
            };
            held += report.bodies.iter().filter(|body| !whole(&body.solve)).count();
            let rest = (0..sim.bodies().len()).map(|body| sim.rest_report(body).deepest_m);
            let touch = sim.touch_reports().iter().map(|report| report.deepest_m);
            deepest = rest.chain(touch).fold(deepest, f64::max);
            touching = touching.max(sim.touch_reports().len());
        }
        let cell = sim.bodies()[0].cell_m();
        let of = |what: &str| format!("{what}, threads: {threads}");
        evidence.exactly(of("steps held, refused or divided"), held, 0);
        evidence.at_most(of("largest depth"), deepest / cell, 0.5, "h");
        evidence.at_least(of("pairs of bodies that touch"), touching as f64, 25.0, "");
        let all = sim.bodies().iter().flat_map(|body| body.body.positions()).flatten();
        evidence.exactly(
            of("coordinates that are not finite"),
            all.clone().filter(|x| !x.is_finite()).count(),
            0,
        );
        bits.push(all.map(|x| x.to_bits()).collect());
    }
    let differ = bits[0].iter().zip(&bits[1]).filter(|(one, two)| one != two).count();
    evidence.exactly("coordinates with other bits", differ, 0);
    evidence.tell("tetrahedra of a body", 1000.0, "");
    Ok(evidence)
}

fn heap() -> String {
    let mut random = Random(3);
    let mut text = [
        WORLD,
        "effects = { body_collision = true }\n",
        "[[obstacle]]\nid = \"floor\"\nhalf_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }\n",
    ]
    .concat();
    for number in 0..50 {
        let place = [number % 5, number / 5 % 5, number / 25].map(f64::from);
        let mut aside = || 0.008 * random.uniform();
        let low = [0.07 * place[0] + aside(), 0.07 * place[1] + aside(), 0.002 + 0.053 * place[2]];
        let high = [low[0] + 0.06, low[1] + 0.06, low[2] + 0.05];
        text += &format!(
            "[[body]]\nid = \"block-{number}\"\nyoung_pa = 2e4\npoisson = 0.4\ndensity_kg_m3 = 1000\n\
             rayleigh = {{ stiffness_s = 0.005 }}\nmesh = {{ box = {{ min_m = {low:?}, max_m = {high:?}, \
             cells = [5, 5, 8], pattern = \"tet5\" }} }}\n"
        );
    }
    text
}
