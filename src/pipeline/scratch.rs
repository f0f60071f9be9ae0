//! Scratch folders: where a run spills and where its outputs grow before they get their names.
//!
//! A folder is `.pointmill-…` with a marker file that the run keeps locked. A killed run leaves the
//! folder and the lock falls open; the next run beside it removes it. The marker is the last file to
//! go, so that a folder whose removal was cut short is still known for what it is.

use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::budget::Bytes;
use crate::error::shown;
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
            let _ = remove(&made.folder);
        }
    }
}

fn make(parent: &Path) -> Result<Made> {
    let mut attempt = 0u32;
    loop {
        let folder = parent.join(format!("{PREFIX}{}-{attempt}", std::process::id()));
        attempt += 1;
        match fs::create_dir(&folder) {
            Ok(()) => {}
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && attempt < ATTEMPTS => continue,
            Err(e) => {
                return Err(Error::io(parent, "create a scratch folder here", e)
                    .help("make the folder writable, or name another with `run.scratch`"));
            }
        }
        match mark(&folder) {
            Ok(Some(marker)) => return Ok(Made { folder, files: 0, _marker: marker }),
            Ok(None) if attempt < ATTEMPTS => {}
            Ok(None) => return Err(Error::internal("scratch folders vanish").at(parent)),
            Err(e) => {
                let _ = remove(&folder);
                return Err(Error::io(&folder, "mark the scratch folder", e));
            }
        }
    }
}

/// Folders that are tried: names of dead runs may be taken, and another run may take a new folder
/// for that of a dead one.
const ATTEMPTS: u32 = 10_000;

/// Puts the marker into a new folder and locks it. None if another run took the folder before it was
/// locked.
fn mark(folder: &Path) -> io::Result<Option<File>> {
    let path = folder.join(MARKER);
    let mut marker = match File::create_new(&path) {
        // The folder is gone, or was removed and made anew by a run that then marked it.
        Err(e) if matches!(e.kind(), io::ErrorKind::NotFound | io::ErrorKind::AlreadyExists) => {
            return Ok(None);
        }
        marker => marker?,
    };
    // Where a file system has no locks, no other run can lock it either and take it for dead.
    let _ = marker.lock();
    if !is_at(&marker, &path) {
        return Ok(None);
    }
    let about = serde_json::json!({
        "about": "scratch of a pointmill run; safe to remove when no run uses it",
        "version": env!("CARGO_PKG_VERSION"),
        "process": std::process::id(),
    });
    writeln!(marker, "{about}")?;
    Ok(Some(marker))
}

/// True if the open `file` is the one that is at `path` now.
fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(there)) => (open.dev(), open.ino()) == (there.dev(), there.ino()),
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
            // The lock is held until the folder is gone: a run that has just made it waits for that.
            // A marker that is no longer there was that of an earlier folder of the same name.
            Ok(marker) if marker.try_lock().is_ok() && is_at(&marker, &folder.join(MARKER)) => {
                let _ = remove(&folder);
            }
            Ok(_) => {}
            // A run killed before it could mark its folder; `remove_dir` spares any that is not empty.
            Err(_) => {
                let _ = fs::remove_dir(&folder);
            }
        }
    }
}

/// Removes a scratch folder, its marker last.
fn remove(folder: &Path) -> io::Result<()> {
    let marker = folder.join(MARKER);
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path != marker {
            fs::remove_file(path)?;
        }
    }
    fs::remove_file(marker)?;
    fs::remove_dir(folder)
}

/// Bytes free for this user on the file system of `folder`; None where the system does not tell.
pub fn free_space(folder: &Path) -> Option<u64> {
    let figures = rustix::fs::statvfs(folder).ok()?;
    figures.f_bavail.checked_mul(figures.f_frsize)
}

/// A warning if `folder` is on a file system that is memory itself: what spills there is not counted
/// in the run's budget, and frees nothing. `spilled` is how much did.
pub fn memory_warning(folder: &Path, spilled: u64) -> Option<String> {
    // linux/magic.h
    const MEMORY: [(u32, &str); 2] = [(0x0102_1994, "tmpfs"), (0x8584_58f6, "ramfs")];
    let kind = rustix::fs::statfs(folder).ok()?.f_type as u32;
    let (_, name) = MEMORY.into_iter().find(|(magic, _)| *magic == kind).filter(|_| spilled > 0)?;
    Some(format!(
        "{}: {} were spilled to a file system in memory ({name}), beyond the budget of the run: name a \
         folder on a disk with `run.scratch`",
        shown(folder),
        Bytes(spilled)
    ))
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

    #[test]
    fn a_removal_that_was_cut_short_is_finished_by_the_next_run() {
        let parent = tempfile::tempdir().unwrap();
        let dead = parent.path().join(format!("{PREFIX}1-0"));
        fs::create_dir(&dead).unwrap();
        fs::write(dead.join(MARKER), "{}").unwrap();
        fs::write(dead.join("1-records"), "data").unwrap();
        // What stops a removal half-way: a folder where files are expected.
        fs::create_dir(dead.join("2-refuses")).unwrap();
        assert!(remove(&dead).is_err());
        assert!(dead.join(MARKER).exists(), "the marker goes last");
        fs::remove_dir(dead.join("2-refuses")).unwrap();
        Scratch::below(parent.path());
        assert!(!dead.exists());
    }

    #[test]
    fn runs_that_begin_together_never_take_each_others_folders() {
        let parent = tempfile::tempdir().unwrap();
        let made = std::sync::atomic::AtomicU32::new(0);
        std::thread::scope(|scope| {
            for _ in 0..6 {
                scope.spawn(|| {
                    for _ in 0..150 {
                        let scratch = Scratch::below(parent.path());
                        let path = scratch.path("a").unwrap();
                        fs::write(&path, "mine").unwrap();
                        remove_stale(parent.path());
                        assert_eq!(fs::read_to_string(path).unwrap(), "mine");
                        made.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    }
                });
            }
        });
        assert_eq!(made.into_inner(), 900);
        assert_eq!(scratch_folders(parent.path()), 0);
    }
}
