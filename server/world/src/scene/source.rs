//! A scene's text as a tree that remembers lines: TOML, or the same tree as JSON.

use serde_json::{Map, Number, Value};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// A value with the line it stands on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    pub line: Option<usize>,
    pub kind: Kind,
}

/// A value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Null,
    Bool(bool),
    Integer(i64),
    Float(f64),
    Text(String),
    Array(Vec<Node>),
    Table(Vec<(String, Node)>),
}

/// Text that is neither TOML nor JSON, or an override that does not fit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Unreadable {
    pub line: Option<usize>,
    pub message: String,
}

impl Node {
    /// The tree of a TOML text.
    pub(super) fn from_toml(text: &str) -> Result<Node, Unreadable> {
        let lines = Lines::of(text);
        let table = DeTable::parse(text).map_err(|error| Unreadable {
            line: error.span().map(|span| lines.at(span.start)),
            message: error.message().to_owned(),
        })?;
        Ok(table_node(&table, &lines))
    }

    /// The tree of a JSON text; lines are not known.
    pub(super) fn from_json(text: &str) -> Result<Node, Unreadable> {
        let value: Value = serde_json::from_str(text)
            .map_err(|error| Unreadable { line: Some(error.line()), message: error.to_string() })?;
        Ok(json_node(&value))
    }

    /// The tree as JSON. Non-finite numbers, which JSON cannot hold, become null.
    pub(super) fn to_json(&self) -> Value {
        match &self.kind {
            Kind::Null => Value::Null,
            Kind::Bool(value) => Value::Bool(*value),
            Kind::Integer(value) => Value::Number((*value).into()),
            Kind::Float(value) => Number::from_f64(*value).map_or(Value::Null, Value::Number),
            Kind::Text(value) => Value::String(value.clone()),
            Kind::Array(items) => Value::Array(items.iter().map(Node::to_json).collect()),
            Kind::Table(entries) => {
                Value::Object(entries.iter().map(|(k, v)| (k.clone(), v.to_json())).collect::<Map<_, _>>())
            }
        }
    }

    /// The value as it would stand in a message.
    pub(super) fn shown(&self) -> String {
        let text = match &self.kind {
            Kind::Null => "nothing".to_owned(),
            Kind::Float(value) if !value.is_finite() => value.to_string(),
            Kind::Float(value) => format!("{value:?}"),
            _ => self.to_json().to_string(),
        };
        if text.chars().count() > 60 { text.chars().take(57).collect::<String>() + "..." } else { text }
    }

    /// The member of a table.
    pub(super) fn get(&self, key: &str) -> Option<&Node> {
        match &self.kind {
            Kind::Table(entries) => entries.iter().find(|(k, _)| k == key).map(|(_, v)| v),
            Kind::Array(items) => position(items, key).map(|i| &items[i]),
            _ => None,
        }
    }

    /// The line of a key path, or of the deepest part of it that exists.
    pub(super) fn line_of(&self, path: &str) -> Option<usize> {
        let mut node = self;
        let mut line = self.line;
        for segment in path.split('.').filter(|s| !s.is_empty()) {
            match node.get(segment) {
                Some(next) => node = next,
                None => break,
            }
            line = node.line.or(line);
        }
        line
    }

    /// Overrides one value: `body.beam.young_pa=3e4`. Tables that are missing are made; members
    /// of an array of tables go by `id` or index and must exist.
    pub(super) fn set(&mut self, assignment: &str) -> Result<(), Unreadable> {
        let fail = |message: String| Unreadable { line: None, message };
        let (path, text) = assignment.split_once('=').ok_or_else(|| {
            fail(format!("`{assignment}` has no `=`; write key=value, for example world.step_s=0.01"))
        })?;
        let value = parse_value(text.trim());
        let segments: Vec<&str> = path.trim().split('.').collect();
        if segments.iter().any(|s| s.is_empty()) {
            return Err(fail(format!("`{path}` is not a key path such as body.beam.young_pa")));
        }
        let (last, parents) = segments.split_last().ok_or_else(|| fail("empty key".into()))?;
        let mut node = self;
        for segment in parents {
            node = node
                .enter(segment)
                .ok_or_else(|| fail(format!("`{path}` does not exist: there is no `{segment}`")))?;
        }
        match &mut node.kind {
            Kind::Table(entries) => match entries.iter_mut().find(|(k, _)| k == last) {
                Some((_, old)) => *old = value,
                None => entries.push(((*last).to_owned(), value)),
            },
            Kind::Array(items) => {
                let index = position(items, last)
                    .ok_or_else(|| fail(format!("`{path}` does not exist: the list has no item `{last}`")))?;
                items[index] = value;
            }
            _ => {
                return Err(fail(format!(
                    "`{path}` does not exist: it leads into a value that is not a table"
                )));
            }
        }
        Ok(())
    }

    /// The member called `segment`; made if a table lacks it.
    fn enter(&mut self, segment: &str) -> Option<&mut Node> {
        match &mut self.kind {
            Kind::Table(entries) => {
                let index = entries.iter().position(|(k, _)| k == segment).unwrap_or_else(|| {
                    entries.push((segment.to_owned(), Node { line: None, kind: Kind::Table(Vec::new()) }));
                    entries.len() - 1
                });
                Some(&mut entries[index].1)
            }
            Kind::Array(items) => position(items, segment).map(move |i| &mut items[i]),
            _ => None,
        }
    }
}

