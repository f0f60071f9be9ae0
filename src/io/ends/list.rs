//! Lists of paths: a text with one of them a line.

use std::io::Read;
use std::path::Path;

use crate::io::origin::open_plain;
use crate::{Error, Result};

/// Bytes of the longest list.
const LONGEST: u64 = 64 << 20;

/// The paths of the list at `list` with the numbers of their lines; blank lines and those that
/// begin with `#` are none.
///
/// # Errors
///
/// A list that cannot be read, is too long or no UTF-8 text, or has a list in it.
pub(super) fn paths_in(list: &Path) -> Result<Vec<(usize, String)>> {
    let (file, about) = open_plain(list)?;
    if about.len() > LONGEST {
        return Err(Error::data(list, format!("a list of paths has {LONGEST} bytes at most")));
    }
    let mut text = Vec::new();
    file.take(LONGEST).read_to_end(&mut text).map_err(|e| Error::io(list, "read it", e))?;
    let text = String::from_utf8(text).map_err(|cause| {
        let at = cause.utf8_error().valid_up_to() as u64;
        Error::data(list, "the list is not UTF-8 text").at_byte(at)
    })?;
    let lines = text.lines().map(str::trim).enumerate().map(|(n, path)| (n + 1, path));
    let paths = lines.filter(|(_, path)| !path.is_empty() && !path.starts_with('#'));
    let paths: Vec<(usize, String)> = paths.map(|(n, path)| (n, path.to_owned())).collect();
    let is_list = |path: &str| path.starts_with('@') && !Path::new(path).exists();
    match paths.iter().find(|(_, path)| is_list(path)) {
        None => Ok(paths),
        Some((line, _)) => {
            let told = format!("line {line}: a list in a list is not read");
            Err(Error::data(list, told).help("name both lists where the first is named"))
        }
    }
}
