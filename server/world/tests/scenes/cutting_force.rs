//! Cutting with force: a blade deforms the tissue before it, and cuts where its load exceeds the toughness.

use nalgebra::Vector3;
use scindo_world::inputs::Inputs;
use scindo_world::simulation::Simulation;

use crate::start;

/// A block of 10 × 6 × 4 cm, held below, and a blade along y that goes from 2 mm above it by `down` and `aside` [m] in
/// `seconds`.
fn scene(
    toughness: f64,
    (stiffness, most): (f64, f64),
    (down, aside): (f64, f64),
    seconds: f64,
    body: &str,
) -> String {
    let cells = if body.contains("octree") { [20, 12, 8] } else { [15, 9, 6] };
    format!(
        r#"
        schema = 1
        effects = {{ cutting_force = {force} }}
        [world]
        gravity_m_s2 = [0, 0, 0]
        step_s = 0.005
        [[body]]
        id = "flesh"
        mesh = {{ box = {{ min_m = [0, 0, 0], max_m = [0.1, 0.06, 0.04], cells = {cells:?} }} }}
        young_pa = 2e4
        poisson = 0.4
        density_kg_m3 = 1000
        rayleigh = {{ stiffness_s = 0.005 }}
        cutting = {{ toughness_j_m2 = {toughness:?} }}
        {body}
        [[body.fix]]
        where = {{ slab = {{ axis = "z", from = 0, to = 0.001 }} }}
        [[tool]]
        id = "blade"
        shape = {{ blade = {{ length_m = 0.16, thickness_m = 0.001 }} }}
        stiffness_n_m = {stiffness:?}
        max_force_n = {most:?}
        path = [
            {{ at_s = 0.0, tip_m = [0.051, -0.06, 0.042], toward = [0, 1, 0], mode = "cut" }},
            {{ at_s = {seconds:?}, tip_m = [0.051, {y:?}, {z:?}], toward = [0, 1, 0], mode = "cut" }},
        ]
        "#,
        force = !body.contains("# free"),
        y = aside - 0.06,
        z = 0.042 - down,
    )
}

struct Course {
    sim: Simulation,
    /// Work of the hand [J].
    work: f64,
    /// Force on the hand [N] after every step, and copies of nodes.
    steps: Vec<(Vector3<f64>, usize)>,
}

fn run(text: &str, seconds: f64) -> Course {
    let mut sim = start(text);
    let (mut work, mut steps, mut last) = (0.0, Vec::new(), None::<(Vector3<f64>, Vector3<f64>)>);
    for _ in 0..(seconds / 0.005).round() as usize {
        sim.step(&Inputs::default());
        let tool = sim.tools().iter().next().unwrap();
        let at = tool.pose.translation.vector;
        if let Some((from, force_n)) = last {
            work -= 0.5 * (tool.force_n + force_n).dot(&(at - from));
        }
        last = Some((at, tool.force_n));
        steps.push((tool.force_n, sim.bodies()[0].body.n_copies()));
    }
    Course { sim, work, steps }
}

/// J L for the block of 6 cm.
const WIDTH_M: f64 = 0.06;
const OCTREE: &str = "element = \"octree\"";

#[test]
fn the_hand_works_against_the_toughness() {
    let (down, along) = ((0.052, 0.0), (0.052, 0.052));
    for (what, spring, way, seconds, body) in [
        ("usual", (2000.0, 100.0), down, 1.0, ""),
        ("stiff spring", (20_000.0, 100.0), down, 1.0, ""),
        ("soft spring", (500.0, 100.0), (0.062, 0.0), 1.0, ""),
        ("fast", (2000.0, 100.0), down, 0.1, ""),
        ("slicing", (2000.0, 100.0), along, 1.0, ""),
        ("octree", (2000.0, 100.0), down, 1.0, OCTREE),
    ] {
        let course = run(&scene(50.0, spring, way, seconds, body), seconds);
        let edge = course.sim.edge_report(0).unwrap();
        let body = &course.sim.bodies()[0].body;
        let mut volumes = body.components().volume;
        volumes.sort_by(|a, b| b.total_cmp(a));
        let crumbs = volumes.iter().skip(2).sum::<f64>() / volumes.iter().sum::<f64>();
        assert!(volumes.len() > 1 && volumes[1] > 0.8 * volumes[0] && crumbs < 0.005, "{what}: {volumes:?}");
        let least = 50.0 * body.opened_area(1);
        // Between cells the lips are larger than what the blade swept.
        let bound = if what == "octree" { 0.12 } else { 0.05 };
        assert!((edge.work_j / least - 1.0).abs() < bound, "{what}: {edge:?}, J A = {least}");
        assert!(course.work > 0.98 * least, "{what}: {} J by the hand, J A = {least}", course.work);
        let most = course.steps.iter().map(|step| step.0.norm()).fold(0.0, f64::max);
        assert!(most < 1.25 * 50.0 * WIDTH_M, "{what}: {most} N");
    }
}

