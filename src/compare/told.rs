//! What a file says of the run that it came out of, read as what anybody may have written there.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::graph::literal;
use crate::graph::noted::OUTPUT;
use crate::language::Registry;
use crate::stage::RoleName;
use crate::{Error, Result};

/// The run that a file says it came out of.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct ToldRun {
    /// The version of pointmill.
    pub pointmill: String,
    /// What the file is called among the outputs.
    output: PathBuf,
    /// What was read.
    pub inputs: Vec<ToldInput>,
    run: Map<String, Value>,
    stage: Vec<Map<String, Value>>,
}

/// A file that was read.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct ToldInput {
    /// Its way from the folder of the output.
    pub path: String,
    /// Its length.
    pub bytes: u64,
    /// 64 hexadecimal digits.
    pub sha256: String,
}

/// Keys that name files.
const PLACES: [&str; 3] = ["path", "folder", "file"];

impl ToldRun {
    /// The run that `text` tells of.
    ///
    /// # Errors
    ///
    /// A text of another form.
    pub fn read(text: &str) -> Result<Self> {
        serde_json::from_str(text).map_err(|cause| {
            Error::pipeline("what the file says of how it was made cannot be read").because(cause)
        })
    }

    /// The pipeline as a text: it reads what is `found` in the place of each input, and writes into
    /// `folder` and nowhere else.
    ///
    /// # Errors
    ///
    /// A pipeline that reads what it does not say, or would write elsewhere.
    pub fn pipeline(
        &self,
        found: &BTreeMap<&str, PathBuf>,
        folder: &Path,
        registry: &Registry,
    ) -> Result<String> {
        let mut stages = self.stage.clone();
        for stage in &mut stages {
            let kind = stage.get("kind").and_then(Value::as_str).unwrap_or_default();
            // A kind that nobody knows is told when the text is read.
            let Some(role) = registry.role(kind) else { continue };
            let places = stage.iter_mut().filter(|(key, _)| PLACES.contains(&&***key));
            for (_, value) in places {
                each_text(value, &mut |text| match role {
                    RoleName::Sink => within(folder, Path::new(text)),
                    _ => found.get(text).cloned().ok_or_else(|| untold(text)),
                })?;
            }
        }
        Ok(json!({ "run": self.run, "stage": stages }).to_string())
    }

    /// Where the file is among what the pipeline writes into `folder`.
    ///
    /// # Errors
    ///
    /// A place elsewhere.
    pub fn made(&self, folder: &Path) -> Result<PathBuf> {
        within(folder, &self.output)
    }
}

/// Puts the path that `put` says in the place of each text of a value.
fn each_text(value: &mut Value, put: &mut dyn FnMut(&str) -> Result<PathBuf>) -> Result<()> {
    match value {
        Value::String(text) => {
            let path = put(&text.replace("$${", "${"))?;
            *value = literal(path.to_string_lossy().into());
            Ok(())
        }
        Value::Array(all) => all.iter_mut().try_for_each(|one| each_text(one, put)),
        _ => Ok(()),
    }
}

/// The path of an output in `folder`.
fn within(folder: &Path, output: &Path) -> Result<PathBuf> {
    let mut parts = output.components();
    let is_plain = parts.clone().all(|part| matches!(part, Component::Normal(_)));
    let is_named = parts
        .next()
        .is_some_and(|part| part.as_os_str().to_str().is_some_and(|name| name.starts_with(OUTPUT)));
    match is_plain && is_named && parts.count() <= 1 {
        true => Ok(folder.join(output)),
        false => Err(Error::pipeline("what the file says of how it was made writes elsewhere")),
    }
}

fn untold(path: &str) -> Error {
    let path = crate::error::shown(Path::new(path)).to_string();
    Error::pipeline(format!("it was made of {path}, of which it says no hash"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(stage: Value) -> ToldRun {
        let text = json!({
            "pointmill": "0.1.0", "output": "output.laz", "run": {}, "stage": stage,
            "inputs": [{ "path": "../${x}.laz", "bytes": 1, "sha256": "" }],
        });
        ToldRun::read(&text.to_string()).unwrap()
    }

    #[test]
    fn inputs_are_read_where_they_are_found_and_outputs_stay_in_the_folder() {
        let stages = json!([
            { "kind": "read", "path": "../$${x}.laz" },
            { "kind": "write", "path": "output.laz" },
        ]);
        let run = told(stages);
        let found = BTreeMap::from([("../${x}.laz", PathBuf::from("/in/${x}.laz"))]);
        let text = run.pipeline(&found, Path::new("/made"), &Registry::builtin()).unwrap();
        let made: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(made["stage"][0]["path"], "/in/$${x}.laz");
        assert_eq!(made["stage"][1]["path"], "/made/output.laz");
        assert_eq!(run.made(Path::new("/made")).unwrap(), Path::new("/made/output.laz"));
    }

    #[test]
    fn a_file_that_says_what_it_likes_reads_and_writes_nothing_else() {
        let registry = Registry::builtin();
        let refused = |stage: Value| {
            let run = told(json!([stage]));
            run.pipeline(&BTreeMap::new(), Path::new("/made"), &registry).unwrap_err().to_string()
        };
        for path in ["/etc/passwd", "../output.laz", "output/../../x.laz", "output/a/b.laz", "x"] {
            let told = refused(json!({ "kind": "write", "path": path }));
            assert!(told.ends_with("writes elsewhere"), "{path}: {told}");
        }
        assert!(refused(json!({ "kind": "read", "path": ["/etc/passwd"] })).contains("no hash"));
        assert!(refused(json!({ "kind": "crop", "file": "x.wkt" })).contains("x.wkt"));
        assert!(ToldRun::read("{}").is_err() && ToldRun::read("").is_err());
    }
}
