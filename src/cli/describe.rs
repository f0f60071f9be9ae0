//! `info`: what the headers of files say, or all their points, as tables or JSON.

use std::path::PathBuf;

use serde_json::Value;

use super::arguments::InfoArguments;
use super::console::Console;
use super::{deep, print, table};
use crate::error::shown;
use crate::io::DeepFigures;
use crate::io::ends::expand;
use crate::report::Coordinate;
use crate::stage::Formats;
use crate::{Error, Result, io};

/// Prints what the headers of files say, and their points if that is wanted. A file that cannot be
/// read is told, the others are shown.
pub(super) fn info(arguments: &InfoArguments, formats: &Formats, console: &Console) -> Result<()> {
    let files = expand(&arguments.files, formats)?;
    let total = files.len();
    let mut described = Vec::new();
    let mut failures = Vec::new();
    for file in files {
        let facts = io::describe(&file, formats);
        let facts = facts.and_then(|facts| match arguments.deep {
            true => Ok((facts, Some(io::deep(&file, formats, &arguments.walk.walk())?))),
            false => Ok((facts, None)),
        });
        match facts {
            Ok((facts, figures)) => described.push((file, facts, figures)),
            Err(error) => failures.push(error.at(file)),
        }
    }
    if arguments.json {
        let all: Result<Vec<Value>> =
            described.into_iter().map(|(_, facts, figures)| with_figures(facts, figures)).collect();
        let all = Value::Array(all?);
        print::json(&format!("{all:#}"))?;
    } else {
        let text = |(file, facts, figures): (PathBuf, Value, Option<DeepFigures>)| {
            let mut facts = in_short(facts);
            if let Some(figures) = figures {
                facts["deep"] = deep::shown(&figures, &numbers(&facts["scale"]));
            }
            format!("{}\n{}", shown(&file), table::render(&facts, 2))
        };
        let all: Vec<String> = described.into_iter().map(text).collect();
        if !all.is_empty() {
            print::result(all.join("\n\n"))?;
        }
    }
    match (failures.len(), failures.pop()) {
        (_, None) => Ok(()),
        (1, Some(only)) => Err(only),
        (n, Some(last)) => {
            let kind = last.kind();
            failures.iter().chain([&last]).for_each(|error| console.error(error));
            Err(Error::new(kind, format!("{n} of {total} files cannot be described")))
        }
    }
}

/// The facts of a file and, below `deep`, what its points come to.
fn with_figures(mut facts: Value, figures: Option<DeepFigures>) -> Result<Value> {
    if let Some(figures) = figures {
        let failed = |e| Error::internal("figures could not be written as JSON").because(e);
        facts["deep"] = serde_json::to_value(figures).map_err(failed)?;
    }
    Ok(facts)
}

/// The facts of a file with the corners of its box in as many digits as its scale tells apart:
/// headers hold what was computed of it.
fn in_short(mut facts: Value) -> Value {
    let scale: Vec<f64> = numbers(&facts["scale"]);
    for corner in ["min", "max"] {
        let each = numbers(&facts[corner]);
        // Of PLY files and of what is no number nothing is known that could be shorter.
        if each.len() == 3 && scale.len() == 3 {
            let short = each.iter().zip(&scale).map(|(&at, &step)| Coordinate { at, step });
            let number = |short: Coordinate| short.to_string().parse().unwrap_or(short.at);
            facts[corner] = short.map(number).collect();
        }
    }
    facts
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn corners_have_the_digits_of_the_scale() {
        let facts = json!({ "scale": [0.01, 0.01, 0.001], "min": [1.5, 2.0, -3.25],
                            "max": [119.94, 19.990_000_000_000_002, 1.0] });
        let short = in_short(facts);
        assert_eq!(short["max"], json!([119.94, 19.99, 1.0]));
        assert_eq!(short["min"], json!([1.5, 2.0, -3.25]));
        assert_eq!(in_short(json!({ "points": 5 }))["points"], 5);
    }
}
