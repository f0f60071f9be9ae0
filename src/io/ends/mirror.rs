//! Where the files that paths mean are below the folders that the paths name, so that a folder of
//! outputs can be laid out alike.

use std::path::{Component, Path, PathBuf};

use super::inputs::{WILD, each, once};
use crate::Result;
use crate::stage::Formats;

/// A file, and its way from the folder that its path names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MirroredFile {
    /// The file.
    pub file: PathBuf,
    /// Its way from the folder: a file that is named by itself, or is in a folder that is, has no
    /// folder in it, one that a pattern means has those from the first wildcard on, and one of a
    /// list has those below the folder in which all of the list are.
    pub way: PathBuf,
}

/// The files that the paths mean, in their order; names may be of any bytes.
///
/// # Errors
/// Those of `expand_any`.
pub fn expand_mirrored<P: AsRef<str>>(paths: &[P], formats: &Formats) -> Result<Vec<MirroredFile>> {
    let means = each(paths, formats)?;
    once(&means)?;
    let mut all = Vec::new();
    for (path, files) in means {
        let base = base(path, &files);
        for file in files {
            let below = base.as_ref().and_then(|base| file.strip_prefix(base).ok());
            let plain = |way: &&Path| way.components().all(|c| matches!(c, Component::Normal(_)));
            let name = || file.file_name().map(PathBuf::from).unwrap_or_default();
            let way = below.filter(plain).map_or_else(name, Path::to_owned);
            all.push(MirroredFile { file, way });
        }
    }
    Ok(all)
}

/// The folder that `path` names, which means `files`; None where the names alone count.
fn base(path: &str, files: &[PathBuf]) -> Option<PathBuf> {
    let literal = Path::new(path);
    if literal.exists() {
        return None;
    }
    if path.starts_with('@') {
        return shared(files);
    }
    let wild =
        |part: &Component<'_>| part.as_os_str().to_str().is_some_and(|part| part.contains(WILD));
    Some(literal.components().take_while(|part| !wild(part)).collect())
}

/// The folder that all files are below.
fn shared(files: &[PathBuf]) -> Option<PathBuf> {
    let mut folders = files.iter().filter_map(|file| file.parent());
    let mut shared = folders.next()?.to_owned();
    for folder in folders {
        while !folder.starts_with(&shared) {
            shared = shared.parent()?.to_owned();
        }
    }
    Some(shared)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::io::las::LAZ;

    #[test]
    fn outputs_are_laid_out_as_inputs_are() {
        let at = tempfile::tempdir().unwrap();
        for file in ["a/x.laz", "a/b/x.laz", "a/b/y.laz", "c/x.laz"] {
            let file = at.path().join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, b"").unwrap();
        }
        let path = |name: &str| at.path().join(name).to_str().unwrap().to_owned();
        let list = format!("{}\n{}\n", path("a/b/y.laz"), path("c/x.laz"));
        fs::write(at.path().join("list.txt"), list).unwrap();
        let ways = |given: &str| -> Vec<String> {
            let given = match given.strip_prefix('@') {
                Some(list) => format!("@{}", path(list)),
                None => path(given),
            };
            let all = expand_mirrored(&[given], &Formats::default().with(LAZ)).unwrap();
            all.into_iter().map(|one| one.way.to_str().unwrap().to_owned()).collect()
        };
        assert_eq!(ways("a/b"), ["x.laz", "y.laz"]);
        assert_eq!(ways("a/b/y.laz"), ["y.laz"]);
        assert_eq!(ways("a/*.laz"), ["x.laz"]);
        assert_eq!(ways("*/x.laz"), ["a/x.laz", "c/x.laz"]);
        assert_eq!(ways("a/**/*.laz"), ["b/x.laz", "b/y.laz", "x.laz"]);
        assert_eq!(ways("a/../a/**/y.laz"), ["b/y.laz"]);
        assert_eq!(ways("@list.txt"), ["a/b/y.laz", "c/x.laz"]);
    }
}
