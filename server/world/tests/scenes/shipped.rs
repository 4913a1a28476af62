//! Every example scene runs; the demonstration dents, is cut, opens and stays finite.

use std::collections::BTreeSet;
use std::path::Path;

use scindo_world::inputs::Inputs;
use scindo_world::mesh_in::Organ;
use scindo_world::scene::{SHIPPED, Scene, ShippedScene};
use scindo_world::simulation::Simulation;

fn scenes() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes"))
}

fn run(sim: &mut Simulation, until_s: f64) {
    while sim.time_s() < until_s - 1e-9 {
        sim.step(&Inputs::default());
        for body in &sim.report().bodies {
            assert!(body.solve.residual.is_finite());
        }
    }
    for body in sim.bodies() {
        assert!(body.body.positions().iter().all(|x| x.iter().all(|c| c.abs() < 10.0)));
    }
}

fn start(name: &str, overrides: &[&str]) -> Simulation {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    let scene = Scene::load_with(&scenes().join(name), &overrides).unwrap();
    Simulation::new(&scene, scene.base_dir()).unwrap()
}

/// Both menus, `scindo demo --list` and the page's, list `SHIPPED`.
#[test]
fn every_scene_of_the_folder_ships_and_says_what_it_shows() {
    let files = std::fs::read_dir(scenes()).unwrap().map(|entry| entry.unwrap().path());
    let files: BTreeSet<String> = files
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    let shipped: BTreeSet<String> = SHIPPED.iter().map(|scene| scene.name.to_owned()).collect();
    assert_eq!(shipped, files);
    for scene in SHIPPED {
        let said = scene.description();
        assert!(said.len() > 30 && said.ends_with('.'), "{}: {said}", scene.name);
        assert_eq!(scene.read(&[]).unwrap().description(), said);
        assert_ne!(scene.read(&[]).unwrap().name(), "unnamed", "{}", scene.name);
    }
}

/// The gallery of the guide, which `tests/gallery/page.py` writes, shows the scenes as they are.
#[test]
fn the_gallery_of_the_guide_shows_every_shipped_scene() {
    let guide = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/guide"));
    let page = std::fs::read_to_string(guide.join("gallery.md")).unwrap();
    let mut entries = page.split("\n## ").skip(1);
    for scene in SHIPPED {
        let entry = entries.next().unwrap_or_default();
        let picture = format!("pictures/gallery/{}.jpg", scene.name);
        assert!(entry.starts_with(&format!("{}\n", scene.name)), "{} is not next: {entry}", scene.name);
        let command = format!("`scindo demo {}`", scene.name);
        for part in [scene.description(), format!("]({picture})"), command] {
            assert!(entry.contains(&part), "{part} is not in: {entry}");
        }
        assert!((1..=40_000).contains(&std::fs::metadata(guide.join(picture)).unwrap().len()));
    }
    assert_eq!(entries.next(), None);
}

/// Wherever the program stands, its scenes find their files inside it.
#[test]
fn shipped_scenes_bring_their_files() {
    for name in ["organ-surface", "textured-liver"] {
        let scene = ShippedScene::of_name(name).unwrap().read(&[]).unwrap();
        let mut sim = Simulation::new(&scene, scene.base_dir()).unwrap();
        assert!(sim.warnings().is_empty(), "{name}: {:?}", sim.warnings());
        run(&mut sim, 0.1);
        // A recording has the scene as JSON and looks for its files from another folder.
        let again = Scene::from_json_in(&scene.to_json().to_string(), name, Path::new("/elsewhere")).unwrap();
        assert!(Simulation::new(&again, again.base_dir()).is_ok());
    }
}

#[test]
fn the_half_cut_beam_opens() {
    let mut sim = start("half-cut-beam.toml", &[]);
    run(&mut sim, 1.0);
    let at = |i: usize| sim.probe_position(&sim.probes()[i]);
    assert!((at(0) - at(1)).norm() > 5e-4, "{} {}", at(0), at(1));
}

#[test]
fn a_block_cut_along_its_faces_comes_apart_and_its_probes_and_groups_follow() {
    let mut sim = start("cut-along-faces.toml", &[]);
    let before = (sim.bodies()[0].fix_groups[0].len(), sim.bodies()[0].body.total_mass());
    run(&mut sim, 0.5);
    let body = &sim.bodies()[0];
    assert_eq!(body.body.parts().len(), 2);
    assert!((body.body.total_mass() / before.1 - 1.0).abs() < 1e-9);
    assert_eq!(body.fix_groups[0].len(), before.0);
    let held = body.body.reaction(&body.fix_groups[0], sim.scene().gravity_m_s2);
    let at = |i: usize| sim.probe_position(&sim.probes()[i]);
    // The part cut off is pinned by the rule of the scene; the one below hangs at its base.
    assert!((at(0) - at(1)).norm() > 1e-4 && held.norm() > 0.1, "{} {} {held}", at(0), at(1));
    assert!(sim.plan().to_string().contains("change the mesh"));
    sim.reset().unwrap();
    assert_eq!(sim.bodies()[0].fix_groups[0].len(), before.0);
    run(&mut sim, 0.3);
    assert_eq!(sim.bodies()[0].body.parts().len(), 2);
}

