//! Every bad scene is refused with what, where, value found, allowed range and next step.

use scindo_physics::element::Held;
use scindo_world::scene::{CutPath, Fault, Scene};

/// A scene without faults, to be spoilt.
const GOOD: &str = r#"
schema = 1
name = "beam"
[world]
gravity_m_s2 = [0, 0, -9.81]
[[body]]
id = "beam"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.03, 0.06, 0.2], cells = [2, 4, 12], pattern = "tet5" } }
young_pa = 3e5
poisson = 0.35
density_kg_m3 = 1070
[[body.fix]]
where = { box = { min_m = [-1, -1, -1e-6], max_m = [1, 1, 1e-6] } }
[[cut]]
body = "beam"
sweep_m = [[[0, 0, 0.1], [0, 0.06, 0.1]], [[0.015, 0, 0.1], [0.015, 0.06, 0.1]]]
[[probe]]
id = "lip"
body = "beam"
point_m = [0, 0.03, 0.1]
side = [0, 0, 1]
[[tool]]
id = "scalpel"
shape = { blade = { length_m = 0.04, thickness_m = 0.001 } }
"#;

fn message_after(find: &str, replace: &str) -> String {
    assert!(GOOD.contains(find), "{find}");
    Scene::from_toml(&GOOD.replace(find, replace)).unwrap_err().to_string()
}

fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn the_unspoilt_scene_is_accepted() {
    let scene = Scene::from_toml(GOOD).unwrap();
    assert_eq!(scene.checked().bodies[0].id, "beam");
    assert!(matches!(&scene.checked().cuts[0].blade, CutPath::Sweep(segments) if segments.len() == 2));
}

#[test]
fn unknown_keys_come_with_line_and_suggestion() {
    assert_says(
        &message_after("young_pa", "yuong_pa"),
        &["scene:9: body.beam.yuong_pa", "did you mean `young_pa`?"],
    );
    assert_says(&message_after("name =", "step_s ="), &["scene:3: step_s", "did you mean `world.step_s`?"]);
    assert_says(&message_after("cells =", "cell ="), &["body.beam.mesh.box.cell", "did you mean `cells`?"]);
    assert_says(&message_after("name =", "zebra ="), &["unknown key `zebra`", "known here: schema, name"]);
}

#[test]
fn values_out_of_range_name_range_and_next_step() {
    let cases: &[(&str, &str, &[&str])] = &[
        (
            "1070",
            "-1070",
            &["scene:11: body.beam.density_kg_m3: found -1070", "at least 0.000001", "1000 kg/m3"],
        ),
        (
            "0.35",
            "0.5",
            &["scene:10: body.beam.poisson: found 0.5", "at least -0.99 and at most 0.4999", "0.49"],
        ),
        ("0.35", "-1", &["found -1", "at least -0.99 and at most 0.4999"]),
        ("3e5", "0", &["scene:9: body.beam.young_pa: found 0", "at least 0.000001"]),
        ("3e5", "1e14", &["scene:9: body.beam.young_pa: found", "at most 10000000000000"]),
        ("3e5", "nan", &["body.beam.young_pa", "finite"]),
        ("[0, 0, -9.81]", "[0, 0, inf]", &["world.gravity_m_s2.2", "inf", "finite"]),
        ("[2, 4, 12]", "[2, 0, 12]", &["cells.1: found 0", "at least 1", "at least one cell per axis"]),
        ("[2, 4, 12]", "[2, 4]", &["found 2 items", "exactly 3 items"]),
        ("[2, 4, 12]", "[2, 4, 1.5]", &["whole number", "1.5"]),
        ("[2, 4, 12]", "[1000, 1000, 1000]", &["1000000000 cells", "at most"]),
        ("max_m = [0.03,", "max_m = [-0.03,", &["max_m lies below min_m along x"]),
        ("schema = 1", "schema = 2", &["scene:2: schema: found 2", "schema = 1"]),
        (
            "name = \"beam\"",
            "description = \"\"",
            &["scene:3: description: found", "1 to 200 characters in one line", "one plain sentence"],
        ),
        ("name = \"beam\"", "description = \"two\\nlines\"", &["scene:3: description", "in one line"]),
        ("name = \"beam\"", "description = 3", &["description: expected text, found 3"]),
        ("length_m = 0.04", "length_m = 0", &["tool.scalpel.shape.blade.length_m", "above 0"]),
        ("side = [0, 0, 1]", "side = [0, 0, 0]", &["probe.lip.side", "zero length"]),
        ("id = \"beam\"\nmesh", "id = \"Beam 1\"\nmesh", &["a-z, 0-9"]),
        ("3e5", "\"soft\"", &["expected a number, found \"soft\""]),
        ("poisson = 0.35\n", "", &["key `poisson` is missing: Poisson's ratio"]),
        ("sweep_m = [", "sweep_m = 3 #", &["cut.0.sweep_m: expected a list, found 3"]),
    ];
    for (find, replace, parts) in cases {
        assert_says(&message_after(find, replace), parts);
    }
    let long = format!("description = \"{}\"", "x".repeat(201));
    assert_says(&message_after("name = \"beam\"", &long), &["1 to 200 characters in one line"]);
}

