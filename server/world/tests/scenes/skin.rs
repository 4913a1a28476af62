//! A body with a skin: what is shown and touched is the skin, cut with the body.

use std::collections::BTreeSet;

use scindo_collision::SurfaceBvh;
use scindo_world::format::SurfaceMesh;
use scindo_world::inputs::Inputs;
use scindo_world::mesh_in::Organ;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

use crate::{shown, start};

const ORGAN: &str = r#"
schema = 1
[[body]]
id = "organ"
mesh = { organ = { cells = 10 } }
skin = { divisions = 4 }
young_pa = 1e4
poisson = 0.4
density_kg_m3 = 1050
[[body.fix]]
where = { slab = { axis = "x", from = 0.0, to = 0.1 } }
[[cut]]
body = "organ"
at_s = 0.04
sweep_m = [[[0.02, -0.1, 0.03], [0.02, -0.1, 0.2]], [[0.02, 0.1, 0.03], [0.02, 0.1, 0.2]]]
"#;

/// Enclosed volume [m³], after checking that every edge has two triangles.
fn volume(snapshot: &Snapshot) -> f64 {
    let body = &snapshot.bodies[0];
    let mut edges = BTreeSet::new();
    let mut six = 0.0;
    for t in &body.topology.triangles {
        (0..3).for_each(|k| assert!(edges.insert((t[k], t[(k + 1) % 3])), "an edge twice"));
        let [p, q, r] = t.map(|v| nalgebra::Vector3::from(body.positions[v as usize].map(f64::from)));
        six += p.dot(&q.cross(&r));
    }
    assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "an edge without an opposite");
    six / 6.0
}

#[test]
fn the_skin_lies_on_the_organ_and_is_cut_with_it() {
    let mut sim = start(ORGAN);
    let uncut = shown(&mut sim);
    let surface = Organ::Liver.surface();
    let exact = surface_volume(&surface);
    let skin = volume(&uncut);
    let elements = sim.bodies()[0].rest_volume_m3;
    // Twice as close to the organ as the elements are, at least.
    assert!((skin - exact).abs() < 0.5 * (elements - exact).abs(), "{skin} {elements} {exact}");
    let faces = sim.bodies()[0].body.tets().unwrap().mesh().boundary_faces().len();
    assert_eq!(uncut.bodies[0].topology.triangles.len(), 16 * faces);
    for _ in 0..4 {
        sim.step(&Inputs::default());
    }
    let cut = shown(&mut sim);
    assert!(sim.bodies()[0].body.skin().unwrap().fits());
    assert!(cut.bodies[0].topology.tags.contains(&1));
    assert!((volume(&cut) / skin - 1.0).abs() < 0.02);
    sim.reset().unwrap();
    assert_eq!(shown(&mut sim).bodies[0].topology.triangles, uncut.bodies[0].topology.triangles);
}

fn surface_volume(surface: &SurfaceMesh) -> f64 {
    let corners = surface.triangles.iter().map(|t| t.map(|v| surface.vertices[v as usize]));
    corners.map(|[p, q, r]| p.dot(&q.cross(&r)) / 6.0).sum()
}

#[test]
fn a_skin_of_own_triangles_has_the_shape_of_its_surface() {
    let surface = Organ::Kidney.surface();
    for cells in [14, 30] {
        let organ = format!("mesh = {{ organ = {{ shape = \"kidney\", cells = {cells} }} }}");
        let text = ORGAN
            .replace("mesh = { organ = { cells = 10 } }", &organ)
            .replace("divisions = 4", "triangles = \"own\"");
        let mut sim = start(&text);
        assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
        let kept = sim.bodies()[0].body.skin().unwrap().kept().unwrap();
        assert_eq!(kept.of, surface.triangles.len());
        assert!(kept.area > 0.99 && kept.area < 1.0 + 1e-9, "{kept:?}");
        let uncut = shown(&mut sim);
        let exact = surface_volume(&surface);
        assert!((volume(&uncut) / exact - 1.0).abs() < 2e-4, "{} instead of {exact}", volume(&uncut));
        // Nearly every triangle that is shown lies in one of the surface.
        let positions: Vec<[f32; 3]> =
            surface.vertices.iter().map(|v| [v.x, v.y, v.z].map(|c| c as f32)).collect();
        let tree = SurfaceBvh::new(&positions, &surface.triangles).unwrap();
        let body = &uncut.bodies[0];
        let off = |t: &&[u32; 3]| {
            let centre = t.map(|v| nalgebra::Vector3::from(body.positions[v as usize].map(f64::from)));
            let centre = (centre[0] + centre[1] + centre[2]) / 3.0;
            (tree.closest_point(centre, 1.0).unwrap().point - centre).norm() > 1e-7
        };
        let off = body.topology.triangles.iter().filter(off).count();
        assert!(off < body.topology.triangles.len() / 50, "{off} of {}", body.topology.triangles.len());
        for _ in 0..4 {
            sim.step(&Inputs::default());
        }
        let cut = shown(&mut sim);
        assert!(sim.bodies()[0].body.skin().unwrap().fits());
        assert!(cut.bodies[0].topology.tags.contains(&1));
        assert!((volume(&cut) / volume(&uncut) - 1.0).abs() < 0.02);
    }
}

