//! Which files a list of paths, patterns and folders means.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use super::list::paths_in;
use crate::error::{listed, shown, whereabouts};
use crate::host::standard;
use crate::stage::Formats;
use crate::{Error, ErrorKind, Result};

/// The files that the paths mean, in their order, as [`Read`](super::kinds::Read) says.
pub fn expand<P: AsRef<str>>(paths: &[P], formats: &Formats) -> Result<Vec<PathBuf>> {
    let files = expand_any(paths, formats)?;
    match files.iter().find(|file| file.to_str().is_none()) {
        Some(odd) => Err(unreadable(odd)),
        None => Ok(files),
    }
}

/// The error of a file whose name is not UTF-8 text: no pipeline and no report could say it.
pub fn unreadable(file: &Path) -> Error {
    Error::pipeline("the name is not UTF-8 text")
        .at(file)
        .help("rename it: pipelines and reports could not say its name")
}

/// As [`expand`], but names may be of any bytes.
///
/// # Errors
/// Those of [`expand`] but for such names.
pub fn expand_any<P: AsRef<str>>(paths: &[P], formats: &Formats) -> Result<Vec<PathBuf>> {
    let means = each(paths, formats)?;
    once(&means)?;
    Ok(means.into_iter().flat_map(|(_, files)| files).collect())
}

/// Each path with the files that it means.
pub(super) fn each<'a, P: AsRef<str>>(
    paths: &'a [P],
    formats: &Formats,
) -> Result<Vec<(&'a str, Vec<PathBuf>)>> {
    let paths = paths.iter().map(AsRef::as_ref);
    paths.map(|path| Ok((path, one(path, formats)?))).collect()
}

/// Refuses a file that is meant twice, and paths that mean none.
pub(super) fn once(means: &[(&str, Vec<PathBuf>)]) -> Result<()> {
    let mut named = BTreeSet::new();
    for (path, file) in means.iter().flat_map(|(path, files)| files.iter().map(move |f| (path, f)))
    {
        if !named.insert(file.canonicalize().unwrap_or_else(|_| file.clone())) {
            let (twice, path) = (shown(file).to_string(), shown(Path::new(path)).to_string());
            let told = match twice == path {
                true => format!("`{path}` is a file that is named before it"),
                false => format!("`{path}` means {twice}, which is named before it"),
            };
            return Err(Error::pipeline(told));
        }
    }
    match named.is_empty() {
        true => Err(Error::pipeline("no input is named")),
        false => Ok(()),
    }
}

/// What the lines of the list at `list` mean.
fn listed_in(list: &Path, formats: &Formats) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for (line, path) in paths_in(list)? {
        files.extend(one(&path, formats).map_err(|error| match error.path() {
            Some(_) => error,
            None => Error::data(list, format!("line {line}: {error}")),
        })?);
    }
    Ok(files)
}

fn one(path: &str, formats: &Formats) -> Result<Vec<PathBuf>> {
    let literal = Path::new(path);
    if let Some(list) = path.strip_prefix('@').filter(|_| !literal.exists()) {
        return listed_in(Path::new(list), formats);
    }
    if literal.is_dir() {
        return folder(literal, formats);
    }
    let pattern = path.contains(WILD);
    if !pattern || literal.exists() {
        return match path {
            "" => Err(Error::pipeline("a path is empty")),
            _ => Ok(vec![standard::input(path)]),
        };
    }
    if path.len() > LONGEST {
        let told = format!("a pattern of {} bytes is longer than any path", path.len());
        return Err(Error::pipeline(told));
    }
    let start = if path.starts_with('/') { Path::new("/") } else { Path::new("") };
    let steps = steps(path)?;
    let mut walk = Walk { pattern: path, ..Walk::default() };
    // A slash at the end asks for folders.
    if !path.ends_with('/') {
        walk.on(start, &steps)?;
    }
    let mut files = walk.files;
    if files.is_empty() {
        let error = Error::new(ErrorKind::Io, format!("no file matches `{}`", shown(literal)));
        return Err(match whereabouts(literal) {
            Some(help) => error.help(help),
            None => error,
        });
    }
    sort(&mut files);
    files.dedup();
    Ok(files)
}

/// What one component of a pattern means.
enum Step<'a> {
    /// The one of this name.
    Name(&'a str),
    /// All whose names match.
    Matching(glob::Pattern),
    /// Any number of folders.
    Below,
}

fn steps(path: &str) -> Result<Vec<Step<'_>>> {
    let mut steps = Vec::new();
    for part in path.split('/').filter(|part| !part.is_empty()) {
        steps.push(match part {
            "**" if matches!(steps.last(), Some(Step::Below)) => continue,
            "**" => Step::Below,
            _ if !part.contains(WILD) => Step::Name(part),
            _ => Step::Matching(glob::Pattern::new(part).map_err(|e| {
                let path = shown(Path::new(path));
                Error::pipeline(format!("`{path}` is no pattern: {}", e.msg))
            })?),
        });
    }
    Ok(steps)
}

