//! No file of a crate takes names from a file that takes names from it, directly or through others.
//!
//! Names are followed to the file that defines them, through the re-exports of the files above it. Files that have
//! modules below them hand names on and hold what their modules share, so they are left out, as tests are.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::imports::{Segments, Taken, absolute, crates, modules};

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
    let found: Vec<String> = crates().values().flat_map(|folder| circles(folder)).collect();
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