#[test]
fn what_is_not_supported_yet_is_refused_never_ignored() {
    let with = |line: &str| message_after("young_pa", &format!("{line}\nyoung_pa"));
    for (line, parts) in [
        (
            r#"solver = { method = "multigrid" }"#,
            ["found `multigrid` with tet4, allowed: octree", "choose cg, pcg or cholesky"],
        ),
        (
            r#"solver = { method = "mg-pcg" }"#,
            ["found `mg-pcg` with tet4, allowed: octree", "choose cg, pcg or cholesky"],
        ),
        (
            r#"element = "tet10"
            solver = { method = "two-level-pcg" }"#,
            ["found `two-level-pcg` with tet10, allowed: tet4", "choose another solver.method"],
        ),
        (
            r#"solver = { method = "two-level-pcg", tolerance = 1e-9 }"#,
            ["found `two-level-pcg` with precision other than single", "choose cg, pcg or cholesky"],
        ),
        (
            r#"integrator = "implict-euler""#,
            ["unknown value `implict-euler`", "did you mean `implicit-euler`?"],
        ),
    ] {
        assert_says(&with(line), &parts);
    }
    let cut = |method: &str| message_after("sweep_m =", &format!("method = \"{method}\"\nsweep_m ="));
    assert_says(&cut("links"), &["found `links`, but all cuts of `beam` are made by xfem"]);
    assert_says(&cut("snap"), &["found `snap`, but all cuts of `beam` are made by xfem", "[body.cutting]"]);
    let snap = "cutting = { method = \"snap\" }";
    assert_says(&with(&format!("{snap}\nelement = \"tet10\"")), &["found `snap` with tet10, allowed: tet4"]);
    let slab = "where = { slab = { axis = \"z\", from = 1, to = 1 } }";
    let growing = format!("{snap}\nload = [{{ {slab}, force_n = [1, 0, 0], ramp_s = 1 }}]");
    assert_says(
        &with(&growing),
        &["load.0", "changes over time with cutting.method = `snap`", "constant loads"],
    );
    let pressed = |more: &str| format!("load = [{{ {slab}, pressure_pa = 100{more} }}]");
    assert_says(
        &with(&format!("{snap}\n{}", pressed(""))),
        &["load.0.pressure_pa", "a pressure with cutting.method = `snap`", "give a force_n"],
    );
    assert_says(&with(&pressed(", share = \"area\"")), &["load.0.share", "beside pressure_pa", "remove it"]);
    assert_says(&with(&pressed(", force_n = [1, 0, 0]")), &["load.0", "force_n", "pressure_pa"]);
    assert_says(&with(&format!("load = [{{ {slab} }}]")), &["load.0", "force_n", "pressure_pa"]);
    assert_says(&with(&pressed("0000000000")), &["load.0.pressure_pa", "at most 1000000000"]);
    assert_says(
        &with(&format!("{snap}\nskin = {{ divisions = 2 }}")),
        &["scene:10: body.beam.skin", "found a skin with cutting.method = `snap`", "remove the skin"],
    );
    assert_says(
        &with("cutting = { loose = \"pinned\" }"),
        &["found `pinned` with xfem, allowed: snap", "cutting.method"],
    );
    assert_says(
        &with("cutting = { method = \"snap\", front = \"calibrated\" }"),
        &["found `calibrated` with tet4 and cutting.method = `snap`", "cutting.front"],
    );
    assert_says(
        &with("cutting = { front = \"calibrated\", toughness_j_m2 = 100.0 }"),
        &["opens what no edge has pressed on", "remove cutting.front"],
    );
    assert_says(
        &with("cutting = { moves = \"press\" }"),
        &["body.beam.cutting.moves", "found with xfem, allowed: snap", "remove moves"],
    );
    assert_says(
        &with("cutting = { method = \"remove\", clean = false }"),
        &["body.beam.cutting.clean", "found with remove, allowed: snap", "remove clean"],
    );
    for (line, needed) in [
        ("integrator = \"rk4\"", "an implicit integrator of motion"),
        ("law = \"stvk\"", "the law linear or corotational"),
        ("element = \"tet10\"", "steps by linear solves in single precision"),
    ] {
        let text = GOOD.replace("[world]", "[effects]\nself_collision = true\n[world]");
        let error = Scene::from_toml(&text.replace("young_pa", &format!("{line}\nyoung_pa"))).unwrap_err();
        assert_says(&error.to_string(), &["effects.self_collision", needed, "body `beam`"]);
    }
}

