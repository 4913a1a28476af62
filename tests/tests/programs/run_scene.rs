//! `scindo run --fast --out`: a cut beam from scene file to results.

use std::fs;
use std::process::Command;

use scindo_tests::{program, run};

const SCENE: &str = r#"
schema = 1
name = "half-cut beam"
[world]
gravity_m_s2 = [9.81, 0.0, 0.0]
step_s = 0.02
[[body]]
id = "beam"
mesh = { box = { min_m = [0,0,0], max_m = [0.03,0.06,0.2], cells = [4,8,24], pattern = "tet5" } }
element = "tet4"
law = "corotational"
young_pa = 3e5
poisson = 0.35
density_kg_m3 = 1070
integrator = "implicit-euler"
solver = { method = "pcg", tolerance = 1e-6 }
[[body.fix]]
where = { box = { min_m = [-1,-1,-1e-6], max_m = [1,1,1e-6] } }
axes = "xyz"
[[cut]]
body = "beam"
at_s = 0.1
method = "xfem"
sweep_m = [ [[-0.01,-0.01,0.101],[-0.01,0.07,0.101]], [[0.015,-0.01,0.101],[0.015,0.07,0.101]] ]
[[probe]]
id = "lip"
body = "beam"
point_m = [0.002,0.03,0.101]
side = [0,0,1]
"#;

#[test]
fn results_are_complete_finite_and_the_same_for_any_thread_count() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let scene = directory.path().join("beam.toml");
    fs::write(&scene, SCENE).expect("written");
    let mut probes = Vec::new();
    for threads in ["1", "2"] {
        let out = directory.path().join(format!("out{threads}"));
        let (scene, out_text) = (scene.display().to_string(), out.display().to_string());
        let output = run(
            "scindo",
            &["run", &scene, "--fast", "--steps", "60", "--threads", threads, "--out", &out_text],
        )
        .expect("scindo starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

        let summary: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(out.join("summary.json")).expect("summary.json"))
                .expect("JSON");
        assert_eq!(summary["steps"], 60, "{summary:#}");
        let csv = fs::read_to_string(out.join("probes.csv")).expect("probes.csv");
        assert_eq!(csv.lines().next(), Some("step,time_s,id,x_m,y_m,z_m,ux_m,uy_m,uz_m"));
        assert!(csv.lines().count() >= 60, "a row per step:\n{csv}");
        let last: Vec<f64> = csv
            .lines()
            .last()
            .expect("rows")
            .split(',')
            .skip(3)
            .map(|v| v.parse().expect("a number"))
            .collect();
        assert!(last.iter().all(|v| v.is_finite()), "{last:?}");
        assert!(last[3] > 1e-4, "the beam sags along gravity: {last:?}");
        assert!(fs::metadata(out.join("final.vtu")).expect("final.vtu").len() > 10_000);
        probes.push(csv);
    }
    assert_eq!(probes[0], probes[1], "the result does not depend on the number of threads");
}

/// Runs the scene with these overrides: exit code, standard output and the summary.
fn ended(overrides: &[&str]) -> (i32, String, serde_json::Value) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let scene = directory.path().join("beam.toml");
    fs::write(&scene, SCENE).expect("written");
    let (scene, out) = (scene.display().to_string(), directory.path().join("out").display().to_string());
    let mut arguments = vec!["run", &scene, "--fast", "--steps", "10", "--out", &out];
    overrides.iter().for_each(|text| arguments.extend(["--set", text]));
    let output = run("scindo", &arguments).expect("scindo starts");
    let summary = fs::read_to_string(format!("{out}/summary.json")).expect("summary.json");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (output.status.code().expect("an exit code"), text, serde_json::from_str(&summary).expect("JSON"))
}

#[test]
fn a_run_that_did_not_converge_fails_unless_its_iterations_are_meant() {
    let (code, text, summary) = ended(&[]);
    assert_eq!((code, &summary["status"]), (0, &"done".into()), "{text}");
    assert_eq!(summary["warnings"], serde_json::json!([]), "{summary:#}");

    let few = "body.beam.solver.iterations=5";
    let (code, text, summary) = ended(&[few]);
    assert_eq!((code, &summary["status"]), (1, &"failed".into()), "{text}");
    assert_eq!(summary["bodies"][0]["solver"]["unconverged_steps"], 10);
    let warning = summary["warnings"][0].as_str().expect("a warning");
    for word in ["10 of 10 steps ended above the tolerance 1e-6", "raise solver.iterations to about"] {
        assert!(warning.contains(word), "{word:?} in {warning}");
    }
    assert!(text.contains("unreliable: body `beam`: 10 of 10 steps did not converge"), "{text}");

    let (code, text, summary) = ended(&[few, "body.beam.solver.fixed_iterations=true"]);
    assert_eq!((code, &summary["warnings"]), (0, &serde_json::json!([])), "{text}");
    assert_eq!(summary["bodies"][0]["solver"]["unconverged_steps"], 10);
}

#[test]
fn a_run_whose_steps_are_refused_fails() {
    let (code, text, summary) = ended(&["body.beam.integrator=\"rk4\"", "world.step_s=0.5"]);
    assert_eq!((code, &summary["status"]), (1, &"failed".into()), "{text}");
    assert!(text.contains("10 of 10 steps were refused"), "{text}");
    let events = summary["events"].as_array().expect("events");
    let refused = events.iter().filter(|event| event["name"] == "step-refused").count();
    assert_eq!(refused, 1, "one event for all of them: {events:?}");
}

#[test]
fn a_run_prints_its_phases_and_a_log_at_trace_level_shows_each_of_them() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let scene = directory.path().join("beam.toml");
    fs::write(&scene, SCENE).expect("written");
    let logged = |level: &str| {
        let mut scindo = Command::new(program("scindo"));
        scindo.env("SCINDO_LOG", level).arg("run").arg(&scene).args(["--fast", "--steps", "3", "--json"]);
        let output = scindo.output().expect("scindo starts");
        let text = String::from_utf8(output.stdout).expect("text");
        (text, String::from_utf8(output.stderr).expect("text"))
    };
    let (text, log) = logged("warn,scindo_world=trace");
    let solves = log.lines().filter(|line| line.contains("solve: close time.busy=")).count();
    assert_eq!(solves, 3, "{log}");
    let ended: serde_json::Value = serde_json::from_str(text.lines().last().expect("lines")).expect("JSON");
    for (parts, name) in [("stages_ms", "deform"), ("phases_ms", "solve"), ("phases_ms", "operator")] {
        assert!(ended["ended"][parts][name].as_f64().is_some_and(|ms| ms > 0.0), "{name}: {text}");
    }
    assert!(!logged("warn").1.contains("time.busy"));
}
