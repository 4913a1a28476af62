//! The mistakes that people make in their first scenes: each has a word, none is silent.
//!
//! A mistake is a good scene that is spoilt in one place, and what must be said about it: by the reader of scenes,
//! by the build, or by the forecast of `scindo check`.

use std::fmt::Write as _;
use std::path::Path;

use scindo_world::assemble::doubts;
use scindo_world::forecast::{Effort, forecast};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

const GOOD: &str = r#"
schema = 1
name = "block"
[world]
gravity_m_s2 = [0, 0, -9.81]
step_s = 0.02
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [4, 4, 4] } }
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
rayleigh = { stiffness_s = 0.01 }
solver = { iterations = 200, tolerance = 1e-4 }
[[body.fix]]
where = { box = { min_m = [-1, -1, -1e-6], max_m = [1, 1, 1e-6] } }
[[body.load]]
where = { box = { min_m = [-1, -1, 0.0999], max_m = [1, 1, 0.1001] } }
force_n = [0, 0.1, 0]
[[cut]]
body = "block"
at_s = 0.2
sweep_m = [[[0.05, -0.01, 0.07], [0.05, -0.01, 0.12]], [[0.05, 0.11, 0.07], [0.05, 0.11, 0.12]]]
[[probe]]
id = "top"
body = "block"
point_m = [0.02, 0.05, 0.1]
[[tool]]
id = "finger"
shape = { sphere = { radius_m = 0.01 } }
path = [{ at_s = 0.0, tip_m = [0.02, 0.05, 0.15] }, { at_s = 0.3, tip_m = [0.02, 0.05, 0.105] }]
"#;

/// What is put in the place of what, and words that must be said.
type Mistake = (&'static str, &'static str, &'static [&'static str]);

const BOX: &str = "box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [4, 4, 4] }";
const SWEEP: &str =
    "sweep_m = [[[0.05, -0.01, 0.07], [0.05, -0.01, 0.12]], [[0.05, 0.11, 0.07], [0.05, 0.11, 0.12]]]";
const FIX: &str = "[[body.fix]]\nwhere = { box = { min_m = [-1, -1, -1e-6], max_m = [1, 1, 1e-6] } }";
const BODY_END: &str = "solver = { iterations = 200, tolerance = 1e-4 }";

