//! The step: gravity, determinism, cuts that open, probes on their side, what is off costs nothing.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::{CutRequest, Inputs, ToolInput, Wants};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

use crate::{run, start};

/// The half-cut beam: 0.03 x 0.06 x 0.2 m, base held, gravity along x, cut to half its depth.
const BEAM: &str = r#"
schema = 1
name = "half-cut beam"
[world]
gravity_m_s2 = [9.81, 0, 0]
step_s = 0.01
[[body]]
id = "beam"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.03, 0.06, 0.2], cells = [3, 6, 15], pattern = "tet5" } }
young_pa = 3e5
poisson = 0.35
density_kg_m3 = 1070
rayleigh = { stiffness_s = 0.01 }
[[body.fix]]
where = { slab = { axis = "z", from = 0, to = 0 } }
"#;

const CUT: &str = r#"
[[cut]]
body = "beam"
sweep_m = [[[-0.001, -0.001, 0.101], [-0.001, 0.061, 0.101]], [[0.015, -0.001, 0.101], [0.015, 0.061, 0.101]]]
[[probe]]
id = "above"
body = "beam"
point_m = [0, 0.03, 0.101]
side = [0, 0, 1]
[[probe]]
id = "below"
body = "beam"
point_m = [0, 0.03, 0.101]
side = [0, 0, -1]
"#;

/// Refusals that only show when meshes and selections are built.
fn refusal(text: &str) -> String {
    Simulation::new(&Scene::from_toml(text).unwrap(), Path::new("")).unwrap_err().to_string()
}

/// Sub-steps of a body are steps of a shorter step of the world, also where nodes are drawn meanwhile.
#[test]
fn sub_steps_are_shorter_steps() {
    for integrator in ["implicit-euler", "bdf2", "newmark", "generalised-alpha"] {
        let drawn = "[[body.fix]]\nwhere = { slab = { axis = \"z\", from = 1, to = 1 } }\ndisplacement_m = [0, 0, 0.01]\n";
        let text = BEAM.replace("young_pa = 3e5", &format!("integrator = \"{integrator}\"\nyoung_pa = 3e4"));
        let text = format!("{}{drawn}", text.replace("rayleigh", "displacement_over_s = 0.16\nrayleigh"));
        let mut short = start(&text.replace("step_s = 0.01", "step_s = 0.005"));
        let mut whole = start(
            &text.replace("step_s = 0.01", "step_s = 0.02").replace("poisson", "sub_steps = 4\npoisson"),
        );
        run(&mut short, 40);
        run(&mut whole, 10);
        let apart = |(a, b): (&Vector3<f64>, &Vector3<f64>)| (a - b).norm();
        let [a, b] = [&short, &whole].map(|sim| sim.bodies()[0].body.positions());
        let farthest = a.iter().zip(b).map(apart).fold(0.0, f64::max);
        assert!(farthest < 1e-7, "{integrator}: {farthest:e} m");
        assert_eq!(whole.bodies()[0].counts().steps, 10);
    }
}

/// Wherever a plane lies and however far the body has moved, it parts the body; every method does.
#[test]
fn a_plane_cuts_a_moving_body_all_the_way_through() {
    let ways = [
        ("", "xfem"),
        ("element = \"tet10\"", "xfem"),
        ("", "snap"),
        ("", "subdivide"),
        ("element = \"octree\"", "links"),
    ];
    let block = BEAM.replace("cells = [3, 6, 15], pattern = \"tet5\"", "cells = [3, 6, 20]");
    for (element, method) in ways {
        let how = format!("{element}\ncutting = {{ method = \"{method}\" }}\nyoung_pa = 2e4");
        let mut text = block.replace("young_pa = 3e5", &how);
        for (at_s, height, normal) in [(0.0, 0.051, "[0.2, -0.3, 1]"), (0.06, 0.113, "[-3, 5, 40]")] {
            let plane = format!("{{ point_m = [0.01, 0.02, {height}], normal = {normal} }}");
            text += &format!("[[cut]]\nbody = \"beam\"\nat_s = {at_s}\nplane = {plane}\n");
        }
        let mut sim = start(&text);
        run(&mut sim, 10);
        assert_eq!(sim.bodies()[0].body.parts().len(), 3, "{element} {method}");
    }
}

