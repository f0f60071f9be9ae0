//! Files that the records of outputs refer to, such as waveforms: copied beside the outputs, under their
//! names.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use super::publish::Staged;
use super::scratch::Trouble;
use crate::error::shown;
use crate::stage::{CreateSink, SinkSummary};
use crate::{Error, Result};

/// Copies what is to be beside the outputs to places of their own, as `first` has one. A file that is
/// there already, because an output is beside its input and has its name, is left alone.
pub fn beside<'a>(
    written: impl Iterator<Item = (&'a dyn CreateSink, &'a (u64, SinkSummary))>,
    first: &Staged,
    trouble: &Trouble,
) -> Result<Vec<Staged>> {
    let (mut copies, mut taken) = (Vec::new(), BTreeSet::new());
    for (sink, (_, summary)) in written {
        let Some((from, extension)) = &summary.beside else { continue };
        let to = sink.path().with_extension(extension);
        if is_same(from, &to) || !taken.insert(to.clone()) {
            continue;
        }
        let staged = first.also(&to, trouble)?;
        copy(from, staged.file()).map_err(|error| staged.tell(error))?;
        copies.push(staged);
    }
    Ok(copies)
}

/// Copies a file and brings the copy to disk.
fn copy(from: &Path, to: &Path) -> Result<()> {
    if !fs::metadata(from).map_err(|e| Error::io(from, "find it again", e))?.is_file() {
        return Err(Error::data(from, "this is not a plain file any more"));
    }
    let copied = fs::copy(from, to).and_then(|_| File::open(to)).and_then(|file| file.sync_all());
    copied.map_err(|e| Error::io(to, &format!("copy {} to it", shown(from)), e))
}

/// True if both paths lead to one file.
fn is_same(one: &Path, two: &Path) -> bool {
    match (fs::metadata(one), fs::metadata(two)) {
        (Ok(one), Ok(two)) => (one.dev(), one.ino()) == (two.dev(), two.ino()),
        _ => false,
    }
}
