//! Whether the disks have room for what a run writes, asked before its work.
//!
//! A run of hours should not end at a full disk that could have been seen at its beginning. What is
//! known to be written is refused where it does not fit, and what may be written is a warning: how
//! far outputs are compressed, and how many points are left, only the work tells. Folders on one
//! disk are added up.

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::budget::Bytes;
use crate::error::shown;
use crate::host::disk::free_space;
use crate::{Error, Result};

/// What one kind of data takes on its disk.
pub struct Taken<'a> {
    /// The folder that it is in, which exists.
    pub folder: &'a Path,
    /// True for the spill, false for outputs.
    pub spilled: bool,
    /// Bytes that it takes at least.
    pub bytes: u64,
    /// Bytes that it may take besides.
    pub again: u64,
}

/// All that goes to one disk.
#[derive(Debug, Default, Clone)]
struct Disk {
    folder: PathBuf,
    free: u64,
    spill: u64,
    outputs: u64,
    again: u64,
}

/// Refuses a run for which a disk has not enough room; a warning for each that may not.
pub fn check<'a>(all: impl Iterator<Item = Taken<'a>>) -> Result<Vec<String>> {
    let mut disks: BTreeMap<u64, Disk> = BTreeMap::new();
    for Taken { folder, spilled, bytes, again } in all {
        let folder = if folder == Path::new("") { Path::new(".") } else { folder };
        // Where the system does not tell, nothing is refused.
        let (Ok(about), Some(free)) = (folder.metadata(), free_space(folder)) else { continue };
        let new = || Disk { folder: folder.to_owned(), free, ..Disk::default() };
        let disk = disks.entry(about.dev()).or_insert_with(new);
        let sum = if spilled { &mut disk.spill } else { &mut disk.outputs };
        *sum = sum.saturating_add(bytes);
        disk.again = disk.again.saturating_add(again);
    }
    let warnings: Result<Vec<_>> = disks.values().map(Disk::check).collect();
    Ok(warnings?.into_iter().flatten().collect())
}

impl Disk {
    fn check(&self) -> Result<Option<String>> {
        let Disk { folder, free, spill, outputs, again } = self;
        let needed = spill.saturating_add(*outputs);
        if *free < needed {
            let spilled = format!("the scan will spill about {}", Bytes(*spill));
            let written = format!("outputs will take {} at least", Bytes(*outputs));
            let what = match (spill, outputs) {
                (_, 0) => spilled,
                (0, _) => written,
                _ => format!("{spilled}, {written}"),
            };
            let help = match spill {
                0 => "free some disk space, or write elsewhere",
                _ => {
                    "free some disk space, name another folder with `run.scratch`, or give more \
                      `run.memory`"
                }
            };
            let told = format!("{what}, and only {} are free here", Bytes(*free));
            return Err(Error::memory(told).at(folder).help(help));
        }
        let most = needed.saturating_add(*again);
        Ok((*free < most).then(|| {
            format!(
                "{}: only {} are free here; an output that is written anew because its colours \
                 turn out to have more or fewer bits makes it {} in all: `write.colors` says how \
                 many",
                shown(folder),
                Bytes(*free),
                Bytes(most)
            )
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn a_disk_without_room_is_refused_and_one_with_too_little_for_a_second_copy_is_told() {
        let disk = Disk { folder: "there".into(), free: 100, ..Disk::default() };
        let told = |disk: Disk| disk.check().unwrap_err().to_string();
        let spill = told(Disk { spill: 101, ..disk.clone() });
        assert_eq!(spill, "there: the scan will spill about 101 B, and only 100 B are free here");
        let both = told(Disk { spill: 1, outputs: 100, ..disk.clone() });
        assert!(both.contains("spill about 1 B, outputs will take 100 B at least, and"), "{both}");
        let outputs = Disk { outputs: 60, again: 40, ..disk };
        assert!(outputs.check().unwrap().is_none());
        let doubt = Disk { again: 41, ..outputs.clone() }.check().unwrap().unwrap();
        assert!(doubt.contains("makes it 101 B in all: `write.colors`"), "{doubt}");
        // No sum wraps around.
        assert!(Disk { spill: u64::MAX, ..outputs }.check().is_err());
    }

    #[test]
    fn what_goes_to_one_disk_is_added_up() {
        let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let free = free_space(one.path()).unwrap();
        // Other tests take and free some of it meanwhile.
        let bytes = free / 4 * 3;
        let spill = || Taken { folder: one.path(), spilled: true, bytes, again: 0 };
        assert!(check([spill()].into_iter()).unwrap().is_empty());
        let output = Taken { folder: two.path(), spilled: false, ..spill() };
        let error = check([spill(), output].into_iter()).unwrap_err();
        assert_eq!((error.kind(), error.path()), (ErrorKind::Memory, Some(one.path())));
        assert!(error.to_string().contains("outputs will take"), "{error}");
    }
}