/// What makes a path a pattern.
pub(super) const WILD: [char; 3] = ['*', '?', '['];
/// Bytes of the longest pattern: the system's longest path.
const LONGEST: usize = 4096;
/// Names that a pattern may look at.
const NAMES_MOST: usize = 1 << 20;

/// A search for the files that a pattern means.
#[derive(Default)]
struct Walk<'a> {
    pattern: &'a str,
    files: Vec<PathBuf>,
    /// Folders with the number of steps that were left there: `*/..` leads to one from each of its
    /// folders, and `*/../*/..` from each of these again.
    seen: BTreeSet<(PathBuf, usize)>,
    names: usize,
}

impl Walk<'_> {
    /// Collects the files that `steps` lead to from `at`.
    fn on(&mut self, at: &Path, steps: &[Step<'_>]) -> Result<()> {
        let Some((step, rest)) = steps.split_first() else {
            if !at.is_dir() && at.exists() {
                self.files.push(at.to_owned());
            }
            return Ok(());
        };
        match step {
            Step::Name(name) => self.on(&at.join(name), rest),
            Step::Matching(pattern) => {
                for name in self.entries(at, steps.len())? {
                    // Bytes that are no text match `*` and `?` as the character that stands for
                    // such.
                    let text = name.to_string_lossy();
                    let hidden = text.starts_with('.') && !pattern.as_str().starts_with('.');
                    if !hidden && pattern.matches(&text) {
                        self.on(&at.join(name), rest)?;
                    }
                }
                Ok(())
            }
            Step::Below => {
                let names = self.entries(at, steps.len())?;
                self.on(at, rest)?;
                for name in names {
                    let inner = at.join(&name);
                    // A link could lead back up.
                    if !name.as_bytes().starts_with(b".") && inner.is_dir() && !inner.is_symlink() {
                        self.on(&inner, steps)?;
                    }
                }
                Ok(())
            }
        }
    }

    /// Names in a folder where `left` steps are left; none where there is no such folder, or where
    /// the search was before.
    fn entries(&mut self, folder: &Path, left: usize) -> Result<Vec<OsString>> {
        let folder = if folder == Path::new("") { Path::new(".") } else { folder };
        let Ok(real) = folder.canonicalize() else { return Ok(Vec::new()) };
        if !self.seen.insert((real, left)) {
            return Ok(Vec::new());
        }
        let mut names = entries(folder)?;
        // Where two ways lead to one folder, the first by its name is gone.
        names.sort_unstable();
        self.names += names.len();
        if self.names > NAMES_MOST {
            let told = format!("`{}` looks at more than {NAMES_MOST} names", self.pattern);
            return Err(Error::pipeline(told).help("name fewer folders, or one of them at a time"));
        }
        Ok(names)
    }
}

/// Names in a folder; none where there is no such folder.
fn entries(folder: &Path) -> Result<Vec<OsString>> {
    let failed = |e| Error::io(folder, "list the folder", e);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    fs::read_dir(folder)
        .map_err(failed)?
        .map(|entry| entry.map(|e| e.file_name()).map_err(failed))
        .collect()
}

