//! What viewers are told beside surfaces: rest, held parts, stress, probes, looks.

use scindo_world::inputs::{Inputs, Wants};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

use crate::start;

/// A bar of 0.2 m, its left end held, its right end drawn out by 1 %, free to become thinner.
const BAR: &str = r##"
schema = 1
name = "bar"
[[body]]
id = "bar"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.2, 0.02, 0.02], cells = [20, 2, 2], pattern = "tet6" } }
young_pa = 1e5
poisson = 0.3
density_kg_m3 = 1000
integrator = "static"
[[body.fix]]
where = { slab = { axis = "x", from = 0, to = 0 } }
axes = "x"
[[body.fix]]
where = { slab = { axis = "x", from = 1, to = 1 } }
axes = "x"
displacement_m = [0.002, 0, 0]
[[body.fix]]
where = { box = { min_m = [-1e-9, -1e-9, -1e-9], max_m = [1e-9, 1e-9, 1e-9] } }
[[body.fix]]
where = { box = { min_m = [-1e-9, 0.0199, -1e-9], max_m = [1e-9, 0.0201, 1e-9] } }
axes = "z"
[body.look]
colour = "#b5523f"
opacity = 0.5
layers = [{ depth_m = 0.002, colour = "#e8c39e" }, { depth_m = 0.01, colour = "#F0D060" }]
[[probe]]
id = "middle"
body = "bar"
point_m = [0.1, 0.01, 0.01]
"##;

fn snapshot(sim: &mut Simulation, wants: &Wants) -> Snapshot {
    let mut snapshot = Snapshot::default();
    sim.snapshot_into(wants, &mut snapshot);
    snapshot
}

#[test]
fn stress_and_probes_are_right_and_only_there_for_those_who_ask() {
    let mut sim = start(BAR);
    sim.step(&Inputs::default());
    let nobody = snapshot(&mut sim, &Wants { surface: vec![true], ..Wants::default() });
    assert!(nobody.bodies[0].stress.is_empty() && nobody.bodies[0].energy.is_none());
    assert!(nobody.probes.is_empty() && !sim.plan().is_on("surface stress"));
    let wants = Wants { stress: vec![true], measures: true, ..Wants::default() };
    let asked = snapshot(&mut sim, &wants);
    let body = &asked.bodies[0];
    assert_eq!(body.stress.len(), body.topology.vertex_count as usize);
    // E ε of a bar that is free to become thinner.
    assert!(body.stress.iter().all(|stress| (stress / 1e3 - 1.0).abs() < 0.02), "{:?}", body.stress);
    assert!((asked.probes[0].x - 0.101).abs() < 1e-5, "{}", asked.probes[0]);
    // E ε² V / 2
    let elastic = body.energy.unwrap().elastic_j;
    assert!((elastic / (0.5 * 1e5 * 1e-4 * 0.2 * 4e-4) - 1.0).abs() < 0.02, "{elastic}");
    sim.step(&Inputs { wants, ..Inputs::default() });
    assert!(sim.plan().is_on("surface stress") && sim.plan().is_on("energies"));
}

#[test]
fn the_topology_tells_rest_and_what_is_held() {
    let cut = r#"
[[cut]]
body = "bar"
sweep_m = [[[0.105, -1, -1], [0.105, -1, 1]], [[0.105, 1, -1], [0.105, 1, 1]]]
"#;
    let held_left_only =
        BAR.replace("to = 1 } }\naxes = \"x\"\ndisplacement_m = [0.002, 0, 0]", "to = 1 } }\naxes = \"x\"");
    let at = held_left_only.find("[[body.fix]]\nwhere = { slab = { axis = \"x\", from = 1").unwrap();
    let end = at + held_left_only[at..].find("axes = \"x\"\n").unwrap() + "axes = \"x\"\n".len();
    let text = format!("{}{}{cut}", &held_left_only[..at], &held_left_only[end..]);
    let mut sim = start(&text.replace("integrator = \"static\"\n", ""));
    let wants = Wants { surface: vec![true], ..Wants::default() };
    let whole = snapshot(&mut sim, &wants).bodies[0].topology.clone();
    assert_eq!(whole.rest.len(), whole.vertex_count as usize);
    for (rest, held) in whole.rest.iter().zip(&whole.held) {
        assert_eq!(*held, rest[0] < 1e-6, "{rest:?}");
    }
    assert!(whole.hangs.iter().all(|hangs| *hangs));
    sim.step(&Inputs::default());
    let parted = snapshot(&mut sim, &wants).bodies[0].topology.clone();
    assert!(parted.hangs.iter().any(|hangs| *hangs) && parted.hangs.iter().any(|hangs| !hangs));
    for (rest, hangs) in parted.rest.iter().zip(&parted.hangs) {
        if (rest[0] - 0.105).abs() > 1e-4 {
            assert_eq!(*hangs, rest[0] < 0.105, "{rest:?}");
        }
    }
}

#[test]
fn looks_are_read_and_wrong_ones_refused() {
    let scene = Scene::from_toml(BAR).unwrap();
    let look = &scene.checked().bodies[0].look;
    assert_eq!((look.colour, look.opacity), (Some(0xb5_52_3f), 0.5));
    assert_eq!(look.layers, [(0.002, 0xe8_c3_9e), (0.01, 0xf0_d0_60)]);
    let refused =
        |find: &str, replace: &str| Scene::from_toml(&BAR.replace(find, replace)).unwrap_err().to_string();
    assert!(refused("#b5523f", "red").contains("body.bar.look.colour"));
    assert!(refused("opacity = 0.5", "opacity = 0").contains("body.bar.look.opacity"));
    assert!(refused("depth_m = 0.01,", "depth_m = 0.001,").contains("from the skin inwards"));
}
