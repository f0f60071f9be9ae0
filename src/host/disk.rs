//! The file systems that folders are on.

use std::path::Path;

/// Bytes free for this user on the file system of `folder`; None where the system does not tell.
pub fn free_space(folder: &Path) -> Option<u64> {
    let figures = rustix::fs::statvfs(folder).ok()?;
    figures.f_bavail.checked_mul(figures.f_frsize)
}

/// The kind of the file system of `folder` if that is memory itself.
pub fn memory_itself(folder: &Path) -> Option<&'static str> {
    // linux/magic.h
    const MEMORY: [(u32, &str); 2] = [(0x0102_1994, "tmpfs"), (0x8584_58f6, "ramfs")];
    let kind = rustix::fs::statfs(folder).ok()?.f_type as u32;
    MEMORY.into_iter().find(|(magic, _)| *magic == kind).map(|(_, name)| name)
}
