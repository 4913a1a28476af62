//! `--record`, `replay`, `--resume` and `export` as a user runs them, and a server that is killed meanwhile.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use scindo_tests::scene::{WORLD, ball, block, cut, held};
use scindo_tests::{free_pair, program, run};
use serde_json::Value;

fn pressed_and_cut() -> String {
    let keys = "rayleigh = { stiffness_s = 0.02 }\n".to_owned() + &held("z");
    [
        WORLD,
        &block("block", [[0.0; 3], [0.1; 3]], [5; 3], &keys),
        &cut("block", 0.3, [[[0.05, -0.1, 0.04], [0.05, -0.1, 0.2]], [[0.05, 0.2, 0.04], [0.05, 0.2, 0.2]]]),
        &ball(
            "finger",
            0.01,
            &[(0.0, [0.07, 0.05, 0.13]), (0.5, [0.07, 0.05, 0.103]), (9.0, [0.02, 0.05, 0.1])],
        ),
    ]
    .concat()
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

fn report(output: &Output, what: &str) -> Value {
    let lines = String::from_utf8_lossy(&output.stdout);
    let found = lines.lines().find_map(|line| {
        let value: Value = serde_json::from_str(line).ok()?;
        value.get(what).cloned()
    });
    let words = String::from_utf8_lossy(&output.stderr);
    found.unwrap_or_else(|| panic!("no `{what}` in {lines}\n{words}"))
}

#[test]
fn a_recording_is_verified_resumed_and_exported() {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let at = |name: &str| text(&folder.path().join(name));
    fs::write(at("scene.toml"), pressed_and_cut()).expect("written");
    let (scene, file) = (at("scene.toml"), at("run.mcap"));
    let recorded =
        ["run", &scene, "--fast", "--steps", "80", "--record", &file, "--checkpoint-s", "0.05", "--json"];
    let listen = format!("tcp/127.0.0.1:{}", free_pair());
    let ran = run("scindo", &[&recorded[..], &["--listen", &listen]].concat()).expect("scindo starts");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    // A second run must not overwrite it.
    let again = run("scindo", &[&recorded[..], &["--listen", &listen]].concat()).expect("scindo starts");
    assert_eq!(again.status.code(), Some(1), "{}", String::from_utf8_lossy(&again.stdout));

    let mut hashes = Vec::new();
    for threads in ["1", "2", "3"] {
        let replayed = run("scindo", &["replay", &file, "--verify", "--threads", threads, "--json"]);
        let replayed = replayed.expect("scindo starts");
        let report = report(&replayed, "replayed");
        assert_eq!(replayed.status.code(), Some(0), "{report:#}");
        assert_eq!((&report["found"]["compared"], &report["cuts_applied"]), (&80.into(), &1.into()));
        hashes.push(report["hash"].clone());
    }
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");

    // What goes on from its last checkpoint ends where the whole would have.
    let (more, whole) = (at("more.mcap"), at("whole.mcap"));
    let from =
        report(&run("scindo", &["replay", &file, "--from", "0.8", "--json"]).expect("starts"), "replayed");
    let left = (120 - from["found"]["from"].as_u64().expect("a number")).to_string();
    let resumed =
        ["run", "--resume", &file, "--fast", "--steps", &left, "--record", &more, "--listen", &listen];
    assert!(run("scindo", &resumed).expect("scindo starts").status.success());
    let at_once = ["run", &scene, "--fast", "--steps", "120", "--record", &whole, "--listen", &listen];
    assert!(run("scindo", &at_once).expect("scindo starts").status.success());
    let end = |file: &str| {
        let output = run("scindo", &["replay", file, "--verify", "--json"]).expect("scindo starts");
        let report = report(&output, "replayed");
        (report["step"].clone(), report["hash"].clone(), report["differs"].clone())
    };
    let (resumed, whole) = (end(&more), end(&whole));
    assert_eq!((&resumed.0, &resumed.2), (&120.into(), &false.into()));
    assert_eq!(resumed, whole);

    let (vtu, glb, csv) = (at("series"), at("scene.glb"), at("forces.csv"));
    let exported = ["export", &file, "--vtu", &vtu, "--gltf", &glb, "--csv", &csv, "--json"];
    let exported = run("scindo", &exported).expect("scindo starts");
    let report = report(&exported, "exported");
    assert_eq!((&report["frames"], &report["first_difference"]), (&9.into(), &Value::Null), "{report:#}");
    let table = fs::read_to_string(&csv).expect("forces.csv");
    assert_eq!(table.lines().count(), 81);
    let forces =
        table.lines().skip(1).map(|line| line.rsplit(',').next().and_then(|f| f.parse::<f64>().ok()));
    assert!(
        forces.clone().all(|force| force.is_some()) && forces.flatten().any(|force| force > 0.05),
        "{table}"
    );
    assert!(fs::read(&glb).expect("scene.glb").starts_with(b"glTF"));
}

#[test]
fn bad_input_ends_with_code_2() {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let file = text(&folder.path().join("no.mcap"));
    fs::write(&file, "not a recording").expect("written");
    for arguments in [
        &["replay", "missing.mcap"][..],
        &["replay", &file, "--verify"],
        &["export", &file, "--csv", "x.csv"],
        &["export", &file],
        &["run", "--resume", &file],
        &["run"],
    ] {
        let output = run("scindo", arguments).expect("scindo starts");
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {words}");
    }
}

/// Simulated and real time run alike in this scene, so the steps tell what was lost.
#[test]
fn a_killed_server_loses_at_most_a_second() {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let (scene, file) = (folder.path().join("scene.toml"), text(&folder.path().join("killed.mcap")));
    fs::write(&scene, pressed_and_cut()).expect("written");
    let listen = format!("tcp/127.0.0.1:{}", free_pair());
    let arguments = ["run", &text(&scene), "--record", &file, "--json", "--listen", &listen];
    let mut server = Command::new(program("scindo"))
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .expect("scindo starts");
    let mut lines = BufReader::new(server.stdout.take().expect("its output")).lines();
    let started = lines.find_map(|line| line.ok().filter(|line| line.contains("\"started\"")));
    assert!(started.is_some(), "it tells that it has started");
    let since = Instant::now();
    std::thread::sleep(Duration::from_millis(3300));
    let ran_s = since.elapsed().as_secs_f64();
    // SIGKILL: nothing of the program runs any more.
    server.kill().expect("killed");
    server.wait().expect("ended");

    let output = run("scindo", &["replay", &file, "--verify", "--json"]).expect("scindo starts");
    let report = report(&output, "replayed");
    assert_eq!(output.status.code(), Some(0), "{report:#}");
    assert!(report["found"]["truncated"].is_string(), "the file has no end: {report:#}");
    let recorded_s = 0.01 * report["found"]["compared"].as_f64().expect("a number");
    assert!(recorded_s >= ran_s - 1.0, "of {ran_s:.2} s, {recorded_s:.2} s are recorded");
}
