//! JSON facts as text that people read: keys in a column, lists of objects as tables.

use serde_json::{Map, Value};

/// The lines of an object's keys and values, indented by `indent`.
pub(super) fn render(value: &Value, indent: usize) -> String {
    let mut lines = Vec::new();
    match value {
        Value::Object(object) => fields(object, indent, &mut lines),
        other => lines.push(format!("{:indent$}{}", "", plain(other))),
    }
    lines.join("\n")
}

fn fields(object: &Map<String, Value>, indent: usize, lines: &mut Vec<String>) {
    let width = object.keys().map(|key| key.chars().count()).max().unwrap_or(0);
    for (key, value) in object {
        let label = format!("{:indent$}{key}", "");
        match value {
            Value::Null => {}
            Value::Object(inner) if !inner.is_empty() => {
                lines.push(label);
                fields(inner, indent + 2, lines);
            }
            Value::Array(list) if list.iter().any(holds_lists) => {
                for entry in list {
                    lines.push(label.clone());
                    match entry {
                        Value::Object(inner) => fields(inner, indent + 2, lines),
                        other => lines.push(format!("{:1$}{2}", "", indent + 2, plain(other))),
                    }
                }
            }
            Value::Array(list) if list.iter().any(Value::is_object) => {
                lines.push(label);
                rows(list, indent + 2, lines);
            }
            other => {
                let text = plain(other);
                let pad = width + indent + 2;
                for (i, line) in text.lines().enumerate() {
                    let label = if i == 0 { label.as_str() } else { "" };
                    lines.push(format!("{label:pad$}{line}"));
                }
            }
        }
    }
}

/// Columns are padded to no more characters than this: a file may hold longer ones, and a table
/// that repeats the longest in every row could be larger than any memory.
const WIDEST: usize = 60;

/// True for what no row of a table can hold: an object with lists of objects in it.
fn holds_lists(value: &Value) -> bool {
    let list = |v: &Value| v.as_array().is_some_and(|list| list.iter().any(Value::is_object));
    value.as_object().is_some_and(|object| object.values().any(list))
}

/// A list of objects as a table, with the keys of all of them as its columns.
fn rows(list: &[Value], indent: usize, lines: &mut Vec<String>) {
    let mut columns: Vec<&str> = Vec::new();
    for key in list.iter().filter_map(Value::as_object).flat_map(Map::keys) {
        if !columns.contains(&key.as_str()) {
            columns.push(key);
        }
    }
    let cell = |row: &Value, column: &str| row.get(column).map(plain).unwrap_or_default();
    let mut table = vec![columns.iter().map(|c| (*c).to_owned()).collect::<Vec<String>>()];
    table.extend(list.iter().map(|row| columns.iter().map(|c| cell(row, c)).collect()));
    let width =
        |i: usize| table.iter().map(|row| row[i].chars().count()).max().unwrap_or(0).min(WIDEST);
    let widths: Vec<usize> = (0..columns.len()).map(width).collect();
    for row in &table {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        lines.push(format!("{:indent$}{}", "", cells.join("  ")).trim_end().to_owned());
    }
}

/// A value on one line, control characters escaped: files hold what they like.
fn plain(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Bool(true) => "yes".to_owned(),
        Value::Bool(false) => "no".to_owned(),
        Value::String(text) => text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect(),
        Value::Array(list) if list.iter().all(|v| !v.is_array() && !v.is_object()) => {
            list.iter().map(plain).collect::<Vec<_>>().join(", ")
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn facts_read_as_columns() {
        let facts = json!({
            "points": 5, "compressed": true, "crs": null, "max": [1.5, 2], "none": [],
            "box": { "x": 1 }, "dimensions": [{"name": "X", "type": "i32"}, {"name": "Red"}],
            "text": "a\u{1b}[31mb",
        });
        let expected = "
  points      5
  compressed  yes
  max         1.5, 2
  box
    x  1
  dimensions
    name  type
    X     i32
    Red
  text        a [31mb";
        assert_eq!(format!("\n{}", render(&facts, 2)), expected);
    }

    #[test]
    fn a_cell_longer_than_any_column_makes_no_other_row_long() {
        let mut rows: Vec<Value> = (0..500).map(|i| json!({ "name": "x", "n": i })).collect();
        rows.push(json!({ "name": "x".repeat(100_000), "n": 0 }));
        let text = render(&json!({ "elements": rows }), 0);
        assert!(text.contains(&"x".repeat(100_000)) && text.len() < 150_000, "{}", text.len());
    }

    #[test]
    fn lists_within_lists_are_tables_of_their_own() {
        let property = json!({"name": "x", "type": "float"});
        let facts = json!({"elements": [
            {"name": "vertex", "count": 7, "properties": [property]},
            {"name": "face", "count": 0, "properties": []},
        ]});
        let expected = "
elements
  name        vertex
  count       7
  properties
    name  type
    x     float
elements
  name        face
  count       0";
        assert_eq!(format!("\n{}", render(&facts, 0)), expected);
    }
}
