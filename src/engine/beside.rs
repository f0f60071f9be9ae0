//! Files that the records of outputs refer to, such as waveforms: copied beside the outputs, under
//! their names.
//!
//! A record tells a place in such a file by its byte. A copy of the whole file keeps all of these
//! true, whichever records are left; a file of what they still refer to would be smaller, and every
//! record would have to be changed.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use super::publish::Staged;
use super::scratch::Trouble;
use crate::error::shown;
use crate::host::{Clash, Files, standard};
use crate::stage::{CreateSink, Input};
use crate::{Error, Result};

/// A copy that is to be made.
pub(crate) struct Beside {
    from: PathBuf,
    /// Where it is to be.
    pub to: PathBuf,
}

impl Beside {
    /// The copy of what is beside `input` for the output of `sink`, if there is to be one: a file
    /// that is there already, because an output is beside its input and has its name, is left
    /// alone, and nothing is beside standard output; see [`missing`].
    ///
    /// # Errors
    ///
    /// Where it is to be and why not, if one of the `files` would be replaced.
    pub fn of(
        input: &Input,
        sink: &dyn CreateSink,
        files: &mut Files,
    ) -> Result<Option<Beside>, (PathBuf, Clash)> {
        let Some((from, extension)) = input.beside.as_ref().filter(|_| sink.wants_beside()) else {
            return Ok(None);
        };
        if standard::is_output(sink.path()) {
            return Ok(None);
        }
        let to = sink.path().with_extension(extension);
        match files.copy(from, &to) {
            Ok(wanted) => Ok(wanted.then(|| Beside { from: from.clone(), to })),
            Err(clash) => Err((to, clash)),
        }
    }

    /// Makes the copy, in a place of its own, as `first` has one.
    pub fn make(&self, first: &Staged, trouble: &Trouble) -> Result<Staged> {
        let staged = first.also(&self.to, trouble)?;
        copy(&self.from, staged.file()).map_err(|error| staged.tell(error))?;
        Ok(staged)
    }
}

/// What to say where the records of `inputs` that `sink` gets refer to a file that is not beside
/// it, since it is standard output.
pub(crate) fn missing(inputs: &[Input], sink: &dyn CreateSink) -> Option<String> {
    let is_wanted = standard::is_output(sink.path()) && sink.wants_beside();
    let (from, _) = inputs.iter().filter(|_| is_wanted).find_map(|one| one.beside.as_ref())?;
    Some(format!(
        "records of standard output refer to waveforms in {}, which has no copy beside it: put one \
         beside the file that you make of it, under its name",
        shown(from)
    ))
}

/// Copies what is in a file, with the mode that all new files get, and brings the copy to disk.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let mut source = File::open(from).map_err(|e| Error::io(from, "find it again", e))?;
    if !source.metadata().map_err(|e| Error::io(from, "find it again", e))?.is_file() {
        return Err(Error::data(from, "this is not a plain file any more"));
    }
    let copied = File::create(to).and_then(|mut file| {
        io::copy(&mut source, &mut file)?;
        file.sync_all()
    });
    copied.map_err(|e| Error::io(to, &format!("copy {} to it", shown(from)), e))
}