#[test]
fn a_beam_under_gravity_bends_and_comes_to_rest() {
    let mut sim = start(BEAM);
    run(&mut sim, 300);
    let body = &sim.bodies()[0].body;
    assert!(body.positions().iter().all(|x| x.iter().all(|c| c.is_finite())));
    let tip = body.positions().iter().map(|x| x.x).fold(0.0, f64::max) - 0.03;
    assert!((0.005..0.1).contains(&tip), "tip moved {tip} m");
    let weight = body.total_mass() * 9.81;
    let held = body.reaction(&sim.bodies()[0].fix_groups[0], sim.scene().gravity_m_s2);
    assert!((held.x + weight).abs() < 0.02 * weight, "reaction {held:?}, weight {weight}");
    assert!(body.kinetic_energy() < 1e-6);
}

#[test]
fn a_half_cut_beam_opens_and_probes_stay_on_their_side() {
    let mut sim = start(&format!("{BEAM}{CUT}"));
    assert_eq!(sim.bodies()[0].epoch(), 0);
    sim.step(&Inputs::default());
    assert!(sim.report().events.iter().any(|event| event.name == "cut-applied"), "{:?}", sim.report().events);
    run(&mut sim, 199);
    let at = |i: usize| sim.probe_position(&sim.probes()[i]);
    let gap = at(0).z - at(1).z;
    assert!(gap > 5e-4, "the lips are {gap} m apart");
    let surface = sim.bodies()[0].body.surface();
    assert!(surface.tags.contains(&1));
}

#[test]
fn the_result_does_not_depend_on_threads_or_repetition() {
    let scene = Scene::from_toml(&format!("{BEAM}{CUT}")).unwrap();
    let state = |threads| {
        let options = BuildOptions { threads, portable: false };
        let mut sim = Simulation::with_options(&scene, Path::new(""), options).unwrap();
        run(&mut sim, 40);
        sim.bodies()[0].body.positions().to_vec()
    };
    let one = state(1);
    assert_eq!(one, state(1));
    assert_eq!(one, state(2));
}

#[test]
fn reset_repeats_the_run_and_raises_the_epoch() {
    let mut sim = start(&format!("{BEAM}{CUT}"));
    run(&mut sim, 20);
    let first = sim.bodies()[0].body.positions().to_vec();
    let epoch = sim.bodies()[0].epoch();
    sim.reset().unwrap();
    assert_eq!((sim.steps(), sim.time_s()), (0, 0.0));
    run(&mut sim, 20);
    assert_eq!(first, sim.bodies()[0].body.positions());
    assert!(sim.bodies()[0].epoch() > epoch);
}

#[test]
fn reset_repeats_a_touch() {
    // A ball reaches the side of a beam at rest, ten micrometres away, and then presses on it.
    let still = BEAM.replace("[9.81, 0, 0]", "[0, 0, 0]");
    let with_finger = format!(
        "{still}[[tool]]\nid = \"finger\"\nshape = {{ sphere = {{ radius_m = 0.005 }} }}\nstiffness_n_m = 300"
    );
    let touch = |sim: &mut Simulation, away_m: f64| {
        for step in 0..10_u32 {
            let x = 0.03 + 0.00501 + away_m - 5e-4 * f64::from(step);
            let tool = ToolInput::new("finger", "hand", Isometry3::translation(x, 0.03, 0.1));
            sim.step(&Inputs { tools: vec![tool], ..Inputs::default() });
        }
        sim.bodies()[0].body.positions().to_vec()
    };
    let mut sim = start(&with_finger);
    let first = touch(&mut sim, 0.0);
    assert_ne!(first, touch(&mut start(&with_finger), 0.1), "the finger touches");
    for _ in 0..3 {
        // The finger leaves the tissue before the scene starts again.
        touch(&mut sim, 0.1);
        sim.reset().unwrap();
        assert_eq!(first, touch(&mut sim, 0.0));
    }
}

