//! Measures of the source that may only fall: today's numbers stand here, and whoever brings one down writes the new one.
//!
//! Tests, benches and examples are not counted, nor is generated code.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use super::imports::crates;

/// Functions of more than sixty lines, from their signature to their closing brace.
const LONG_FUNCTIONS: usize = 48;
/// Functions that take more than six values once tuples are taken apart, `self` not counted.
const CROWDED_FUNCTIONS: usize = 22;
/// Parameters that are tuples taken apart in the signature.
const TUPLE_PARAMETERS: usize = 224;
/// Names that more than one type bears.
const SHARED_NAMES: usize = 182;
/// Folders with more than twenty files and folders of code.
const CROWDED_ROOMS: usize = 5;

const MOST_LINES: usize = 60;
const MOST_VALUES: usize = 6;
const MOST_ENTRIES: usize = 20;

/// What one pass over the source finds, each entry with its place.
#[derive(Default)]
struct Found {
    file: PathBuf,
    long: Vec<String>,
    crowded: Vec<String>,
    tuples: Vec<String>,
    names: BTreeMap<String, Vec<String>>,
}

/// Values in a type once its tuples are taken apart.
fn values(ty: &syn::Type) -> usize {
    match ty {
        syn::Type::Tuple(tuple) => tuple.elems.iter().map(values).sum(),
        syn::Type::Reference(reference) => values(&reference.elem),
        _ => 1,
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    let tokens = |a: &syn::Attribute| a.meta.require_list().map(|list| list.tokens.to_string());
    attributes.iter().any(|a| a.path().is_ident("cfg") && tokens(a).is_ok_and(|t| t == "test"))
}

impl Found {
    fn function(&mut self, signature: &syn::Signature, end: usize) {
        let start = signature.span().start().line;
        let place = format!("{}:{start} {}", self.file.display(), signature.ident);
        if end + 1 - start > MOST_LINES {
            self.long.push(format!("{place}: {} lines", end + 1 - start));
        }
        let mut sum = 0;
        for input in &signature.inputs {
            let syn::FnArg::Typed(argument) = input else { continue };
            sum += values(&argument.ty);
            if matches!(*argument.pat, syn::Pat::Tuple(_)) {
                self.tuples.push(place.clone());
            }
        }
        if sum > MOST_VALUES {
            self.crowded.push(format!("{place}: {sum} values"));
        }
    }

    fn name(&mut self, name: &syn::Ident) {
        let place = format!("{}:{}", self.file.display(), name.span().start().line);
        self.names.entry(name.to_string()).or_default().push(place);
    }
}

impl<'a> Visit<'a> for Found {
    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        if !is_test(&item.attrs) {
            self.function(&item.sig, item.block.span().end().line);
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        if !is_test(&item.attrs) {
            self.function(&item.sig, item.block.span().end().line);
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_trait_item_fn(&mut self, item: &'a syn::TraitItemFn) {
        self.function(&item.sig, item.span().end().line);
        visit::visit_trait_item_fn(self, item);
    }

    fn visit_item_struct(&mut self, item: &'a syn::ItemStruct) {
        self.name(&item.ident);
    }

    fn visit_item_enum(&mut self, item: &'a syn::ItemEnum) {
        self.name(&item.ident);
    }

    fn visit_item_trait(&mut self, item: &'a syn::ItemTrait) {
        self.name(&item.ident);
        visit::visit_item_trait(self, item);
    }

    fn visit_item_type(&mut self, item: &'a syn::ItemType) {
        self.name(&item.ident);
    }
}

/// Goes through a folder of source; returns the folders in it that hold too much.
fn read(folder: &Path, root: &Path, found: &mut Found) -> Vec<String> {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("entry").path()).collect();
    entries.sort();
    entries.retain(|path| !path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("tests")));
    entries.retain(|path| path.is_dir() || path.extension().is_some_and(|e| e == "rs"));
    let place = |path: &Path| path.strip_prefix(root).expect("below the root").to_path_buf();
    let mut crowded = Vec::new();
    // A module `a.rs` with its folder `a` is one entry.
    let doubled = |path: &&PathBuf| path.is_dir() && path.with_extension("rs").exists();
    let count = entries.len() - entries.iter().filter(doubled).count();
    if count > MOST_ENTRIES {
        crowded.push(format!("{}: {count}", place(folder).display()));
    }
    for path in entries {
        if path.is_dir() {
            crowded.extend(read(&path, root, found));
        } else {
            let text = std::fs::read_to_string(&path).expect("readable");
            let file = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            found.file = place(&path);
            found.visit_file(&file);
        }
    }
    crowded
}

/// An error unless `found` has as many entries as the ratchet says.
fn hold(what: &str, found: &[String], limit: usize) -> Result<(), String> {
    let n = found.len();
    match n.cmp(&limit) {
        std::cmp::Ordering::Equal => Ok(()),
        std::cmp::Ordering::Less => {
            Err(format!("{what}: only {n} are left of {limit}; write {n} into this test"))
        }
        std::cmp::Ordering::Greater => {
            Err(format!("{what}: {n}, at most {limit} are allowed:\n{}", found.join("\n")))
        }
    }
}

#[test]
fn measures_of_the_source_only_fall() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = Found::default();
    let mut crowded_rooms = Vec::new();
    for folder in crates().values() {
        crowded_rooms.extend(read(&folder.join("src"), &root, &mut found));
    }
    let shared = found.names.iter().filter(|(_, places)| places.len() > 1);
    let shared: Vec<String> = shared.map(|(name, places)| format!("{name}: {}", places.join(", "))).collect();
    let wrong: Vec<String> = [
        hold("functions of more than 60 lines", &found.long, LONG_FUNCTIONS),
        hold("functions that take more than 6 values", &found.crowded, CROWDED_FUNCTIONS),
        hold("parameters that are tuples", &found.tuples, TUPLE_PARAMETERS),
        hold("names of several types", &shared, SHARED_NAMES),
        hold("folders of more than 20 entries", &crowded_rooms, CROWDED_ROOMS),
    ]
    .into_iter()
    .filter_map(Result::err)
    .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}
