//! Holds the dependency arrows of the house: who may know whom.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Package → the workspace packages it may depend on (dev-dependencies excepted).
fn allowed() -> BTreeMap<&'static str, BTreeSet<&'static str>> {
    BTreeMap::from([
        ("scindo-proto", BTreeSet::new()),
        ("scindo-matter", BTreeSet::new()),
        ("scindo-algebra", BTreeSet::from(["scindo-matter"])),
        ("scindo-physics", BTreeSet::from(["scindo-algebra", "scindo-matter"])),
        ("scindo-collision", BTreeSet::new()),
        ("scindo-world", BTreeSet::from(["scindo-physics", "scindo-collision"])),
        ("scindo-study", BTreeSet::from(["scindo-world", "scindo-physics"])),
        (
            "scindo",
            BTreeSet::from([
                "scindo-world",
                "scindo-study",
                "scindo-proto",
                "scindo-view",
                // For `scindo top`, which looks at a server as any client does.
                "scindo-client",
                "scindo-program",
            ]),
        ),
        // Drills and papers hold server and haptic client against each other. No other crate knows them.
        (
            "scindo-drill",
            BTreeSet::from(["scindo", "scindo-world", "scindo-haptic", "scindo-client", "scindo-proto"]),
        ),
        (
            "scindo-papers",
            BTreeSet::from([
                "scindo",
                "scindo-drill",
                "scindo-study",
                "scindo-world",
                "scindo-physics",
                "scindo-collision",
                "scindo-haptic",
                "scindo-proto",
                "scindo-program",
            ]),
        ),
        ("scindo-client", BTreeSet::from(["scindo-proto"])),
        ("scindo-view", BTreeSet::from(["scindo-proto", "scindo-client", "scindo-program"])),
        ("scindo-haptic", BTreeSet::from(["scindo-proto", "scindo-client", "scindo-program"])),
        ("scindo-igtl", BTreeSet::from(["scindo-proto", "scindo-client", "scindo-program"])),
        ("scindo-program", BTreeSet::new()),
        ("scindo-tests", BTreeSet::new()),
        ("scindo-allocations", BTreeSet::new()),
        ("scindo-verification", BTreeSet::new()),
        ("scindo-fuzz", BTreeSet::new()),
        ("scindo-schedules", BTreeSet::new()),
    ])
}

#[test]
fn crates_know_only_whom_they_may() {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml");
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--manifest-path", manifest])
        .output()
        .expect("cargo runs");
    let metadata: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("cargo metadata prints JSON");
    let allowed = allowed();
    let packages = metadata["packages"].as_array().expect("packages");
    let members: BTreeSet<&str> = packages.iter().filter_map(|p| p["name"].as_str()).collect();
    let mut wrong = Vec::new();
    for package in packages {
        let name = package["name"].as_str().expect("name");
        let Some(may) = allowed.get(name) else {
            wrong.push(format!("{name} is not in the plan of the house"));
            continue;
        };
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let to = dependency["name"].as_str().expect("name");
            if dependency["kind"] != "dev" && members.contains(to) && !may.contains(to) {
                wrong.push(format!("{name} must not know {to}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("; "));
}

/// Clock, files, network and wire stay out of the mechanics.
#[test]
fn physics_and_collision_stay_pure() {
    let banned = [
        "std::fs",
        "std::net",
        "Instant::now",
        "SystemTime",
        "tokio",
        "zenoh",
        "prost",
        "println!",
        "eprintln!",
    ];
    let mut wrong = Vec::new();
    for room in ["matter", "algebra", "physics", "collision"] {
        let mut open =
            vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../server").join(room).join("src")];
        while let Some(path) = open.pop() {
            if path.is_dir() {
                open.extend(std::fs::read_dir(&path).expect("readable").map(|e| e.expect("entry").path()));
            } else {
                let text = std::fs::read_to_string(&path).expect("readable");
                for (number, line) in text.lines().enumerate() {
                    let code = line.split("//").next().unwrap_or("");
                    if banned.iter().any(|word| code.contains(word)) {
                        wrong.push(format!("{}:{}: {}", path.display(), number + 1, line.trim()));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The state of the cuts is a matter of physics; the others ask the body. Their tests may build what they like.
#[test]
fn nothing_but_physics_and_its_studies_knows_the_state_of_the_cuts() {
    let mut wrong = Vec::new();
    for room in ["../server/world", "../server/runtime", "../client"] {
        let mut open = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(room)];
        while let Some(path) = open.pop() {
            if path.is_dir() {
                open.extend(std::fs::read_dir(&path).expect("readable").map(|e| e.expect("entry").path()));
            } else if path.extension().is_some_and(|end| end == "rs") {
                let is_test = path.to_string_lossy().ends_with("tests.rs")
                    || path.components().any(|folder| folder.as_os_str() == "tests");
                let text = std::fs::read_to_string(&path).expect("readable");
                if !is_test && text.contains("CutMesh") {
                    wrong.push(path.display().to_string());
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A crate is seen at one glance: its `lib.rs` has at most fourteen modules, tests and re-exports not counted.
#[test]
fn no_crate_has_more_modules_than_a_reader_can_hold() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut seen = 0;
    let mut wrong = Vec::new();
    for side in ["server", "client"] {
        for folder in std::fs::read_dir(root.join(side)).expect("readable").map(|e| e.expect("entry").path())
        {
            let Ok(face) = std::fs::read_to_string(folder.join("src/lib.rs")) else { continue };
            let mut of_tests = false;
            let mut modules = 0;
            for line in face.lines() {
                let module = line.trim_start_matches("pub ").trim_start_matches("pub(crate) ");
                modules += usize::from(module.starts_with("mod ") && !of_tests);
                of_tests = line.starts_with("#[cfg(test)]");
            }
            seen += 1;
            if modules > 14 {
                wrong.push(format!("{}: {modules}", folder.display()));
            }
        }
    }
    assert!(seen >= 9, "only {seen} crates were found");
    assert!(wrong.is_empty(), "{}", wrong.join("; "));
}