#[test]
fn cells_wear_the_triangles_of_their_surface_too() {
    let surface = Organ::Kidney.surface();
    let text = ORGAN
        .replace("{ organ = { cells = 10 } }", "{ organ = { shape = \"kidney\", cells = 28 } }")
        .replace(
            "{ divisions = 4 }",
            "{ triangles = \"own\" }\nelement = \"octree\"\nsolver = { method = \"mg-pcg\" }",
        );
    let mut sim = start(&text);
    assert!(sim.warnings().is_empty(), "{:?}", sim.warnings());
    let kept = sim.bodies()[0].body.kept().unwrap();
    assert_eq!(kept.of, surface.triangles.len());
    assert!(kept.area > 0.99 && kept.area < 1.0 + 1e-9, "{kept:?}");
    let uncut = shown(&mut sim);
    let exact = surface_volume(&surface);
    assert!((volume(&uncut) / exact - 1.0).abs() < 2e-4, "{} instead of {exact}", volume(&uncut));
    for _ in 0..4 {
        sim.step(&Inputs::default());
    }
    let cut = shown(&mut sim);
    let [before, after] = [&uncut, &cut].map(|shown| &shown.bodies[0].topology);
    assert!(after.tags.contains(&1));
    assert!((volume(&cut) / volume(&uncut) - 1.0).abs() < 0.01);
    // Beside the cut the skin is that of the cells.
    let corners = |t: &[u32; 3], rest: &[[f32; 3]]| {
        let mut x = t.map(|v| rest[v as usize].map(f32::to_bits));
        x.sort_unstable();
        x
    };
    let seen: BTreeSet<_> = after.triangles.iter().map(|t| corners(t, &after.rest)).collect();
    let stayed = before.triangles.iter().filter(|t| seen.contains(&corners(t, &before.rest))).count();
    let share = stayed as f64 / before.triangles.len() as f64;
    assert!(share > 0.8 && share < 0.99, "{share} of the skin stayed");
    // It comes back with an earlier state, and with the whole body.
    let state = sim.checkpoint().unwrap();
    sim.reset().unwrap();
    assert_eq!(shown(&mut sim).bodies[0].topology.triangles, uncut.bodies[0].topology.triangles);
    sim.restore(&state).unwrap();
    let again = shown(&mut sim);
    assert_eq!(again.bodies[0].topology.triangles, cut.bodies[0].topology.triangles);
    assert_eq!(again.bodies[0].positions, cut.bodies[0].positions);
}

#[test]
fn own_triangles_need_a_surface_and_no_divisions() {
    let own = ORGAN.replace("divisions = 4", "triangles = \"own\"");
    let cube = "{ box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [2, 2, 2] } }";
    for (text, key) in [
        (own.replace("{ organ = { cells = 10 } }", cube), "body.organ.skin.triangles"),
        (own.replace("\"own\"", "\"own\", divisions = 2"), "body.organ.skin.divisions"),
        (ORGAN.replace("skin =", "element = \"octree\"\nskin ="), "body.organ.skin"),
    ] {
        let error = Scene::from_toml(&text).unwrap_err().to_string();
        assert!(error.contains(key) && (error.contains("divided") || error.contains("own")), "{error}");
    }
    let snapped =
        own.replace("\"own\"", "\"own\", snapping = 0.2").replace("skin =", "element = \"octree\"\nskin =");
    let error = Scene::from_toml(&snapped).unwrap_err().to_string();
    assert!(error.contains("body.organ.skin.snapping"), "{error}");
    // Elements far coarser than the surface keep only a part of it, and the scene says so.
    let coarse = own.replace("cells = 10", "shape = \"brain\", cells = 8");
    let mut sim = start(&coarse);
    let warning = sim.warnings().iter().find(|warning| warning.starts_with("body.organ.skin")).unwrap();
    assert!(warning.contains("triangles of the surface are on the skin"), "{warning}");
    volume(&shown(&mut sim));
}

