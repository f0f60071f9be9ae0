//! Scratch folders: where a run spills and where its outputs grow before they get their names.
//!
//! A folder is `.pointmill-…` with a marker file that the run keeps locked. A killed run leaves the
//! folder and the lock falls open; the next run beside it removes it.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::tile::{Folder, lock};
use crate::{Error, ErrorKind, Result};

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

/// How often a folder that another run took for a dead one's is made again.
const ATTEMPTS: u32 = 100;

fn make(parent: &Path) -> Result<Made> {
    for _ in 0..ATTEMPTS {
        let folder = make_folder(parent)?;
        let path = folder.join(MARKER);
        match mark(&path) {
            Ok(marker) if path.exists() => return Ok(Made { folder, files: 0, _marker: marker }),
            // Another run found it before it was marked and locked, and removed it.
            Ok(_) => {}
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
            Err(e) => return Err(Error::io(&path, "mark the scratch folder", e)),
        }
    }
    Err(Error::new(ErrorKind::Io, "something removes the scratch folder as soon as it is made")
        .at(parent)
        .help("name another folder with --scratch"))
}

fn make_folder(parent: &Path) -> Result<PathBuf> {
    let mut attempt = 0u32;
    loop {
        let folder = parent.join(format!("{PREFIX}{}-{attempt}", std::process::id()));
        match fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists && attempt < 10_000 => {
                attempt += 1
            }
            Err(e) => {
                return Err(Error::io(parent, "create a scratch folder here", e)
                    .help("make the folder writable, or name another with --scratch"));
            }
        }
    }
}

/// Writes the marker and locks it.
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

/// Removes scratch folders in `parent` whose runs are gone. What cannot be read or removed is left.
fn remove_stale(parent: &Path) {
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        if !entry.file_name().to_string_lossy().starts_with(PREFIX) {
            continue;
        }
        let folder = entry.path();
        match File::open(folder.join(MARKER)) {
            Ok(marker) => {
                // Held until the folder is gone: its run, if it is just beginning, waits and sees.
                if marker.try_lock().is_ok() {
                    let _ = fs::remove_dir_all(folder);
                }
            }
            // A run killed before it could mark its folder; this spares any that is not empty.
            Err(_) => _ = fs::remove_dir(folder),
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
    #[test]
    fn runs_that_begin_side_by_side_spare_each_other() {
        let parent = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        let scratch = Scratch::below(parent.path());
                        let path = scratch.path("a").unwrap();
                        fs::write(&path, "mine").unwrap();
                        remove_stale(parent.path());
                        assert_eq!(fs::read(&path).unwrap(), b"mine");
                    }
                });
            }
        });
        assert_eq!(scratch_folders(parent.path()), 0);
    }
}
