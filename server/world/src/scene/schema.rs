//! The JSON Schema of scene files, generated from the types in [`super::raw`], and its use:
//! every value of a scene is held against it, so the schema published is the schema enforced.
//!
//! Only the keywords that the generated schema uses are read: `$ref`, `type`, `properties`,
//! `required`, `items`, `enum`, `const`, `anyOf` (optional values), `oneOf` (words, or "exactly
//! one of these keys"), the numeric ranges, lengths, and our own `x-next` (what to do next).

use serde_json::Value;

use super::problem::{Fault, nearest_word};
use super::raw::RawScene;
use super::source::{Kind, Node, segment_of};

/// JSON Schema (2020-12) of a scene.
pub fn json_schema() -> Value {
    schemars::schema_for!(RawScene).to_value()
}

/// Every key of the format with type, range, default and meaning, as a Markdown table.
pub fn key_reference() -> String {
    let root = json_schema();
    let mut rows = String::from("| key | value | meaning |\n|---|---|---|\n");
    reference_rows(&root, &root, "", &mut rows, 0);
    rows
}

/// The pattern of text in one line. All other patterns are those of names.
const ONE_LINE: &str = r"^[^\r\n]+$";

/// A fault and the key path it was found at.
pub(crate) type Finding = (String, Fault);

/// Holds a scene's tree against the schema; collects everything that does not fit.
pub(crate) fn validate(root: &Value, tree: &Node) -> Vec<Finding> {
    let mut walk = Walk { root, all_keys: all_keys(root), findings: Vec::new() };
    walk.value(root, tree, "");
    walk.findings
}

struct Walk<'a> {
    root: &'a Value,
    all_keys: Vec<(String, &'a str)>,
    findings: Vec<Finding>,
}

impl<'a> Walk<'a> {
    fn report(&mut self, path: &str, fault: Fault) {
        self.findings.push((path.to_owned(), fault));
    }

    fn value(&mut self, schema: &'a Value, node: &Node, path: &str) {
        if let Kind::Float(number) = node.kind
            && !number.is_finite()
        {
            return self.report(path, Fault::NotFinite { found: node.shown() });
        }
        let target = resolve(self.root, schema);
        let words = words(target);
        if !words.is_empty() {
            return self.word(&words, node, path);
        }
        match types(target).first().copied() {
            Some("object") => self.table(target, node, path),
            Some("array") => self.array(schema, target, node, path),
            Some("integer") => self.number(schema, target, node, path, true),
            Some("number") => self.number(schema, target, node, path, false),
            Some("string") => self.text(target, node, path),
            Some("boolean") if !matches!(node.kind, Kind::Bool(_)) => {
                self.wrong_type("true or false", node, path)
            }
            _ => {}
        }
    }

    fn wrong_type(&mut self, expected: &str, node: &Node, path: &str) {
        self.report(path, Fault::WrongType { expected: expected.to_owned(), found: node.shown() });
    }

