//! The files of a run: complete, readable, and telling the truth.

use std::path::Path;

use scindo_tests::scene::FLOOR;
use scindo_world::format::{MeshFile, read_mesh_bytes};
use scindo_world::inputs::Inputs;
use scindo_world::results::Results;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

const SCENE: &str = r#"
schema = 1
name = "two blocks"
[world]
gravity_m_s2 = [0, 0, -9.81]
step_s = 0.01
[results]
series_steps = 5
[[body]]
id = "held"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [4, 4, 4], pattern = "tet6" } }
young_pa = 1e5
poisson = 0.4
density_kg_m3 = 1000
[[body.fix]]
where = { half_space = { point_m = [0, 0, 1e-6], normal = [0, 0, -1] } }
[[body]]
id = "loose"
mesh = { box = { min_m = [0.2, 0, 0], max_m = [0.3, 0.1, 0.1], cells = [2, 2, 2] } }
young_pa = 1e5
poisson = 0.4
density_kg_m3 = 1000
[[cut]]
body = "held"
at_s = 0.05
sweep_m = [[[-0.01, -0.01, 0.062], [-0.01, 0.11, 0.062]], [[0.11, -0.01, 0.062], [0.11, 0.11, 0.062]]]
[[probe]]
id = "corner"
body = "loose"
point_m = [0.2, 0, 0]
"#;

