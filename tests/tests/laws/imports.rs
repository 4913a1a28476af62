//! What the modules of a crate take from each other, read from their source.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Segments of a path, from the crate on.
pub(crate) type Segments = Vec<String>;

/// What the source of a module takes from others.
#[derive(Default)]
pub(crate) struct Taken {
    /// Paths as they are written.
    pub paths: Vec<Segments>,
    /// Those that it hands on.
    pub shared: Vec<Segments>,
}

/// The source without comments and without its tests, which stand at the end of a file.
fn plain(source: &str) -> String {
    let lines = source.lines().map(|line| line.split("//").next().unwrap_or(""));
    let text = lines.collect::<Vec<_>>().join("\n");
    let tests = text.match_indices("#[cfg(test)]").find(|(at, _)| text[*at..].contains("mod "));
    tests.map_or(text.clone(), |(at, _)| text[..at].to_owned())
}

fn segments(path: &str) -> impl Iterator<Item = String> {
    path.split("::").map(str::trim).filter(|s| !s.is_empty()).map(str::to_owned)
}

/// Paths of a tree of `use`, each behind the segments `before`.
fn paths(tree: &str, before: &Segments, out: &mut Vec<Segments>) {
    let Some(open) = tree.find('{') else {
        let path = tree.split(" as ").next().unwrap_or("");
        if !path.trim().is_empty() {
            out.push(before.iter().cloned().chain(segments(path)).collect());
        }
        return;
    };
    let before = before.iter().cloned().chain(segments(&tree[..open])).collect();
    let inner = tree[open + 1..].trim_end();
    let inner = inner.strip_suffix('}').unwrap_or(inner);
    let (mut depth, mut start) = (0, 0);
    for (i, c) in inner.char_indices().chain([(inner.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                paths(&inner[start..i], &before, out);
                start = i + 1;
            }
            _ => {}
        }
    }
}

/// What the source of a module takes from others.
pub(crate) fn taken(source: &str) -> Taken {
    let text = plain(source);
    let mut taken = Taken::default();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let Some((front, tree)) = line
            .split_once("use ")
            .filter(|(front, _)| front.trim().is_empty() || front.trim_start().starts_with("pub"))
        else {
            // Paths within the code.
            for root in ["crate::", "super::"] {
                for (at, _) in line.match_indices(root) {
                    let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
                    let end = line[at..].find(|c| !is_path(c)).map_or(line.len(), |length| at + length);
                    taken.paths.push(segments(&line[at..end]).collect());
                }
            }
            continue;
        };
        let mut tree = tree.to_owned();
        while !tree.contains(';') {
            let Some(next) = lines.next() else { break };
            tree += next.trim();
        }
        let out = if front.trim().is_empty() { &mut taken.paths } else { &mut taken.shared };
        paths(tree.trim_end_matches(';'), &Vec::new(), out);
    }
    taken
}

/// The modules of a crate by their path, without `lib.rs`, `main.rs` and tests.
pub(crate) fn modules(folder: &Path, at: &Segments, out: &mut BTreeMap<Segments, Taken>) {
    for entry in std::fs::read_dir(folder).expect("readable").map(|e| e.expect("entry").path()) {
        let name = entry.file_stem().and_then(|s| s.to_str()).expect("a name").to_owned();
        if name.ends_with("tests") || ["lib", "main"].contains(&name.as_str()) {
            continue;
        }
        let mut path = at.clone();
        if name != "mod" {
            path.push(name);
        }
        if entry.is_dir() {
            modules(&entry, &path, out);
        } else if entry.extension().is_some_and(|e| e == "rs") {
            out.insert(path, taken(&std::fs::read_to_string(&entry).expect("readable")));
        }
    }
}

/// A path from the crate on, as module `at` writes it.
pub(crate) fn absolute(at: &Segments, path: &[String], all: &BTreeMap<Segments, Taken>) -> Option<Segments> {
    let rest = |from: &[String], skip: usize| from.iter().chain(&path[skip..]).cloned().collect();
    match path.first()?.as_str() {
        "crate" => Some(rest(&[], 1)),
        "self" => Some(rest(at, 1)),
        "super" => {
            let up = path.iter().take_while(|s| *s == "super").count();
            Some(rest(&at[..at.len().checked_sub(up)?], up))
        }
        first => {
            let child: Segments = at.iter().cloned().chain([first.to_owned()]).collect();
            all.contains_key(&child).then(|| rest(at, 0))
        }
    }
}

/// The folders of all crates of the product with a library, by their names.
pub(crate) fn crates() -> BTreeMap<String, PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let inside = |side: &str| {
        let folders = std::fs::read_dir(root.join(side)).expect("readable");
        folders.map(|entry| entry.expect("entry").path()).collect::<Vec<_>>()
    };
    let folders = ["server", "client"].into_iter().flat_map(inside).chain([root.join("proto")]);
    let name = |folder: &Path| folder.file_name().expect("a name").to_string_lossy().into_owned();
    let found: BTreeMap<_, _> =
        folders.filter(|f| f.join("src/lib.rs").exists()).map(|f| (name(&f), f)).collect();
    assert!(found.len() >= 10, "only these crates were found: {found:?}");
    found
}
