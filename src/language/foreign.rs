//! Pipeline texts that are not quite: tables in single brackets, and pipelines of other programs.

use super::mistake::Mistake;
use super::node;
use super::node::KeyEntry;
use super::place::TextPlace;

/// Reads a pipeline file's text as TOML, or says every place where it is none, or the one thing
/// that it is instead.
pub(crate) fn parse(text: &str) -> Result<Vec<KeyEntry>, Vec<Mistake>> {
    node::parse(text, 0).map_err(|wrong| match json(text).or_else(|| single_brackets(text)) {
        Some(one) => vec![one],
        None => wrong,
    })
}

/// What a text that is JSON is told.
fn json(text: &str) -> Option<Mistake> {
    let begin = text.len() - text.trim_start_matches('\u{feff}').trim_start().len();
    let json = serde_json::from_str::<serde_json::Value>(&text[begin..]);
    if json.is_err() && !text[begin..].starts_with('{') {
        return None; // a TOML file may begin with any other bracket, but never with this one
    }
    let is_pdal = json.is_ok_and(|value| value.is_array() || value.get("pipeline").is_some());
    let told = match is_pdal {
        true => "this is a pipeline of PDAL, in JSON; a pipeline file of pointmill is TOML",
        false => "this is JSON; a pipeline file is TOML",
    };
    let note = "write a table [[stage]] with kind = \"read\", and one for every further stage";
    Some(Mistake::new(TextPlace::new(0, begin..begin + 1), told).note(note))
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
