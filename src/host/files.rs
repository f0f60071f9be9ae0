//! The files that a command reads and those that it writes, and that none of them is another:
//! names, links and further names of one file are the same here. Knows no stages.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf};

use super::standard;
use crate::error::shown;

/// All files of a command. What is read is entered first, then what is written.
#[derive(Debug, Default)]
pub struct Files {
    all: BTreeMap<Identity, (Use, PathBuf)>,
    /// Those that become copies of others: of which, and where.
    copies: BTreeSet<(Identity, Identity)>,
}

/// What a command does with a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Points are read from it.
    Input,
    /// It is the pipeline that is run.
    Pipeline,
    /// It is written.
    Output,
}

/// What tells a file from others, whatever its name: where it is on its device, or, as long as it
/// does not exist, where it will be.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Identity {
    There(u64, u64),
    Place(PathBuf),
}

/// A file that would be written although the command reads it or writes it already. Displayed as
/// what completes "this file …".
#[derive(Debug)]
pub struct Clash {
    used: Use,
    /// The name by which the other means it, where that is another.
    other: Option<PathBuf>,
}

impl Files {
    /// Enters a file that is read.
    pub fn read(&mut self, path: &Path, used: Use) {
        self.all.entry(Identity::of(path)).or_insert((used, path.to_owned()));
    }

    /// Enters a file that is written.
    ///
    /// # Errors
    ///
    /// If it is there already.
    pub fn write(&mut self, path: &Path) -> Result<(), Clash> {
        match self.all.entry(Identity::of(path)) {
            Entry::Vacant(free) => {
                free.insert((Use::Output, path.to_owned()));
                Ok(())
            }
            Entry::Occupied(taken) => {
                let (used, other) = taken.get();
                Err(Clash { used: *used, other: (other != path).then(|| other.clone()) })
            }
        }
    }

    /// Enters a file that becomes a copy of `from`; false if there is nothing to do, because it is
    /// that file or becomes its copy already.
    ///
    /// # Errors
    ///
    /// If it is there already as anything else.
    pub fn copy(&mut self, from: &Path, to: &Path) -> Result<bool, Clash> {
        let copy = (Identity::of(from), Identity::of(to));
        if copy.0 == copy.1 || self.copies.contains(&copy) {
            return Ok(false);
        }
        self.write(to)?;
        self.copies.insert(copy);
        Ok(true)
    }
}

impl Identity {
    fn of(path: &Path) -> Identity {
        match fs::metadata(path) {
            // Both may be one device, which nothing is written over.
            _ if standard::is_input(path) || standard::is_output(path) => {
                Identity::Place(path.to_owned())
            }
            Ok(there) => Identity::There(there.dev(), there.ino()),
            Err(_) => Identity::Place(resolved(path)),
        }
    }
}

/// The way from `folder`, which is resolved, to the file at `path`: its folder is resolved, too,
/// and its name stays as it is, link or not. Standard input is
/// everywhere the same.
pub fn relative(folder: &Path, path: &Path) -> PathBuf {
    if standard::is_input(path) {
        return PathBuf::from(standard::DASH);
    }
    let Some(name) = path.file_name() else { return resolved(path) };
    let above = resolved(path.parent().unwrap_or(Path::new("")));
    let common = above.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(above.components().skip(common)).collect::<PathBuf>().join(name)
}

/// The place that `path` means, links and dots resolved as far as it exists.
pub fn resolved(path: &Path) -> PathBuf {
    for above in path.ancestors() {
        let there = if above == Path::new("") { Path::new(".") } else { above };
        if let (Ok(found), Ok(rest)) = (there.canonicalize(), path.strip_prefix(above)) {
            return found.join(rest);
        }
    }
    path.to_owned()
}

impl fmt::Display for Clash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.used, &self.other) {
            (Use::Input, None) => f.write_str("is an input: it cannot be written over"),
            (Use::Input, Some(other)) => {
                write!(f, "is the input {}: it cannot be written over", shown(other))
            }
            (Use::Pipeline, _) => {
                f.write_str("is the pipeline that is run: it cannot be written over")
            }
            (Use::Output, None) => f.write_str("is written twice"),
            (Use::Output, Some(other)) => {
                write!(f, "is written twice, the other time as {}", shown(other))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_file_is_known_by_any_of_its_names() {
        let at = tempfile::tempdir().unwrap();
        let path = |name: &str| at.path().join(name);
        fs::create_dir(path("sub")).unwrap();
        fs::write(path("in.las"), "x").unwrap();
        symlink(path("in.las"), path("soft.las")).unwrap();
        symlink("../soft.las", path("sub/link.las")).unwrap();
        fs::hard_link(path("in.las"), path("hard.las")).unwrap();
        symlink("..", path("sub/up")).unwrap();
        let names = ["in.las", "soft.las", "sub/link.las", "hard.las", "sub/up/in.las"];
        for read in names {
            for written in names {
                let mut files = Files::default();
                files.read(&path(read), Use::Input);
                let clash = files.write(&path(written)).unwrap_err().to_string();
                assert_eq!(clash.contains(read), read != written, "{clash}");
                assert!(files.write(&path("other.las")).is_ok());
            }
        }
    }

    #[test]
    fn a_file_that_does_not_exist_yet_is_known_by_its_place() {
        let at = tempfile::tempdir().unwrap();
        let path = |name: &str| at.path().join(name);
        fs::create_dir(path("sub")).unwrap();
        symlink("sub", path("link")).unwrap();
        let mut files = Files::default();
        assert!(files.write(&path("sub/new.las")).is_ok());
        assert!(files.write(&path("link/new.las")).unwrap_err().to_string().contains("twice"));
        assert!(files.write(&path("sub/../link/./new.las")).is_err());
        // So is one in a folder that does not exist either.
        assert!(files.write(&path("sub/none/deep/new.las")).is_ok());
        assert!(files.write(&path("link/none/deep/new.las")).is_err());
        assert!(files.write(&path("link/none/new.las")).is_ok());
        assert!(files.write(&path("link/new.laz")).is_ok());
    }

    #[test]
    fn a_copy_is_made_once_and_replaces_nothing_of_the_command() {
        let at = tempfile::tempdir().unwrap();
        let path = |name: &str| at.path().join(name);
        for name in ["a.wdp", "b.wdp", "in.las"] {
            fs::write(path(name), name).unwrap();
        }
        symlink("a.wdp", path("link.wdp")).unwrap();
        let mut files = Files::default();
        for name in ["in.las", "a.wdp", "b.wdp"] {
            files.read(&path(name), Use::Input);
        }
        assert!(!files.copy(&path("a.wdp"), &path("link.wdp")).unwrap(), "it is there already");
        assert!(files.copy(&path("a.wdp"), &path("out.wdp")).unwrap());
        assert!(!files.copy(&path("link.wdp"), &path("./out.wdp")).unwrap(), "the same again");
        let told = |clash: Result<bool, Clash>| clash.unwrap_err().to_string();
        assert!(told(files.copy(&path("b.wdp"), &path("out.wdp"))).contains("is written twice"));
        assert!(told(files.copy(&path("a.wdp"), &path("in.las"))).contains("is an input"));
    }

    #[test]
    fn the_pipeline_is_told_from_inputs() {
        let mut files = Files::default();
        files.read(Path::new("p.toml"), Use::Pipeline);
        let clash = files.write(Path::new("./p.toml")).unwrap_err().to_string();
        assert!(clash.starts_with("is the pipeline that is run"), "{clash}");
    }
}
