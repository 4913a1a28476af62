//! Random scenes end within their promises, or say that they do not: with a warning and exit code 1 or 2.
//!
//! `SCINDO_RANDOM_SCENES` says how many (200 if it is not set), `SCINDO_RANDOM_SEED` from which seed on (0). A
//! scene that fails is written to `SCINDO_TEST_ARTIFACTS`, or beside the others of the system's temporary files.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use scindo_tests::random_scene::{RandomScene, random_scene};
use scindo_tests::{PATIENCE, program};
use serde_json::Value;

/// How a scene ended, or what is wrong with how it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Kept,
    Told,
    Refused,
}

fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|value| value.parse().ok()).unwrap_or(otherwise)
}

#[test]
fn every_scene_keeps_its_promises_or_says_that_it_does_not() {
    let (first, count) = (setting("SCINDO_RANDOM_SEED", 0), setting("SCINDO_RANDOM_SCENES", 200));
    let next = AtomicU64::new(first);
    let ends = Mutex::new(Vec::new());
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= first + count {
                        return;
                    }
                    let end = run(&random_scene(seed));
                    ends.lock().expect("no worker panicked").push((seed, end));
                }
            });
        }
    });
    let ends = ends.into_inner().expect("no worker panicked");
    let number = |wanted| ends.iter().filter(|(_, end)| *end == Ok(wanted)).count();
    let [kept, told, refused] = [End::Kept, End::Told, End::Refused].map(number);
    println!("{kept} kept their promises, {told} said that they did not, {refused} were refused");
    let mut broken: Vec<String> =
        ends.iter().filter_map(|(seed, end)| Some(format!("seed {seed}: {}", end.as_ref().err()?))).collect();
    broken.sort();
    assert!(broken.is_empty(), "{} of {count} scenes:\n{}", broken.len(), broken.join("\n"));
    assert!(
        kept > count as usize / 5,
        "a generator of nothing but bad scenes tests little: {kept} of {count}"
    );
    assert!(refused < count as usize / 3, "most scenes must get past the checks: {refused} of {count}");
}

#[test]
fn a_seed_always_gives_the_same_scene() {
    assert_eq!(random_scene(7).toml, random_scene(7).toml);
    assert_ne!(random_scene(7).toml, random_scene(8).toml);
}

/// Runs a scene and judges how it ended; keeps its file where that is not as it should be.
fn run(scene: &RandomScene) -> Result<End, String> {
    let directory = tempfile::tempdir().map_err(|e| e.to_string())?;
    let file = directory.path().join("scene.toml");
    std::fs::write(&file, &scene.toml).map_err(|e| e.to_string())?;
    let judged = end(scene, &file, directory.path());
    if judged.is_err() {
        let kept = artifacts().join(format!("random-{}.toml", scene.seed));
        let _ = std::fs::copy(&file, kept);
    }
    judged
}

fn artifacts() -> PathBuf {
    std::env::var_os("SCINDO_TEST_ARTIFACTS").map_or_else(std::env::temp_dir, PathBuf::from)
}

fn end(scene: &RandomScene, file: &Path, directory: &Path) -> Result<End, String> {
    let out = directory.join("out");
    let said = std::fs::File::create(directory.join("said")).map_err(|e| e.to_string())?;
    let mut child = Command::new(program("scindo"))
        .arg("run")
        .arg(file)
        .args(["--fast", "--steps", &scene.steps.to_string(), "--out"])
        .arg(&out)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(said)
        .spawn()
        .map_err(|e| e.to_string())?;
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            break status;
        }
        if start.elapsed() > PATIENCE {
            let _ = child.kill();
            let _ = child.wait();
            return Err("hangs".into());
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    };
    let said = std::fs::read_to_string(directory.join("said")).map_err(|e| e.to_string())?;
    if said.contains("panicked") {
        return Err(format!("panics: {said}"));
    }
    match status.code() {
        Some(2) if !said.is_empty() => Ok(End::Refused),
        Some(code @ (0 | 1)) => judge((code, scene.reach_m), &out, &said),
        code => Err(format!("ends with {code:?}: {said}")),
    }
}

/// Exit code 0 means that every step converged and none was refused, 1 that something did not and was said.
fn judge((code, reach_m): (i32, f64), out: &Path, said: &str) -> Result<End, String> {
    let text =
        std::fs::read_to_string(out.join("summary.json")).map_err(|e| format!("no summary: {e}, {said}"))?;
    let summary: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let bodies = summary["bodies"].as_array().ok_or("a summary without bodies")?;
    for body in bodies {
        let id = &body["id"];
        if body["finite"] != true {
            return Err(format!("body {id} is not finite"));
        }
        if code == 0 {
            let solver = &body["solver"];
            for (count, what) in [
                ("unconverged_steps", "did not converge"),
                ("refused_steps", "were refused"),
                ("rolled_back_steps", "were rolled back"),
            ] {
                let steps = solver[count].as_u64().unwrap_or(0);
                // Some steps may miss their tolerance in a run that counts as one that succeeded: it says so.
                let few = count == "unconverged_steps" && 2 * steps <= summary["steps"].as_u64().unwrap_or(0);
                let warned = summary["warnings"].as_array().is_some_and(|warnings| !warnings.is_empty());
                if steps > 0 && !(few && warned) {
                    return Err(format!("exit code 0, but {steps} steps of body {id} {what}"));
                }
            }
            let displaced = body["max_displacement_m"].as_f64().unwrap_or(f64::INFINITY);
            if displaced > reach_m {
                return Err(format!("exit code 0, but body {id} moved by {displaced:e} m"));
            }
        }
    }
    match code {
        0 => Ok(End::Kept),
        _ if said.is_empty() => Err("exit code 1 without a word".into()),
        _ => Ok(End::Told),
    }
}