#[test]
fn tissue_yields_before_it_opens() {
    for body in ["", OCTREE] {
        let mut sim = start(&scene(50.0, (2000.0, 100.0), (0.052, 0.0), 1.0, body));
        let uncut = sim.bodies()[0].body.n_copies();
        let (mut force, mut dent) = (0.0, 0.0);
        for step in 0.. {
            sim.step(&Inputs::default());
            let now = sim.tools().iter().next().unwrap().force_n.norm();
            let body = &sim.bodies()[0].body;
            if body.n_copies() > uncut || body.opened_area(1) > 0.0 {
                break;
            }
            assert!(step < 150, "it opens at last");
            assert!(now >= 0.97 * force, "step {step}: {now} N after {force} N");
            (force, dent) = (now, dent_m(&sim));
        }
        assert!(force > 0.85 * 50.0 * WIDTH_M, "opened at {force} N");
        assert!(dent > 0.003, "dent of {dent} m");
    }
}

/// How far the skin below the blade has moved down [m].
fn dent_m(sim: &Simulation) -> f64 {
    let body = &sim.bodies()[0].body;
    let (x, rest) = (body.positions(), body.rest_positions());
    let top = body.surface().vertices.iter().filter(|v| v.position(rest).z > 0.0399);
    top.map(|v| v.position(rest).z - v.position(x).z).fold(0.0, f64::max)
}

#[test]
fn slicing_lowers_the_load() {
    // Mean push of the hand while the edge is deep inside, for ways with ξ = 0, 1 and 2.
    let push = |aside: f64| {
        let course = run(&scene(50.0, (20_000.0, 100.0), (0.052, aside), 1.0, ""), 1.0);
        let inside = &course.steps[70..130];
        inside.iter().map(|step| step.0.z).sum::<f64>() / inside.len() as f64
    };
    let [pressing, even, slicing] = [0.0, 0.052, 0.104].map(push);
    assert!((even / pressing - 0.5).abs() < 0.1, "{even} N of {pressing} N");
    assert!((slicing / pressing - 0.2).abs() < 0.1, "{slicing} N of {pressing} N");
}

#[test]
fn a_weak_hand_dents_and_does_not_cut() {
    let course = run(&scene(50.0, (2000.0, 2.0), (0.052, 0.0), 1.0, ""), 1.0);
    let (first, last) = (course.steps[0].1, course.steps[course.steps.len() - 1].1);
    assert_eq!(first, last);
    assert!(course.steps.iter().all(|step| step.0.norm() <= 2.0));
    assert!(dent_m(&course.sim) > 0.001);
}

#[test]
fn a_blade_that_is_drawn_back_is_free_and_finds_its_front_again() {
    let mut text = scene(50.0, (2000.0, 100.0), (0.027, 0.0), 0.6, "");
    // Down to half of the block, up to the skin, and down again.
    let back = text.rfind("]\n").unwrap();
    text.insert_str(
        back,
        "    { at_s = 1.0, tip_m = [0.051, -0.06, 0.038], toward = [0, 1, 0], mode = \"cut\" },\n\
         { at_s = 1.4, tip_m = [0.051, -0.06, 0.015], toward = [0, 1, 0], mode = \"cut\" },\n",
    );
    let course = run(&text, 1.4);
    let force = |at_s: f64| course.steps[(at_s / 0.005) as usize - 1].0.norm();
    assert!(force(0.6) > 2.0, "{} N while it cuts", force(0.6));
    assert!(force(0.95) < 0.1, "{} N while it is drawn back", force(0.95));
    assert!(force(1.4) > 1.0, "{} N where it goes on", force(1.4));
    let opened = course.sim.bodies()[0].body.opened_area(1);
    let edge = course.sim.edge_report(0).unwrap();
    assert!(edge.work_j < 1.4 * 50.0 * opened + 0.02, "not paid twice: {edge:?}, opened {opened}");
}

