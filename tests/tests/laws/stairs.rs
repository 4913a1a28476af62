//! The modules of a crate form a stair: `lib.rs` names them in the order of the data, and each takes names only from those
//! before it. The files that hand on what their room shares are held to it as well; tests are not.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::imports::{Segments, Taken, absolute, crates, modules, taken};

/// A crate as its source shows it.
struct House {
    /// Modules of `lib.rs` in its order.
    rooms: Vec<String>,
    /// All modules, and `lib.rs` itself under the empty path.
    modules: BTreeMap<Segments, Taken>,
}

impl House {
    fn read(folder: &Path) -> Self {
        let face = std::fs::read_to_string(folder.join("src/lib.rs")).expect("readable");
        let mut all = BTreeMap::from([(Vec::new(), taken(&face))]);
        modules(&folder.join("src"), &Vec::new(), &mut all);
        let module = |line: &str| {
            let name = line.rsplit_once("mod ")?.1.strip_suffix(';')?;
            all.contains_key(&vec![name.to_owned()]).then(|| name.to_owned())
        };
        Self { rooms: face.lines().filter_map(module).collect(), modules: all }
    }

    /// The room from which module `at` takes what it writes as `path`, also where `lib.rs` hands the name on.
    fn room(&self, at: &Segments, path: &[String]) -> Option<usize> {
        let path = absolute(at, path, &self.modules)?;
        let room = |name: &String| self.rooms.iter().position(|room| room == name);
        let first = path.first()?;
        room(first).or_else(|| {
            let handed_on = &self.modules[&Vec::new()].shared;
            room(handed_on.iter().find(|shared| shared.last() == Some(first))?.first()?)
        })
    }

    /// Every name that a module takes from a room above its own.
    fn climbs(&self) -> Vec<String> {
        let mut found = BTreeSet::new();
        for (at, taken) in &self.modules {
            let own = at.first().and_then(|name| self.rooms.iter().position(|room| room == name));
            let Some(own) = own else { continue };
            for path in taken.paths.iter().chain(&taken.shared) {
                if self.room(at, path).is_some_and(|room| room > own) {
                    found.insert(format!("{} takes {}", at.join("::"), path.join("::")));
                }
            }
        }
        found.into_iter().collect()
    }
}

#[test]
fn no_module_takes_names_from_a_room_above_its_own() {
    let climbs = |(name, folder): (&String, _)| {
        let found = House::read(folder).climbs();
        found.into_iter().map(|line| format!("{name}: {line}")).collect::<Vec<_>>()
    };
    let found: Vec<String> = crates().iter().flat_map(|(name, folder)| climbs((name, folder))).collect();
    assert!(found.is_empty(), "each module may know only those before it in lib.rs:\n{}", found.join("\n"));
}

/// In every crate, a name that the face of the lowest room takes from the highest one is noticed.
#[test]
fn a_planted_import_is_noticed() {
    for (name, folder) in crates() {
        let mut house = House::read(&folder);
        let [lowest, .., highest] = &house.rooms[..] else { continue };
        let planted = format!("use crate::{highest}::Planted;");
        let expected = format!("{lowest} takes crate::{highest}::Planted");
        let face = house.modules.get_mut(&vec![lowest.clone()]).expect("a face");
        face.paths.extend(taken(&planted).paths);
        assert!(house.climbs().contains(&expected), "{name}: {:?}", house.climbs());
    }
}

/// Modules of the Python package that a source takes names from: also within functions, and for the checker of types.
fn python_imports(source: &str, modules: &BTreeSet<String>) -> BTreeSet<String> {
    let lines = source.lines().filter_map(|line| line.trim_start().strip_prefix("from ."));
    let names = |line: &str| {
        let (module, names) = line.split_once(" import ").unwrap_or((line, ""));
        let names = if module.is_empty() { names } else { module };
        names.split(',').map(|name| name.trim().to_owned()).collect::<Vec<_>>()
    };
    lines.flat_map(names).filter(|name| modules.contains(name)).collect()
}

/// What is left of the modules after all that take names only from modules already gone.
fn knot(mut arrows: BTreeMap<String, BTreeSet<String>>) -> BTreeMap<String, BTreeSet<String>> {
    loop {
        let ready: Vec<String> =
            arrows.iter().filter(|(_, to)| to.is_empty()).map(|(name, _)| name.clone()).collect();
        if ready.is_empty() {
            return arrows;
        }
        arrows.retain(|name, _| !ready.contains(name));
        arrows.values_mut().for_each(|to| to.retain(|name| !ready.contains(name)));
    }
}

#[test]
fn the_modules_of_the_python_package_form_a_stair() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../client/python/src/scindo");
    let mut sources = BTreeMap::new();
    for path in std::fs::read_dir(folder).expect("readable").map(|e| e.expect("entry").path()) {
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        if path.extension().is_some_and(|e| e == "py") && name != "__init__" {
            sources.insert(name, std::fs::read_to_string(&path).expect("readable"));
        }
    }
    assert!(sources.len() >= 15, "only {:?} were found", sources.keys());
    let modules: BTreeSet<String> = sources.keys().cloned().collect();
    let mut arrows: BTreeMap<String, BTreeSet<String>> =
        sources.iter().map(|(name, source)| (name.clone(), python_imports(source, &modules))).collect();
    assert!(knot(arrows.clone()).is_empty(), "modules that take names in a circle: {:?}", knot(arrows));
    arrows.entry("errors".into()).or_default().insert("session".into());
    assert!(knot(arrows).contains_key("errors"), "a planted import was not noticed");
}