/// A body with these lines and without the cut.
fn uncut_with(lines: &str) -> Result<Scene, scindo_world::scene::SceneError> {
    let start = GOOD.find("[[cut]]").unwrap();
    let end = GOOD.find("[[probe]]").unwrap();
    let text = [&GOOD[..start], &GOOD[end..]].concat();
    Scene::from_toml(&text.replace("young_pa", &format!("{lines}\nyoung_pa")))
}

#[test]
fn combinations_that_do_not_go_together_are_refused_with_what_is_allowed() {
    let cases: &[(&str, &[&str])] = &[
        (r#"element = "hex8""#, &["body.beam.element", "`hex8` on a mesh of tetrahedra", "pattern `hex`"]),
        (r#"locking = "selective""#, &["body.beam.locking", "allowed: only hex8", "node-averaged on tet4"]),
        (
            r#"element = "tet10"
locking = "node-averaged""#,
            &["`node-averaged` with tet10", "allowed: only tet4"],
        ),
        (
            r#"law = "stvk"
locking = "node-averaged""#,
            &["with `stvk`", "does not split", "neo-hookean"],
        ),
        ("newmark = { beta = 0.3 }", &["body.beam.newmark", "found implicit-euler", "remove it"]),
        (
            r#"integrator = "newmark"
newmark = { gamma = 0.4 }"#,
            &["newmark.gamma: found 0.4", "at least 0.5", "would gain energy"],
        ),
        (
            r#"integrator = "midpoint"
solver = { method = "cholesky" }"#,
            &["solver.method", "midpoint is explicit", "remove"],
        ),
        (
            r#"solver = { method = "relaxation" }"#,
            &["body.beam.solver.method", "`relaxation` with implicit-euler", "static"],
        ),
        (
            r#"integrator = "static"
solver = { method = "relaxation", precision = "mixed" }"#,
            &["solver.precision", "allowed: double"],
        ),
        (
            r#"integrator = "midpoint"
solver = { newton_steps = 3 }"#,
            &["solver.newton_steps", "midpoint is explicit"],
        ),
        (
            r#"integrator = "symplectic-euler"
solver = { precision = "mixed" }"#,
            &["`mixed` with symplectic-euler", "allowed: double"],
        ),
        (
            r#"integrator = "static"
rayleigh = { stiffness_s = 0.1 }"#,
            &["body.beam.rayleigh", "static body", "remove it"],
        ),
        (
            r#"integrator = "static"
mass = "consistent""#,
            &["body.beam.mass", "static body"],
        ),
        (
            r#"element = "tet10"
mass = "floored""#,
            &["body.beam.mass", "`floored` with tet10", "only tet4"],
        ),
        (
            r#"law = "neo-hookean"
element = "octree"
solver = { precision = "single" }"#,
            &["`single` with a law that is nonlinear", "mixed, double"],
        ),
        (
            r#"law = "stvk"
solver = { operator = "matrix-free" }"#,
            &["solver.operator", "`matrix-free` with stvk", "assembled"],
        ),
        (r#"solver = { precision = "single", newton_steps = 2 }"#, &["more than one Newton step"]),
        (r#"solver = { precision = "single", method = "cg" }"#, &["a solver other than pcg"]),
        (
            r#"solver = { method = "cg", operator = "assembled" }"#,
            &["solver.operator", "general path", "remove it"],
        ),
        (
            r#"element = "octree"
solver = { operator = "assembled" }"#,
            &["solver.operator", "`assembled` with octree", "matrix-free"],
        ),
        (r#"solver = { cycle = "w" }"#, &["solver.cycle", "`w` with solver.method = `pcg`", "mg-pcg"]),
    ];
    for (lines, parts) in cases {
        assert_says(&uncut_with(lines).unwrap_err().to_string(), parts);
    }
    let hex = GOOD.replace("tet5", "hex");
    assert_says(
        &Scene::from_toml(&hex).unwrap_err().to_string(),
        &["`tet4` on the box pattern `hex`", "hex8"],
    );
    let loose = GOOD.replace("[[body.fix]]", "integrator = \"static\"\n[[body.load]]\nforce_n = [1, 0, 0]");
    assert_says(&Scene::from_toml(&loose).unwrap_err().to_string(), &["fixed nowhere", "[[body.fix]]"]);
    let grid = "mesh = { grid = { x_m = [0, 1], y_m = [0, 1, 1], z_m = [0, 1] } }";
    let text =
        GOOD.lines().map(|l| if l.starts_with("mesh") { grid } else { l }).collect::<Vec<_>>().join("\n");
    assert_says(&Scene::from_toml(&text).unwrap_err().to_string(), &["grid.y_m.2", "1 does not lie above 1"]);
}

#[test]
fn only_linear_tetrahedra_have_an_error_estimate() {
    let text =
        GOOD.replace("young_pa", "element = \"tet10\"\nyoung_pa") + "[effects]\nerror_estimate = true\n";
    let message = Scene::from_toml(&text).unwrap_err().to_string();
    assert_says(&message, &["effects.error_estimate", "only tet4", "body `beam` has other elements"]);
}

#[test]
fn hexahedra_are_not_cut() {
    let path = "path = [{ at_s = 0, tip_m = [0, 0, 0], mode = \"cut\" }]\n";
    let text = GOOD.replace("tet5", "hex").replace("young_pa", "element = \"hex8\"\nyoung_pa") + path;
    let message = Scene::from_toml(&text).unwrap_err().to_string();
    assert_says(
        &message,
        &[
            "cut.0.body",
            "of hex8",
            "allowed: tet4, tet10, octree",
            "tool.scalpel.path.0.mode",
            "a blade cuts every body",
        ],
    );
}

#[test]
fn names_must_exist_and_be_unique() {
    let cut = message_after("[[cut]]\nbody = \"beam\"", "[[cut]]\nbody = \"baem\"");
    assert_says(&cut, &["scene:15: cut.0.body", "no body is called `baem`", "did you mean `beam`?"]);
    let twice =
        message_after("[[tool]]", "[[probe]]\nid = \"lip\"\nbody = \"beam\"\npoint_m = [0, 0, 0]\n[[tool]]");
    assert_says(&twice, &["the id `lip` is taken"]);
}

#[test]
fn mesh_needs_exactly_one_source() {
    let both = message_after("mesh = { box", "mesh = { file = \"a.msh\", box");
    assert_says(&both, &["exactly one of box, grid, file, surface, organ", "found box and file"]);
    let surface =
        GOOD.lines().map(|l| if l.starts_with("mesh") { "mesh = { surface = \"a.obj\" }" } else { l });
    let text = surface.collect::<Vec<_>>().join("\n");
    assert_says(&Scene::from_toml(&text).unwrap_err().to_string(), &["key `cells` is missing", "16 to 48"]);
}

#[test]
fn all_problems_are_told_together_in_the_order_of_lines() {
    let text = GOOD.replace("1070", "-1").replace("0.35", "0.7").replace("young_pa", "young");
    let error = Scene::from_toml(&text).unwrap_err();
    assert_eq!(error.problems.len(), 4, "{error}");
    let lines: Vec<_> = error.problems.iter().map(|p| p.place.line).collect();
    assert!(lines.is_sorted(), "{lines:?}");
    assert!(matches!(error.problems.last().unwrap().fault, Fault::OutOfRange { .. }));
}

#[test]
fn missing_file_and_broken_text() {
    let error = Scene::load(std::path::Path::new("/nowhere/scene.toml")).unwrap_err().to_string();
    assert_says(&error, &["/nowhere/scene.toml", "cannot read", "check the path"]);
    assert_says(&Scene::from_toml("schema = = 1").unwrap_err().to_string(), &["scene:1", "not readable"]);
}

#[test]
fn toml_and_json_are_the_same_tree() {
    let scene = Scene::from_toml(GOOD).unwrap();
    let again = Scene::from_json(&scene.to_json().to_string()).unwrap();
    assert_eq!(format!("{:?}", scene.checked()), format!("{:?}", again.checked()));
}

#[test]
fn overrides_are_checked_like_the_file() {
    let scene = Scene::from_toml(GOOD).unwrap();
    assert_eq!(scene.apply_set("body.beam.young_pa=3e4").unwrap().checked().bodies[0].young_pa, 3e4);
    assert_says(
        &scene.apply_set("body.beam.young_pa=-1").unwrap_err().to_string(),
        &["found -1", "at least 0.000001"],
    );
    assert_says(
        &scene.apply_set("body.baem.young_pa=1").unwrap_err().to_string(),
        &["`body.baem.young_pa` does not exist", "baem"],
    );
    assert_says(
        &scene.apply_set("body.beam.yuong_pa=1").unwrap_err().to_string(),
        &["did you mean `young_pa`?"],
    );
}

#[test]
fn tool_scripts_are_consistent() {
    let tool = |lines: &str| message_after("[[tool]]", &format!("[[tool]]\n{lines}\n"));
    let falling = tool("path = [{ at_s = 1, tip_m = [0, 0, 0] }, { at_s = 0.5, tip_m = [0, 0, 1] }]");
    assert_says(&falling, &["tool.scalpel.path.1.at_s", "does not come after"]);
    let ball =
        GOOD.replace("blade = { length_m = 0.04, thickness_m = 0.001 }", "sphere = { radius_m = 0.01 }");
    let text = ball + "path = [{ at_s = 0, tip_m = [0, 0, 0], mode = \"cut\" }]\n";
    assert_says(&Scene::from_toml(&text).unwrap_err().to_string(), &["only a blade can cut"]);
}

#[test]
fn inclined_directions_are_directions() {
    let after = |key: &str| {
        let fix = "[[body.fix]]\n";
        message_after(fix, &format!("{fix}{key}\n"))
    };
    assert_says(
        &after("normal = [0, 0, 0]"),
        &["body.beam.fix.0.normal", "the direction has zero length", "give a direction such as [0, 0, 1]"],
    );
    assert_says(&after("rail = [0, nan, 1]"), &["body.beam.fix.0.rail", "NaN", "finite"]);
    assert_says(&after("normal = [1, 0]"), &["body.beam.fix.0.normal"]);
    assert_says(
        &after("normal = [1, 0, 2]\naxes = \"x\""),
        &["body.beam.fix.0", "found axes and normal", "at most one of axes, normal, rail", "keep one"],
    );
    assert_says(&after("norm = [1, 0, 2]"), &["unknown key `norm`", "normal"]);
    let cells = GOOD
        .replace("cells = [2, 4, 12], pattern = \"tet5\"", "cells = [3, 6, 20]")
        .replace("young_pa", "element = \"octree\"\noctree = { levels = 1, simulate_level = 1 }\nyoung_pa")
        .replace("[[body.fix]]\n", "[[body.fix]]\nrail = [1, 0, 2]\n");
    let message = Scene::from_toml(&cells).unwrap_err().to_string();
    assert_says(&message, &["body.beam.fix.0.rail", "simulate_level", "allowed there: axes"]);
}

#[test]
fn rollers_and_grooves_hold_what_they_say() {
    let held = |key: &str| {
        let fix = "[[body.fix]]\n";
        let scene = Scene::from_toml(&GOOD.replace(fix, &format!("{fix}{key}\n"))).unwrap();
        scene.checked().bodies[0].fixes[0].held
    };
    assert_eq!(held(""), Held::FULLY);
    assert_eq!(held("axes = \"xz\""), Held::Axes([true, false, true]));
    assert_eq!(held("normal = [0, 0, -7]"), Held::Axes([false, false, true]));
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-15);
    assert!(matches!(held("normal = [3, 0, 4]"), Held::Along(n) if near(n, [0.6, 0.0, 0.8])));
    assert!(matches!(held("rail = [0, 4, 3]"), Held::Across(t) if near(t, [0.0, 0.8, 0.6])));
}
