//! Files held to the rules of their formats, for `validate`.

use std::path::Path;

use super::{describe, sniff};
use crate::stage::{Findings, Formats, PointWalk, enter_error};
use crate::{ErrorKind, Result};

/// Holds the file at `path` to the rules of its format, which its first bytes tell: what is wrong
/// with it, and the name of the format, if it is one of `formats`. A file that cannot be opened or
/// read is a fault in the words of the error.
///
/// ```
/// use pointmill::stage::PointWalk;
/// use pointmill::{Registry, io};
///
/// let path = std::env::temp_dir().join(format!("pointmill-validate-{}.ply", std::process::id()));
/// std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\n\
///                        property float y\nproperty float z\nend_header\n1 2 3\n")?;
/// let registry = Registry::builtin();
/// let (findings, format) = io::validate(&path, registry.formats(), &PointWalk::default())?;
/// assert_eq!(format, Some("ply"));
/// assert!(findings.have_faults(), "a point is missing");
/// # std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// A memory that does not do.
pub fn validate(
    path: &Path,
    formats: &Formats,
    walk: &PointWalk<'_>,
) -> Result<(Findings, Option<&'static str>)> {
    let (mut findings, mut name) = (Findings::default(), None);
    let checked = describe::format_of(path, formats).and_then(|format| {
        name = Some(format.name());
        let told = |error| sniff::told(error, &**format, formats);
        format.validate(path, walk, &mut findings).map_err(told)
    });
    match checked {
        Err(error) if error.kind() == ErrorKind::Memory => return Err(error.at(path)),
        Err(error) => enter_error(&mut findings, &error),
        Ok(()) => {}
    }
    Ok((findings, name))
}
