//! The hashes of what a run reads, taken while it reads: whoever reads a batch also hashes as large
//! a part of the inputs as was read of their points, if nobody else is at it.
//!
//! So the bytes are in the page cache, and a scan that is larger than the memory is not read from
//! its disk twice. No thread is needed besides those of the run. Which thread hashes which piece
//! changes nothing.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::Result;
use crate::host::hashed::{FileHash, HashingFile};
use crate::host::lock;
use crate::io::Origin;

/// Files that are hashed as their points are read.
pub(crate) struct InputHashes {
    files: Vec<Origin>,
    /// Bytes of all of them, and the points that headers claim.
    bytes: u64,
    points: u64,
    read: AtomicU64,
    work: Mutex<HashingWork>,
}

/// How far it is.
#[derive(Default)]
struct HashingWork {
    done: Vec<FileHash>,
    open: Option<HashingFile>,
    bytes: u64,
    piece: Vec<u8>,
}

impl InputHashes {
    /// Those of the files at `paths`, which have so many points; None if one of them is no plain
    /// file: what cannot be read twice cannot be told again.
    ///
    /// # Errors
    ///
    /// A plain file that cannot be opened.
    pub fn new(paths: &[PathBuf], points: u64) -> Result<Option<Self>> {
        let open = |path: &PathBuf| Origin::open(path).map(|(_, origin)| origin);
        let opened: Result<Vec<Origin>> = paths.iter().map(open).collect();
        let files = match opened {
            Ok(files) => files,
            Err(_) if paths.iter().any(|path| !path.is_file()) => return Ok(None),
            Err(error) => return Err(error),
        };
        let bytes = files.iter().map(Origin::length).sum();
        let (read, work) = (AtomicU64::new(0), Mutex::default());
        Ok(Some(InputHashes { files, bytes, points, read, work }))
    }

    /// What stands in the place of the hashes until they are known.
    pub fn drafts(&self) -> Vec<FileHash> {
        self.files.iter().map(|file| FileHash::draft(file.length())).collect()
    }

    /// Goes on with hashing when so many more points were read.
    ///
    /// # Errors
    ///
    /// A file that cannot be read any more, or that changed.
    pub fn follow(&self, points: u64) -> Result<()> {
        let read = self.read.fetch_add(points, Ordering::Relaxed).saturating_add(points);
        let share = u128::from(read.min(self.points)) * u128::from(self.bytes);
        let up_to = (share / u128::from(self.points.max(1))) as u64;
        match self.work.try_lock() {
            Ok(mut work) => self.hash(&mut work, up_to),
            Err(_) => Ok(()), // somebody is at it
        }
    }

    /// The hashes of all files, in their order; what is left of them is read now.
    ///
    /// # Errors
    ///
    /// As [`follow`](InputHashes::follow).
    pub fn all(&self) -> Result<Vec<FileHash>> {
        let mut work = lock(&self.work);
        self.hash(&mut work, u64::MAX)?;
        Ok(work.done.clone())
    }

    /// The hash of the file at `path`, if it is one of these and all are known.
    pub fn of(&self, path: &Path) -> Option<String> {
        let number = self.files.iter().position(|file| file.path() == path)?;
        lock(&self.work).done.get(number).map(|hash| hash.sha256.clone())
    }

    /// Hashes on to byte `up_to` of all.
    fn hash(&self, work: &mut HashingWork, up_to: u64) -> Result<()> {
        while let Some(file) = self.files.get(work.done.len()) {
            if work.bytes >= up_to {
                break;
            }
            let open = match &mut work.open {
                Some(open) => open,
                none => none.insert(HashingFile::new(file.reopen()?)),
            };
            let bytes = open.piece(file.path(), &mut work.piece)? as u64;
            work.bytes += bytes;
            if bytes == 0 {
                // What was read is what it was when the run began, and is still.
                file.unchanged()?;
                work.done.extend(work.open.take().map(HashingFile::finish));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(folder: &Path, lengths: &[usize]) -> Vec<PathBuf> {
        let each = lengths.iter().enumerate().map(|(n, &length)| {
            let path = folder.join(format!("{n}"));
            std::fs::write(&path, vec![n as u8; length]).unwrap();
            path
        });
        each.collect()
    }

    #[test]
    fn hashes_follow_what_is_read_and_are_those_of_the_files() {
        let folder = tempfile::tempdir().unwrap();
        let paths = files(folder.path(), &[1 << 20, 0, 300_000]);
        let hashes = InputHashes::new(&paths, 100).unwrap().unwrap();
        let done = || lock(&hashes.work).bytes;
        hashes.follow(10).unwrap();
        let tenth = done();
        assert!((100_000..300_000).contains(&tenth), "{tenth}");
        hashes.follow(5).unwrap();
        assert!(done() > tenth && done() < 400_000);
        // More points than the headers claim.
        hashes.follow(1_000).unwrap();
        let alone = |path: &PathBuf| FileHash::of(path, || Ok(())).unwrap();
        let expected: Vec<FileHash> = paths.iter().map(alone).collect();
        assert_eq!(hashes.all().unwrap(), expected);
        assert_eq!(hashes.of(&paths[2]).unwrap(), expected[2].sha256);
        let drafts = hashes.drafts();
        assert!(drafts.iter().zip(&expected).all(|(a, b)| a.bytes == b.bytes));
    }

    #[test]
    fn a_file_that_changes_meanwhile_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let paths = files(folder.path(), &[200_000]);
        let hashes = InputHashes::new(&paths, 10).unwrap().unwrap();
        hashes.follow(5).unwrap();
        std::fs::write(&paths[0], "another").unwrap();
        assert!(hashes.all().unwrap_err().to_string().contains("changed while it was read"));
        assert!(InputHashes::new(&[folder.path().to_owned()], 1).unwrap().is_none(), "a folder");
    }
}