/// Found when the scene is read or built.
const AT_ONCE: &[Mistake] = &[
    // keys
    ("young_pa", "youngs_modulus", &["unknown key `youngs_modulus`"]),
    ("young_pa", "yuong_pa", &["mistakes.toml:10", "did you mean `young_pa`?"]),
    ("young_pa", "young_kpa", &["`young_kpa`", "key `young_pa` is missing: Young's modulus"]),
    ("poisson = 0.4\n", "", &["key `poisson` is missing: Poisson's ratio"]),
    ("young_pa = 2e4", "young_pa = \"soft\"", &["expected a number"]),
    ("id = \"block\"\nmesh", "id = \"My Block\"\nmesh", &["a-z, 0-9"]),
    // units
    ("2e4", "5", &["its own weight would compress the body", "young_pa"]),
    ("2e4", "5e12", &["is young_pa in pascals?"]),
    ("= 1000", "= 0", &["density_kg_m3: found 0", "allowed: at least 0.000001"]),
    ("= 1000", "= 1.06", &["given in g/cm³ or t/mm³?"]),
    ("-9.81", "-9810", &["world.gravity_m_s2", "mm/s²"]),
    ("force_n = [0, 0.1, 0]", "force_n = [0, 5e4, 0]", &["load.0.force_n", "in newtons"]),
    ("force_n = [0, 0.1, 0]", "pressure_pa = 1e7", &["load.0.pressure_pa", "in pascals"]),
    (
        "max_m = [1, 1, 1e-6] } }\n",
        "max_m = [1, 1, 1e-6] } }\ndisplacement_m = [0, 0, 5]\n",
        &["fix.0.displacement_m", "in metres?"],
    ),
    ("stiffness_s = 0.01", "stiffness_s = 10", &["rayleigh.stiffness_s", "delays every deformation by 10 s"]),
    ("poisson = 0.4", "poisson = 0.5", &["poisson: found 0.5", "at most 0.4999"]),
    ("poisson = 0.4", "poisson = 0.499", &["poisson: linear tetrahedra lock", "tet10"]),
    ("step_s = 0.02", "step_s = 5", &["step_s: found 5", "0.005 to 0.04"]),
    (
        "step_s = 0.02",
        "step_s = 1",
        &["world.step_s: in one step of 1 s gravity moves a body by 4.91 m", "0.005 to 0.04"],
    ),
    ("step_s = 0.02", "step_s = 0", &["step_s: found 0", "above 0"]),
    // meshes
    (BOX, "file = \"nowhere.msh\"", &["nowhere.msh", "relative to the scene file"]),
    (
        BOX,
        "surface = \"millimetres.obj\", cells = 8",
        &["is the file in millimetres? then set scale = 0.001"],
    ),
    (BOX, "surface = \"cube.obj\", cells = 8, scale = 0.001", &["the body is only", "scale"]),
    (BOX, "surface = \"cube.obj\"", &["key `cells` is missing"]),
    (BOX, "surface = \"cube.obj\", cells = 256", &["million tetrahedra", "Use cells ="]),
    (
        BOX,
        "surface = \"two.obj\", cells = 16",
        &["its mesh consists of 2 separate parts", "nothing holds one of them", "mesh.parts = \"largest\""],
    ),
    (BOX, "surface = \"comb.obj\", cells = 8", &["of the volume at 8 cells", "use cells ="]),
    (
        BOX,
        "surface = \"fin.obj\", cells = 8",
        &["of the surface has no element below it", "thinner than a cell"],
    ),
    // regions and names
    (
        "max_m = [1, 1, 1e-6]",
        "max_m = [1, 1, -1e-7]",
        &["fix.0.where: selects no node; the body reaches from"],
    ),
    ("min_m = [-1, -1, 0.0999]", "min_m = [-1, -1, 0.10005]", &["load.0.where: selects no node"]),
    (
        "body = \"block\"\nat_s",
        "body = \"blok\"\nat_s",
        &["no body is called `blok`", "did you mean `block`?"],
    ),
    (
        "[[body.fix]]",
        "[[body.fix]]\naxes = \"xy\"",
        &["nothing holds it along z, although gravity pulls it that way"],
    ),
    (FIX, "", &["body.block: nothing holds the body: it has no `fix`", "falls without end", "axis = \"z\""]),
    (
        "point_m = [0.02, 0.05, 0.1]",
        "point_m = [0.02, 0.05, 0.3]",
        &["outside the body", "nearest point inside"],
    ),
    (
        "young_pa",
        "most_stable_steps = 9\nyoung_pa",
        &["most_stable_steps", "explicit integrators", "sub_steps"],
    ),
    ("young_pa", "sub_steps = 0\nyoung_pa", &["sub_steps", "1"]),
    // cuts
    (
        SWEEP,
        "sweep_m = [[[5.05, 0, 0], [5.05, 0, 0.2]], [[5.05, 1, 0], [5.05, 1, 0.2]]]",
        &["cut.0.sweep_m", "passes beside body `block`"],
    ),
    (
        SWEEP,
        "path_m = [[0.02, 0.05, 0.5], [0.08, 0.05, 0.5]]\ndepth_m = 0.03",
        &["cut.0.path_m: misses the body altogether", "lies 40 cm from the skin"],
    ),
    (
        SWEEP,
        "path_m = [[0.02, 0.05, 0.1], [0.08, 0.05, 0.5]]\ndepth_m = 0.03",
        &["cut.0.path_m: leaves the body at 1 of its 2 points"],
    ),
    (SWEEP, "path_m = [[0.02, 0.05, 0.1], [0.08, 0.05, 0.1]]", &["cut.0", "key `depth_m` is missing"]),
    (
        SWEEP,
        "plane = { point_m = [0, 0, 0.4], normal = [0, 0, 2] }",
        &["cut.0.plane: passes 30 cm beside body `block`"],
    ),
    (SWEEP, "plane = { point_m = [0, 0, 0.05], normal = [0, 0, 0] }", &["cut.0.plane.normal", "zero length"]),
    (
        SWEEP,
        "plane = { point_m = [0, 0, 0.05], normal = [0, 0, 1] }\ndepth_m = 0.01",
        &["cut.0.depth_m", "only goes with `path_m`"],
    ),
    (SWEEP, "", &["needs exactly one of sweep_m, path_m, plane"]),
    ("at_s = 0.2", "at_s = 7.5", &["cut.0.at_s: the cut comes at 7.5 s, after the end of the run at 5 s"]),
    (BODY_END, "element = \"hex8\"", &["hex8", "tet4, tet10"]),
    (
        "force_n = [0, 0.1, 0]",
        "force_n = [0, 0.1, 0]\nramp_s = -1",
        &["load.0.ramp_s: found -1", "at least 0"],
    ),
    (
        "force_n = [0, 0.1, 0]",
        "force_n = [0, 0.1, 0]\nramp_s = 1\ntable = [[0, 0], [1, 1]]",
        &["load.0.table: found table beside ramp_s, allowed: one of them", "write the growth into the table"],
    ),
    (
        "force_n = [0, 0.1, 0]",
        "force_n = [0, 0.1, 0]\ntable = [[0, 0], [1, 1], [1, 0]]",
        &["load.0.table.2: the time 1 does not lie above 1", "let the times rise"],
    ),
    (
        BODY_END,
        "displacement_table = [[0, 0], [-1, 1]]",
        &["displacement_table.1: found [-1.0, 1.0]", "[time in seconds, share of the full value]"],
    ),
    // tools
    (
        "radius_m = 0.01",
        "radius_m = 10",
        &["tool.finger.shape.sphere.radius_m: 10 m is more than the length of the longest body"],
    ),
    (
        "tip_m = [0.02, 0.05, 0.15] }, { at_s = 0.3, tip_m = [0.02, 0.05, 0.105] }",
        "tip_m = [20, 50, 150] }, { at_s = 30, tip_m = [20, 50, 105] }",
        &["tool.finger.path: the tool never comes nearer"],
    ),
    (
        "{ at_s = 0.0, tip_m",
        "{ at_s = 0.9, tip_m",
        &["tool.finger.path.1.at_s", "give the times of a path in ascending order"],
    ),
    // what does not exist
    (BODY_END, "solver = { method = \"multigrid\" }", &["found `multigrid` with tet4"]),
];

