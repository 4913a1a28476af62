//! Builds the page in `web/` with npm, in a copy under `OUT_DIR`: nothing is written beside the sources.
//!
//! Without npm, or when it fails, the build goes on and the embedded page says what to do. The next build tries again.
//! With `CI=true` or `SCINDO_REQUIRE_WEB=1` a page that was not built is an error of the build.
//! `SCINDO_SKIP_WEB=1` leaves the page out on purpose.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
    process::Command,
};

/// What the page is made of, below `web/`. Everything else there (node_modules, dist) is ignored.
const INPUTS: [&str; 7] =
    ["package.json", "package-lock.json", ".npmrc", "tsconfig.json", "build.mjs", "src", "static"];

/// The oldest Node.js that runs the packages of the page.
const OLDEST_NODE: u32 = 18;

/// Why there is no page; each has its own advice.
enum NoPage {
    Skipped,
    NpmMissing,
    NodeTooOld(String),
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
    for variable in ["SCINDO_SKIP_WEB", "SCINDO_REQUIRE_WEB"] {
        println!("cargo:rerun-if-env-changed={variable}");
    }

    let page = out.join("page");
    let _ = fs::remove_dir_all(&page);
    fs::create_dir_all(&page)?;
    match build_page(&web, &out.join("web"), &proto)? {
        Ok(dist) => copy_tree(&dist, &page),
        Err(reason) => {
            report(&reason, &out);
            fs::write(page.join("index.html"), advice(&reason))
        }
    }
}

/// Tells whoever builds that there is no page, and ends the build where a page is required.
fn report(reason: &NoPage, out: &Path) {
    let skipped = matches!(reason, NoPage::Skipped);
    if !skipped {
        // Neither a repaired network nor a new Node.js changes an input. A file that never exists makes cargo ask again.
        println!("cargo:rerun-if-changed={}", out.join("page-was-not-built").display());
    }
    let (what, next, said) = explain(reason);
    let (what, next) = (plain(what), plain(&next));
    if is_set("SCINDO_REQUIRE_WEB") || (env::var("CI").is_ok_and(|value| value == "true") && !skipped) {
        eprintln!(
            "The viewer has no page, and CI=true or SCINDO_REQUIRE_WEB=1 requires one.\n{what}\n{next}\n{said}"
        );
        std::process::exit(1);
    }
    if skipped {
        return;
    }
    println!("cargo:warning=The viewer has no page. {what}");
    println!("cargo:warning={next}");
    for line in said.lines().filter(|line| !line.trim().is_empty()).take(6) {
        println!("cargo:warning={line}");
    }
}

fn is_set(variable: &str) -> bool {
    env::var_os(variable).is_some_and(|value| !value.is_empty() && value != "0")
}

/// Copies the inputs, installs what the lockfile pins, bundles. The inner result tells why there is no page.
fn build_page(web: &Path, copy: &Path, proto: &Path) -> io::Result<Result<PathBuf, NoPage>> {
    if is_set("SCINDO_SKIP_WEB") {
        return Ok(Err(NoPage::Skipped));
    }
    if output_of(npm().arg("--version")).is_none() {
        return Ok(Err(NoPage::NpmMissing));
    }
    let version = output_of(Command::new("node").arg("--version")).unwrap_or_default();
    let major = version.trim_start_matches('v').split('.').next().and_then(|major| major.parse::<u32>().ok());
    if major.is_none_or(|major| major < OLDEST_NODE) {
        return Ok(Err(NoPage::NodeTooOld(version)));
    }
    for input in INPUTS {
        let target = copy.join(input);
        let _ = fs::remove_dir_all(&target);
        copy_tree(&web.join(input), &target)?;
    }
    let built =
        install(copy)?.and_then(|()| run(copy, npm().args(["run", "build"]).env("SCINDO_PROTO", proto)));
    Ok(built.map(|()| copy.join("dist")).map_err(NoPage::NpmFailed))
}

