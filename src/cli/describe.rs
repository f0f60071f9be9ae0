//! `info`: what the headers of files say, as tables or JSON.

use serde_json::Value;

use super::arguments::Info;
use super::console::Console;
use super::{print, table};
use crate::error::shown;
use crate::pipeline::expand;
use crate::{Error, Result, io};

/// Prints what the headers of files say. A file that cannot be read is told, the others are shown.
pub(super) fn info(arguments: &Info, console: &Console) -> Result<()> {
    let files = expand(&arguments.files)?;
    let total = files.len();
    let mut described = Vec::new();
    let mut failures = Vec::new();
    for file in files {
        match io::describe(&file) {
            Ok(facts) => described.push((file, facts)),
            Err(error) => failures.push(error.at(file)),
        }
    }
    if arguments.json {
        let all = Value::Array(described.into_iter().map(|(_, facts)| facts).collect());
        print::json(&format!("{all:#}"))?;
    } else {
        let text = |(file, facts): (std::path::PathBuf, Value)| {
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
