//! `scindo doctor` on setups that are broken on purpose: each is noticed, with the right line and exit code.

use std::collections::BTreeMap;
use std::fs::{self, Permissions};
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use scindo::lab::folder::Folder;
use scindo::lab::members::Lab;
use scindo::lab::roles::LabRole;
use scindo_tests::free_pair;
use serde_json::Value;

const DAY: Duration = Duration::from_secs(86_400);

/// Exit code and findings.
fn doctor(arguments: &[&str]) -> (i32, Vec<Value>) {
    let run = Command::new(env!("CARGO_BIN_EXE_scindo")).arg("doctor").args(arguments).arg("--json").output();
    let run = run.unwrap();
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    (run.status.code().unwrap(), report["findings"].as_array().unwrap().clone())
}

/// Lines of a state other than ok, about one thing.
fn about<'a>(findings: &'a [Value], state: &str, about: &str) -> Vec<&'a str> {
    let of = findings.iter().filter(|finding| finding["state"] == state && finding["about"] == about);
    of.map(|finding| finding["found"].as_str().unwrap()).collect()
}

fn lab(dir: &Path, life: Duration) {
    let lab = Lab {
        lab: "anatomy".into(),
        realm: "scindo".into(),
        session: "main".into(),
        server: vec!["localhost".into()],
        clients: BTreeMap::new(),
    };
    Folder::create(dir, lab, life).unwrap().admit("anna", LabRole::Haptic, life).unwrap();
}

#[test]
fn a_sound_laboratory_has_nothing_wrong() {
    let dir = tempfile::tempdir().unwrap();
    lab(dir.path(), 365 * DAY);
    let zenoh = dir.path().join("server.json5");
    let listen = format!("quic/0.0.0.0:{}", free_pair());
    let (code, findings) = doctor(&["--zenoh", zenoh.to_str().unwrap(), "--listen", &listen]);
    assert_eq!(code, 0, "{findings:#?}");
    assert!(findings.iter().all(|finding| finding["state"] != "wrong"));
    assert_eq!(about(&findings, "ok", "certificate").len(), 2, "{findings:#?}");
    assert_eq!(about(&findings, "ok", "key").len(), 1, "{findings:#?}");
    let reached = about(&findings, "ok", "endpoint");
    assert_eq!(reached.len(), 2, "{findings:#?}");
    assert!(reached[0].contains("access control"), "{reached:?}");
}

#[test]
fn what_is_broken_in_a_laboratory_is_named() {
    type Break = fn(&Path);
    let table: [(&str, Duration, Break, &str, &str, &str); 7] = [
        ("expired", Duration::ZERO, |_| (), "wrong", "certificate", "expired on"),
        ("expires soon", 5 * DAY, |_| (), "warning", "certificate", "expires in"),
        (
            "key for all",
            365 * DAY,
            |dir| fs::set_permissions(dir.join("server.key"), Permissions::from_mode(0o644)).unwrap(),
            "wrong",
            "key",
            "mode 0644",
        ),
        (
            "no key",
            365 * DAY,
            |dir| fs::remove_file(dir.join("server.key")).unwrap(),
            "wrong",
            "key",
            "No such file",
        ),
        (
            "no certificate",
            365 * DAY,
            |dir| fs::remove_file(dir.join("ca.pem")).unwrap(),
            "wrong",
            "certificate",
            "No such file",
        ),
        (
            "not a certificate",
            365 * DAY,
            |dir| fs::write(dir.join("server.pem"), "hello").unwrap(),
            "wrong",
            "certificate",
            "holds no certificate",
        ),
        (
            "key of another",
            365 * DAY,
            |dir| fs::rename(dir.join("anna.key"), dir.join("server.key")).unwrap(),
            "wrong",
            "key",
            "not the key of its certificate",
        ),
    ];
    for (name, life, spoil, state, thing, says) in table {
        let dir = tempfile::tempdir().unwrap();
        lab(dir.path(), life);
        spoil(dir.path());
        let zenoh = dir.path().join("server.json5");
        let listen = format!("quic/127.0.0.1:{}", free_pair());
        let (code, findings) = doctor(&["--zenoh", zenoh.to_str().unwrap(), "--listen", &listen]);
        let lines = about(&findings, state, thing);
        assert!(lines.iter().any(|line| line.contains(says)), "{name}: {findings:#?}");
        assert_eq!(code, i32::from(state == "wrong"), "{name}: {findings:#?}");
    }
}

#[test]
fn what_is_broken_on_the_network_is_named() {
    // Nobody listens there any more.
    let left = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let occupied = TcpListener::bind("127.0.0.1:0").unwrap();
    let (here, port) = (format!("tcp/{}", occupied.local_addr().unwrap()), free_pair());
    let free = format!("tcp/127.0.0.1:{port}");
    let open = format!("tcp/0.0.0.0:{port}");
    let table: [(&[&str], &str, &str, &str); 7] = [
        (&["--listen", &here], "wrong", "port", "in use"),
        (&["--listen", "tcp/192.0.2.1:7447"], "wrong", "port", "192.0.2.1"),
        (&["--listen", "7447"], "wrong", "endpoint", "PROTOCOL/HOST:PORT"),
        (&["--listen", &open], "warning", "endpoint", "whoever reaches it may watch, touch and cut"),
        (&["--listen", &free, "--connect", &format!("tcp/{left}")], "wrong", "router", "refused"),
        (&["--listen", &free, "--zenoh", "/nowhere.json5"], "wrong", "zenoh", "/nowhere.json5"),
        (&["--listen", &free, "--record", "/nowhere"], "wrong", "disk", "/nowhere"),
    ];
    for (arguments, state, thing, says) in table {
        let (code, findings) = doctor(arguments);
        let lines = about(&findings, state, thing);
        assert!(lines.iter().any(|line| line.contains(says)), "{arguments:?}: {findings:#?}");
        assert_eq!(code, i32::from(state == "wrong"), "{arguments:?}: {findings:#?}");
    }
    let (code, findings) = doctor(&["--listen", &free, "--connect", &here]);
    assert_eq!((code, about(&findings, "ok", "router").len()), (0, 1), "{findings:#?}");
}
