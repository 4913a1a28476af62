//! Builds the page in `web/` with npm, in a copy under `OUT_DIR`: nothing is written beside the sources.
//!
//! Without npm, or when it fails, the build goes on and the embedded page says what to install.
//! `SCINDO_SKIP_WEB=1` leaves the page out on purpose.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
    process::Command,
};

/// What the page is made of, below `web/`. Everything else there (node_modules, dist) is ignored.
const INPUTS: [&str; 7] =
    ["package.json", "package-lock.json", ".npmrc", "tsconfig.json", "build.mjs", "src", "static"];

/// Why there is no page; each has its own advice.
enum NoPage {
    Skipped,
    NpmMissing,
    NpmFailed(String),
}

fn main() -> io::Result<()> {
    let manifest = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let web = manifest.join("web");
    let proto = manifest.join("../../proto");
    for input in INPUTS {
        println!("cargo:rerun-if-changed={}", web.join(input).display());
    }
    println!("cargo:rerun-if-changed={}", proto.join("scindo").display());
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=SCINDO_SKIP_WEB");

    let page = out.join("page");
    let copy = out.join("web");
    let _ = fs::remove_dir_all(&page);
    fs::create_dir_all(&page)?;
    let built = match build_page(&web, &copy, &proto)? {
        Ok(dist) => {
            copy_tree(&dist, &page)?;
            true
        }
        Err(reason) => {
            fs::write(page.join("index.html"), advice(&reason))?;
            false
        }
    };
    // Read by tests: where the page was built, empty when it was not.
    println!(
        "cargo:rustc-env=SCINDO_WEB_BUILD={}",
        if built { copy.display().to_string() } else { String::new() }
    );
    println!("cargo:rustc-env=SCINDO_PROTO_DIR={}", proto.display());
    Ok(())
}

/// Copies the inputs, installs what the lockfile pins, bundles. The inner result tells why there is no page.
fn build_page(web: &Path, copy: &Path, proto: &Path) -> io::Result<Result<PathBuf, NoPage>> {
    if env::var_os("SCINDO_SKIP_WEB").is_some_and(|value| !value.is_empty() && value != "0") {
        return Ok(Err(NoPage::Skipped));
    }
    if !npm().arg("--version").output().is_ok_and(|output| output.status.success()) {
        // No input changes when somebody installs npm: a file that never exists makes cargo ask again.
        println!("cargo:rerun-if-changed={}", copy.join("npm-was-missing").display());
        println!(
            "cargo:warning=npm not found: the viewer has no page. Install Node.js 20 or newer and build again"
        );
        return Ok(Err(NoPage::NpmMissing));
    }
    for input in INPUTS {
        let target = copy.join(input);
        let _ = fs::remove_dir_all(&target);
        copy_tree(&web.join(input), &target)?;
    }
    let result =
        install(copy)?.and_then(|()| run(copy, npm().args(["run", "build"]).env("SCINDO_PROTO", proto)));
    if let Err(words) = result {
        println!(
            "cargo:warning=the viewer page was not built; the page served instead holds the full message"
        );
        for line in words.lines().filter(|line| !line.trim().is_empty()).take(6) {
            println!("cargo:warning={line}");
        }
        return Ok(Err(NoPage::NpmFailed(words)));
    }
    Ok(Ok(copy.join("dist")))
}

/// `npm ci`, unless node_modules already holds what this lockfile pins.
fn install(copy: &Path) -> io::Result<Result<(), String>> {
    let lock = fs::read(copy.join("package-lock.json"))?;
    let stamp = copy.join("node_modules/.scindo-lock");
    if fs::read(&stamp).is_ok_and(|installed| installed == lock) {
        return Ok(Ok(()));
    }
    let flags = [
        "ci",
        "--no-audit",
        "--no-fund",
        "--prefer-offline",
        "--fetch-retries=2",
        "--fetch-retry-maxtimeout=8000",
    ];
    let result = run(copy, npm().args(flags));
    if result.is_ok() {
        fs::write(stamp, lock)?;
    }
    Ok(result)
}

/// Runs a command; on failure, what it said.
fn run(directory: &Path, command: &mut Command) -> Result<(), String> {
    let output = command.current_dir(directory).output().map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [&output.stderr[..], &output.stdout[..]].concat();
    Err(format!("{command:?} ended with {}\n{}", output.status, String::from_utf8_lossy(&said)))
}

fn npm() -> Command {
    Command::new(if cfg!(windows) { "npm.cmd" } else { "npm" })
}

fn copy_tree(from: &Path, to: &Path) -> io::Result<()> {
    if from.is_file() {
        if let Some(parent) = to.parent() {
            fs::create_dir_all(parent)?;
        }
        return fs::copy(from, to).map(|_| ());
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        copy_tree(&entry.path(), &to.join(entry.file_name()))?;
    }
    Ok(())
}

/// The page in place of the page: what is missing and what to do.
fn advice(reason: &NoPage) -> String {
    let (what, next, said) = match reason {
        NoPage::Skipped => (
            "It was left out on purpose: <code>SCINDO_SKIP_WEB</code> was set during the build.",
            "Unset <code>SCINDO_SKIP_WEB</code>, then run the same cargo command again.",
            "",
        ),
        NoPage::NpmMissing => (
            "npm was not found when the program was built.",
            "Install Node.js 20 or newer (Debian, Ubuntu: <code>apt install nodejs npm</code>; others: <code>https://nodejs.org</code>), \
             then run the same cargo command again.",
            "",
        ),
        NoPage::NpmFailed(words) => (
            "npm could not build it. Its words stand below.",
            "Repair what they name (often: no network, or Node.js older than 20), then run \
             <code>touch client/viewer/build.rs</code> and the same cargo command again.",
            words.as_str(),
        ),
    };
    let said = said.replace('&', "&amp;").replace('<', "&lt;");
    format!(
        "<!doctype html><html lang=en><meta charset=utf-8><title>scindo: no page</title>\
         <style>body{{font:16px/1.5 system-ui,sans-serif;max-width:46em;margin:12vh auto;padding:0 1em;background:#171c23;color:#e8edf3}}\
         code,pre{{background:#0006;padding:.1em .4em;border-radius:4px}}pre{{padding:1em;overflow:auto;font-size:13px}}</style>\
         <h1>The simulation runs, but its page was not built</h1><p>{what}</p><p>{next}</p>\
         <p>Meanwhile the streams are on zenoh as always; <code>/healthz</code> tells whether the viewer hears a server.</p>\
         {}</html>",
        if said.is_empty() { String::new() } else { format!("<pre>{said}</pre>") }
    )
}
