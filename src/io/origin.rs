//! What a file was when a source opened it, so that one that is written to, cut, replaced or
//! removed while it is read is told and not milled. Knows no formats.

use std::fs::{self, File, FileType, Metadata, OpenOptions};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::sync::Arc;

use crate::host::standard;
use crate::{Error, Result};

/// A file's path, and which file was there in which state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    path: Arc<Path>,
    was: FileState,
}

/// What changes with a file's content. Times of modification can be set back, those of the last
/// change of any kind cannot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct FileState {
    device: u64,
    inode: u64,
    length: u64,
    modified: (i64, i64),
    changed: (i64, i64),
}

impl FileState {
    fn of(about: &Metadata) -> FileState {
        FileState {
            device: about.dev(),
            inode: about.ino(),
            length: about.len(),
            modified: (about.mtime(), about.mtime_nsec()),
            changed: (about.ctime(), about.ctime_nsec()),
        }
    }
}

impl Origin {
    /// Opens `path`, which must be a plain file: others cannot be read at positions.
    pub fn open(path: &Path) -> Result<(File, Origin)> {
        let (file, about) = open_plain(path)?;
        Ok((file, Origin { path: path.into(), was: FileState::of(&about) }))
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
        let there = standard::opened(&self.path)?;
        let now = fs::metadata(there).map_err(|e| Error::io(&self.path, "find it again", e))?;
        self.compare(FileState::of(&now))
    }

    /// What came of reading, `at_end` where all of a stretch was read: then, and where it failed, a
    /// change of the file is the better answer.
    pub fn vouch(&self, outcome: Result<()>, at_end: bool) -> Result<()> {
        if outcome.is_err() || at_end {
            self.unchanged()?;
        }
        outcome
    }

    fn compare(&self, now: FileState) -> Result<()> {
        let was = self.was;
        if now == was {
            return Ok(());
        }
        let how = if (was.device, was.inode) != (now.device, now.inode) {
            "another file took its place".to_owned()
        } else if was.length != now.length {
            format!("it had {} bytes and has {}", was.length, now.length)
        } else if was.modified != now.modified {
            "it was written to".to_owned()
        } else {
            "its content, its name or its permissions were changed".to_owned()
        };
        Err(Error::data(&self.path, format!("the file changed while it was read: {how}"))
            .help("wait until nothing writes to it any more, and run again"))
    }
}

/// Opens the plain file at `path`. A pipe that nobody writes to would be waited for without end,
/// and opening a device can set it to work: neither is opened, whatever the order in which things
/// happen.
pub fn open_plain(path: &Path) -> Result<(File, Metadata)> {
    let opening = |e| Error::io(path, "open it", e);
    let there = standard::opened(path)?;
    plain(path, fs::metadata(&there).map_err(opening)?)?;
    let without_waiting = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(without_waiting.bits().cast_signed())
        .open(there)
        .map_err(opening)?;
    let about = file.metadata().map_err(|e| Error::io(path, "read its length", e))?;
    plain(path, about).map(|about| (file, about))
}

fn plain(path: &Path, about: Metadata) -> Result<Metadata> {
    if about.is_file() {
        return Ok(about);
    }
    let told = format!("this is {}, not a plain file", kind(about.file_type()));
    Err(Error::data(path, told).help("files are read at positions, which only plain ones have"))
}

fn kind(found: FileType) -> &'static str {
    if found.is_dir() {
        "a folder"
    } else if found.is_fifo() {
        "a pipe"
    } else if found.is_socket() {
        "a socket"
    } else {
        "a device"
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
        let rewrite = |path: &Path| {
            let was = fs::metadata(path).unwrap().modified().unwrap();
            std::thread::sleep(Duration::from_millis(20)); // file systems count time in ticks
            fs::write(path, "TEN BYTES!").unwrap();
            File::open(path).unwrap().set_modified(was).unwrap();
        };
        assert!(told(rewrite).ends_with("permissions were changed"), "times can be set back");
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
    }

    #[test]
    fn what_is_no_plain_file_is_named_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let told = |path: &Path| open_plain(path).unwrap_err().to_string();
        assert!(told(folder.path()).ends_with("this is a folder, not a plain file"));
        assert!(told(Path::new("/dev/zero")).ends_with("this is a device, not a plain file"));
        let socket = folder.path().join("socket");
        let _listening = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        assert!(told(&socket).ends_with("this is a socket, not a plain file"));
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        assert!(told(&pipe).ends_with("this is a pipe, not a plain file"));
    }
}
