//! Outputs appear under their names when they are complete: they grow in a scratch folder beside
//! their place, are brought to disk, and get their names by a rename.
//!
//! A rename is the one change that a file system makes at once: a reader of an output sees the old
//! file or the whole new one, also after a crash. The folder is beside the place, since a rename
//! cannot cross file systems. The report gets its name last, so that the outputs which it speaks of
//! are there.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::scratch::{Scratch, Trouble};
use crate::error::{shown, whereabouts};
use crate::graph::Existing;
use crate::host::standard;
use crate::{Error, ErrorKind, Result};

/// A file that is to appear at `path`.
#[derive(Debug)]
pub struct Staged {
    path: PathBuf,
    file: PathBuf,
    scratch: Arc<Scratch>,
    existing: Existing,
}

impl Staged {
    /// Makes a place for the file beside `path`, so that a folder which cannot be written refuses a
    /// run before its work and not behind it. `trouble` is for scratch that stays.
    pub fn beside(path: &Path, existing: Existing, trouble: &Trouble) -> Result<Self> {
        check_place(path, existing)?;
        let scratch = Arc::new(Scratch::below(&growing_in(path), trouble));
        let file = scratch.path("output").map_err(|error| match error.path() {
            // The folder itself refuses; other failures have their own remedies.
            Some(refusing) if refusing == scratch.parent() => error.help(
                "make the folder writable, or write to another: a file grows beside its place",
            ),
            _ => error,
        })?;
        Ok(Staged { path: path.to_owned(), file, scratch, existing })
    }

    /// The same for another file of the run, in this one's scratch folder where both are beside it.
    pub fn also(&self, path: &Path, trouble: &Trouble) -> Result<Self> {
        match growing_in(path) == growing_in(&self.path) {
            true => self.in_same_folder(path),
            false => Staged::beside(path, self.existing, trouble),
        }
    }

    /// The same for another file of the run in the folder of this one.
    pub fn in_same_folder(&self, path: &Path) -> Result<Self> {
        check_place(path, self.existing)?;
        let scratch = self.scratch.clone();
        let file = scratch.path("report")?;
        Ok(Staged { path: path.to_owned(), file, scratch, existing: self.existing })
    }

    /// Where it is to appear.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the file grows.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The scratch folder that holds it, for other scratch.
    pub fn scratch(&self) -> &Arc<Scratch> {
        &self.scratch
    }

    /// An error about the growing file is one about the file that the user named.
    pub fn tell(&self, error: Error) -> Error {
        error.readdress(&self.file, &self.path)
    }

    /// Gives the file its name; what is for standard output is copied there.
    fn place(&self) -> Result<()> {
        if standard::is_output(&self.path) {
            return standard::send(&self.file);
        }
        let failed = |e| Error::io(&self.path, "put the finished file in place", e);
        match self.existing {
            Existing::Replace => {
                self.keep_mode().map_err(failed)?;
                fs::rename(&self.file, &self.path).map_err(failed)
            }
            Existing::Refuse => match rename_new(&self.file, &self.path) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Err(existing(&self.path)),
                renamed => renamed.map_err(failed),
            },
        }
    }

    /// Users that may read and write the file that is replaced may do so with the new one.
    fn keep_mode(&self) -> io::Result<()> {
        let Ok(old) = fs::symlink_metadata(&self.path) else { return Ok(()) };
        let (file, mode) = (OpenOptions::new().write(true).open(&self.file)?, old.permissions());
        if !old.is_file() || file.metadata()?.permissions().mode() == mode.mode() {
            return Ok(());
        }
        file.set_permissions(fs::Permissions::from_mode(mode.mode() & 0o777))?;
        file.sync_all()
    }
}

/// Gives the outputs their names, one after the other, and then the report; all of them are
/// on disk already. The names of the outputs are on disk before the report appears. What is for
/// standard output comes first: nothing else is in place if its reader refuses it.
///
/// # Errors
///
/// The first thing that cannot be done; the remedy lists what is in place already.
pub fn publish(outputs: &[Staged], report: Option<&Staged>) -> Result<()> {
    let mut placed: Vec<&Path> = Vec::new();
    let all = outputs.len() + usize::from(report.is_some());
    let mut place = |files: &mut dyn Iterator<Item = _>| place_all(files, &mut placed);
    let is_sent = |staged: &&Staged| standard::is_output(&staged.path);
    let mut in_order = outputs.iter().filter(is_sent).chain(outputs.iter().filter(|s| !is_sent(s)));
    let outcome = place(&mut in_order).and_then(|()| place(&mut report.into_iter()));
    outcome.map_err(|error| match (placed.len(), error.remedy().map(str::to_owned)) {
        (0, _) => error,
        (_, remedy) => {
            let remedy = remedy.map_or(String::new(), |remedy| format!("{remedy}; "));
            error.help(format!("{remedy}{}", partly(&placed, all)))
        }
    })
}