/// Found by the first steps.
const IN_THE_FIRST_STEPS: &[Mistake] = &[
    (
        BODY_END,
        "solver = { iterations = 4, tolerance = 1e-6 }",
        &["end above the tolerance", "write solver.iterations ="],
    ),
    ("young_pa = 2e4", "young_pa = 700", &["elements turn inside out", "raise young_pa"]),
];

fn write_box(text: &mut String, first: &mut usize, low: [f64; 3], high: [f64; 3]) {
    for corner in 0..8 {
        let x = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] });
        writeln!(text, "v {} {} {}", x[0], x[1], x[2]).unwrap();
    }
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        writeln!(text, "f {} {} {} {}", a + *first, b + *first, c + *first, d + *first).unwrap();
    }
    *first += 8;
}

/// Surfaces made of boxes, beside the scene.
fn write_meshes(directory: &Path) {
    type Boxes<'a> = &'a [([f64; 3], [f64; 3])];
    let files: [(&str, Boxes<'_>); 5] = [
        ("cube.obj", &[([0.0; 3], [0.1; 3])]),
        ("millimetres.obj", &[([0.0; 3], [100.0; 3])]),
        ("two.obj", &[([0.0; 3], [0.1; 3]), ([0.0, 0.0, 0.13], [0.04, 0.04, 0.16])]),
        // Three leaves as thin as cardboard join two slabs.
        (
            "comb.obj",
            &[
                ([0.0; 3], [0.1, 0.1, 0.03]),
                ([0.0, 0.0, 0.07], [0.1; 3]),
                ([0.01, 0.0, 0.03], [0.016, 0.1, 0.07]),
                ([0.045, 0.0, 0.03], [0.051, 0.1, 0.07]),
                ([0.08, 0.0, 0.03], [0.086, 0.1, 0.07]),
            ],
        ),
        // A fin as thin as paper stands on the cube.
        ("fin.obj", &[([0.0; 3], [0.1; 3]), ([0.05, 0.0, 0.1], [0.0502, 0.1, 0.16])]),
    ];
    for (name, boxes) in files {
        let (mut text, mut first) = (String::new(), 1);
        boxes.iter().for_each(|(low, high)| write_box(&mut text, &mut first, *low, *high));
        std::fs::write(directory.join(name), text).unwrap();
    }
}

/// Everything that is said about a scene, errors or warnings; with its first steps, if asked for.
fn said(directory: &Path, text: &str, with_steps: bool) -> String {
    let path = directory.join("mistakes.toml");
    std::fs::write(&path, text).unwrap();
    let scene = match Scene::load(&path) {
        Ok(scene) => scene,
        Err(error) => return error.to_string(),
    };
    let mut simulation = match Simulation::new(&scene, scene.base_dir()) {
        Ok(simulation) => simulation,
        Err(error) => return error.to_string(),
    };
    let mut warnings = simulation.warnings().to_vec();
    warnings.extend(doubts::after_the_end(scene.checked(), 5.0));
    if with_steps {
        let effort = Effort { processor_s: 2.0, end_s: Some(1.0) };
        warnings.extend(forecast(&mut simulation, effort, &mut |_| ()).unwrap().warnings);
    }
    warnings.join("\n")
}

/// What should have been said and was not, for each of `mistakes`.
fn silences(directory: &Path, mistakes: &[Mistake], with_steps: bool) -> String {
    let mut silences = String::new();
    for (find, replace, words) in mistakes {
        assert!(GOOD.contains(find), "{find}");
        let text = said(directory, &GOOD.replacen(find, replace, 1), with_steps);
        for word in words.iter().filter(|word| !text.contains(**word)) {
            writeln!(silences, "with `{replace}` for `{find}`: `{word}` is not in: {text}").unwrap();
        }
    }
    silences
}

#[test]
fn the_good_scene_gives_no_cause_for_doubt() {
    let directory = tempfile::tempdir().unwrap();
    assert_eq!(said(directory.path(), GOOD, true), "");
}

#[test]
fn no_mistake_that_can_be_seen_in_the_scene_is_silent() {
    let directory = tempfile::tempdir().unwrap();
    write_meshes(directory.path());
    assert_eq!(silences(directory.path(), AT_ONCE, false), "");
    // A scene that holds nothing at all.
    let empty = said(directory.path(), "schema = 1\n", false);
    assert!(empty.contains("the scene has no body"), "{empty}");
    // With the two that need steps, and the one above.
    assert_eq!(AT_ONCE.len() + IN_THE_FIRST_STEPS.len() + 1, 57);
}

#[test]
fn no_mistake_that_shows_in_the_first_steps_is_silent() {
    let directory = tempfile::tempdir().unwrap();
    assert_eq!(silences(directory.path(), IN_THE_FIRST_STEPS, true), "");
}