    fn table(&mut self, schema: &'a Value, node: &Node, path: &str) {
        let Kind::Table(entries) = &node.kind else { return self.wrong_type("a table", node, path) };
        let Some(properties) = schema["properties"].as_object() else { return };
        for (key, value) in entries {
            let at = join(path, key);
            match properties.get(key) {
                Some(inner) => self.value(inner, value, &at),
                None => self.unknown_key(properties.keys().map(String::as_str).collect(), key, &at),
            }
        }
        for key in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if node.get(key).is_none() {
                let meaning = describe(self.root, &properties[key]);
                self.report(path, Fault::MissingKey { key: key.to_owned(), meaning });
            }
        }
        let one_of: Vec<String> = exclusive_keys(schema).map(str::to_owned).collect();
        let found: Vec<String> = one_of.iter().filter(|key| node.get(key).is_some()).cloned().collect();
        if !one_of.is_empty() && found.len() != 1 {
            self.report(path, Fault::Choice { found, one_of });
        }
    }

    fn unknown_key(&mut self, here: Vec<&str>, key: &str, at: &str) {
        let elsewhere = self.all_keys.iter().find(|(_, known)| *known == key).map(|(path, _)| path.clone());
        let suggestion = nearest_word(key, here.iter().copied()).or(elsewhere);
        let known = here.into_iter().map(str::to_owned).collect();
        self.report(at, Fault::UnknownKey { key: key.to_owned(), suggestion, known });
    }

    fn array(&mut self, outer: &Value, schema: &'a Value, node: &Node, path: &str) {
        let Kind::Array(items) = &node.kind else { return self.wrong_type("a list", node, path) };
        let least = schema["minItems"].as_u64().unwrap_or(0);
        let most = schema["maxItems"].as_u64().unwrap_or(u64::MAX);
        let count = items.len() as u64;
        if count < least || count > most {
            let allowed = if least == most {
                format!("exactly {least} items")
            } else {
                format!("{least} to {most} items")
            };
            let next = next_step(outer, schema, "give a list of that length");
            return self.report(path, Fault::OutOfRange { found: format!("{count} items"), allowed, next });
        }
        for (index, item) in items.iter().enumerate() {
            let before = self.findings.len();
            self.value(&schema["items"], item, &join(path, &segment_of(index, item)));
            if let Some(better) = outer["x-next"].as_str() {
                for (_, fault) in &mut self.findings[before..] {
                    if let Fault::OutOfRange { next, .. } = fault {
                        *next = better.to_owned();
                    }
                }
            }
        }
    }

    fn number(&mut self, outer: &Value, schema: &Value, node: &Node, path: &str, integer: bool) {
        let number = match node.kind {
            Kind::Integer(value) => value as f64,
            Kind::Float(value) if !integer => value,
            _ => return self.wrong_type(if integer { "a whole number" } else { "a number" }, node, path),
        };
        let range = Range::of(outer).or(Range::of(schema));
        if !range.holds(number) {
            let next = next_step(outer, schema, "give a value in that range");
            self.report(path, Fault::OutOfRange { found: node.shown(), allowed: range.shown(), next });
        }
    }

    fn text(&mut self, schema: &Value, node: &Node, path: &str) {
        let Kind::Text(text) = &node.kind else { return self.wrong_type("text", node, path) };
        let least = schema["minLength"].as_u64().unwrap_or(0);
        let most = schema["maxLength"].as_u64().unwrap_or(u64::MAX);
        let length = text.chars().count() as u64;
        // Text of a closed form is one line or a name.
        let (fits, form) = match schema["pattern"].as_str() {
            None => (true, None),
            Some(ONE_LINE) => (!text.contains(['\r', '\n']), Some("in one line")),
            Some(_) => (text.chars().all(is_of_names), Some("out of a-z, 0-9, - and _")),
        };
        if length < least || length > most || !fits {
            let allowed = match form {
                None => "text that is not empty".to_owned(),
                Some(form) => format!("{least} to {most} characters {form}"),
            };
            let next = next_step(schema, schema, "rename it");
            self.report(path, Fault::OutOfRange { found: node.shown(), allowed, next });
        }
    }

    fn word(&mut self, words: &[&str], node: &Node, path: &str) {
        let Kind::Text(text) = &node.kind else {
            return self.wrong_type(&format!("one of {}", words.join(", ")), node, path);
        };
        if !words.contains(&text.as_str()) {
            let suggestion = nearest_word(text, words.iter().copied());
            let known = words.iter().map(|word| (*word).to_owned()).collect();
            self.report(path, Fault::UnknownValue { found: text.clone(), suggestion, known });
        }
    }
}

/// A numeric range as JSON Schema writes it.
#[derive(Debug, Default, Clone, Copy)]
struct Range {
    min: Option<f64>,
    max: Option<f64>,
    above: Option<f64>,
    below: Option<f64>,
}

impl Range {
    fn of(schema: &Value) -> Self {
        Self {
            min: schema["minimum"].as_f64(),
            max: schema["maximum"].as_f64(),
            above: schema["exclusiveMinimum"].as_f64(),
            below: schema["exclusiveMaximum"].as_f64(),
        }
    }

    fn or(self, other: Self) -> Self {
        Self {
            min: self.min.or(other.min),
            max: self.max.or(other.max),
            above: self.above.or(other.above),
            below: self.below.or(other.below),
        }
    }

    fn holds(&self, value: f64) -> bool {
        self.min.is_none_or(|bound| value >= bound)
            && self.max.is_none_or(|bound| value <= bound)
            && self.above.is_none_or(|bound| value > bound)
            && self.below.is_none_or(|bound| value < bound)
    }

    fn is_open(&self) -> bool {
        self.min.is_none() && self.max.is_none() && self.above.is_none() && self.below.is_none()
    }

    fn shown(&self) -> String {
        let low = self.above.map(|b| format!("above {b}")).or(self.min.map(|b| format!("at least {b}")));
        let high = self.below.map(|b| format!("below {b}")).or(self.max.map(|b| format!("at most {b}")));
        [low, high].into_iter().flatten().collect::<Vec<_>>().join(" and ")
    }
}

