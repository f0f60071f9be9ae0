//! Scratch folders: where a run spills and where its outputs grow before they get their names.
//!
//! A folder is `.pointmill-…` with a marker file that the run keeps locked. A killed run leaves the
//! folder and the lock falls open; the next run beside it removes it.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::tile::{Folder, lock};
use crate::{Error, Result};

const PREFIX: &str = ".pointmill-";
const MARKER: &str = "pointmill-scratch.json";

/// A scratch folder below a parent, made when it is first needed and removed when dropped.
#[derive(Debug)]
pub struct Scratch {
    parent: PathBuf,
    made: Mutex<Option<Made>>,
}

#[derive(Debug)]
struct Made {
    folder: PathBuf,
    files: u32,
    /// Locked for as long as the run lives.
    _marker: File,
}

impl Scratch {
    /// A scratch folder to be made in `parent`. Removes what killed runs left there.
    pub fn below(parent: &Path) -> Self {
        remove_stale(parent);
        Scratch { parent: parent.to_owned(), made: Mutex::default() }
    }

    /// The folder that outputs at `path` are staged in: the one that holds it.
    pub fn parent_of(path: &Path) -> PathBuf {
        match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        }
    }

    /// The folder it is made in.
    pub fn parent(&self) -> &Path {
        &self.parent
    }

    /// A path for a new file in the folder.
    pub fn path(&self, name: &str) -> Result<PathBuf> {
        let mut slot = lock(&self.made);
        let made = match slot.as_mut() {
            Some(made) => made,
            None => slot.insert(make(&self.parent)?),
        };
        made.files += 1;
        Ok(made.folder.join(format!("{}-{name}", made.files)))
    }
}

impl Folder for Arc<Scratch> {
    fn file(&self, name: &str) -> Result<PathBuf> {
        self.path(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if let Some(made) = lock(&self.made).take() {
            // Nothing more can be done about a folder that will not go; the next run tries again.
            let _ = fs::remove_dir_all(made.folder);
        }
    }
}

fn make(parent: &Path) -> Result<Made> {
    // A run that starts at the same time may take a folder without a lock for a killed run's and
    // remove it; then the next number is tried.
    for attempt in 0..10_000u32 {
        let folder = parent.join(format!("{PREFIX}{}-{attempt}", std::process::id()));
        match fs::create_dir(&folder) {
            Ok(()) => {}
            Err(e) if e.kind() == ErrorKind::AlreadyExists => continue,
            Err(e) => {
                return Err(Error::io(parent, "create a scratch folder here", e)
                    .help("make the folder writable, or name another with --scratch"));
            }
        }
        let path = folder.join(MARKER);
        match mark(&path) {
            Ok(marker) if is_still(&marker, &path) => {
                return Ok(Made { folder, files: 0, _marker: marker });
            }
            Err(e) if e.kind() != ErrorKind::NotFound => {
                let _ = fs::remove_dir_all(&folder); // the error says more than a second one could
                return Err(Error::io(&path, "mark the scratch folder", e));
            }
            _ => {}
        }
    }
    let told = "there are too many scratch folders here; remove those that no run uses";
    Err(Error::new(crate::ErrorKind::Io, told).at(parent))
}

/// A marker file at `path`, locked.
fn mark(path: &Path) -> std::io::Result<File> {
    let mut marker = File::create(path)?;
    marker.lock()?;
    let about = serde_json::json!({
        "about": "scratch of a pointmill run; safe to remove when no run uses it",
        "version": env!("CARGO_PKG_VERSION"),
        "process": std::process::id(),
    });
    writeln!(marker, "{about}")?;
    Ok(marker)
}

/// True if the open `file` is the one at `path`.
fn is_still(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
        _ => false,
    }
}

/// Removes scratch folders in `parent` whose runs are gone. What cannot be read or removed is left.
fn remove_stale(parent: &Path) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        if !entry.file_name().to_string_lossy().starts_with(PREFIX) {
            continue;
        }
        let folder = entry.path();
        match File::open(folder.join(MARKER)) {
            // The lock is held until all is gone: a run that was about to take it then finds its
            // marker missing.
            Ok(marker) => {
                if marker.try_lock().is_ok() {
                    let _ = fs::remove_dir_all(&folder);
                }
            }
            // A run killed before it could mark its folder; `remove_dir` spares any that is not empty.
            Err(_) => {
                let _ = fs::remove_dir(&folder);
            }
        }
    }
}

/// Bytes free for this user on the file system of `folder`; None where the system does not tell.
pub fn free_space(folder: &Path) -> Option<u64> {
    let figures = rustix::fs::statvfs(folder).ok()?;
    figures.f_bavail.checked_mul(figures.f_frsize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scratch_folders(parent: &Path) -> usize {
        fs::read_dir(parent)
            .unwrap()
            .flatten()
            .filter(|e| e.file_name().to_string_lossy().starts_with(PREFIX))
            .count()
    }

    #[test]
    fn a_folder_lives_as_long_as_its_run() {
        let parent = tempfile::tempdir().unwrap();
        let scratch = Scratch::below(parent.path());
        assert_eq!(scratch_folders(parent.path()), 0);
        fs::write(scratch.path("a").unwrap(), "x").unwrap();
        assert_eq!(scratch_folders(parent.path()), 1);
        drop(scratch);
        assert_eq!(scratch_folders(parent.path()), 0);
    }

    #[test]
    fn runs_that_start_at_once_do_not_take_each_other_for_killed() {
        let parent = tempfile::tempdir().unwrap();
        std::thread::scope(|threads| {
            for _ in 0..4 {
                threads.spawn(|| {
                    for _ in 0..200 {
                        let scratch = Scratch::below(parent.path());
                        let file = scratch.path("a").unwrap();
                        fs::write(&file, "x").unwrap();
                        remove_stale(parent.path());
                        assert_eq!(fs::read(&file).unwrap(), b"x");
                    }
                });
            }
        });
        assert_eq!(scratch_folders(parent.path()), 0);
    }

    #[test]
    fn the_next_run_removes_what_a_killed_one_left_and_spares_the_living() {
        let parent = tempfile::tempdir().unwrap();
        let living = Scratch::below(parent.path());
        living.path("a").unwrap();
        let dead = parent.path().join(format!("{PREFIX}1-7"));
        fs::create_dir(&dead).unwrap();
        fs::write(dead.join(MARKER), "{}").unwrap();
        fs::write(dead.join("1-records"), "data").unwrap();
        fs::create_dir(parent.path().join(format!("{PREFIX}2-0"))).unwrap();
        let foreign = parent.path().join(format!("{PREFIX}notes"));
        fs::create_dir(&foreign).unwrap();
        fs::write(foreign.join("mine.txt"), "keep").unwrap();
        Scratch::below(parent.path());
        assert!(!dead.exists() && foreign.join("mine.txt").exists());
        assert_eq!(scratch_folders(parent.path()), 2, "the living one and the foreign one");
    }
}
