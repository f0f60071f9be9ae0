//! Which files a list of paths, patterns and folders means.

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use super::kinds::Format;
use crate::{Error, Result};

/// The files that `paths` mean, in their order. For each path:
///
/// - a file that exists means itself, whatever characters its name has;
/// - a folder means every LAS, LAZ and PLY file in it, sorted by the bytes of their names, hidden
///   ones left out;
/// - else `*`, `?`, `[…]` and `**` make it a pattern: the files that match, sorted by the bytes of
///   their paths; one that matches none is an error;
/// - else it is a file that does not exist (yet): opening it will tell.
///
/// A file meant twice is an error: its points would be read twice.
pub fn expand<P: AsRef<str>>(paths: &[P]) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = Vec::new();
    for path in paths.iter().map(AsRef::as_ref) {
        let meant = one(path)?;
        if let Some(twice) = meant.iter().find(|file| files.contains(file)) {
            let twice = twice.display();
            return Err(Error::pipeline(format!("`{path}` means {twice}, which is named before")));
        }
        files.extend(meant);
    }
    if files.is_empty() {
        return Err(Error::pipeline("no input is named"));
    }
    Ok(files)
}

fn one(path: &str) -> Result<Vec<PathBuf>> {
    let literal = Path::new(path);
    if literal.is_dir() {
        return folder(literal);
    }
    let pattern = path.contains(['*', '?', '[']);
    if !pattern || literal.exists() {
        return match path {
            "" => Err(Error::pipeline("a path is empty")),
            _ => Ok(vec![literal.to_owned()]),
        };
    }
    let options = glob::MatchOptions { require_literal_leading_dot: true, ..Default::default() };
    let wrong =
        |e: glob::PatternError| Error::pipeline(format!("`{path}` is no pattern: {}", e.msg));
    let mut files = Vec::new();
    for entry in glob::glob_with(path, options).map_err(wrong)? {
        let entry = entry.map_err(|e| {
            let place = e.path().to_owned();
            Error::io(place, "list the folder", e.into())
        })?;
        if !entry.is_dir() {
            files.push(entry);
        }
    }
    if files.is_empty() {
        return Err(Error::pipeline(format!("no file matches `{path}`")));
    }
    sort(&mut files);
    Ok(files)
}

fn folder(path: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::io(path, "list the folder", e);
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let hidden = entry.file_name().as_bytes().starts_with(b".");
        let file = entry.path();
        if !hidden && Format::of(&file).is_some() && !file.is_dir() {
            files.push(file);
        }
    }
    if files.is_empty() {
        let path = path.display();
        return Err(Error::pipeline(format!("the folder `{path}` has no las, laz or ply file")));
    }
    sort(&mut files);
    Ok(files)
}

fn sort(files: &mut [PathBuf]) {
    files.sort_by(|a, b| a.as_os_str().as_bytes().cmp(b.as_os_str().as_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder_of(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            fs::write(folder.path().join(name), b"").unwrap();
        }
        folder
    }

    fn names(folder: &Path, paths: &[&str]) -> Result<Vec<String>> {
        let paths: Vec<String> =
            paths.iter().map(|p| folder.join(p).to_str().unwrap().to_owned()).collect();
        let name = |p: PathBuf| p.file_name().unwrap().to_str().unwrap().to_owned();
        expand(&paths).map(|files| files.into_iter().map(name).collect())
    }

    #[test]
    fn patterns_and_folders_are_sorted_by_bytes() {
        let at = folder_of(&[
            "b.laz", "B.laz", "a10.laz", "a9.laz", "ä.LAS", "n.txt", ".h.laz", "p.ply",
        ]);
        let all = ["B.laz", "a10.laz", "a9.laz", "b.laz", "p.ply", "ä.LAS"];
        assert_eq!(names(at.path(), &[""]).unwrap(), all);
        assert_eq!(names(at.path(), &["*.laz"]).unwrap(), all[..4]);
        assert_eq!(names(at.path(), &["b.laz", "a?.laz"]).unwrap(), ["b.laz", "a9.laz"]);
    }

    #[test]
    fn a_file_that_exists_wins_over_the_pattern() {
        let at = folder_of(&["a[1].laz", "a1.laz"]);
        assert_eq!(names(at.path(), &["a[1].laz"]).unwrap(), ["a[1].laz"]);
        fs::remove_file(at.path().join("a[1].laz")).unwrap();
        assert_eq!(names(at.path(), &["a[1].laz"]).unwrap(), ["a1.laz"]);
    }

    #[test]
    fn what_means_no_file_or_one_twice_is_named() {
        let at = folder_of(&["a.laz"]);
        let told = |paths: &[&str]| names(at.path(), paths).unwrap_err().to_string();
        assert!(told(&["*.las"]).contains("/*.las`"));
        assert!(told(&["a.laz", "*.laz"]).contains("a.laz, which is named before"));
        assert!(told(&["[.laz"]).contains("no pattern"));
        let empty = folder_of(&["a.txt"]);
        assert!(names(empty.path(), &[""]).unwrap_err().to_string().contains("has no las"));
        assert!(expand::<&str>(&[]).is_err());
        assert_eq!(names(at.path(), &["missing.laz"]).unwrap(), ["missing.laz"]);
    }
}
