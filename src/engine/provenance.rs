//! What outputs say of the run that they come out of: its graph, the version of pointmill, and the
//! hashes of what it read. That is a function of these and of where the inputs are from the output:
//! threads, memory and time are not in it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::hashing::InputHashes;
use super::job::Job;
use super::publish::folder_of;
use crate::Result;
use crate::error::shown;
use crate::graph::noted::NotedGraph;
use crate::point::{Note, Settle};
use crate::report::Grouped;

/// The longest note of an output that is one file, and of one of several, which would all say the
/// same.
const LONGEST: [usize; 2] = [1 << 20, 64 << 10];

/// What outputs are to say.
#[derive(Default)]
pub(crate) enum Provenance {
    /// Nothing.
    #[default]
    Untold,
    /// That the report has hashes of these files; and outputs, where the graph can be noted.
    Told { files: Vec<PathBuf>, noted: Option<Arc<NotedGraph>> },
    /// This text, of a run that is made again.
    Again(Arc<str>),
}

impl Provenance {
    /// Hashes to be taken while the run reads so many points.
    pub fn hashes(&self, points: u64) -> Option<Arc<InputHashes>> {
        match self {
            Provenance::Told { files, .. } => InputHashes::new(files, points).map(Arc::new),
            _ => None,
        }
    }
}

/// The note of one output, until the hashes are known.
struct DraftedNote {
    noted: Arc<NotedGraph>,
    folder: PathBuf,
    output: PathBuf,
    hashes: Arc<InputHashes>,
}

impl Settle for DraftedNote {
    fn settle(&self) -> Result<Arc<str>> {
        Ok(self.noted.text(&self.folder, &self.output, &self.hashes.all()?).into())
    }
}

impl Job<'_> {
    /// What the output of a sink that is to be at `path` says of the run.
    pub fn note(&self, sink: usize, path: &Path) -> Option<Arc<Note>> {
        let noted = match &self.task.provenance {
            Provenance::Untold => return None,
            Provenance::Again(text) => return Some(Arc::new(Note::new(text))),
            Provenance::Told { noted, .. } => noted.clone()?,
        };
        let hashes = self.hashes.clone()?;
        let is_several = self.task.sinks[sink].is_folder() || self.task.has_squares(sink);
        let output = noted.output(sink, path, is_several)?;
        let folder = folder_of(path);
        let draft = noted.text(&folder, &output, &hashes.drafts());
        if draft.len() > LONGEST[usize::from(is_several)] {
            self.warn(format!(
                "{}: outputs do not say how they were made: {} files were read, more than there \
                 is room for",
                shown(self.task.sinks[sink].path()),
                Grouped(noted.files().len() as u64)
            ));
            return None;
        }
        let settle = DraftedNote { noted, folder, output, hashes };
        Some(Arc::new(Note::drafted(draft.into(), Arc::new(settle))))
    }
}
