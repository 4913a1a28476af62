//! Commands of `scindo` that the program `scindo-papers` beside it runs.

use std::fs::{self, Permissions};
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// `scindo` in a folder of its own, with `sibling` as the script beside it, and nothing on the PATH.
fn command(folder: &Path, sibling: Option<&str>) -> Command {
    let program = folder.join("scindo");
    let built = env!("CARGO_BIN_EXE_scindo");
    fs::hard_link(built, &program).or_else(|_| fs::copy(built, &program).map(|_| ())).unwrap();
    if let Some(script) = sibling {
        let papers = folder.join("scindo-papers");
        fs::write(&papers, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&papers, Permissions::from_mode(0o755)).unwrap();
    }
    let mut command = Command::new(&program);
    command.env("PATH", "").current_dir(folder);
    command
}

fn scindo(sibling: Option<&str>, arguments: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    command(folder.path(), sibling).args(arguments).output().unwrap()
}

#[test]
fn a_missing_sibling_is_named_with_what_to_do() {
    for command in ["stress", "haptics", "reliability", "book", "accuracy"] {
        let run = scindo(None, &[command]);
        let words = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(1), "{words}");
        assert!(words.contains(&format!("`scindo {command}`")), "{words}");
        assert!(words.contains("cargo build --release -p scindo-papers"), "{words}");
    }
    let run = scindo(None, &["stress", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["error"]["code"], "no-sibling");
}

#[test]
fn arguments_signals_and_the_exit_code_pass() {
    let run =
        scindo(Some("echo \"$#\" \"$@\"; exit 7"), &["accuracy", "r1", "--out", "two words", "--quick"]);
    assert_eq!(String::from_utf8(run.stdout).unwrap(), "5 accuracy r1 --out two words --quick\n");
    assert_eq!(run.status.code(), Some(7));

    let folder = tempfile::tempdir().unwrap();
    let script = "trap 'exit 9' INT; echo ready; while :; do /bin/sleep 0.05; done";
    let mut run = command(folder.path(), Some(script)).arg("stress").stdout(Stdio::piped()).spawn().unwrap();
    BufReader::new(run.stdout.take().unwrap()).read_line(&mut String::new()).unwrap();
    let kill = Command::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(run.wait().unwrap().code(), Some(9));
}

#[test]
fn what_is_mistyped_is_refused_before() {
    let run = scindo(None, &["stress", "--cas", "free-fall"]);
    assert_eq!(run.status.code(), Some(2));
}
