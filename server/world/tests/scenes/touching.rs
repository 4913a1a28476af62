//! Bodies on bodies and bodies on themselves.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::Outcome;
use scindo_tests::scene;
use scindo_world::inputs::Inputs;
use scindo_world::simulation::Simulation;

use crate::start_with;

const WORLD: &str = r#"
    schema = 1
    [world]
    gravity_m_s2 = [0, 0, -9.81]
    step_s = 0.01
    [effects]
    body_collision = true
    [[obstacle]]
    id = "floor"
    half_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }
"#;

/// A block of 6 cm whose lowest corner is at these coordinates [m].
fn block(id: &str, at: [f64; 3], lines: &str) -> String {
    let cells = if lines.contains("octree") { 6 } else { 3 };
    let keys = format!("rayleigh = {{ stiffness_s = 0.005 }}\n{lines}");
    scene::block(id, [at, at.map(|x| x + 0.06)], [cells; 3], &keys)
}

/// A block that is cut through across and touches itself.
fn split(lines: &str) -> String {
    WORLD.replace("body_collision", "self_collision")
        + lines
        + &block("split", [0.0, 0.0, 0.0], "")
        + &scene::cut(
            "split",
            0.0,
            [[[-0.01, -0.01, 0.031], [0.07, -0.01, 0.031]], [[-0.01, 0.07, 0.031], [0.07, 0.07, 0.031]]],
        )
}

/// Steps; every body advances and nothing sinks in by more than `depth` cells.
fn steps(sim: &mut Simulation, n: usize, depth: f64) {
    for _ in 0..n {
        sim.step(&Inputs::default());
        let cell = sim.bodies()[0].cell_m();
        for report in sim.touch_reports() {
            assert!(report.deepest_m <= depth * cell, "step {}: {report:?}", sim.steps());
        }
        for report in &sim.report().bodies {
            assert_eq!(report.solve.outcome, Outcome::Advanced);
            assert_eq!(report.solve.notice, None);
        }
    }
}

fn kinetic(sim: &Simulation) -> f64 {
    sim.bodies().iter().map(|body| body.body.kinetic_energy()).sum()
}

fn centre(sim: &Simulation, body: usize) -> Vector3<f64> {
    sim.bodies()[body].body.centre_of_mass()
}

#[test]
fn three_blocks_fall_on_each_other_and_stay_where_they_are() {
    let text = [
        WORLD,
        &block("low", [0.0, 0.0, 0.001], ""),
        &block("middle", [0.01, 0.005, 0.063], ""),
        &block("high", [0.0, 0.01, 0.125], ""),
    ]
    .concat();
    // A column of softer jelly buckles under its own weight.
    let text = text.replace("young_pa = 2e4", "young_pa = 1e5");
    let mut sim = start_with(&text, 1);
    steps(&mut sim, 600, 0.1);
    assert!(kinetic(&sim) < 1e-8, "{}", kinetic(&sim));
    let before = [0, 1, 2].map(|body| centre(&sim, body));
    // A minute later they are still where they were.
    steps(&mut sim, 6000, 0.05);
    let drift = (0..3).map(|body| (centre(&sim, body) - before[body]).norm()).fold(0.0, f64::max);
    assert!(drift < 1e-6, "{drift}");
    let weight = 9.81 * sim.bodies()[2].body.total_mass();
    let top = sim.touch_reports().iter().find(|report| report.bodies == [1, 2]).unwrap();
    assert!((-top.force_n.z / weight - 1.0).abs() < 1e-3, "{top:?} {weight}");
}

#[test]
fn two_bodies_exchange_momentum_exactly() {
    let still = WORLD.replace("[0, 0, -9.81]", "[0, 0, 0]");
    for lines in ["", "element = \"octree\""] {
        let thrown = block("a", [0.0, 0.0, 0.2], "velocity_m_s = [1, 0, 0]");
        let text = format!("{still}{thrown}{}", block("b", [0.075, 0.02, 0.21], lines));
        let mut sim = start_with(&text, 1);
        let total = |sim: &Simulation| sim.bodies().iter().map(|b| b.body.momentum()).sum::<Vector3<f64>>();
        let (start, alone) = (total(&sim), sim.bodies()[0].body.momentum());
        let mut deepest = 0.0f64;
        for _ in 0..60 {
            sim.step(&Inputs::default());
            assert!((total(&sim) - start).norm() < 1e-6 * start.norm());
            deepest = sim.touch_reports().iter().map(|r| r.deepest_m).fold(deepest, f64::max);
        }
        assert!(deepest < 0.25 * sim.bodies()[0].cell_m(), "{deepest}");
        let left = sim.bodies()[0].body.momentum();
        assert!((left - alone).norm() > 0.3 * alone.norm(), "they met: {left} {alone}");
        assert!(sim.touch_reports().is_empty(), "and parted");
    }
}

