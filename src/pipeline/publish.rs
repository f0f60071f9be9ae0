//! Outputs appear under their names when they are complete: they grow in a scratch folder beside
//! their place, are brought to disk, and get their names by a rename.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::plan::refuse_overwrite;
use super::scratch::Scratch;
use crate::{Error, ErrorKind, Result};

/// A file that is to appear at `path`.
#[derive(Debug)]
pub struct Staged {
    path: PathBuf,
    file: PathBuf,
    scratch: Arc<Scratch>,
}

impl Staged {
    /// Makes a place for the file beside `path`, so that a folder which cannot be written refuses a
    /// run before its work and not behind it.
    pub fn beside(path: &Path) -> Result<Self> {
        check_place(path)?;
        let scratch = Arc::new(Scratch::below(&folder_of(path)));
        let file = scratch.path("output").map_err(|error| {
            error.help(
                "make the folder writable, or write to another: a file grows beside its place",
            )
        })?;
        Ok(Staged { path: path.to_owned(), file, scratch })
    }

    /// The same for another file of the run, in this one's scratch folder where both are beside it.
    pub fn also(&self, path: &Path) -> Result<Self> {
        if folder_of(path) != folder_of(&self.path) {
            return Staged::beside(path);
        }
        check_place(path)?;
        let scratch = self.scratch.clone();
        let file = scratch.path("report")?;
        Ok(Staged { path: path.to_owned(), file, scratch })
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

    /// Gives the file its name; whoever wrote it has brought it to disk.
    pub fn publish(self) -> Result<()> {
        fs::rename(&self.file, &self.path)
            .map_err(|e| Error::io(&self.path, "put the finished file in place", e))?;
        // The name is there; that it outlives a loss of power is more than some file systems promise.
        let _ = File::open(folder_of(&self.path)).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

/// Writes `bytes` to `path`, where they appear complete or not at all; never over one of `inputs`.
pub fn publish_bytes(path: &Path, bytes: &[u8], inputs: &[PathBuf]) -> Result<()> {
    inputs.iter().try_for_each(|input| refuse_overwrite(input, path))?;
    let staged = Staged::beside(path)?;
    let write = || {
        let mut file = File::create(staged.file())?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write().map_err(|cause| staged.tell(Error::io(staged.file(), "write", cause)))?;
    staged.publish()
}

/// Makes the folder for outputs if it does not exist; that it is in must.
pub fn make_folder(folder: &Path) -> Result<()> {
    match fs::create_dir(folder) {
        Err(_) if folder.is_dir() => Ok(()),
        made => made.map_err(|e| Error::io(folder, "make the folder", e)),
    }
}

/// Refuses `path` if no file can appear there: its folder is missing, or something is there that is
/// no file and would be replaced by one.
pub fn check_place(path: &Path) -> Result<()> {
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => {
            return Err(Error::pipeline("this is a folder, not a file to write").at(path));
        }
        Ok(there) if !there.is_file() => {
            return Err(Error::pipeline("this is no regular file: an output would replace it")
                .at(path)
                .help("write to a file"));
        }
        _ => {}
    }
    let folder = folder_of(path);
    if folder.is_dir() {
        return Ok(());
    }
    if let Some(file) = folder.ancestors().find(|above| above.is_file()) {
        return Err(Error::new(ErrorKind::Io, "this is a file: nothing can be written below it")
            .at(file)
            .help("write into a folder"));
    }
    Err(Error::new(ErrorKind::Io, "the folder does not exist").at(folder).help("create it first"))
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_complete_or_not_at_all() {
        let at = tempfile::tempdir().unwrap();
        let path = at.path().join("out.las");
        fs::write(&path, "old").unwrap();
        let staged = Staged::beside(&path).unwrap();
        fs::write(staged.file(), "ne").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        drop(staged);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        let staged = Staged::beside(&path).unwrap();
        fs::write(staged.file(), "new").unwrap();
        staged.publish().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(at.path()), ["out.las"]);
    }

    #[test]
    fn a_link_is_replaced_and_what_it_means_is_spared() {
        let at = tempfile::tempdir().unwrap();
        let (path, other) = (at.path().join("out.las"), at.path().join("other.las"));
        fs::write(&other, "other").unwrap();
        std::os::unix::fs::symlink(&other, &path).unwrap();
        let staged = Staged::beside(&path).unwrap();
        fs::write(staged.file(), "new").unwrap();
        staged.publish().unwrap();
        assert_eq!(fs::read_to_string(&other).unwrap(), "other");
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    }

    #[test]
    fn places_where_no_file_can_appear_are_refused_before_any_work() {
        let at = tempfile::tempdir().unwrap();
        let told = |path: &Path| Staged::beside(path).unwrap_err().to_string();
        assert!(told(&at.path().join("none/out.las")).ends_with("none: the folder does not exist"));
        assert!(told(at.path()).contains("a folder, not a file"));
        assert!(told(Path::new("/dev/null")).contains("no regular file"));
        assert_eq!(names(at.path()), [""; 0]);
    }

    #[test]
    fn errors_are_about_the_file_that_the_user_named() {
        let at = tempfile::tempdir().unwrap();
        let path = at.path().join("out.las");
        let staged = Staged::beside(&path).unwrap();
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let error = staged.tell(Error::io(staged.file(), "write it", full));
        assert_eq!(error.path(), Some(path.as_path()));
        assert!(error.remedy().unwrap().contains("free some disk space"));
        let error = staged.tell(Error::data("in.las", "odd"));
        assert_eq!(error.path(), Some(Path::new("in.las")));
    }
}
