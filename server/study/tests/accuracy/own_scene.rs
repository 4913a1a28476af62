//! `scindo accuracy SCENE`: an answer for every scene that runs, within its time, and none that the
//! reference cannot carry.
use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use scindo_study::bench::runner::{Ask, Runner};
use scindo_study::case::{Ladder, Truth};
use scindo_study::design::Configuration;
use scindo_study::design::axes::{Factor, Setting};
use scindo_study::reference::Climb;
use scindo_study::reference::limit::UNKNOWN;
use scindo_study::trial::series::Series;
use scindo_study::trial::{Status, Trial};
use scindo_study::{Settings, StudyResult, run};

fn study(directory: &Path, scene: &str) -> StudyResult {
    let path = directory.join("scene.toml");
    std::fs::write(&path, scene).unwrap();
    let settings = Settings {
        cases: vec![path.display().to_string()],
        out: directory.join("out"),
        quick: true,
        within_s: Some(4.0),
        budget_ms: Some(1e4),
        seconds: None,
        only: Vec::new(),
        cells: Vec::new(),
        surface: None,
        stop: Arc::new(AtomicBool::new(false)),
    };
    let mut told = Vec::new();
    let result = run(&settings, &mut |progress| told.extend(progress.note.clone())).unwrap();
    if result.cases[0].points.is_empty() {
        assert!(told.is_empty());
    } else {
        assert!(told[0].contains("Estimate"), "{told:?}");
    }
    result
}

const HEX: &str = r#"
schema = 1
[world]
gravity_m_s2 = [0, 0, -9.81]
[[body]]
id = "block"
element = "hex8"
mesh = { box = { min_m = [0,0,0], max_m = [0.1,0.1,0.1], cells = [2,2,2], pattern = "hex" } }
law = "linear"
young_pa = 1e4
poisson = 0.3
density_kg_m3 = 1000
integrator = "static"
solver = { method = "cholesky", tolerance = 1e-8 }
[[body.fix]]
where = { slab = { axis = "x", from = 0, to = 0.3 } }
"#;

#[test]
fn a_hexahedral_pattern_gets_a_reference_and_a_recommendation() {
    let directory = tempfile::tempdir().unwrap();
    let result = study(directory.path(), HEX);
    let case = &result.cases[0];
    let reference = case.reference.as_ref().unwrap();
    assert!(reference.error_bar < 0.2, "{reference:?}");
    assert!(result.has_results());
    let elements: Vec<&str> = case
        .points
        .iter()
        .filter(|point| point.errors.is_some())
        .map(|point| point.configuration.label(Factor::Element))
        .collect();
    for element in ["hex8", "tet4", "tet10"] {
        assert!(elements.contains(&element), "{element}: {elements:?}");
    }
    let advice = case.recommendation.as_ref().unwrap();
    let error = advice.error.unwrap();
    assert!(advice.choice.is_some() && (error > advice.error_bar || advice.indistinguishable), "{advice:?}");
    for file in ["index.html", "study.json", "points.csv"] {
        assert!(directory.path().join("out").join(file).exists(), "{file}");
    }
    let page = std::fs::read_to_string(directory.path().join("out/index.html")).unwrap();
    assert!(page.contains("href=\"points.csv\"") && page.contains("class=\"advice answer\""));
    // The region ends at 0.3 of the block, where no face of its two cells lies: the reader is told.
    assert!(case.notes.iter().any(|note| note.contains("`body.block.fix.0` selects")), "{:?}", case.notes);
}

#[test]
fn a_scene_that_cannot_be_run_has_no_results_and_says_why() {
    let directory = tempfile::tempdir().unwrap();
    let outside = format!("{HEX}[[probe]]\nid = \"p\"\nbody = \"block\"\npoint_m = [9, 9, 9]\n");
    let result = study(directory.path(), &outside);
    assert!(!result.has_results());
    let why = result.cases[0].reference.as_ref().unwrap_err();
    assert!(why.contains("with its own settings gives no result"), "{why}");
}

/// Runs of u = 1 + h that take h⁻³ of simulated time; from `broken` cells on they fail.
struct Fake {
    left_s: Cell<f64>,
    runs: usize,
    broken: f64,
}

impl Fake {
    fn new(left_s: f64, broken: f64) -> Self {
        Self { left_s: Cell::new(left_s), runs: 0, broken }
    }
}

