//! Whether an output is what a run would write, by what it says of how it was made. Nothing is run.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::engine::publish::folder_of;
use crate::graph::Graph;
use crate::graph::noted::NotedGraph;
use crate::host::hashed::FileHash;
use crate::io::note;
use crate::stage::Formats;

/// True if the file at `output` says that this version of pointmill made it, by `graph`, whose only
/// output it is, from inputs that have not changed since: files as long as they were that are not
/// newer than the output, or have the SHA-256 that it names.
///
/// A file that cannot be read, or says nothing, is not what a run would write.
pub fn is_current(graph: &Graph, output: &Path, formats: &Formats) -> bool {
    made_of_the_same(graph, output, formats).unwrap_or(false)
}

/// See [`is_current`]; None where something is missing.
fn made_of_the_same(graph: &Graph, output: &Path, formats: &Formats) -> Option<bool> {
    let made = fs::metadata(output).ok()?.modified().ok()?;
    let told: Value = serde_json::from_str(&note(output, formats).ok()??).ok()?;
    let noted = NotedGraph::of(graph, &graph.settings)?;
    let mut drafts = Vec::new();
    for file in noted.files() {
        drafts.push(FileHash::draft(fs::metadata(file).ok()?.len()));
    }
    let name = noted.output(0, output, false)?;
    let now = noted.text(&folder_of(output), &name, &drafts);
    if without_hashes(serde_json::from_str(&now).ok()?) != without_hashes(told.clone()) {
        return Some(false);
    }
    for (number, file) in noted.files().iter().enumerate() {
        let changed = fs::metadata(file).ok()?.modified().ok()?;
        if changed > made {
            let sha256 = told["inputs"][number]["sha256"].as_str()?;
            if FileHash::of(file, || Ok(())).ok()?.sha256 != sha256 {
                return Some(false);
            }
        }
    }
    Some(true)
}

fn without_hashes(mut told: Value) -> Value {
    let inputs = told["inputs"].as_array_mut();
    for input in inputs.into_iter().flatten().filter_map(Value::as_object_mut) {
        input.remove("sha256");
    }
    told
}
