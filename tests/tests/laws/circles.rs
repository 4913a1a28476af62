//! No file of a crate takes names from a file that takes names from it, directly or through others.
//!
//! Names are followed to the file that defines them, through the re-exports of the files above it. Files that have
//! modules below them hand names on and hold what their modules share, so they are left out, as tests are.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Segments of a path, from the crate on.
type Segments = Vec<String>;

/// What the source of a module takes from others.
#[derive(Default)]
struct Taken {
    /// Paths as they are written.
    paths: Vec<Segments>,
    /// Those that it hands on.
    shared: Vec<Segments>,
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

fn taken(source: &str) -> Taken {
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
fn modules(folder: &Path, at: &Segments, out: &mut BTreeMap<Segments, Taken>) {
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
fn absolute(at: &Segments, path: &[String], all: &BTreeMap<Segments, Taken>) -> Option<Segments> {
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

/// The module that defines the name at the end of `path`.
fn home(path: &[String], all: &BTreeMap<Segments, Taken>, hops: usize) -> Option<Segments> {
    let length = (1..=path.len()).rev().find(|&n| all.contains_key(&path[..n]))?;
    let module = path[..length].to_vec();
    let Some(name) = path.get(length) else { return Some(module) };
    let shared = all[&module].shared.iter().find(|shared| shared.last() == Some(name));
    match shared.and_then(|shared| absolute(&module, shared, all)) {
        Some(further) if hops > 0 && further != path => home(&further, all, hops - 1),
        _ => Some(module),
    }
}

/// Every module of a crate that can reach itself, with those that it takes names from.
fn circles(crate_folder: &Path) -> Vec<String> {
    let mut all = BTreeMap::new();
    modules(&crate_folder.join("src"), &Vec::new(), &mut all);
    let faces: BTreeSet<&[String]> =
        all.keys().filter_map(|m| m.split_last().map(|(_, above)| above)).collect();
    let leaves = || all.keys().filter(|m| !faces.contains(m.as_slice()));
    let arrows: BTreeMap<&Segments, BTreeSet<Segments>> = leaves()
        .map(|module| {
            let homes = all[module].paths.iter().filter_map(|path| absolute(module, path, &all));
            let homes = homes.filter_map(|path| home(&path, &all, 4));
            (module, homes.filter(|to| to != module && !faces.contains(to.as_slice())).collect())
        })
        .collect();
    let reaches_itself = |start: &Segments| {
        let mut open: Vec<&Segments> = arrows[start].iter().collect();
        let mut seen = BTreeSet::new();
        while let Some(module) = open.pop() {
            if seen.insert(module) {
                open.extend(&arrows[module]);
            }
        }
        seen.contains(start)
    };
    let words = |module: &Segments| module.join("::");
    let arrow = |from: &Segments| {
        let to: Vec<String> = arrows[from].iter().map(words).collect();
        format!("{} takes from {}", words(from), to.join(", "))
    };
    leaves().filter(|module| reaches_itself(module)).map(arrow).collect()
}

#[test]
fn no_files_take_names_from_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = Vec::new();
    let mut crates = 0;
    for side in ["server", "client"] {
        for folder in std::fs::read_dir(root.join(side)).expect("readable").map(|e| e.expect("entry").path())
        {
            if folder.join("src/lib.rs").exists() {
                crates += 1;
                found.extend(circles(&folder));
            }
        }
    }
    assert!(crates >= 9, "only {crates} crates were found");
    assert!(found.is_empty(), "files that take names from each other:\n{}", found.join("\n"));
}

/// Two files that name each other, one of them through what the file above hands on.
#[test]
fn a_circle_is_noticed() {
    let folder = std::env::temp_dir().join(format!("scindo-circles-{}", std::process::id()));
    let room = folder.join("src/room");
    std::fs::create_dir_all(&room).expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(room.join(name), text).expect("a file");
    write("mod.rs", "mod a;\nmod b;\nmod c;\npub use a::A;\n");
    write("a.rs", "use super::b::{self, B};\npub struct A(B);\n");
    write("b.rs", "use std::fmt;\n#[derive(Debug)]\npub struct B;\n");
    write("c.rs", "use crate::room::A;\n");
    let none = circles(&folder);
    write("b.rs", "use crate::room::{\n    A,\n};\npub struct B(A);\n");
    let one = circles(&folder);
    std::fs::remove_dir_all(&folder).expect("removed");
    assert!(none.is_empty(), "{none:?}");
    assert_eq!(one, ["room::a takes from room::b", "room::b takes from room::a"]);
}