#[test]
fn the_first_cut_opens_the_block() {
    let mut sim = start("first-cut.toml", &[]);
    run(&mut sim, 0.6);
    let tags = &sim.bodies()[0].body.surface().tags;
    assert!(tags.contains(&1));
}

/// A user's surface file, made here so that no mesh needs to be kept.
#[test]
fn an_organ_from_a_surface_file_is_cut_across() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("organ.obj");
    let surface = Organ::Liver.surface();
    let mut text = String::new();
    for v in &surface.vertices {
        text += &format!("v {} {} {}\n", 1e3 * v.x, 1e3 * v.y, 1e3 * v.z);
    }
    for [a, b, c] in &surface.triangles {
        text += &format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    }
    std::fs::write(&path, text).unwrap();
    let file = format!("body.organ.mesh.surface={:?}", path.display().to_string());
    let cut = "cut=[{ body = \"organ\", sweep_m = [[[0.02, -0.1, -0.1], [0.02, -0.1, 0.2]], [[0.02, 0.1, -0.1], [0.02, 0.1, 0.2]]] }]";
    let mut sim =
        start("organ-surface.toml", &[&file, "body.organ.mesh.cells=12", "body.organ.mesh.scale=0.001", cut]);
    assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
    run(&mut sim, 0.1);
    assert_eq!(sim.bodies()[0].body.components().len(), 2);
    let millimetres = start("organ-surface.toml", &[&file, "body.organ.mesh.cells=8"]);
    assert!(
        millimetres.warnings().iter().any(|w| w.contains("scale = 0.001")),
        "{:?}",
        millimetres.warnings()
    );
}

#[test]
fn the_demonstration_dents_is_cut_and_opens() {
    let scene = Scene::demonstration(&["body.organ.mesh.organ.cells=14".into()]).unwrap();
    let mut sim = Simulation::new(&scene, Path::new("")).unwrap();
    run(&mut sim, 0.9);
    let rest = sim.probe_position(&sim.probes()[1]) - sim.probe_position(&sim.probes()[0]);
    run(&mut sim, 2.0);
    let finger = sim.tools().iter().next().unwrap();
    let pressed = finger.force_n.z;
    assert!(pressed > 0.3, "the finger feels {} N", finger.force_n);
    run(&mut sim, 14.6);
    let body = &sim.bodies()[0].body;
    let lips = body.surface().tags.iter().filter(|tag| **tag > 0).count();
    assert!(lips > 50, "{lips} triangles on lips");
    let open = sim.probe_position(&sim.probes()[1]) - sim.probe_position(&sim.probes()[0]);
    assert!(open.norm() > rest.norm() + 5e-4, "lips were {} m apart and are {} m", rest.norm(), open.norm());
    assert!(body.least_volume_ratio() > 0.0);
    assert!(sim.report().events.iter().all(|event| event.name != "step-rolled-back"));
}

fn displacement(sim: &Simulation, probe: usize) -> nalgebra::Vector3<f64> {
    let probe = &sim.probes()[probe];
    sim.probe_position(probe) - probe.rest_m
}

/// Converged values of this beam (StVK, quadratic and finer meshes): tip u_x = 0.01197 m; linear
/// tetrahedra of this size are some 10 % too stiff.
#[test]
fn the_half_cut_equilibrium_is_found_in_one_step() {
    let mut sim = start("half-cut-equilibrium.toml", &[]);
    sim.step(&Inputs::default());
    let solve = sim.report().bodies[0].solve;
    assert!(solve.residual <= 1e-10 && solve.newton_steps < 30, "{solve:?}");
    let tip = displacement(&sim, 0);
    assert!(tip.x > 0.0095 && tip.x < 0.012, "{tip}");
    let error = sim.report().bodies[0].mesh_error.unwrap();
    assert!(error.relative > 0.1 && error.relative < 0.6, "{error:?}");
    let before = sim.bodies()[0].body.positions().to_vec();
    sim.step(&Inputs::default());
    assert_eq!(before, sim.bodies()[0].body.positions(), "an equilibrium stays");
}

