//! What the people see who run a server for others: figures for a monitor, `scindo top`, logs for programs.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use scindo_tests::{PATIENCE, Running, free_pair, program, run};
use serde_json::Value;

const SCENE: &str = r#"
schema = 1
name = "operations"
[world]
gravity_m_s2 = [0, 0, -9.81]
step_s = 0.01
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.08, 0.04, 0.02], cells = [4, 2, 1], pattern = "tet5" } }
young_pa = 5e4
poisson = 0.4
density_kg_m3 = 1000
[[body.fix]]
where = { box = { min_m = [-1, -1, -1e-6], max_m = [1, 1, 1e-6] } }
"#;

/// A server, what it says when it has started, and the folder of its scene.
fn served(more: &[&str], log: Stdio) -> (Running, Value, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).unwrap();
    let mut command = Command::new(program("scindo"));
    command.arg("run").arg(&scene).args(["--json", "--listen", &format!("tcp/127.0.0.1:{}", free_pair())]);
    command.args(more).env("SCINDO_LOG_FORMAT", "json").env("SCINDO_LOG", "info");
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(log).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let started = serde_json::from_str::<Value>(&lines.next().unwrap().unwrap()).unwrap()["started"].clone();
    (Running(child), started, folder)
}

fn fetch(url: &str) -> String {
    let (address, path) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    write!(stream, "GET /{path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

/// The value of a line without labels.
fn figure(page: &str, name: &str) -> Option<f64> {
    page.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.trim().parse().ok())
}

#[test]
fn a_monitor_reads_what_the_server_does() {
    let (_server, started, _folder) = served(&["--metrics", "0"], Stdio::null());
    let url = started["metrics"].as_str().unwrap();
    let end = Instant::now() + PATIENCE;
    let page = loop {
        let page = fetch(url);
        if figure(&page, "scindo_step_seconds_count").is_some_and(|steps| steps >= 10.0)
            && figure(&page, "scindo_simulated_seconds").is_some_and(|seconds| seconds > 0.0)
        {
            break page;
        }
        assert!(Instant::now() < end, "{page}");
        std::thread::sleep(Duration::from_millis(100));
    };
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("application/openmetrics-text"), "{page}");
    assert!(
        page.contains("scindo_stage_seconds_total{stage=") && page.contains("scindo_build_info{version=")
    );
    assert!(page.contains("scindo_body_elements{body=\"block\"} 40.0"), "{page}");
    assert!(figure(&page, "process_resident_memory_bytes").is_some_and(|bytes| bytes > 1e6));
    let later = fetch(url);
    let steps = |page: &str| figure(page, "scindo_step_seconds_count").unwrap();
    assert!(steps(&later) >= steps(&page));
    assert!(fetch(&url.replace("/metrics", "/")).starts_with("HTTP/1.1 404"));
}

#[test]
fn top_shows_a_server_and_says_when_there_is_none() {
    let (_server, started, _folder) = served(&[], Stdio::null());
    assert!(started["metrics"].is_null(), "{started}");
    let at = started["listen"][0].as_str().unwrap();
    let output = run("scindo", &["top", "--once", "--json", "--connect", at]).unwrap();
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["bodies"]["block"]["elements"], 40, "{report}");
    assert!(report["clients"].as_object().unwrap().keys().any(|id| id.starts_with("top-")), "{report}");
    let output = run("scindo", &["top", "--once", "--connect", at]).unwrap();
    let screen = String::from_utf8(output.stdout).unwrap();
    assert!(
        screen.contains("operations") && screen.contains("block") && screen.contains("ms of 10.00 ms"),
        "{screen}"
    );

    let output = run("scindo", &["top", "--connect", at]).unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && error.contains("--once or --json"), "{error}");
    let nobody = format!("tcp/127.0.0.1:{}", free_pair());
    let output = run("scindo", &["top", "--once", "--connect", &nobody]).unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && error.contains("no scindo server answers"), "{error}");
}

#[test]
fn every_line_of_a_log_for_programs_is_an_object() {
    let results = tempfile::tempdir().unwrap();
    let out = results.path().join("results");
    let (mut server, _, _folder) = served(&["--steps", "3", "--out", out.to_str().unwrap()], Stdio::piped());
    let mut log = String::new();
    server.0.stderr.take().unwrap().read_to_string(&mut log).unwrap();
    assert!(!log.is_empty(), "a log of the level info says something");
    for line in log.lines() {
        let object: Value = serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
        assert!(object["level"].is_string() && object["timestamp"].is_string(), "{line}");
    }
}
