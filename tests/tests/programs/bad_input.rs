//! Bad input is refused with exit code 2 and an error that says what, where, the value found and what is allowed.

use std::path::Path;

use scindo_tests::run;

/// A small valid scene that the tests below spoil in one place each.
const SCENE: &str = r#"
schema = 1
name = "block"
[world]
gravity_m_s2 = [0.0, 0.0, -9.81]
step_s = 0.01
[[body]]
id = "block"
mesh = { box = { min_m = [0,0,0], max_m = [0.1,0.1,0.1], cells = [3,3,3], pattern = "tet5" } }
element = "tet4"
law = "corotational"
young_pa = 1e4
poisson = 0.4
density_kg_m3 = 1000
[[body.fix]]
where = { box = { min_m = [-1,-1,-1e-6], max_m = [1,1,1e-6] } }
axes = "xyz"
"#;

/// Exit code and standard error of `scindo check` on a scene written to a fresh directory.
fn check(scene: &str, beside: &[(&str, &str)]) -> (i32, String) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for (name, content) in beside {
        std::fs::write(directory.path().join(name), content).expect("written");
    }
    let path = directory.path().join("scene.toml");
    std::fs::write(&path, scene).expect("written");
    checked(&path)
}

fn checked(path: &Path) -> (i32, String) {
    let output = run("scindo", &["check", &path.display().to_string()]).expect("scindo starts");
    let text =
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.code().expect("an exit code"), text)
}

fn assert_refused(scene: &str, beside: &[(&str, &str)], words: &[&str]) {
    let (code, text) = check(scene, beside);
    assert_eq!(code, 2, "exit code of\n{scene}\n{text}");
    for word in words {
        assert!(text.contains(word), "the error should say {word:?}:\n{text}");
    }
}

#[test]
fn a_valid_scene_passes() {
    let (code, text) = check(SCENE, &[]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("gravity"), "the plan names its effects:\n{text}");
}

#[test]
fn unknown_key_gets_a_suggestion() {
    assert_refused(&SCENE.replace("young_pa", "yuong_pa"), &[], &["yuong_pa", "young_pa"]);
}

#[test]
fn negative_density() {
    assert_refused(&SCENE.replace("= 1000", "= -1000"), &[], &["density_kg_m3", "-1000"]);
}

#[test]
fn poisson_one_half() {
    assert_refused(&SCENE.replace("poisson = 0.4", "poisson = 0.5"), &[], &["poisson", "0.5"]);
}

#[test]
fn missing_mesh_file() {
    let scene = SCENE.replace(
        r#"mesh = { box = { min_m = [0,0,0], max_m = [0.1,0.1,0.1], cells = [3,3,3], pattern = "tet5" } }"#,
        r#"mesh = { file = "nowhere.msh" }"#,
    );
    assert_ne!(scene, SCENE);
    assert_refused(&scene, &[], &["nowhere.msh"]);
}

#[test]
fn missing_scene_file() {
    let (code, text) = checked(Path::new("no/such/scene.toml"));
    assert_eq!(code, 2, "{text}");
    assert!(text.contains("no/such/scene.toml"), "{text}");
}

#[test]
fn broken_mesh_file() {
    let scene = SCENE.replace(
        r#"mesh = { box = { min_m = [0,0,0], max_m = [0.1,0.1,0.1], cells = [3,3,3], pattern = "tet5" } }"#,
        r#"mesh = { file = "broken.msh" }"#,
    );
    assert_refused(&scene, &[("broken.msh", "$NOD\n4\n1 0 0 0\n2 1 zero 0\n")], &["broken.msh"]);
}

#[test]
fn a_mesh_in_millimetres_is_warned_of() {
    let scene = SCENE
        .replace("[0.1,0.1,0.1]", "[100,100,100]")
        .replace("1e-6], max_m = [1,1", "1e-6], max_m = [1000,1000");
    let (code, text) = check(&scene, &[]);
    assert_eq!(code, 0, "a warning, not a refusal:\n{text}");
    assert!(text.contains("scale"), "the warning names the remedy:\n{text}");
}

#[test]
fn what_is_not_supported_yet_is_refused() {
    let solver = "solver = { method = \"multigrid\" }";
    let multigrid = SCENE.replace("\"corotational\"", &format!("\"corotational\"\n{solver}"));
    assert_refused(&multigrid, &[], &["multigrid", "pcg"]);
    let averaged = SCENE.replace("\"corotational\"", "\"stvk\"\nlocking = \"node-averaged\"");
    let cut = "[[cut]]\nbody = \"block\"\nsweep_m = [[[-1,-1,0.05],[-1,1,0.05]],[[1,-1,0.05],[1,1,0.05]]]";
    let hexahedra = format!("{}\n{cut}", SCENE.replace("\"tet4\"", "\"hex8\""));
    assert_refused(&hexahedra, &[], &["hex8", "tet4", "cut.0.body"]);
    assert_refused(&averaged, &[], &["node-averaged", "stvk", "neo-hookean"]);
}