#[test]
fn without_the_effect_a_blade_is_as_free_as_without_toughness() {
    let bits = |text: &str| {
        let course = run(text, 0.3);
        assert!(course.steps.iter().all(|step| step.0 == Vector3::zeros()));
        assert!(course.sim.bodies()[0].body.opened_area(1) > 0.0);
        let x = course.sim.bodies()[0].body.positions();
        x.iter().flat_map(|x| x.iter().map(|x| x.to_bits())).collect::<Vec<_>>()
    };
    let text = scene(50.0, (2000.0, 100.0), (0.052, 0.0), 0.3, "# free");
    let plain = text.replace("cutting = { toughness_j_m2 = 50.0 }", "");
    assert_ne!(text, plain);
    assert_eq!(bits(&text), bits(&plain));
}

#[test]
fn a_reset_repeats_the_cut_and_undo_takes_it_back() {
    let mut sim = start(&scene(50.0, (2000.0, 100.0), (0.052, 0.0), 1.0, ""));
    let mut course = |steps: usize| {
        (0..steps).for_each(|_| drop(sim.step(&Inputs::default()).clone()));
        let x = sim.bodies()[0].body.positions();
        let bits: Vec<u64> = x.iter().flat_map(|x| x.iter().map(|x| x.to_bits())).collect();
        if steps == 120 {
            assert!(sim.bodies()[0].body.element_surface().tags.iter().any(|tag| *tag > 0));
            sim.reset().unwrap();
        }
        bits
    };
    assert!(course(120) == course(120));
    course(119);
    let body = |sim: &Simulation| sim.bodies()[0].body.element_surface().tags.iter().any(|tag| *tag > 0);
    assert!(body(&sim));
    sim.undo().unwrap();
    assert!(!body(&sim));
    sim.step(&Inputs::default());
    assert!(sim.bodies()[0].body.positions().iter().all(|x| x.iter().all(|x| x.is_finite())));
}

/// A ball of 3 mm is pressed on the skin and drawn over it.
#[test]
fn a_scalpel_cuts_as_deep_as_it_is_pressed() {
    let wound = |pressed: f64, toughness: &str| {
        let low = 0.043 - pressed;
        let text = format!(
            r#"
            schema = 1
            [world]
            gravity_m_s2 = [0, 0, 0]
            step_s = 0.005
            [[body]]
            id = "flesh"
            mesh = {{ box = {{ min_m = [0, 0, 0], max_m = [0.05, 0.06, 0.04], cells = [10, 12, 20] }} }}
            young_pa = 2e4
            poisson = 0.4
            density_kg_m3 = 1000
            rayleigh = {{ stiffness_s = 0.005 }}
            {toughness}
            [[body.fix]]
            where = {{ slab = {{ axis = "z", from = 0, to = 0.001 }} }}
            [[tool]]
            id = "scalpel"
            shape = {{ sphere = {{ radius_m = 0.003 }} }}
            stiffness_n_m = 100
            path = [
                {{ at_s = 0.0, tip_m = [0.026, 0.015, 0.045], mode = "scalpel" }},
                {{ at_s = 0.2, tip_m = [0.026, 0.015, {low:?}], mode = "scalpel" }},
                {{ at_s = 0.6, tip_m = [0.026, 0.045, {low:?}], mode = "scalpel" }},
                {{ at_s = 0.7, tip_m = [0.026, 0.045, 0.045], mode = "hover" }},
            ]
            "#
        );
        let mut sim = start(&text);
        let mut force = 0.0f64;
        for _ in 0..140 {
            sim.step(&Inputs::default());
            force = force.max(sim.tools().iter().next().unwrap().force_n.z);
        }
        let body = &sim.bodies()[0].body;
        let surface = body.element_surface();
        let lips = surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag > 0);
        let lowest =
            lips.flat_map(|(t, _)| t.map(|v| surface.vertices[v as usize].position(body.rest_positions()).z));
        (force, 0.04 - lowest.fold(0.04, f64::min))
    };
    let wounds = [0.005, 0.012, 0.02, 0.03].map(|pressed| wound(pressed, ""));
    for pair in wounds.windows(2) {
        let [(weak, shallow), (strong, deep)] = [pair[0], pair[1]];
        assert!(weak < strong && shallow <= deep, "{wounds:?}");
    }
    // Where the flesh is not squeezed much, the depth is that of the hand, to an element.
    for (force, depth) in &wounds[..2] {
        assert!((depth - force / 100.0).abs() < 0.0025, "{wounds:?}");
    }
    let depth = wounds[3].1;
    assert!(wounds[0].1 < 0.2 * depth, "{wounds:?}");
    let (_, tough) = wound(0.03, "cutting = { toughness_j_m2 = 100 }");
    assert!(tough < depth, "{tough} with toughness, {depth} without");
}