#[test]
fn the_squeezed_block_keeps_its_volume() {
    let mut sim = start("squeezed-block.toml", &[]);
    run(&mut sim, 1.0);
    let body = &sim.bodies()[0];
    let change = body.body.volume() / body.rest_volume_m3 - 1.0;
    assert!(change.abs() < 5e-3, "volume changed by {change}");
    assert!(displacement(&sim, 0).x > 1e-3, "{}", displacement(&sim, 0));
}

#[test]
fn the_bar_swings_with_little_damping() {
    let mut sim = start("swinging-bar.toml", &[]);
    let mut lowest: f64 = 0.0;
    for _ in 0..60 {
        sim.step(&Inputs::default());
        lowest = lowest.min(displacement(&sim, 0).z);
    }
    assert!(lowest < -0.1, "{lowest}");
    assert!(sim.bodies()[0].body.positions().iter().all(|x| x.norm() < 0.4));
}

#[test]
fn the_block_relaxes_step_by_step_to_where_newton_goes_at_once() {
    let mut sim = start("relaxing-block.toml", &[]);
    let residuals: Vec<f64> = (0..60)
        .map(|_| {
            sim.step(&Inputs::default());
            sim.report().bodies[0].solve.residual
        })
        .collect();
    assert!(residuals[0] > 1e-4 && residuals[59] <= 1e-8, "{residuals:?}");
    let mut newton =
        start("relaxing-block.toml", &["body.block.solver={ method = \"pcg\", tolerance = 1e-8 }"]);
    newton.step(&Inputs::default());
    assert!((displacement(&sim, 0) - displacement(&newton, 0)).norm() < 1e-6);
}

/// Statics by relaxation, snapped cuts and pinned parts in one scene: after each cut the body comes to rest again, the
/// first one opens it, and the corner that the second one takes off is held.
#[test]
fn a_block_relaxes_between_cuts_that_press_its_elements() {
    let mut sim = start("relaxing-cuts.toml", &[]);
    let width =
        |sim: &Simulation| sim.probe_position(&sim.probes()[1]).x - sim.probe_position(&sim.probes()[0]).x;
    let is_at_rest = |sim: &Simulation| {
        let solve = &sim.report().bodies[0].solve;
        solve.residual <= solve.tolerance
    };
    let mass = sim.bodies()[0].body.total_mass();
    run(&mut sim, 0.58);
    let whole = width(&sim);
    assert!(is_at_rest(&sim) && whole > 0.101, "{whole}");
    run(&mut sim, 0.62);
    let cut = *sim.bodies()[0].body.snap_report().unwrap();
    assert!(cut.faces > 20 && cut.refused == 0 && cut.degenerate == 0, "{cut:?}");
    assert!(!is_at_rest(&sim));
    run(&mut sim, 1.18);
    let opened = width(&sim);
    assert!(is_at_rest(&sim) && opened > whole + 1e-3, "{whole} {opened}");
    run(&mut sim, 1.8);
    let body = &sim.bodies()[0].body;
    assert_eq!((body.parts().len(), &body.parts().free[..]), (2, &[false, false][..]));
    assert!((body.total_mass() / mass - 1.0).abs() < 1e-9 && body.least_volume_ratio() > 0.0);
    assert!(is_at_rest(&sim));
}

/// A wave of speed √(E/ρ) = 100 m/s runs from the loaded end to the held one and back in 20 ms; the
/// end then stands at twice the static extension F L / (E A) = 1 mm.
#[test]
fn the_bar_rings_at_the_speed_of_sound() {
    let mut sim = start("ringing-bar.toml", &[]);
    run(&mut sim, 0.02);
    let end = displacement(&sim, 0);
    assert!((end.x - 2e-3).abs() < 1e-4, "{end}");
    run(&mut sim, 0.04);
    assert!(displacement(&sim, 0).x.abs() < 3e-4, "{}", displacement(&sim, 0));
}

/// The dome rises with the pressure and comes down with it, and every step finds its equilibrium.
#[test]
fn the_bulge_test_rises_and_comes_down() {
    let mut sim = start("bulge-test.toml", &["body.sheet.mesh.box.cells=[6, 6, 1]"]);
    assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
    let mut heights = Vec::new();
    while sim.time_s() < 2.0 - 1e-9 {
        let until_s = sim.time_s() + 0.5;
        run(&mut sim, until_s);
        let solve = sim.report().bodies[0].solve;
        assert!(solve.residual <= 1e-6, "{solve:?}");
        heights.push(displacement(&sim, 0).z);
    }
    assert!(heights[1] > 0.01 && heights[0] > 0.6 * heights[1], "{heights:?}");
    assert!((heights[2] - heights[0]).abs() < 1e-6 && heights[3].abs() < 1e-6, "{heights:?}");
}
