//! Scratch folders: where a run spills and where its outputs grow before they get their names.
//!
//! A folder is `.pointmill-<boot>-<process>-<n>`, its user's alone, with a marker file that the run
//! keeps locked and that names the machine. A killed run leaves the folder and the lock falls open;
//! the next run beside it removes it. The marker is the last file to go, so that a folder whose
//! removal was cut short is still known for what it is.

mod stale;

use std::fs::{self, File};
use std::io::{self, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use rustix::fs::{CWD, Mode, OFlags, openat};
use rustix::io::Errno;

use crate::budget::Bytes;
use crate::error::shown;
use crate::host::disk;
use crate::host::lock;
use crate::store::Folder;
use crate::{Error, Result};
use stale::{Host, MARKER, is_at, open_folder, remove, remove_stale};

/// What went wrong with scratch and fails no run: told when the run is over.
pub type Trouble = Arc<Mutex<Vec<String>>>;

/// A scratch folder below a parent, made when it is first needed and removed when dropped.
#[derive(Debug)]
pub struct Scratch {
    parent: PathBuf,
    made: Mutex<Option<Made>>,
    trouble: Trouble,
}

#[derive(Debug)]
struct Made {
    folder: PathBuf,
    open: OwnedFd,
    files: u32,
    /// Locked for as long as the run lives.
    _marker: File,
}

impl Scratch {
    /// A scratch folder to be made in `parent`. Removes what killed runs left there. `trouble` gets
    /// to know of folders that cannot be removed.
    pub fn below(parent: &Path, trouble: &Trouble) -> Self {
        lock(trouble).extend(remove_stale(parent));
        let (parent, trouble) = (parent.to_owned(), trouble.clone());
        Scratch { parent, made: Mutex::default(), trouble }
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
        let Some(made) = lock(&self.made).take() else { return };
        if let Err(cause) = remove(CWD, &made.folder, &made.open) {
            let folder = shown(&made.folder);
            let told = format!("{folder}: this scratch folder cannot be removed: {cause}");
            lock(&self.trouble).push(told);
        }
    }
}

fn make(parent: &Path) -> Result<Made> {
    let host = Host::this();
    let mut attempt = 0u32;
    loop {
        let name = format!("{}{}-{attempt}", host.prefix(), std::process::id());
        let folder = parent.join(name);
        attempt += 1;
        match fs::DirBuilder::new().mode(0o700).create(&folder) {
            Ok(()) => {}
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && attempt < ATTEMPTS => continue,
            Err(e) => {
                return Err(Error::io(parent, "create a scratch folder here", e)
                    .help("make the folder writable, or name another with `run.scratch`"));
            }
        }
        let failed = |e: io::Error| Error::io(&folder, "mark the scratch folder", e);
        let open = match open_folder(CWD, &folder) {
            Ok(open) => open,
            // Another run took it for that of a dead one.
            Err(Errno::NOENT) if attempt < ATTEMPTS => continue,
            Err(e) => return Err(failed(e.into())),
        };
        match mark(&open, &folder, &host) {
            Ok(Some(marker)) => return Ok(Made { folder, open, files: 0, _marker: marker }),
            Ok(None) if attempt < ATTEMPTS => {}
            Ok(None) => return Err(Error::internal("scratch folders vanish").at(parent)),
            Err(e) => {
                let _ = remove(CWD, &folder, &open);
                return Err(failed(e));
            }
        }
    }
}

/// Folders that are tried: names of dead runs may be taken, and another run may take a new folder
/// for that of a dead one.
const ATTEMPTS: u32 = 10_000;

/// Puts the marker into the new folder, open as `open`, and locks it. None if another run took the
/// folder before it was locked.
fn mark(open: &OwnedFd, folder: &Path, host: &Host) -> io::Result<Option<File>> {
    let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let mut marker = match openat(open, MARKER, flags, Mode::RUSR | Mode::WUSR) {
        Ok(marker) => File::from(marker),
        // The folder is gone.
        Err(Errno::NOENT | Errno::EXIST) => return Ok(None),
        Err(e) => return Err(e.into()),
    };
    // Where a file system has no locks, no other run can lock it either and take it for dead.
    let _ = marker.lock();
    if !is_at(&marker, CWD, folder.join(MARKER)) {
        return Ok(None);
    }
    let about = serde_json::json!({
        "about": "scratch of a pointmill run; safe to remove when no run uses it",
        "version": env!("CARGO_PKG_VERSION"),
        "process": std::process::id(),
        "host": host.name,
        "boot": host.boot,
    });
    writeln!(marker, "{about}")?;
    Ok(Some(marker))
}

/// A warning if `folder` is on a file system that is memory itself: what spills there is not
/// counted in the run's budget, and frees nothing. `spilled` is how much did.
pub fn memory_warning(folder: &Path, spilled: u64) -> Option<String> {
    let name = disk::memory_itself(folder).filter(|_| spilled > 0)?;
    Some(format!(
        "{}: {} were spilled to a file system in memory ({name}), beyond the budget of the run: \
         name a folder on a disk with `run.scratch`",
        shown(folder),
        Bytes(spilled)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::scratch::stale::PREFIX;

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
        let scratch = Scratch::below(parent.path(), &Trouble::default());
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
                        let scratch = Scratch::below(parent.path(), &Trouble::default());
                        let file = scratch.path("a").unwrap();
                        fs::write(&file, "x").unwrap();
                        assert_eq!(remove_stale(parent.path()), [""; 0]);
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
        let trouble = Trouble::default();
        let living = Scratch::below(parent.path(), &trouble);
        living.path("a").unwrap();
        let prefix = Host::this().prefix();
        let dead = parent.path().join(format!("{prefix}1-7"));
        fs::create_dir(&dead).unwrap();
        // Killed before the marker was written.
        fs::write(dead.join(MARKER), "").unwrap();
        fs::write(dead.join("1-records"), "data").unwrap();
        fs::create_dir(parent.path().join(format!("{prefix}2-0"))).unwrap();
        let foreign = parent.path().join(format!("{PREFIX}notes"));
        fs::create_dir(&foreign).unwrap();
        fs::write(foreign.join("mine.txt"), "keep").unwrap();
        Scratch::below(parent.path(), &trouble);
        assert!(!dead.exists() && foreign.join("mine.txt").exists());
        assert_eq!(scratch_folders(parent.path()), 2, "the living one and the foreign one");
        assert_eq!(*lock(&trouble), [""; 0]);
    }

    #[test]
    fn scratch_is_its_users_alone() {
        use std::os::unix::fs::PermissionsExt;
        let parent = tempfile::tempdir().unwrap();
        let scratch = Scratch::below(parent.path(), &Trouble::default());
        let folder = scratch.path("a").unwrap().parent().unwrap().to_owned();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(&folder), mode(&folder.join(MARKER))), (0o700, 0o600));
        let marker = fs::read_to_string(folder.join(MARKER)).unwrap();
        let marker: serde_json::Value = serde_json::from_str(&marker).unwrap();
        assert_eq!(marker["boot"], Host::this().boot);
        assert_eq!(marker["host"], Host::this().name);
    }

    #[test]
    fn a_folder_that_will_not_go_is_told() {
        let parent = tempfile::tempdir().unwrap();
        let trouble = Trouble::default();
        let scratch = Scratch::below(parent.path(), &trouble);
        let folder = scratch.path("a").unwrap().parent().unwrap().to_owned();
        fs::create_dir_all(folder.join("in the way/a/b/c/d")).unwrap();
        drop(scratch);
        let told = lock(&trouble).join("");
        assert!(told.starts_with(folder.to_str().unwrap()), "{told}");
        assert!(told.contains("cannot be removed"), "{told}");
    }

    #[test]
    fn runs_that_begin_together_never_take_each_others_folders() {
        let parent = tempfile::tempdir().unwrap();
        let made = std::sync::atomic::AtomicU32::new(0);
        std::thread::scope(|scope| {
            for _ in 0..6 {
                scope.spawn(|| {
                    for _ in 0..150 {
                        let scratch = Scratch::below(parent.path(), &Trouble::default());
                        let path = scratch.path("a").unwrap();
                        fs::write(&path, "mine").unwrap();
                        assert_eq!(remove_stale(parent.path()), [""; 0]);
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
