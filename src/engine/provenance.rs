//! What outputs say of the run that they come out of: its graph, the version of pointmill, and the
//! hashes of what it read. That is a function of these and of where the inputs are from the output:
//! threads, memory and time are not in it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::hashing::InputHashes;
use super::publish::folder_of;
use crate::Result;
use crate::graph::noted::NotedGraph;
use crate::point::{RunNote, Settle};
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
    ///
    /// # Errors
    ///
    /// A file that cannot be opened any more.
    pub fn hashes(&self, points: u64) -> Result<Option<Arc<InputHashes>>> {
        match self {
            Provenance::Told { files, .. } => Ok(InputHashes::new(files, points)?.map(Arc::new)),
            _ => Ok(None),
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

impl Provenance {
    /// What the output of sink `number` that is to be at `path` says of a run that takes `hashes`;
    /// it is one of several of the sink, or not. None if it says nothing.
    ///
    /// # Errors
    ///
    /// In words why it cannot say it.
    pub fn note(
        &self,
        hashes: Option<&Arc<InputHashes>>,
        (number, is_several): (usize, bool),
        path: &Path,
    ) -> Result<Option<Arc<RunNote>>, String> {
        let noted = match self {
            Provenance::Again(text) => return Ok(Some(Arc::new(RunNote::new(text)))),
            Provenance::Told { noted, .. } => noted.clone(),
            Provenance::Untold => None,
        };
        let (Some(noted), Some(hashes)) = (noted, hashes.cloned()) else { return Ok(None) };
        let Some(output) = noted.output(number, path, is_several) else { return Ok(None) };
        let folder = folder_of(path);
        let draft = noted.text(&folder, &output, &hashes.drafts());
        if draft.len() > LONGEST[usize::from(is_several)] {
            let files = Grouped(noted.files().len() as u64);
            return Err(format!(
                "outputs do not say how they were made: {files} files were read, more than there \
                 is room for"
            ));
        }
        let settle = DraftedNote { noted, folder, output, hashes };
        Ok(Some(Arc::new(RunNote::drafted(draft.into(), Arc::new(settle)))))
    }
}