#[test]
fn the_lips_of_a_cut_neither_stick_nor_pass_through_each_other() {
    // A block on its side is cut through and pressed together by its own weight, then pulled open.
    let text = split("");
    let mut sim = start_with(&text, 1);
    steps(&mut sim, 300, 0.1);
    let report = *sim.touch_reports().first().unwrap();
    assert!(report.bodies == [0, 0] && report.contacts > 0);
    // The upper half lies on the lower one.
    let body = &sim.bodies()[0].body;
    assert_eq!(body.parts().len(), 2);
    let mut centres = Vec::new();
    body.part_centres(&mut centres);
    let apart = (centres[0].z - centres[1].z).abs();
    assert!((0.028..0.032).contains(&apart), "{apart}");
    // Without it, the upper half falls through.
    let mut free = start_with(&text.replace("self_collision = true", "self_collision = false"), 1);
    for _ in 0..300 {
        free.step(&Inputs::default());
    }
    free.bodies()[0].body.part_centres(&mut centres);
    assert!((centres[0].z - centres[1].z).abs() < 0.02);
}

#[test]
fn a_multiplier_joins_springs_that_are_too_soft() {
    // The upper half of a block presses the springs between the lips down to 7 % of a cell.
    let mut sim = start_with(&split("[world.contact]\nstiffness = 0.2\n"), 1);
    steps(&mut sim, 300, 0.15);
    steps(&mut sim, 300, 0.022);
    let weight = 0.5 * 9.81 * sim.bodies()[0].body.total_mass();
    let report = *sim.touch_reports().first().unwrap();
    assert!((report.normal_n / weight - 1.0).abs() < 0.05, "{report:?} {weight}");
    assert!(kinetic(&sim) < 1e-8, "{}", kinetic(&sim));
}

#[test]
fn threads_change_no_bit_and_a_steady_step_allocates_nothing() {
    // Without friction the upper block would slide off.
    let text = [
        WORLD,
        "[world.contact]\nfriction = 0.5\n",
        &block("low", [0.0, 0.0, 0.001], ""),
        &block("high", [0.01, 0.005, 0.063], "element = \"octree\""),
    ]
    .concat();
    let mut sims = [1, 2, 3].map(|threads| start_with(&text, threads));
    sims.iter_mut().for_each(|sim| steps(sim, 60, 0.2));
    for sim in &sims[1..] {
        for (one, other) in sims[0].bodies().iter().zip(sim.bodies()) {
            assert!(one.body.positions() == other.body.positions());
        }
    }
    let before = allocations();
    steps(&mut sims[0], 20, 0.1);
    assert_eq!(allocations() - before, 0);
    assert!(!sims[0].touch_reports().is_empty());
    let now = centre(&sims[0], 1);
    sims[0].reset().unwrap();
    assert!(sims[0].touch_reports().is_empty());
    steps(&mut sims[0], 80, 0.2);
    assert_eq!(centre(&sims[0], 1), now);
}

#[test]
fn bodies_that_are_apart_step_as_if_the_effect_were_off() {
    let blocks = [block("low", [0.0, 0.0, 0.3], ""), block("high", [0.2, 0.0, 0.3], "")].concat();
    let on = WORLD.replace("body_collision = true", "body_collision = true\nself_collision = true");
    let [mut on, mut off] = [&on, &WORLD.replace("body_collision = true", "")]
        .map(|world| start_with(&format!("{world}{blocks}"), 1));
    for sim in [&mut on, &mut off] {
        steps(sim, 15, 0.0);
    }
    for (one, other) in on.bodies().iter().zip(off.bodies()) {
        assert!(one.body.positions() == other.body.positions());
    }
    assert!(on.plan().is_on("self-collision") && !off.plan().is_on("self-collision"));
}

/// A pressed block on another one is cut: every method of broad phase gives the same bits, also after the cut and
/// the reset, although each has then arranged another surface than a fresh one.
#[test]
fn every_broad_phase_gives_the_same_motion() {
    let bits = |method: &str| {
        let mut text =
            WORLD.replace("[effects]", &format!("contact = {{ broad_phase = \"{method}\" }}\n[effects]"));
        text += &block("low", [0.0, 0.0, 0.0], "");
        text += &block("high", [0.01, 0.0, 0.0601], "");
        text += r#"
            [[tool]]
            id = "finger"
            shape = { sphere = { radius_m = 0.01 } }
            stiffness_n_m = 200
            path = [{ at_s = 0.0, tip_m = [0.04, 0.03, 0.14] }, { at_s = 0.2, tip_m = [0.04, 0.03, 0.12] }]
            [[cut]]
            body = "high"
            at_s = 0.1
            sweep_m = [[[0.055, -0.01, 0.15], [0.055, 0.07, 0.15]], [[0.055, -0.01, 0.08], [0.055, 0.07, 0.08]]]
        "#;
        let mut sim = start_with(&text, 1);
        let mut bits = Vec::new();
        for round in 0..2 {
            (0..25).for_each(|_| drop(sim.step(&Inputs::default()).clone()));
            assert!(sim.bodies()[1].body.n_copies() > 0, "round {round}: cut");
            for body in sim.bodies() {
                bits.extend(body.body.positions().iter().flat_map(|x| x.iter().map(|x| x.to_bits())));
            }
            sim.reset().unwrap();
        }
        bits
    };
    let first = bits("aabb-tree");
    for method in ["octree", "sphere-tree", "spatial-hash", "parry-bvh"] {
        assert!(bits(method) == first, "{method}");
    }
}
