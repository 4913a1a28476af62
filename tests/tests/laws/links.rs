//! Every relative link and anchor in the Markdown files leads somewhere, and the README stays a front door.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_path_buf()
}

/// The files that git knows and that match `pattern`.
fn files(pattern: &str) -> Vec<PathBuf> {
    let listed = Command::new("git").args(["ls-files", pattern]).current_dir(root()).output().unwrap();
    let files: Vec<PathBuf> = String::from_utf8(listed.stdout).unwrap().lines().map(PathBuf::from).collect();
    assert!(files.len() > 20, "git lists {files:?}");
    // A file that was removed but not yet committed.
    files.into_iter().filter(|file| root().join(file).exists()).collect()
}

/// The lines of `text` outside of blocks of code.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        !code && !fence
    })
}

/// The anchor of a heading, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

fn anchors(file: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(file).unwrap();
    prose(&text)
        .filter(|line| line.starts_with('#'))
        .map(|line| anchor(line.trim_start_matches('#')))
        .collect()
}

/// The targets of all links and pictures, inline code left out.
fn targets(text: &str) -> Vec<String> {
    let lines: Vec<&str> = prose(text).collect();
    let joined = lines.join("\n");
    let plain: String = joined.split('`').step_by(2).collect::<Vec<_>>().join("");
    let after = plain.split("](").skip(1);
    after.filter_map(|rest| rest.split_once(')')).map(|(target, _)| target.to_owned()).collect()
}

/// The links of `file` that lead nowhere.
fn broken(file: &Path, text: &str) -> Vec<String> {
    let mut broken = Vec::new();
    for target in targets(text) {
        if target.contains("://") || target.starts_with("mailto:") {
            continue;
        }
        let (path, wanted) = target.split_once('#').unwrap_or((&target, ""));
        let linked = if path.is_empty() { file.to_path_buf() } else { file.parent().unwrap().join(path) };
        let leads = linked.exists() && (wanted.is_empty() || anchors(&linked).contains(wanted));
        if !leads {
            broken.push(format!("{}: {target}", file.display()));
        }
    }
    broken
}

#[test]
fn every_link_of_every_page_leads_somewhere() {
    let mut found = Vec::new();
    for file in files("*.md") {
        let file = root().join(file);
        found.extend(broken(&file, &std::fs::read_to_string(&file).unwrap()));
    }
    assert!(found.is_empty(), "these links lead nowhere:\n{}", found.join("\n"));
}

/// The sources that `text` names in inline code, with a folder, and that no file of `known` ends with.
fn unknown_sources(text: &str, known: &[PathBuf]) -> Vec<String> {
    let joined = prose(text).collect::<Vec<_>>().join("\n");
    let code = joined.split('`').skip(1).step_by(2);
    let is_source = |name: &&str| {
        let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || "./_-".contains(c));
        let ends = [".rs", ".ts", ".py", ".proto"].iter().any(|end| name.ends_with(end));
        plain && ends && name.contains('/') && !name.contains("NAME")
    };
    code.filter(is_source)
        .filter(|name| !known.iter().any(|file| file.ends_with(name)))
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_source_that_a_page_names_exists() {
    let known = files("*");
    for page in ["CONTRIBUTING.md", "README.md", "server/physics/README.md", "deploy/README.md"] {
        let text = std::fs::read_to_string(root().join(page)).unwrap();
        assert_eq!(unknown_sources(&text, &known), [""; 0], "{page}");
    }
    assert_eq!(
        unknown_sources("`src/nowhere.rs`, `src/body/mod.rs`, `src/NAME.rs`", &known),
        ["src/nowhere.rs"]
    );
}

#[test]
fn a_broken_link_is_noticed() {
    let file = root().join("README.md");
    let text = "[a](nowhere.md) [b](LICENSE) [c](CONTRIBUTING.md#no-such-heading) `[d](code.md)`\n```\n[e](x.md)\n```\n";
    let found = broken(&file, text);
    assert_eq!(found.len(), 2, "{found:?}");
    assert_eq!(anchor(" Solvers & `pcg`, again"), "solvers--pcg-again");
}

#[test]
fn the_readme_is_short() {
    let text = std::fs::read_to_string(root().join("README.md")).unwrap();
    let (lines, bytes) = (text.lines().count(), text.len());
    assert!(
        lines <= 150 && bytes <= 12 << 10,
        "{lines} lines and {bytes} bytes; a manual belongs into deploy/guide"
    );
}