#[test]
fn summary_probes_and_fields_are_complete() {
    let scene = Scene::from_toml(SCENE).unwrap();
    let mut sim = Simulation::new(&scene, Path::new("")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let mut results = Results::begin(directory.path(), &scene, &sim).unwrap();
    for _ in 0..20 {
        sim.step(&Inputs::default());
        results.record(&sim).unwrap();
    }
    results.finish(&sim, "done").unwrap();

    let text = std::fs::read_to_string(directory.path().join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((summary["status"].as_str(), summary["steps"].as_u64()), (Some("done"), Some(20)));
    let held = &summary["bodies"][0];
    assert_eq!((held["parts"].as_u64(), held["incisions"].as_u64()), (Some(2), Some(1)));
    assert!(held["finite"].as_bool().unwrap() && held["lip_triangles"].as_u64().unwrap() > 0);
    assert!(held["solver"]["mean_iterations"].as_f64().unwrap() > 1.0);
    assert_eq!(summary["events"][0]["name"], "cut-applied");
    assert_eq!(summary["timing"]["stages"].as_array().unwrap().len(), 7);
    assert_eq!(summary["scene"]["name"], "two blocks");

    let rows: Vec<csv::StringRecord> = csv::Reader::from_path(directory.path().join("probes.csv"))
        .unwrap()
        .records()
        .map(Result::unwrap)
        .collect();
    assert_eq!(rows.len(), 21);
    let last = rows.last().unwrap();
    assert_eq!((&last[0], &last[2]), ("20", "corner"));
    let fallen: f64 = last[8].parse().unwrap();
    // Implicit Euler falls by g h² n (n + 1) / 2.
    assert!((fallen + 9.81 * 1e-4 * 210.0).abs() < 1e-6, "{fallen}");

    let pvd = std::fs::read_to_string(directory.path().join("series.pvd")).unwrap();
    assert_eq!(pvd.matches("<DataSet").count(), 2 * 4);
    assert!(pvd.contains("part=\"1\" file=\"step_000005-surface.vtp\""), "{pvd}");
    let vtu = std::fs::read_to_string(directory.path().join("final.vtu")).unwrap();
    for name in ["displacement_m", "rest_position_m", "von_mises_pa", "cauchy_stress_pa", "piece", "element"]
    {
        assert!(vtu.contains(&format!("Name=\"{name}\"")), "{name}");
    }
    let surface = std::fs::read_to_string(directory.path().join("final-surface.vtp")).unwrap();
    assert!(surface.contains("Name=\"cut_tag\"") && !vtu.contains("Name=\"cut_tag\""));
    let both = std::fs::read_to_string(directory.path().join("final.vtm")).unwrap();
    assert!(both.contains("file=\"final.vtu\"") && both.contains("file=\"final-surface.vtp\""), "{both}");
    let volume: f64 = sim.bodies().iter().map(|body| body.body.volume()).sum();
    assert_tets_fill(vtu.as_bytes(), volume);
}

/// The tetrahedra of a file are positive and fill `volume` [m³]: none overlaps another one.
fn assert_tets_fill(vtu: &[u8], volume: f64) {
    let Ok(MeshFile::Volume(mesh)) = read_mesh_bytes("final.vtu", vtu) else { panic!("not a volume") };
    let volume_of = |tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(|node| mesh.nodes[node as usize]);
        (b - a).dot(&(c - a).cross(&(d - a))) / 6.0
    };
    let volumes: Vec<f64> = mesh.tets.iter().map(volume_of).collect();
    assert!(volumes.iter().all(|&volume| volume > 0.0));
    let sum: f64 = volumes.iter().sum();
    assert!((sum / volume - 1.0).abs() < 1e-9, "tetrahedra of {sum} m³, the bodies have {volume} m³");
}

#[test]
fn an_unwritable_directory_is_named() {
    let scene = Scene::from_toml(SCENE).unwrap();
    let sim = Simulation::new(&scene, Path::new("")).unwrap();
    let error = Results::begin(Path::new("/proc/nowhere/out"), &scene, &sim).unwrap_err().to_string();
    assert!(error.contains("/proc/nowhere/out") && error.contains("writable"), "{error}");
}

#[test]
fn the_summary_tells_who_touched_whom() {
    let damped = "id = \"loose\"\nrayleigh = { mass_1_s = 20.0, stiffness_s = 0.01 }";
    let scene = Scene::from_toml(&(SCENE.replace("id = \"loose\"", damped) + FLOOR)).unwrap();
    let mut sim = Simulation::new(&scene, Path::new("")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let mut results = Results::begin(directory.path(), &scene, &sim).unwrap();
    for _ in 0..150 {
        sim.step(&Inputs::default());
        results.record(&sim).unwrap();
    }
    results.finish(&sim, "done").unwrap();
    let text = std::fs::read_to_string(directory.path().join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    let contacts = summary["contacts"].as_array().unwrap();
    let of = |body: &str| contacts.iter().find(|contact| contact["on"] == body).unwrap();
    let loose = of("loose");
    assert_eq!((&loose["kind"], &loose["by"]), (&"obstacle".into(), &"floor".into()));
    let weight = 9.81 * 1e-3 * 1000.0;
    let carried = loose["force_n"][2].as_f64().unwrap();
    assert!((carried / weight - 1.0).abs() < 0.02, "{carried} of {weight}");
    assert!(loose["largest_force_n"].as_f64().unwrap() >= carried);
    assert!(loose["largest_depth_m"].as_f64().unwrap() >= loose["deepest_m"].as_f64().unwrap());
    // The table has a row for each step of the contact; the last one is what the summary calls the end.
    let rows: Vec<csv::StringRecord> = csv::Reader::from_path(directory.path().join("contacts.csv"))
        .unwrap()
        .records()
        .map(Result::unwrap)
        .filter(|row| &row[3] == "loose")
        .collect();
    assert_eq!(rows.len() as u64, loose["steps"].as_u64().unwrap());
    let last = rows.last().unwrap();
    // Both files have the same digits; the reader of JSON may lose the last one.
    assert!(&last[0] == "150" && text.contains(&last[9]), "{last:?}: {carried}");
    assert!((last[9].parse::<f64>().unwrap() / carried - 1.0).abs() < 1e-15);
    assert_eq!(last[5].parse::<u64>().unwrap(), loose["contacts"].as_u64().unwrap());
}

/// A strip that is drawn out and let back: the clamps pull equally, and in proportion but for the law.
#[test]
fn reactions_are_a_force_displacement_curve() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/tensile-test.toml");
    let scene = Scene::load(&file).unwrap();
    let mut sim = Simulation::new(&scene, scene.base_dir()).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let mut results = Results::begin(directory.path(), &scene, &sim).unwrap();
    for _ in 0..40 {
        sim.step(&Inputs::default());
        results.record(&sim).unwrap();
    }
    results.finish(&sim, "done").unwrap();
    let rows: Vec<Vec<f64>> = csv::Reader::from_path(directory.path().join("reactions.csv"))
        .unwrap()
        .records()
        .map(|row| row.unwrap().iter().map(|field| field.parse().unwrap_or(f64::NAN)).collect())
        .collect();
    assert_eq!(rows.len(), 2 * 40);
    let (left, right): (Vec<&Vec<f64>>, Vec<&Vec<f64>>) = rows.iter().partition(|row| row[3] == 0.0);
    let full = right[19][5];
    // Young's modulus 1e5 Pa, 1e-4 m² and a strain of a quarter: 2.5 N but for the lateral contraction at the clamps.
    assert!((2.0..3.0).contains(&full), "{full}");
    for (step, (left, right)) in (1..).zip(left.iter().zip(&right)) {
        let t = f64::from(step) / 20.0;
        let share = if t < 1.0 { t } else { 1.0 - 0.8 * (t - 1.0) };
        assert_eq!((left[0], right[0]), (f64::from(step), f64::from(step)));
        assert!((right[4] - share).abs() < 1e-12);
        assert!((left[5] + right[5]).abs() < 1e-4 * full, "{left:?} {right:?}");
        assert!(right[5] >= 0.6 * share * full - 1e-4 * full && right[5] <= 1.4 * share * full + 1e-4 * full);
    }
    // Nothing changes in the other scene, and nothing is written.
    let scene = Scene::from_toml(SCENE).unwrap();
    let sim = Simulation::new(&scene, Path::new("")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    Results::begin(directory.path(), &scene, &sim).unwrap();
    assert!(!directory.path().join("reactions.csv").exists());
}