#[test]
fn surfaces_and_energies_are_only_computed_for_those_who_ask() {
    let mut sim = start(BEAM);
    let mut snapshot = Snapshot::default();
    sim.step(&Inputs::default());
    sim.snapshot_into(&Wants::default(), &mut snapshot);
    assert!(snapshot.bodies[0].positions.is_empty() && snapshot.bodies[0].topology.triangles.is_empty());
    assert!(sim.report().bodies[0].energy.is_none());
    assert!(!sim.plan().is_on("surface publication") && sim.plan().is_on("gravity"));
    let wants = Wants { surface: vec![true], contact: false, energy: true, ..Wants::default() };
    sim.step(&Inputs { wants: wants.clone(), ..Inputs::default() });
    sim.snapshot_into(&wants, &mut snapshot);
    let body = &snapshot.bodies[0];
    assert_eq!(body.positions.len(), body.topology.vertex_count as usize);
    assert!(body.velocities.is_empty() && !body.topology.triangles.is_empty());
    assert!(sim.report().bodies[0].energy.unwrap().kinetic_j > 0.0);
    assert!(sim.plan().is_on("surface publication"));
}

#[test]
fn cuts_of_clients_come_back_with_their_number() {
    let mut sim = start(BEAM);
    let edge = |x: f64| [Vector3::new(x, -0.001, 0.1), Vector3::new(x, 0.061, 0.1)];
    let request = |request, body: &str, segments| CutRequest {
        request,
        tool: Arc::from("scalpel"),
        body: Some(Arc::from(body)),
        segments,
    };
    let cuts = vec![
        request(7, "beam", vec![edge(-0.001), edge(0.01)]),
        request(8, "beam", vec![edge(0.01), edge(0.02)]),
        request(9, "bean", vec![edge(0.01), edge(0.02)]),
        request(10, "beam", vec![edge(0.01), edge(f64::NAN)]),
    ];
    let report = sim.step(&Inputs { cuts, ..Inputs::default() });
    // What cannot be queued is answered first.
    let mut outcomes = report.cuts.clone();
    outcomes.sort_by_key(|outcome| outcome.request);
    let [a, b, c, d] = &outcomes[..] else { panic!("{outcomes:?}") };
    assert!(a.request == 7 && *a.result.as_ref().unwrap() > 0);
    assert!(b.request == 8 && *b.result.as_ref().unwrap() > 0);
    assert!(c.result.as_ref().unwrap_err().contains("there are: beam"));
    assert!(d.result.as_ref().unwrap_err().contains("not finite"));
    let tags = &sim.bodies()[0].body.surface().tags;
    assert_eq!(tags.iter().copied().max(), Some(1), "connected requests are one incision");
}