fn folder(path: &Path, formats: &Formats) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::io(path, "list the folder", e);
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let hidden = entry.file_name().as_bytes().starts_with(b".");
        let file = entry.path();
        let is_of_points = formats.of(&file).is_some_and(|format| format.owns_extension());
        if !hidden && is_of_points && !file.is_dir() {
            files.push(file);
        }
    }
    if files.is_empty() {
        let path = shown(path);
        // What is arranged is of another's extension, too.
        let owned = formats.iter().filter(|f| f.owns_extension() && f.arranged().is_none());
        let known = listed(owned.map(|format| format.extension()), "or");
        let told = format!("the folder `{path}` has no {known} file");
        return Err(Error::new(ErrorKind::Io, told));
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
    use crate::io::las::{LAS, LAZ};
    use crate::io::ply::PLY;

    fn formats() -> Formats {
        Formats::default().with(LAS).with(LAZ).with(PLY)
    }

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
        expand(&paths, &formats()).map(|files| files.into_iter().map(name).collect())
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
    fn patterns_tell_case_leave_hidden_ones_out_and_go_through_folders() {
        let at = folder_of(&["a.laz", "A.laz", "b.LAZ", ".c.laz"]);
        for inner in ["x/y", "x/.z", "w"] {
            fs::create_dir_all(at.path().join(inner)).unwrap();
            fs::write(at.path().join(inner).join("d.laz"), b"").unwrap();
        }
        std::os::unix::fs::symlink("..", at.path().join("x/up")).unwrap();
        let found = |pattern: &str| -> Vec<String> {
            let files = expand(&[at.path().join(pattern).to_str().unwrap()], &formats()).unwrap();
            let inner = |f: PathBuf| f.strip_prefix(at.path()).unwrap().display().to_string();
            files.into_iter().map(inner).collect()
        };
        assert_eq!(found("*.laz"), ["A.laz", "a.laz"]);
        assert_eq!(found("*.LAZ"), ["b.LAZ"]);
        assert_eq!(found(".*.laz"), [".c.laz"]);
        assert_eq!(found("[a-c]*"), ["a.laz", "b.LAZ"]);
        assert_eq!(found("**/*.laz"), ["A.laz", "a.laz", "w/d.laz", "x/y/d.laz"]);
        assert_eq!(found("**/**/d.laz"), ["w/d.laz", "x/y/d.laz"]);
        assert_eq!(found("x/.*/d.*"), ["x/.z/d.laz"]);
        assert_eq!(found("[x]/../w/*"), ["x/../w/d.laz"]);
        assert!(
            expand(&[at.path().join("x/**").to_str().unwrap()], &formats()).is_err(),
            "folders alone"
        );
        assert!(expand(&[at.path().join("none/*").to_str().unwrap()], &formats()).is_err());
    }

    #[test]
    fn names_that_are_no_text_are_refused_by_patterns_and_folders() {
        let at = folder_of(&["a.laz"]);
        let name = std::ffi::OsStr::from_bytes(b"\xff.laz");
        fs::write(at.path().join(name), b"").unwrap();
        for path in ["", "*.laz", "?.laz", "**/*.laz"] {
            let refused =
                expand(&[at.path().join(path).to_str().unwrap()], &formats()).unwrap_err();
            assert_eq!(refused.path(), Some(at.path().join(name).as_path()), "{path}");
            assert!(refused.to_string().ends_with("not UTF-8 text"), "{refused}");
        }
        assert_eq!(names(at.path(), &["a*.laz"]).unwrap(), ["a.laz"]);
    }

    #[test]
    fn patterns_that_go_up_again_and_again_end() {
        let at = folder_of(&["a.laz"]);
        (0..20).for_each(|i| fs::create_dir(at.path().join(format!("d{i}"))).unwrap());
        let start = std::time::Instant::now();
        let up = "*/../".repeat(40) + "*.laz";
        assert_eq!(names(at.path(), &[&up]).unwrap(), ["a.laz"]);
        assert!(start.elapsed() < std::time::Duration::from_secs(5), "{:?}", start.elapsed());
        let long = names(at.path(), &[&("*/".repeat(3000) + "x")]).unwrap_err();
        assert!(long.to_string().contains("longer than any path"), "{long}");
    }

    #[test]
    fn a_list_means_what_its_lines_mean() {
        let at = folder_of(&["a.laz", "b.laz", "c.laz", "@odd.laz"]);
        let path = |name: &str| at.path().join(name).to_str().unwrap().to_owned();
        let list = path("list.txt");
        let of = |paths: &[String]| {
            let name = |p: PathBuf| p.file_name().unwrap().to_str().unwrap().to_owned();
            let files = expand(paths, &formats())?;
            Ok::<_, Error>(files.into_iter().map(name).collect::<Vec<_>>())
        };
        let lines = format!("# two\n{}\n\n  {}\r\n", path("c.laz"), path("[ab].laz"));
        fs::write(&list, lines).unwrap();
        let at_list = format!("@{list}");
        assert_eq!(of(std::slice::from_ref(&at_list)).unwrap(), ["c.laz", "a.laz", "b.laz"]);
        assert_eq!(of(&[path("@odd.laz")]).unwrap(), ["@odd.laz"], "a file that exists is itself");
        let told = |text: &str| {
            fs::write(&list, text).unwrap();
            of(std::slice::from_ref(&at_list)).unwrap_err().to_string()
        };
        assert!(told(&path("none*.laz")).contains("list.txt: line 1: no file matches"));
        assert!(told("@other.txt").contains("a list in a list is not read"));
        assert!(told("# nothing").contains("no input is named"));
        fs::remove_file(&list).unwrap();
        assert_eq!(of(&[at_list]).unwrap_err().path(), Some(Path::new(&list)));
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
        assert!(told(&["a.laz", "./a.laz"]).contains("./a.laz` is a file that is named"));
        assert!(told(&["[.laz"]).contains("no pattern"));
        let empty = folder_of(&["a.txt"]);
        assert!(names(empty.path(), &[""]).unwrap_err().to_string().contains("has no las"));
        assert!(expand::<&str>(&[], &formats()).is_err());
        assert_eq!(names(at.path(), &["missing.laz"]).unwrap(), ["missing.laz"]);
    }
}