/// `npm ci`, unless node_modules already holds what this lockfile pins.
fn install(copy: &Path) -> io::Result<Result<(), String>> {
    let lock = fs::read(copy.join("package-lock.json"))?;
    let stamp = copy.join("node_modules/.scindo-lock");
    if fs::read(&stamp).is_ok_and(|installed| installed == lock) {
        return Ok(Ok(()));
    }
    // Retries within seconds. npm refuses a longest wait that is shorter than the shortest one (10 s unless given).
    let flags = [
        "ci",
        "--no-audit",
        "--no-fund",
        "--prefer-offline",
        "--fetch-retries=2",
        "--fetch-retry-mintimeout=1000",
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

/// What a command printed; nothing when it is missing or fails.
fn output_of(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
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

/// What happened, what to do next (both HTML), and what npm said.
fn explain(reason: &NoPage) -> (&'static str, String, &str) {
    let install = "Install Node.js 18 or newer with npm (Debian 12, Ubuntu 24.04 or newer: <code>apt install nodejs npm</code>; \
                   others: <code>https://nodejs.org</code>), then run the same cargo command again.";
    match reason {
        NoPage::Skipped => (
            "It was left out on purpose: <code>SCINDO_SKIP_WEB</code> was set during the build.",
            "Unset <code>SCINDO_SKIP_WEB</code>, then run the same cargo command again.".to_owned(),
            "",
        ),
        NoPage::NpmMissing => ("npm was not found when the program was built.", install.to_owned(), ""),
        NoPage::NodeTooOld(version) => (
            "Node.js is older than 18, or <code>node --version</code> does not answer.",
            install.to_owned(),
            version,
        ),
        NoPage::NpmFailed(words) => {
            let (what, next) = cause(words);
            (what, format!("{next} Then run the same cargo command again."), words)
        }
    }
}

/// The cause of a failure by the error codes of npm, most specific first, and its remedy.
fn cause(words: &str) -> (&'static str, &'static str) {
    let causes: [(&[&str], &str, &str); 6] = [
        (
            &["ENOSPC"],
            "The disk is full.",
            "Make room: the packages of the page take 210 MB below the build folder.",
        ),
        (
            &["EACCES", "EPERM", "EROFS"],
            "npm has no permission to write its files.",
            "Make the path named below writable.",
        ),
        (
            &["EINTEGRITY"],
            "A package that npm fetched differs from the one that package-lock.json pins.",
            "Run <code>npm cache clean --force</code>.",
        ),
        (
            &["SELF_SIGNED_CERT", "UNABLE_TO_GET_ISSUER", "UNABLE_TO_VERIFY", "CERT_"],
            "npm does not trust the certificate of its package registry.",
            "Name your network's certificates with <code>npm config set cafile FILE</code>.",
        ),
        (
            &[
                "ECONNREFUSED",
                "ENOTFOUND",
                "EAI_AGAIN",
                "ETIMEDOUT",
                "ECONNRESET",
                "SOCKET_TIMEOUT",
                "ENOTCACHED",
            ],
            "npm did not reach its package registry.",
            "Check the network, and <code>npm config get registry proxy https-proxy</code>.",
        ),
        (
            &["EBADENGINE", "EUSAGE"],
            "npm refused the packages or the way it was called.",
            "See its message below.",
        ),
    ];
    let known = causes.iter().find(|(codes, ..)| codes.iter().any(|code| words.contains(code)));
    known.map_or(
        ("npm could not build the page, for an unknown reason.", "See the message of npm below."),
        |(_, what, next)| (what, next),
    )
}

fn plain(html: &str) -> String {
    html.replace("<code>", "`").replace("</code>", "`")
}

/// The page in place of the page: what is missing and what to do.
fn advice(reason: &NoPage) -> String {
    let (what, next, said) = explain(reason);
    let said = said.replace('&', "&amp;").replace('<', "&lt;");
    format!(
        "<!doctype html><html lang=en><meta charset=utf-8><title>scindo: no page</title>\
         <style>body{{font:16px/1.5 system-ui,sans-serif;max-width:46em;margin:12vh auto;padding:0 1em;background:#171c23;color:#e8edf3}}\
         code,pre{{background:#0006;padding:.1em .4em;border-radius:4px}}pre{{padding:1em;overflow:auto;font-size:13px}}</style>\
         <h1>The simulation runs, but its page was not built</h1><p>{what}</p><p>{next}</p>\
         <p>The data of the simulation are still available over zenoh. \
         <code>/healthz</code> reports whether the viewer is connected to a server.</p>\
         {}</html>",
        if said.is_empty() { String::new() } else { format!("<pre>{said}</pre>") }
    )
}