impl Runner for Fake {
    fn run(&mut self, configuration: &Configuration, ask: Ask) -> Option<Trial> {
        let seconds = self.forecast_s(configuration, ask.timed);
        self.left_s.set(self.left_s.get() - seconds.min(ask.cap_s));
        self.runs += 1;
        let n = configuration.setting(Factor::Mesh).unwrap().size;
        if n >= self.broken {
            return Some(Trial::refused("broken".into()));
        }
        if seconds > ask.cap_s {
            return Some(Trial { status: Status::Late, ..Trial::refused("late".into()) });
        }
        let series = Series { frames: vec![0], displacement_m: vec![1.0 + 1.0 / n], energy_j: vec![1.0] };
        Some(Trial { status: Status::Done, series, ..Trial::refused(String::new()) })
    }

    fn left_s(&self) -> f64 {
        self.left_s.get()
    }

    fn forecast_s(&self, configuration: &Configuration, _timed: bool) -> f64 {
        configuration.setting(Factor::Mesh).unwrap().size.powi(3)
    }
}

fn ladder() -> Ladder {
    let meshes = [1.0, 1.4, 2.0, 2.8, 4.0, 5.6];
    Ladder {
        configuration: Configuration { choices: Vec::new() },
        meshes: meshes.map(|n: f64| Setting::new(n.to_string(), n, Vec::new())).to_vec(),
        step_s: None,
        words: "test".into(),
    }
}

#[test]
fn the_reference_takes_what_it_is_given_and_no_more() {
    for total_s in [10.0, 50.0, 120.0, 400.0] {
        let mut fake = Fake::new(total_s, f64::INFINITY);
        let ladder = ladder();
        let mut climb = Climb::start(&ladder, "linear", &mut fake, 0.5 * total_s).unwrap().unwrap();
        climb.climb(&mut fake, 0.5 * total_s);
        assert!(fake.left_s() >= 0.5 * total_s - 1e-9, "{total_s}: {}", fake.left_s());
        // The next level would not have fitted, or there is none, or the bar is small enough.
        let next_s = climb.next().map_or(f64::INFINITY, |next| fake.forecast_s(&next, false));
        assert!(1.2 * next_s > fake.left_s() - 0.5 * total_s || climb.bar() < 3e-3, "{total_s}");
        let reference = climb.reference().unwrap();
        let error = (1.0 - 1.0 / reference.series.displacement_m[0]).abs();
        assert!(error <= reference.error_bar, "{total_s}: {error} ± {}", reference.error_bar);
    }
}

#[test]
fn a_level_that_fails_leaves_the_finest_that_ended_with_their_own_bar() {
    for (broken, levels, known) in [(1.4, 1, false), (2.0, 2, true), (4.0, 4, true)] {
        let mut fake = Fake::new(1e6, broken);
        let ladder = ladder();
        let mut climb = Climb::start(&ladder, "linear", &mut fake, 0.0).unwrap().unwrap();
        climb.climb(&mut fake, 0.0);
        let reference = climb.reference().unwrap();
        let told = reference.source.split("levels ").nth(1).unwrap().split(". ").next().unwrap();
        assert_eq!(told.split(", ").count(), levels, "{}", reference.source);
        assert!(reference.source.contains("broken"), "{}", reference.source);
        assert_eq!(reference.error_bar < UNKNOWN, known, "{broken}: {}", reference.error_bar);
        let error = (1.0 - 1.0 / reference.series.displacement_m[0]).abs();
        assert!(error <= reference.error_bar, "{broken}: {error} ± {}", reference.error_bar);
    }
}

#[test]
fn a_ladder_whose_first_level_fails_says_why() {
    let ladder = ladder();
    let error = Climb::start(&ladder, "linear", &mut Fake::new(1e6, 0.0), 0.0).unwrap_err();
    assert!(error.contains("broken"), "{error}");
}

#[test]
fn shipped_scenes_have_a_way_to_a_reference() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../world/scenes");
    let directory = tempfile::tempdir().unwrap();
    for name in ["first-cut", "squeezed-block", "relaxing-block", "ringing-bar", "swinging-bar"] {
        let scene = scindo_world::scene::Scene::load(&scenes.join(format!("{name}.toml"))).unwrap();
        let wishes = scindo_study::case::Wishes {
            seconds: None,
            quick: false,
            cells: &[],
            threads: &[],
            directory: directory.path(),
        };
        let case = scindo_study::case::from_scene(&scene, wishes).unwrap();
        let Truth::Refined { ladders, .. } = &case.truth else { panic!("{name}") };
        let allowed = ladders.iter().find(|ladder| {
            let levels = ladder.meshes.len();
            levels >= 3 && (0..levels).all(|i| case.scene.apply_sets(&ladder.at(i, 2).overrides()).is_ok())
        });
        assert!(allowed.is_some(), "{name}");
    }
}