fn place_all<'a>(
    files: &mut dyn Iterator<Item = &'a Staged>,
    placed: &mut Vec<&'a Path>,
) -> Result<()> {
    let mut folders: Vec<PathBuf> = Vec::new();
    for staged in files {
        staged.place()?;
        placed.push(&staged.path);
        let folder = growing_in(&staged.path);
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    folders.iter().try_for_each(|folder| sync_folder(folder))
}

/// What a run that ends between its renames leaves, as a sentence.
fn partly(placed: &[&Path], all: usize) -> String {
    /// Names that are listed.
    const NAMED: usize = 20;
    let names: Vec<String> = placed.iter().take(NAMED).map(|p| shown(p).to_string()).collect();
    let more = placed.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let left = match all - placed.len() {
        0 => String::new(),
        left => format!("; the other {left} of {all} files are as they were"),
    };
    format!("complete and in place already: {}{more}{left}", names.join(", "))
}

/// Renames where nothing has that name; fails with [`io::ErrorKind::AlreadyExists`] otherwise.
fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    #[cfg(target_os = "linux")]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        use rustix::io::Errno;
        match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
            // The file system does not offer it.
            Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => {}
            renamed => return Ok(renamed?),
        }
    }
    // The other name goes with the scratch folder.
    fs::hard_link(from, to)
}

/// Brings the names in a folder to disk, where the file system can do that.
fn sync_folder(folder: &Path) -> Result<()> {
    // A folder may be written to by users who may not open it.
    let Ok(open) = File::open(folder) else { return Ok(()) };
    match open.sync_all() {
        Err(e) if matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => {
            Ok(())
        }
        synced => synced.map_err(|e| {
            Error::io(folder, "bring the names of finished files to disk in this folder", e)
        }),
    }
}

/// Writes `bytes` to `path`, where they appear complete or not at all; what cannot be cleared away
/// is added to `trouble`.
#[cfg(feature = "cli")]
pub fn publish_bytes(path: &Path, bytes: &[u8], trouble: &Trouble) -> Result<()> {
    use std::io::Write as _;

    let staged = Staged::beside(path, Existing::Replace, trouble)?;
    let write = || {
        let mut file = File::create(staged.file())?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write().map_err(|cause| staged.tell(Error::io(staged.file(), "write", cause)))?;
    publish(&[staged], None)
}

/// Makes the folder for outputs if it does not exist, and those that it is in; returns what it
/// made, the outermost first.
pub fn make_folder(folder: &Path) -> Result<Vec<PathBuf>> {
    let missing = |above: &&Path| !above.as_os_str().is_empty() && !above.is_dir();
    let mut missing: Vec<&Path> = folder.ancestors().take_while(missing).collect();
    missing.reverse();
    let mut made = Vec::new();
    for one in missing {
        match fs::create_dir(one) {
            // Another run may make it at the same time.
            Err(_) if one.is_dir() => {}
            created => {
                created.map_err(|e| Error::io(one, "make the folder", e))?;
                made.push(one.to_owned());
                sync_folder(&folder_of(one))?;
            }
        }
    }
    Ok(made)
}

/// Refuses a file that is there already, if nothing is to be replaced.
pub fn refuse_existing(path: &Path, existing_files: Existing) -> Result<()> {
    let refused = existing_files == Existing::Refuse && path.symlink_metadata().is_ok();
    if refused { Err(existing(path)) } else { Ok(()) }
}

fn existing(path: &Path) -> Error {
    let told = "this file exists, and `run.existing` asks for nothing to be replaced";
    Error::new(ErrorKind::Io, told).at(path).help("write to another file, or remove this one")
}

/// Refuses `path` if no file can appear there: its folder is missing, or something is there that
/// would be replaced and is no file, or is to stay.
pub fn check_place(path: &Path, existing: Existing) -> Result<()> {
    if standard::is_output(path) {
        return standard::check_output();
    }
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => {
            return Err(Error::pipeline("this is a folder, not a file to write")
                .at(path)
                .help("name a file in it"));
        }
        Ok(there) if !there.is_file() => {
            return Err(Error::pipeline("this is no regular file: an output would replace it")
                .at(path)
                .help("write to a file"));
        }
        Err(error) if error.kind() == io::ErrorKind::InvalidFilename => {
            return Err(Error::new(ErrorKind::Io, "the name is too long for its file system")
                .at(path)
                .help("give a shorter one"));
        }
        _ => {}
    }
    refuse_existing(path, existing)?;
    let folder = folder_of(path);
    if folder.is_dir() {
        return Ok(());
    }
    if let Some(file) = folder.ancestors().find(|above| above.is_file()) {
        return Err(Error::new(ErrorKind::Io, "this is a file: nothing can be written below it")
            .at(file)
            .help("write into a folder"));
    }
    let make =
        format!("create it first, such as by `mkdir -p {}`, or write elsewhere", shown(&folder));
    let help = match whereabouts(&folder) {
        Some(help) => format!("{make}; {help}"),
        None => make,
    };
    Err(Error::new(ErrorKind::Io, "the folder does not exist").at(folder).help(help))
}

/// The folder in which a file grows: its own, so that a rename puts it in place.
fn growing_in(path: &Path) -> PathBuf {
    if standard::is_output(path) { std::env::temp_dir() } else { folder_of(path) }
}

/// The folder that a file is in; standard output is taken to end up where the process is.
pub fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() && !standard::is_output(path) => {
            parent.to_owned()
        }
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests;