fn next_step(outer: &Value, schema: &Value, otherwise: &str) -> String {
    outer["x-next"].as_str().or(schema["x-next"].as_str()).unwrap_or(otherwise).to_owned()
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// Whether a name of a body, tool or probe may contain it.
fn is_of_names(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_'
}

/// Follows `$ref` and the optional wrapper `anyOf: [T, null]`.
fn resolve<'a>(root: &'a Value, schema: &'a Value) -> &'a Value {
    if let Some(pointer) = schema["$ref"].as_str() {
        return root.pointer(pointer.trim_start_matches('#')).map_or(schema, |target| resolve(root, target));
    }
    if let Some(options) = schema["anyOf"].as_array()
        && let Some(first) = options.iter().find(|option| option["type"] != "null")
    {
        return resolve(root, first);
    }
    schema
}

fn types(schema: &Value) -> Vec<&str> {
    match &schema["type"] {
        Value::String(name) => vec![name],
        Value::Array(names) => {
            names.iter().filter_map(Value::as_str).filter(|name| *name != "null").collect()
        }
        _ => Vec::new(),
    }
}

/// The words of a closed list; empty if the schema is none.
fn words(schema: &Value) -> Vec<&str> {
    if let Some(list) = schema["enum"].as_array() {
        return list.iter().filter_map(Value::as_str).collect();
    }
    let options = schema["oneOf"].as_array().into_iter().flatten();
    options.flat_map(|option| option["const"].as_str().into_iter().chain(words(option))).collect()
}

/// Whether a word is part of the format but not of this version of the program.
fn is_planned(schema: &Value, word: &str) -> bool {
    let mut options = schema["oneOf"].as_array().into_iter().flatten();
    let described =
        options.find(|option| option["const"] == word).map(|option| option["description"].as_str());
    described.flatten().is_some_and(|text| text.to_lowercase().contains("not supported yet"))
}

/// The keys of "exactly one of these keys".
fn exclusive_keys(schema: &Value) -> impl Iterator<Item = &str> {
    schema["oneOf"].as_array().into_iter().flatten().filter_map(|option| option["required"][0].as_str())
}

fn describe(root: &Value, schema: &Value) -> String {
    let text = schema["description"].as_str().or(resolve(root, schema)["description"].as_str()).unwrap_or("");
    text.replace('\n', " ").trim_end_matches('.').to_owned()
}

/// Every key with the place it belongs to, to recognise a key that stands in the wrong table.
fn all_keys(root: &Value) -> Vec<(String, &str)> {
    fn collect<'a>(
        root: &'a Value,
        schema: &'a Value,
        path: &str,
        keys: &mut Vec<(String, &'a str)>,
        depth: usize,
    ) {
        let target = resolve(root, schema);
        let target = if target["items"].is_object() { resolve(root, &target["items"]) } else { target };
        if depth > 8 {
            return;
        }
        for (key, inner) in target["properties"].as_object().into_iter().flatten() {
            let at = join(path, key);
            keys.push((at.clone(), key));
            collect(root, inner, &at, keys, depth + 1);
        }
    }
    let mut keys = Vec::new();
    collect(root, root, "", &mut keys, 0);
    keys.sort_by_key(|(path, _)| path.matches('.').count());
    keys
}

fn reference_rows(root: &Value, schema: &Value, path: &str, rows: &mut String, depth: usize) {
    for (key, inner) in schema["properties"].as_object().into_iter().flatten() {
        let target = resolve(root, inner);
        let is_list =
            target["items"].is_object() && types(resolve(root, &target["items"])).contains(&"object");
        let at = format!("{}{}", join(path, key), if is_list { "[]" } else { "" });
        let required = schema["required"].as_array().is_some_and(|list| list.iter().any(|name| name == key));
        let mut value = words(target)
            .into_iter()
            .map(|word| if is_planned(target, word) { format!("({word})") } else { word.to_owned() })
            .collect::<Vec<_>>()
            .join(" \\| ");
        if value.is_empty() {
            value = types(target).join(" ");
        }
        let range = Range::of(inner).or(Range::of(target));
        if !range.is_open() {
            value += &format!(", {}", range.shown());
        }
        if required {
            value += ", required";
        } else if !inner["default"].is_null() && !inner["default"].is_object() && !inner["default"].is_array()
        {
            value += &format!(", default {}", inner["default"]);
        }
        rows.push_str(&format!("| `{at}` | {value} | {} |\n", describe(root, inner)));
        let below = if is_list { resolve(root, &target["items"]) } else { target };
        if depth < 8 {
            reference_rows(root, below, &at, rows, depth + 1);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn every_table_refuses_unknown_keys_and_every_key_has_a_meaning() {
        let root = json_schema();
        let tables = root["$defs"].as_object().unwrap().values().chain([&root]);
        for table in tables.filter(|table| table["properties"].is_object()) {
            assert_eq!(table["additionalProperties"], false, "{}", table["description"]);
            for (key, inner) in table["properties"].as_object().unwrap() {
                assert!(!describe(&root, inner).is_empty(), "{key} has no description");
            }
        }
    }

    #[test]
    fn the_reference_names_nested_keys() {
        let text = key_reference();
        assert!(text.contains("| `body[].young_pa` | number, at least 0.000001"), "{text}");
        assert!(text.contains("| `tool[].path[].mode` | hover \\| touch \\| grab \\| cut"), "{text}");
    }
}