/// How an array element is named in a key path: by its `id` if it has one, else by its index.
pub(crate) fn segment_of(index: usize, item: &Node) -> String {
    match item.get("id").map(|id| &id.kind) {
        Some(Kind::Text(id)) if !id.is_empty() && !id.contains('.') => id.clone(),
        _ => index.to_string(),
    }
}

fn position(items: &[Node], segment: &str) -> Option<usize> {
    let by_id = items.iter().enumerate().position(|(i, item)| segment_of(i, item) == segment);
    by_id.or_else(|| segment.parse().ok().filter(|i| *i < items.len()))
}

/// The right side of an override: a TOML value, else plain text.
fn parse_value(text: &str) -> Node {
    let document = format!("v = {text}");
    match DeTable::parse(&document) {
        Ok(table) => {
            let mut node = table_node(&table, &Lines::of(&document));
            let value = match &mut node.kind {
                Kind::Table(entries) if entries.len() == 1 => entries.pop().map(|(_, value)| value),
                _ => None,
            };
            forget_lines(value.unwrap_or(Node { line: None, kind: Kind::Text(text.to_owned()) }))
        }
        Err(_) => Node { line: None, kind: Kind::Text(text.to_owned()) },
    }
}

fn forget_lines(mut node: Node) -> Node {
    node.line = None;
    node.kind = match node.kind {
        Kind::Array(items) => Kind::Array(items.into_iter().map(forget_lines).collect()),
        Kind::Table(entries) => Kind::Table(entries.into_iter().map(|(k, v)| (k, forget_lines(v))).collect()),
        kind => kind,
    };
    node
}

/// Byte offsets at which lines start.
struct Lines(Vec<usize>);

impl Lines {
    fn of(text: &str) -> Self {
        Self(std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect())
    }

    fn at(&self, offset: usize) -> usize {
        self.0.partition_point(|start| *start <= offset)
    }
}

fn table_node(table: &Spanned<DeTable<'_>>, lines: &Lines) -> Node {
    let entries = table.get_ref().iter();
    Node {
        line: Some(lines.at(table.span().start)),
        kind: Kind::Table(
            entries
                .map(|(key, value)| (key.get_ref().to_string(), toml_node(key.span().start, value, lines)))
                .collect(),
        ),
    }
}

/// `start`: where the key stands, which is the line a user looks for.
fn toml_node(start: usize, value: &Spanned<DeValue<'_>>, lines: &Lines) -> Node {
    let kind = match value.get_ref() {
        DeValue::String(text) => Kind::Text(text.to_string()),
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(integer) => Kind::Integer(integer),
            Err(_) => Kind::Float(number.as_str().parse().unwrap_or(f64::NAN)),
        },
        DeValue::Float(number) => Kind::Float(number.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(value) => Kind::Bool(*value),
        DeValue::Datetime(date) => Kind::Text(date.to_string()),
        DeValue::Array(items) => Kind::Array(array_nodes(items, lines)),
        DeValue::Table(table) => Kind::Table(
            table
                .iter()
                .map(|(key, value)| (key.get_ref().to_string(), toml_node(key.span().start, value, lines)))
                .collect(),
        ),
    };
    Node { line: Some(lines.at(start)), kind }
}

fn array_nodes(items: &DeArray<'_>, lines: &Lines) -> Vec<Node> {
    items.iter().map(|item| toml_node(item.span().start, item, lines)).collect()
}

fn json_node(value: &Value) -> Node {
    let kind = match value {
        Value::Null => Kind::Null,
        Value::Bool(value) => Kind::Bool(*value),
        Value::Number(number) => match number.as_i64() {
            Some(integer) => Kind::Integer(integer),
            None => Kind::Float(number.as_f64().unwrap_or(f64::NAN)),
        },
        Value::String(text) => Kind::Text(text.clone()),
        Value::Array(items) => Kind::Array(items.iter().map(json_node).collect()),
        Value::Object(entries) => {
            Kind::Table(entries.iter().map(|(k, v)| (k.clone(), json_node(v))).collect())
        }
    };
    Node { line: None, kind }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn lines_point_at_the_key() {
        let node =
            Node::from_toml("schema = 1\n[world]\nstep_s = 0.1\n[[body]]\nid = \"a\"\n\nyoung_pa = 3\n")
                .unwrap();
        assert_eq!(node.line_of("world.step_s"), Some(3));
        assert_eq!(node.line_of("body.a.young_pa"), Some(7));
        assert_eq!(node.line_of("body.0.young_pa"), Some(7));
        assert_eq!(node.line_of("body.a.poisson"), Some(4));
    }

    #[test]
    fn overrides_reach_tables_lists_and_missing_keys() {
        let mut node = Node::from_toml("schema = 1\n[[body]]\nid = \"a\"\nyoung_pa = 3\n").unwrap();
        node.set("body.a.young_pa=3e4").unwrap();
        node.set("world.gravity_m_s2=[0,0,-1]").unwrap();
        node.set("name=free fall").unwrap();
        assert_eq!(node.get("body").unwrap().get("a").unwrap().get("young_pa").unwrap().shown(), "30000.0");
        assert_eq!(node.get("world").unwrap().get("gravity_m_s2").unwrap().shown(), "[0,0,-1]");
        assert_eq!(node.get("name").unwrap().shown(), "\"free fall\"");
        assert!(node.set("body.b.young_pa=1").is_err());
        assert!(node.set("nonsense").is_err());
    }

    #[test]
    fn broken_text_names_its_line() {
        assert_eq!(Node::from_toml("a = 1\nb = = 2\n").unwrap_err().line, Some(2));
        assert_eq!(Node::from_json("{\n\"a\": ,\n}").unwrap_err().line, Some(2));
    }
}
