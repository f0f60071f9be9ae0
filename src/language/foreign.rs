//! Pipeline texts that are not quite: tables in single brackets, and pipelines of other programs.

use super::form::{TextForm, begin};
use super::mistake::Mistake;
use super::node::KeyEntry;
use super::place::TextPlace;
use super::{json, node};

/// Reads a pipeline file's text in its form, or says every place where it is not of that form, or
/// the one thing that it is instead.
pub(super) fn parse(text: &str, form: TextForm) -> Result<Vec<KeyEntry>, Vec<Mistake>> {
    let read = match form {
        TextForm::Json => json::parse(text),
        _ => node::parse(text, 0),
    };
    let has = |key: &str| read.as_ref().is_ok_and(|all| all.iter().any(|e| e.key == key));
    let is_pdal = form == TextForm::Json && has("pipeline") && !has("stage");
    match read.is_err().then(|| list(text)).flatten() {
        _ if is_pdal => return Err(vec![pdal(text)]),
        Some(list) if has_kinds(&list) => {
            let (begin, _) = begin(text);
            let told = "a pipeline in JSON is an object, of which this is the list of stages";
            let note = "write {\"stage\": […]} around it";
            return Err(vec![Mistake::new(TextPlace::new(0, begin..begin + 1), told).note(note)]);
        }
        Some(_) => return Err(vec![pdal(text)]),
        None => {}
    }
    read.map_err(|wrong| match single_brackets(text).filter(|_| form == TextForm::Toml) {
        Some(one) => vec![one],
        None => wrong,
    })
}

/// A list in JSON.
fn list(text: &str) -> Option<Vec<serde_json::Value>> {
    serde_json::from_str(begin(text).1).ok()
}

/// True for a list of stages in the words of pointmill.
fn has_kinds(list: &[serde_json::Value]) -> bool {
    list.iter().any(|stage| stage.get("kind").is_some())
}

/// What a pipeline of PDAL is told.
fn pdal(text: &str) -> Mistake {
    let (begin, _) = begin(text);
    let told = "this is a pipeline of PDAL, which pointmill does not run";
    let note = "the same stages in the words of pointmill: {\"stage\": [{\"kind\": \"read\", \
                \"path\": …}, …]}, or [[stage]] and kind = \"read\" in TOML";
    Mistake::new(TextPlace::new(0, begin..begin + 1), told).note(note)
}

/// What a text with `[stage]` for `[[stage]]` is told: once, though TOML refuses every table after
/// the first and all of its keys.
fn single_brackets(text: &str) -> Option<Mistake> {
    let mut at = 0;
    let mut found: Vec<(usize, usize, usize)> = Vec::new();
    for (number, line) in text.split_inclusive('\n').enumerate() {
        let heading = line.split('#').next().unwrap_or_default();
        let name = heading.trim().strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        if name.is_some_and(|name| matches!(name.trim(), "stage" | "stages")) {
            let start = at + line.len() - line.trim_start().len();
            found.push((number + 1, start, start + heading.trim().len()));
        }
        at += line.len();
    }
    let (&(_, start, end), others) = found.split_first()?;
    let mistake = Mistake::new(
        TextPlace::new(0, start..end),
        "a stage is one of several tables: write [[stage]]",
    );
    let lines: Vec<String> = others.iter().map(|(line, ..)| line.to_string()).collect();
    Some(match &lines[..] {
        [] => mistake,
        [one] => mistake.note(format!("so is line {one}")),
        several => mistake.note(format!("so are lines {}", several.join(", "))),
    })
}
