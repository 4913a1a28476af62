//! The published schema and the table of keys are those of the program.
//!
//! To write them anew after a change of the format: `SCINDO_WRITE=1 cargo test -p scindo-world --test reference`.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use scindo_world::scene::{json_schema, key_reference};

fn same_as_published(name: &str, text: &str) {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes")).join(name);
    if std::env::var_os("SCINDO_WRITE").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let published = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(published == text, "{name} is not up to date; write it anew with SCINDO_WRITE=1");
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