#[test]
fn a_torn_and_crumpled_surface_still_makes_a_closed_skin() {
    let surface = Organ::Kidney.surface();
    let mut random = 1_u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as f64 / 2_f64.powi(31)
    };
    let mut text = String::new();
    for v in &surface.vertices {
        let off = [next(), next(), next()].map(|r| 4e-4 * (r - 0.5));
        text += &format!("v {} {} {}\n", v.x + off[0], v.y + off[1], v.z + off[2]);
    }
    for [a, b, c] in surface.triangles.iter().map(|t| t.map(|v| v + 1)) {
        match (20.0 * next()) as usize {
            0 => {}                                                  // a hole
            1 => text += &format!("f {a} {c} {b}\n"),                // inside out
            2 => text += &format!("f {a} {b} {c}\nf {b} {c} {a}\n"), // twice
            _ => text += &format!("f {a} {b} {c}\n"),
        }
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("torn.obj"), text).unwrap();
    let scene = ORGAN
        .replace("{ organ = { cells = 10 } }", "{ surface = \"torn.obj\", cells = 16 }")
        .replace("divisions = 4", "triangles = \"own\"");
    let mut sim = Simulation::new(&Scene::from_toml(&scene).unwrap(), folder.path()).unwrap();
    let kept = sim.bodies()[0].body.skin().unwrap().kept().unwrap();
    assert!(kept.area > 0.6 && kept.area < 1.0, "{kept:?}");
    let uncut = volume(&shown(&mut sim));
    for _ in 0..4 {
        sim.step(&Inputs::default());
    }
    assert!(sim.bodies()[0].body.skin().unwrap().fits());
    assert!((volume(&shown(&mut sim)) / uncut - 1.0).abs() < 0.02);
}

#[test]
fn a_skin_on_quadratic_elements_is_refused() {
    let text = ORGAN.replace("skin =", "element = \"tet10\"\nskin =");
    let error = Scene::from_toml(&text).unwrap_err().to_string();
    assert!(error.contains("skin"), "{error}");
    let error = Scene::from_toml(&ORGAN.replace("divisions = 4", "divisions = 99")).unwrap_err().to_string();
    assert!(error.contains("divisions"), "{error}");
}

#[test]
fn an_incision_follows_a_path_on_the_skin() {
    let path = "path_m = [[0.02, -0.03, 0.07], [0.03, 0.0, 0.07], [0.02, 0.03, 0.07]]\ndepth_m = 0.03\n";
    let at = ORGAN.find("sweep_m").unwrap();
    let mut sim = start(&format!("{}{path}", &ORGAN[..at]));
    for _ in 0..4 {
        sim.step(&Inputs::default());
    }
    let cut = shown(&mut sim);
    let body = &cut.bodies[0];
    assert!(sim.bodies()[0].body.skin().unwrap().fits());
    let lips = body.topology.triangles.iter().zip(&body.topology.tags).filter(|(_, tag)| **tag == 1);
    let wound: Vec<[f32; 3]> = lips.flat_map(|(t, _)| t.map(|v| body.positions[v as usize])).collect();
    let lowest = wound.iter().map(|p| p[2]).fold(f32::INFINITY, f32::min);
    let highest = wound.iter().map(|p| p[2]).fold(f32::NEG_INFINITY, f32::max);
    // From the skin down, and no deeper than asked for (the body hardly moved).
    assert!(highest - lowest > 0.005 && highest - lowest < 0.04, "{lowest} {highest}");
    assert!(wound.iter().all(|p| p[0] > 0.0 && p[0] < 0.05 && p[1].abs() < 0.045), "{wound:?}");
    volume(&cut);
}

#[test]
fn a_scratch_is_drawn_for_everybody_and_reported() {
    let path = "path_m = [[0.02, -0.03, 0.07], [0.03, 0.0, 0.07], [0.02, 0.03, 0.07]]\ndepth_m = 0.002\n";
    let at = ORGAN.find("sweep_m").unwrap();
    let mut sim = start(&format!("{}{path}", &ORGAN[..at]));
    let mut events = Vec::new();
    for _ in 0..4 {
        events.extend(sim.step(&Inputs::default()).events.iter().cloned());
    }
    let told = events.iter().find(|event| event.name == "cut-opens-nothing").unwrap();
    assert!(told.message.contains("drawn on the surface") && told.message.contains("mm"), "{told:?}");
    let seen = shown(&mut sim);
    let body = &seen.bodies[0];
    assert!(!body.topology.tags.contains(&1));
    let length = |[p, q]: &[[f32; 3]; 2]| (0..3).map(|k| (q[k] - p[k]).powi(2)).sum::<f32>().sqrt();
    let drawn: f32 = body.marks.iter().map(length).sum();
    // The path is 63 mm long; close to its ends the skin stands off the elements farther than the blade goes in.
    assert!(drawn > 0.05 && drawn < 0.08, "{drawn} m in {} lines", body.marks.len());
    // Each line lies on a triangle that is shown.
    let vector = |p: [f32; 3]| nalgebra::Vector3::from(p.map(f64::from));
    let tree = scindo_collision::SurfaceBvh::new(&body.positions, &body.topology.triangles).unwrap();
    for end in body.marks.iter().flatten() {
        let off = (tree.closest_point(vector(*end), 1.0).unwrap().point - vector(*end)).norm();
        assert!(off < 1e-6, "{off} m off the skin");
    }
    sim.reset().unwrap();
    assert!(shown(&mut sim).bodies[0].marks.is_empty());
}
