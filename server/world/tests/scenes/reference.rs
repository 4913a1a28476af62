//! The published schema and the tables of keys, in KEYS.md and in the guide, are those of the program.
//!
//! To write them after a change of the format: `SCINDO_WRITE=1 cargo test -p scindo-world --test scenes reference`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use scindo_world::scene::{json_schema, key_reference};

fn same_as_published(name: &str, text: &str) {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes")).join(name);
    same_in(&path, text);
}

fn same_in(path: &Path, text: &str) {
    if std::env::var_os("SCINDO_WRITE").is_some() {
        fs::write(path, text).unwrap();
    }
    let published = fs::read_to_string(path).unwrap_or_default();
    assert!(published == text, "{} is not up to date; write it with SCINDO_WRITE=1", path.display());
}

#[test]
fn the_published_schema_is_the_enforced_one() {
    let schema = serde_json::to_string_pretty(&json_schema()).unwrap() + "\n";
    same_as_published("schema.json", &schema);
}

#[test]
fn the_table_of_keys_is_complete() {
    let intro = "# Keys of a scene\n\nGenerated from the types that read scenes; `[]` marks a list. All numbers \
                 are SI and must be finite. Unknown keys are refused. Words in (brackets) are not supported yet. \
                 The same reference as JSON Schema: [schema.json](schema.json).\n\n";
    same_as_published("KEYS.md", &format!("{intro}{}", key_reference()));
}

const BEGIN: &str = "<!-- keys:";
const END: &str = "<!-- end of keys -->";

/// A table of a page: the prefixes after `keys:`, each of which selects a key and everything below it.
struct Table {
    page: PathBuf,
    prefixes: Vec<String>,
}

/// Whether `prefix` selects `key`. One that ends with a dot selects only what is below, with a `$` only the key itself.
fn selects(prefix: &str, key: &str) -> bool {
    if let Some(alone) = prefix.strip_suffix('$') {
        return key == alone;
    }
    let rest = key.strip_prefix(prefix);
    rest.is_some_and(|rest| rest.is_empty() || prefix.ends_with('.') || rest.starts_with(['.', '[']))
}

fn pages() -> Vec<PathBuf> {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/guide");
    let mut pages: Vec<PathBuf> = [guide.join("scene"), guide]
        .iter()
        .flat_map(|folder| fs::read_dir(folder).unwrap())
        .map(|e| e.unwrap().path())
        .collect();
    pages.retain(|page| page.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    pages
}

fn tables() -> Vec<Table> {
    let mut tables = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for line in text.lines().filter_map(|line| line.strip_prefix(BEGIN)) {
            let prefixes = line.trim_end_matches("-->").split_whitespace().map(str::to_owned).collect();
            tables.push(Table { page: page.clone(), prefixes });
        }
    }
    tables
}

/// Rows of a table. Keys below several prefixes that end with a dot and are the same below each are one row, without
/// the prefix.
fn rows(keys: &[(&str, &str)], prefixes: &[String]) -> String {
    let shared = prefixes.len() > 1 && prefixes.iter().all(|prefix| prefix.ends_with('.'));
    let mut rows: Vec<String> = Vec::new();
    for (key, rest) in keys {
        let short = prefixes.iter().filter(|_| shared).find_map(|prefix| key.strip_prefix(prefix.as_str()));
        let row = format!("| `{}` | {rest}", short.unwrap_or(key));
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    format!("| key | value | meaning |\n|---|---|---|\n{}\n", rows.join("\n"))
}

#[test]
fn every_key_is_in_one_table_of_the_guide() {
    let reference = key_reference();
    let all: Vec<(&str, &str)> =
        reference.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | ")).collect();
    let tables = tables();
    let prefixes: Vec<(&str, usize)> = (tables.iter().enumerate())
        .flat_map(|(number, table)| table.prefixes.iter().map(move |prefix| (prefix.as_str(), number)))
        .collect();
    let distinct: BTreeSet<&str> = prefixes.iter().map(|(prefix, _)| *prefix).collect();
    assert_eq!(distinct.len(), prefixes.len(), "a prefix stands in two tables: {prefixes:?}");

    // The longest prefix decides where a key belongs.
    let mut found: BTreeMap<usize, Vec<(&str, &str)>> = BTreeMap::new();
    let mut used = BTreeSet::new();
    for &(key, rest) in &all {
        let place =
            prefixes.iter().filter(|(prefix, _)| selects(prefix, key)).max_by_key(|(prefix, _)| prefix.len());
        let (prefix, table) =
            place.unwrap_or_else(|| panic!("no page of deploy/guide/scene has the key `{key}`"));
        used.insert(*prefix);
        found.entry(*table).or_default().push((key, rest));
    }
    assert_eq!(used, distinct, "a page asks for keys that do not exist");

    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        let mut parts = text.split(BEGIN);
        let mut written = parts.next().unwrap_or_default().to_owned();
        let here = tables.iter().enumerate().filter(|(_, table)| table.page == page);
        for ((number, table), part) in here.zip(parts) {
            let (asked, rest) = part.split_once("-->\n").unwrap();
            let (_, after) = rest.split_once(END).unwrap_or_else(|| panic!("{}: no {END}", page.display()));
            written +=
                &format!("{BEGIN}{asked}-->\n\n{}\n{END}{after}", rows(&found[&number], &table.prefixes));
        }
        same_in(&page, &written);
    }
}
