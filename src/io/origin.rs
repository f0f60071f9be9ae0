//! What a file was when a source opened it, so that one that is written to, cut, replaced or removed
//! while it is read is told and not milled. Knows no formats.

use std::fs::{self, File, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::Arc;

use crate::{Error, Result};

/// A file's path, and which file was there in which state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    path: Arc<Path>,
    was: State,
}

/// What changes with a file's content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct State {
    device: u64,
    inode: u64,
    length: u64,
    modified: (i64, i64),
}

impl State {
    fn of(about: &Metadata) -> State {
        State {
            device: about.dev(),
            inode: about.ino(),
            length: about.len(),
            modified: (about.mtime(), about.mtime_nsec()),
        }
    }
}

impl Origin {
    /// Opens `path`, which must be a plain file: others cannot be read at positions.
    pub fn open(path: &Path) -> Result<(File, Origin)> {
        let file = File::open(path).map_err(|e| Error::io(path, "open it", e))?;
        let about = file.metadata().map_err(|e| Error::io(path, "read its length", e))?;
        if !about.is_file() {
            return Err(Error::data(path, "this is not a plain file")
                .help("scans are read at positions: pipes and folders cannot be"));
        }
        Ok((file, Origin { path: path.into(), was: State::of(&about) }))
    }

    /// Opens the file again, and fails if another one is there or it has changed.
    pub fn reopen(&self) -> Result<File> {
        let (file, now) = Origin::open(&self.path)?;
        self.compare(now.was).map(|()| file)
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its length in bytes when it was opened.
    pub fn length(&self) -> u64 {
        self.was.length
    }

    /// Fails if the file at the path is another one by now, or has changed.
    pub fn unchanged(&self) -> Result<()> {
        let now =
            fs::metadata(&self.path).map_err(|e| Error::io(&self.path, "find it again", e))?;
        self.compare(State::of(&now))
    }

    /// What came of reading, `at_end` where all of a stretch was read: then, and where it failed, a
    /// change of the file is the better answer.
    pub fn vouch(&self, outcome: Result<()>, at_end: bool) -> Result<()> {
        if outcome.is_err() || at_end {
            self.unchanged()?;
        }
        outcome
    }

    fn compare(&self, now: State) -> Result<()> {
        let was = self.was;
        if now == was {
            return Ok(());
        }
        let how = if (was.device, was.inode) != (now.device, now.inode) {
            "another file took its place".to_owned()
        } else if was.length != now.length {
            format!("it had {} bytes and has {}", was.length, now.length)
        } else {
            "it was written to".to_owned()
        };
        Err(Error::data(&self.path, format!("the file changed while it was read: {how}"))
            .help("wait until nothing writes to it any more, and run again"))
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use super::*;

    fn told(change: impl Fn(&Path)) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan");
        fs::write(&path, "ten bytes!").unwrap();
        let (_, origin) = Origin::open(&path).unwrap();
        origin.unchanged().unwrap();
        origin.reopen().unwrap();
        change(&path);
        let error = origin.unchanged().unwrap_err();
        assert_eq!(error.path(), Some(path.as_path()));
        assert!(origin.reopen().is_err());
        let worse = Err(Error::data(&path, "damaged"));
        assert_eq!(origin.vouch(worse, false).unwrap_err().to_string(), error.to_string());
        error.to_string()
    }

    #[test]
    fn every_change_of_a_file_is_told() {
        assert!(told(|path| fs::write(path, "five!").unwrap()).ends_with("10 bytes and has 5"));
        let later = SystemTime::now() + Duration::from_secs(5);
        let touch = |path: &Path| File::open(path).unwrap().set_modified(later).unwrap();
        assert!(told(touch).ends_with("written to"));
        let replace = |path: &Path| {
            fs::write(path.with_extension("new"), "ten bytes!").unwrap();
            fs::rename(path.with_extension("new"), path).unwrap();
        };
        assert!(told(replace).ends_with("took its place"));
        assert!(told(|path| fs::remove_file(path).unwrap()).ends_with("cannot find it again"));
    }

    #[test]
    fn an_unchanged_file_leaves_the_outcome_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan");
        fs::write(&path, "ten bytes!").unwrap();
        let (_, origin) = Origin::open(&path).unwrap();
        origin.vouch(Ok(()), true).unwrap();
        let damaged = origin.vouch(Err(Error::data(&path, "damaged")), true).unwrap_err();
        assert!(damaged.to_string().ends_with("damaged"));
        assert!(Origin::open(folder.path()).unwrap_err().to_string().contains("plain file"));
    }
}
