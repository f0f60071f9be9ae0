//! A graph as outputs note it: what it takes to run it again and get the same bytes. Says nothing
//! of when, where and how fast it ran.
//!
//! Of the settings of the run it has those that decide about bytes. Files that are read are named
//! by their way from the folder of the output, so that a folder with both may be moved; files that
//! are written by the role that they play.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::toml::{literal, literal_table, table_of, tables};
use super::{Graph, RunSettings};
use crate::host::files::{relative, resolved};
use crate::host::hashed::FileHash;
use crate::stage::{CreateSink, Role};

/// What the name of every noted output begins with.
pub(crate) const OUTPUT: &str = "output";

/// What an output notes of its graph.
pub(crate) struct NotedGraph {
    run: Map<String, Value>,
    stages: Vec<Map<String, Value>>,
    /// The files that are read, with the keys that name them.
    places: Vec<NotedPlace>,
    /// All of these files, each once, wherever they are from here.
    files: Vec<PathBuf>,
    /// What the output of each sink is called; None for what is no file.
    outputs: Vec<Option<PathBuf>>,
    /// True if the order in which files are read decides nothing.
    is_sorted: bool,
}

struct NotedPlace {
    stage: usize,
    key: &'static str,
    /// The numbers of the files.
    files: Vec<usize>,
}

impl NotedGraph {
    /// What the outputs of `graph` note. None if no text can name it: stages that a program put
    /// there cannot be run again by what a file says.
    pub fn of(graph: &Graph, run: &RunSettings) -> Option<NotedGraph> {
        let mut noted = NotedGraph {
            run: literal_table(table_of(&run.deciding()).ok()?),
            stages: tables(graph).ok()?,
            places: Vec::new(),
            files: Vec::new(),
            outputs: Vec::new(),
            is_sorted: false,
        };
        for (n, stage) in graph.stages.iter().enumerate() {
            match &stage.role {
                Role::Source(source) => {
                    let paths = source.paths();
                    if !paths.is_empty() {
                        noted.reads(n, "path", &paths)?;
                    }
                }
                Role::Sink(sink) => noted.writes(n, &**sink)?,
                role => {
                    for (key, path) in role.files() {
                        noted.reads(n, key, &[path])?;
                    }
                }
            }
        }
        Some(noted)
    }

    /// The same where the order of the files that are read decides about bytes only if `decides`.
    pub fn in_order(self, decides: bool) -> Self {
        NotedGraph { is_sorted: !decides, ..self }
    }

    /// The files that are read, each once.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Enters files that stage `n` reads; None if it has no such key.
    fn reads(&mut self, n: usize, key: &'static str, paths: &[PathBuf]) -> Option<()> {
        self.stages[n].get(key)?;
        let mut files = Vec::new();
        for path in paths {
            let known = self.files.iter().position(|file| file == path);
            files.push(known.unwrap_or(self.files.len()));
            if known.is_none() {
                self.files.push(path.clone());
            }
        }
        self.places.push(NotedPlace { stage: n, key, files });
        Some(())
    }

    /// Enters the output of stage `n`; None if it has no key that names it.
    fn writes(&mut self, n: usize, sink: &dyn CreateSink) -> Option<()> {
        if !sink.is_file() {
            self.outputs.push(None);
            return Some(());
        }
        let key = if sink.is_folder() { "folder" } else { "path" };
        let place = self.stages[n].get_mut(key)?;
        let number = self.outputs.len();
        let mut name = if number == 0 { OUTPUT.into() } else { format!("{OUTPUT}-{}", number + 1) };
        let path = sink.path();
        if sink.is_split() {
            name = format!("{name}/{}", path.file_name().and_then(OsStr::to_str)?);
        } else if let Some(extension) = sink.extension().filter(|_| !sink.is_folder()) {
            name = format!("{name}.{}", extension.to_str()?.to_ascii_lowercase());
        }
        *place = literal(name.as_str().into());
        self.outputs.push(Some(name.into()));
        Some(())
    }

    /// What the file of sink `number` that is at `path` is called; None if it notes nothing.
    pub fn output(&self, number: usize, path: &Path, is_several: bool) -> Option<PathBuf> {
        let name = self.outputs.get(number)?.as_ref()?;
        Some(match (is_several, path.file_name()) {
            // That of a folder is the folder, that of a split its pattern.
            (true, Some(file)) if name.components().count() > 1 => name.with_file_name(file),
            (true, Some(file)) => name.join(file),
            _ => name.clone(),
        })
    }

    /// The note of an output in `folder` that is called `output`, as one line of JSON; the files
    /// that are read have these hashes.
    pub fn text(&self, folder: &Path, output: &Path, hashes: &[FileHash]) -> String {
        let folder = resolved(folder);
        let way = |file: &PathBuf| relative(&folder, file).to_string_lossy().into_owned();
        let names: Vec<String> = self.files.iter().map(way).collect();
        let (mut stages, mut inputs) = (self.stages.clone(), Vec::new());
        let mut told = BTreeSet::new();
        for NotedPlace { stage, key, files } in &self.places {
            let mut files = files.clone();
            if self.is_sorted {
                files.sort_by(|a, b| names[*a].cmp(&names[*b]));
            }
            let paths: Vec<Value> =
                files.iter().map(|&n| literal(names[n].as_str().into())).collect();
            let paths = if let [one] = &paths[..] { one.clone() } else { paths.into() };
            stages[*stage].insert((*key).to_owned(), paths);
            for n in files.into_iter().filter(|n| told.insert(*n)) {
                let FileHash { bytes, sha256 } = &hashes[n];
                inputs.push(json!({ "path": names[n], "bytes": bytes, "sha256": sha256 }));
            }
        }
        let note = json!({
            "pointmill": env!("CARGO_PKG_VERSION"),
            "output": output.to_string_lossy(),
            "inputs": inputs,
            "run": self.run,
            "stage": stages,
        });
        note.to_string()
    }
}