#[test]
fn what_selects_nothing_or_lies_outside_is_refused_together() {
    let text = format!(
        "{}\n[[probe]]\nid = \"far\"\nbody = \"beam\"\npoint_m = [0, 0, 0.5]\n",
        BEAM.replace(
            "{ slab = { axis = \"z\", from = 0, to = 0 } }",
            "{ sphere = { centre_m = [9, 9, 9], radius_m = 0.1 } }"
        )
    );
    let message = refusal(&text);
    for part in ["scene:15: body.beam.fix.0.where", "selects no node", "[0.03, 0.06, 0.2]"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    for part in [
        "probe.far.point_m",
        "outside the body",
        "3.000e-1 m away",
        "nearest point inside is [0.0, 0.0, 0.2]",
    ] {
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn millimetres_with_si_stiffness_is_warned_about() {
    let text = BEAM.replace("[0.03, 0.06, 0.2]", "[30, 60, 200]");
    let sim = start(&text);
    assert!(sim.warnings().iter().any(|w| w.contains("200.000 m long")), "{:?}", sim.warnings());
    assert!(start(BEAM).warnings().is_empty());
}

#[test]
fn mesh_files_that_are_missing_or_broken_are_refused_at_their_line() {
    let with_mesh = |mesh: &str| {
        let lines = BEAM.lines().map(|line| if line.starts_with("mesh") { mesh } else { line });
        lines.collect::<Vec<_>>().join("\n")
    };
    let missing = refusal(&with_mesh("mesh = { file = \"nowhere/liver.msh\" }"));
    for part in ["scene:9: body.beam.mesh: cannot read", "nowhere/liver.msh", "relative to the scene file"] {
        assert!(missing.contains(part), "{part}: {missing}");
    }
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("broken.msh");
    std::fs::write(&path, "$NOD\n4\n1 0 0 0\n2 1 0").unwrap();
    let broken = refusal(&with_mesh(&format!("mesh = {{ file = {path:?} }}")));
    assert!(broken.contains("scene:9: body.beam.mesh") && broken.contains("broken.msh"), "{broken}");
}

#[test]
fn the_plan_says_what_is_on_and_why_and_off_costs_nothing() {
    let plan = start(BEAM).plan();
    let effect = |name: &str| plan.effects.iter().find(|effect| effect.name == name).unwrap();
    assert!(effect("gravity").on && effect("large rotation").on && effect("damping").on);
    assert!(effect("deformation beam").predicted_ms > 0.0);
    for off in ["loads", "probes", "energies", "self-collision", "surface publication", "haptic contact"] {
        assert!(!effect(off).on && effect(off).predicted_ms == 0.0 && !effect(off).why.is_empty(), "{off}");
    }
    let text = plan.to_string();
    assert!(
        text.lines().count() == plan.effects.len() + 2 && text.contains("world.gravity_m_s2 has 9.810"),
        "{text}"
    );

    let quiet = BEAM.replace("[9.81, 0, 0]", "[0, 0, 0]").replace("\"corotational\"", "\"linear\"");
    let quiet = quiet.replace("[world]", "[effects]\ncutting = false\ncontact = false\n[world]");
    let mut sim = start(&quiet);
    assert!(!sim.plan().is_on("gravity") && !sim.plan().is_on("cutting"));
    let edge = |x: f64| [Vector3::new(x, -0.001, 0.1), Vector3::new(x, 0.061, 0.1)];
    let cut =
        CutRequest { request: 1, tool: Arc::from("t"), body: None, segments: vec![edge(-0.1), edge(0.1)] };
    let report = sim.step(&Inputs { cuts: vec![cut], ..Inputs::default() });
    assert!(report.cuts[0].result.as_ref().unwrap_err().contains("effects.cutting = false"));
    assert_eq!(sim.bodies()[0].epoch(), 0);
}

#[test]
fn an_effect_that_is_off_does_not_change_a_bit() {
    let run_with = |extra: &str| {
        let mut sim = start(&BEAM.replace("[world]", &format!("{extra}\n[world]")));
        run(&mut sim, 30);
        sim.bodies()[0].body.positions().to_vec()
    };
    let plain = run_with("");
    assert_eq!(plain, run_with("[effects]\ncutting = false\ncontact = false"));
    assert_eq!(plain, run_with("[effects]\nenergy = true"));
    assert_eq!(plain, run_with("tool = [{ id = \"idle\", shape = { sphere = { radius_m = 0.01 } } }]"));
}

/// A linear body in equilibrium follows its loads and displacements in proportion, there and back.
#[test]
fn tables_of_loads_and_displacements_are_followed() {
    let table = "[[0.1, 0], [0.2, 1], [0.3, -0.5]]";
    let share = |t: f64| match t {
        t if t < 0.1 => 0.0,
        t if t < 0.2 => 10.0 * (t - 0.1),
        t if t < 0.3 => 1.0 - 15.0 * (t - 0.2),
        _ => -0.5,
    };
    let end = "where = { slab = { axis = \"z\", from = 1, to = 1 } }";
    let load = |course: &str| format!("load = [{{ {end}, force_n = [0.05, 0, 0], {course} }}]");
    let ways = [
        (load(&format!("table = {table}")), String::new()),
        (load("ramp_s = 0.3"), String::new()),
        (
            format!("displacement_table = {table}"),
            format!("[[body.fix]]\n{end}\ndisplacement_m = [0.002, 0, 0]\n"),
        ),
    ];
    let elements =
        [("", "cells = [3, 6, 15]"), ("tet10", "cells = [3, 6, 15]"), ("octree", "cells = [3, 6, 20]")];
    for ((element, cells), (keys, tables)) in elements.iter().flat_map(|e| ways.iter().map(move |w| (*e, w)))
    {
        let element = if element.is_empty() { String::new() } else { format!("element = \"{element}\"\n") };
        let linear = "law = \"linear\"\nintegrator = \"static\"\nsolver = { tolerance = 1e-9 }";
        let text = BEAM
            .replace("[9.81, 0, 0]", "[0, 0, 0]")
            .replace("cells = [3, 6, 15]", cells)
            .replace("rayleigh = { stiffness_s = 0.01 }", &format!("{element}{linear}\n{keys}"));
        let text = if cells.contains("20") { text.replace(", pattern = \"tet5\"", "") } else { text };
        let mut sim = start(&format!("{text}{tables}"));
        let tip = |sim: &Simulation| {
            let body = &sim.bodies()[0].body;
            let ends =
                body.positions().iter().zip(body.rest_positions()).filter(|(_, rest)| rest.z > 0.2 - 1e-9);
            let (sum, n) = ends.fold((0.0, 0.0), |(sum, n), (x, rest)| (sum + x.x - rest.x, n + 1.0));
            sum / n
        };
        let mut found = Vec::new();
        for step in 1..=35 {
            run(&mut sim, 1);
            let t = f64::from(step) * 0.01;
            found.push((t, if keys.contains("ramp_s") { (t / 0.3).min(1.0) } else { share(t) }, tip(&sim)));
        }
        let full = found.iter().find(|(_, share, _)| (share - 1.0).abs() < 1e-9).unwrap().2;
        assert!(full > 1e-3, "{element}{keys}: {full}");
        for (t, share, tip) in found {
            assert!(
                (tip / full - share).abs() < 1e-5,
                "{element}{keys} at {t} s: {tip} of {full}, not {share}"
            );
        }
        // A reset begins the course anew.
        sim.reset().unwrap();
        run(&mut sim, 3);
        let expected = if keys.contains("ramp_s") { 0.1 } else { 0.0 };
        assert!((tip(&sim) / full - expected).abs() < 1e-5, "{element}{keys}: {}", tip(&sim));
    }
}

/// Displacements that arrive in proportion, whatever computes the body.
#[test]
fn what_is_held_arrives_over_the_time_it_is_given() {
    let stretched = |body: &str| {
        let fix = "[[body.fix]]\nwhere = { slab = { axis = \"z\", from = 1, to = 1 } }\ndisplacement_m = [0, 0, 0.08]\n";
        let text = BEAM.replacen("rayleigh", &format!("{body}\nrayleigh"), 1);
        start(&format!("{text}{fix}"))
    };
    let top = |sim: &Simulation| -> f64 {
        let (body, group) = (&sim.bodies()[0].body, &sim.bodies()[0].fix_groups[1]);
        let up = |&n: &u32| body.positions()[n as usize].z - body.rest_positions()[n as usize].z;
        let [least, most] = [f64::min, f64::max].map(|pick| group.iter().map(up).reduce(pick).unwrap());
        assert!(most - least < 1e-15, "{least} {most}");
        most
    };
    for more in ["", "cutting = { method = \"snap\" }", "law = \"neo-hookean\"", "element = \"tet10\""] {
        let mut sim = stretched(&format!("displacement_over_s = 0.4\n{more}"));
        for step in 1..=60 {
            run(&mut sim, 1);
            let share = (f64::from(step) / 40.0).min(1.0);
            assert!((top(&sim) - 0.08 * share).abs() < 1e-12, "{more}, step {step}: {}", top(&sim));
            assert!(sim.bodies()[0].body.least_volume_ratio() > 0.4, "{more}, step {step}");
        }
        sim.reset().unwrap();
        run(&mut sim, 4);
        assert!((top(&sim) - 0.008).abs() < 1e-12, "{more}: {}", top(&sim));
    }
    let mut sim = stretched("");
    run(&mut sim, 1);
    assert!((top(&sim) - 0.08).abs() < 1e-12, "at once, unless a time is given: {}", top(&sim));
}
