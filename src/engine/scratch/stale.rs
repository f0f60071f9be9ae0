//! Removing scratch folders: one's own at the end, and those of killed runs.
//!
//! All of it goes through descriptors that follow no link, so that another folder cannot be put in
//! the place of one that is being removed. A folder is removed only if it is known to be left over:
//! it is the same user's, its marker is a regular file that no process has locked, and it was made
//! on this machine. Folders of other machines stay, since a network's file system may not show
//! their locks.

use std::ffi::CStr;
use std::fs::File;
use std::io::{self, Read};
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;

use crate::error::shown;

use rustix::fs::{AtFlags, CWD, Dir, FileType, Mode, OFlags, fstat, openat, statat, unlinkat};
use rustix::io::Errno;
use rustix::path::Arg;
use rustix::process::geteuid;

/// How the names of scratch folders begin.
pub(crate) const PREFIX: &str = ".pointmill-";
/// The file that tells such a folder from others.
pub(crate) const MARKER: &str = "pointmill-scratch.json";

/// The machine, as far as it tells whether a lock of another run would be seen here.
#[derive(Debug)]
pub(crate) struct Host {
    pub name: String,
    /// What the kernel calls the time since it was started; empty where it does not tell.
    pub boot: String,
}

impl Host {
    /// This machine.
    pub fn this() -> Host {
        let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
        let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        Host { name, boot: boot.trim().to_owned() }
    }

    /// How the names of this machine's scratch folders begin, until it is started again.
    pub fn prefix(&self) -> String {
        let told = if self.boot.is_empty() { &self.name } else { &self.boot };
        format!("{PREFIX}{:08x}-", crc32fast::hash(told.as_bytes()))
    }

    /// True if a run that marked the folder called `name` by `about` would hold a lock that is seen
    /// here, or must have ended when this machine was started. Locks of other machines may not be
    /// seen: their folders are theirs to remove.
    fn knows(&self, name: &CStr, about: &str) -> bool {
        let about: serde_json::Value = serde_json::from_str(about).unwrap_or_default();
        let (Some(host), Some(boot)) = (about["host"].as_str(), about["boot"].as_str()) else {
            // Killed before the marker was complete: the name tells.
            return self.named(name);
        };
        let is_name = !host.is_empty() && host != "(none)" && !host.starts_with("localhost");
        !boot.is_empty() && boot == self.boot || is_name && host == self.name
    }

    fn named(&self, name: &CStr) -> bool {
        name.to_bytes().starts_with(self.prefix().as_bytes())
    }
}

/// Opens a folder that is no link.
pub(crate) fn open_folder(at: impl AsFd, name: impl Arg) -> rustix::io::Result<OwnedFd> {
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    openat(at, name, flags, Mode::empty())
}

/// Removes scratch folders in `parent` whose runs are gone; tells of each that should go and stays.
pub(crate) fn remove_stale(parent: &Path) -> Vec<String> {
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
    let Ok(at) = openat(CWD, parent, flags, Mode::empty()) else { return Vec::new() };
    let names = Dir::read_from(&at).into_iter().flatten().flatten();
    let (host, user, mut told) = (Host::this(), geteuid().as_raw(), Vec::new());
    for entry in names {
        let name = entry.file_name();
        if !name.to_bytes().starts_with(PREFIX.as_bytes()) {
            continue;
        }
        if let Err(cause) = remove_if_dead(&at, name, &host, user) {
            let folder = parent.join(name.to_string_lossy().as_ref());
            let folder = shown(&folder);
            told.push(format!("{folder}: what a killed run left here cannot be removed: {cause}"));
        }
    }
    told
}

/// Removes the folder if it is scratch of a run of `user` that is gone. Spared is whatever is not
/// sure to be: what another user made, or another machine, and what has no proper marker.
fn remove_if_dead(at: &OwnedFd, name: &CStr, host: &Host, user: u32) -> io::Result<()> {
    // A file, a link, gone by now, or not ours to look at.
    let Ok(folder) = open_folder(at, name) else { return Ok(()) };
    if fstat(&folder)?.st_uid != user {
        return Ok(());
    }
    // A pipe of this name must not make the run wait.
    let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let mut marker = match openat(&folder, MARKER, flags, Mode::empty()) {
        Ok(marker) => File::from(marker),
        Err(Errno::NOENT) if host.named(name) => {
            // A run killed before it could mark its folder. This spares any that is not empty.
            let _ = unlinkat(at, name, AtFlags::REMOVEDIR);
            return Ok(());
        }
        Err(_) => return Ok(()),
    };
    let about = fstat(&marker)?;
    if FileType::from_raw_mode(about.st_mode) != FileType::RegularFile || about.st_uid != user {
        return Ok(());
    }
    let mut text = String::new();
    let _ = (&mut marker).take(4096).read_to_string(&mut text);
    // The lock is held until the folder is gone: a run that has just made it waits for that. A
    // marker that is no longer there was that of an earlier folder of the same name.
    let path = [name.to_bytes(), b"/", MARKER.as_bytes()].concat();
    if host.knows(name, &text) && marker.try_lock().is_ok() && is_at(&marker, at, path.as_slice()) {
        remove(at, name, &folder)?;
    }
    Ok(())
}

/// True if the open `file` is the one that is at `path` now.
pub(crate) fn is_at(file: &File, at: impl AsFd, path: impl Arg) -> bool {
    match (fstat(file), statat(at, path, AtFlags::SYMLINK_NOFOLLOW)) {
        (Ok(open), Ok(there)) => (open.st_dev, open.st_ino) == (there.st_dev, there.st_ino),
        _ => false,
    }
}

/// Folders in a scratch folder are so deep at most: outputs that are made again in one are.
const DEEPEST: u32 = 4;

/// Removes what is in a folder but `spared`, folders in it with all that they hold, if these are no
/// deeper than `depth`.
fn empty(folder: &OwnedFd, spared: &[u8], depth: u32) -> io::Result<()> {
    let entries = Dir::read_from(folder)?.collect::<rustix::io::Result<Vec<_>>>()?;
    for entry in &entries {
        let name = entry.file_name();
        if [b".".as_slice(), b"..", spared].contains(&name.to_bytes()) {
            continue;
        }
        match unlinkat(folder, name, AtFlags::empty()) {
            Ok(()) | Err(Errno::NOENT) => {}
            // A folder: Linux says the one, others the other.
            Err(cause @ (Errno::ISDIR | Errno::PERM)) if depth > 0 => {
                let inner = open_folder(folder, name).map_err(|_| cause)?;
                empty(&inner, b"", depth - 1)?;
                unlinkat(folder, name, AtFlags::REMOVEDIR)?;
            }
            Err(cause) => return Err(cause.into()),
        }
    }
    Ok(())
}

/// Removes a scratch folder, open as `folder` and called `name`, its marker last. What was put in
/// its place meanwhile is spared, unless it is an empty folder.
pub(crate) fn remove(at: impl AsFd, name: impl Arg, folder: &OwnedFd) -> io::Result<()> {
    empty(folder, MARKER.as_bytes(), DEEPEST)?;
    match unlinkat(folder, MARKER, AtFlags::empty()) {
        Ok(()) | Err(Errno::NOENT) => {}
        Err(cause) => return Err(cause.into()),
    }
    // Another run that finds the same folder may have been quicker, and a third may have made and
    // marked a folder of this name since: that one is in use.
    match unlinkat(at, name, AtFlags::REMOVEDIR) {
        Ok(()) | Err(Errno::NOENT | Errno::NOTEMPTY) => Ok(()),
        Err(cause) => Err(cause.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::path::PathBuf;

    use super::*;

    /// A folder as a killed run leaves it: of this machine, or with this in its marker.
    fn dead(parent: &Path, number: u32, marker: Option<&str>) -> PathBuf {
        let host = Host::this();
        let folder = parent.join(format!("{}1-{number}", host.prefix()));
        fs::create_dir(&folder).unwrap();
        let own = serde_json::json!({ "host": host.name, "boot": host.boot }).to_string();
        fs::write(folder.join(MARKER), marker.unwrap_or(&own)).unwrap();
        fs::write(folder.join("1-records"), "data").unwrap();
        folder
    }

    /// A folder with a file that somebody needs.
    fn victim(parent: &Path) -> PathBuf {
        let victim = parent.join("victim");
        fs::create_dir(&victim).unwrap();
        fs::write(victim.join("1-records"), "precious").unwrap();
        fs::write(victim.join(MARKER), "{}").unwrap();
        victim
    }

    #[test]
    fn links_are_not_followed() {
        let at = tempfile::tempdir().unwrap();
        let parent = at.path().join("parent");
        fs::create_dir(&parent).unwrap();
        let victim = victim(at.path());
        // A link instead of a folder, a link to a file in one, and a link as marker.
        symlink(&victim, parent.join(format!("{}1-0", Host::this().prefix()))).unwrap();
        let folder = dead(&parent, 1, None);
        symlink(victim.join("1-records"), folder.join("2-order")).unwrap();
        symlink(&victim, folder.join("3-folder")).unwrap();
        let other = dead(&parent, 2, None);
        fs::remove_file(other.join(MARKER)).unwrap();
        symlink(victim.join(MARKER), other.join(MARKER)).unwrap();
        assert_eq!(remove_stale(&parent), [""; 0]);
        assert!(!folder.exists() && other.join("1-records").exists());
        assert_eq!(fs::read_dir(&victim).unwrap().count(), 2);
        assert_eq!(fs::read_to_string(victim.join("1-records")).unwrap(), "precious");
    }

    #[test]
    fn a_folder_that_is_swapped_for_a_link_during_its_removal_is_no_way_to_another() {
        let at = tempfile::tempdir().unwrap();
        let victim = victim(at.path());
        let folder = dead(at.path(), 0, None);
        let open = open_folder(CWD, &folder).unwrap();
        let moved = at.path().join("moved");
        fs::rename(&folder, &moved).unwrap();
        symlink(&victim, &folder).unwrap();
        assert!(remove(CWD, &folder, &open).is_err(), "a link is no folder to remove");
        assert_eq!(fs::read_dir(&victim).unwrap().count(), 2);
        assert_eq!(fs::read_dir(&moved).unwrap().count(), 0, "what was opened is what is emptied");
    }

    #[test]
    fn folders_of_other_machines_are_theirs() {
        let at = tempfile::tempdir().unwrap();
        let parent = at.path();
        let name = |folder: &Path| {
            CStr::from_bytes_with_nul(
                &[folder.file_name().unwrap().as_encoded_bytes(), b"\0"].concat(),
            )
            .unwrap()
            .to_owned()
        };
        let here = Host { name: "mill".to_owned(), boot: "b1".to_owned() };
        let own = Path::new("/x").join(format!("{}1-0", here.prefix()));
        let other = Path::new("/x/.pointmill-12345678-1-0");
        for (host, boot, folder, known) in [
            ("mill", "b1", other, true),       // this one
            ("twin", "b1", other, true),       // a container of this kernel, whose locks are seen
            ("mill", "b0", other, true),       // this one, before it was started again
            ("twin", "b0", other, false),      // another one
            ("localhost", "b0", other, false), // who knows
            ("", "", &*own, false),
        ] {
            let about = serde_json::json!({ "host": host, "boot": boot }).to_string();
            assert_eq!(here.knows(&name(folder), &about), known, "{about}");
        }
        // Killed before the marker was complete.
        assert!(here.knows(&name(&own), "") && !here.knows(&name(other), "{\"about\": "));
        let nameless = Host { name: "localhost".to_owned(), boot: String::new() };
        assert!(!nameless.knows(&name(other), r#"{"host": "localhost", "boot": ""}"#));
        let foreign = dead(parent, 0, Some(r#"{"host": "elsewhere", "boot": "another"}"#));
        let ours = dead(parent, 1, None);
        assert_eq!(remove_stale(parent), [""; 0]);
        assert!(foreign.join("1-records").exists() && !ours.exists());
    }

    #[test]
    fn folders_of_other_users_are_theirs() {
        let at = tempfile::tempdir().unwrap();
        let folder = dead(at.path(), 0, None);
        let name = folder.file_name().unwrap().as_encoded_bytes();
        let name = CStr::from_bytes_with_nul(&[name, b"\0"].concat()).unwrap().to_owned();
        let open = open_folder(CWD, at.path()).unwrap();
        let (host, user) = (Host::this(), geteuid().as_raw());
        remove_if_dead(&open, &name, &host, user + 1).unwrap();
        assert!(folder.join("1-records").exists());
        remove_if_dead(&open, &name, &host, user).unwrap();
        assert!(!folder.exists());
    }

    #[test]
    fn what_is_no_regular_marker_is_not_waited_for_and_spared() {
        let at = tempfile::tempdir().unwrap();
        let folder = dead(at.path(), 0, None);
        fs::remove_file(folder.join(MARKER)).unwrap();
        let pipe = folder.join(MARKER);
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        assert_eq!(remove_stale(at.path()), [""; 0]);
        assert!(folder.join("1-records").exists());
    }

    #[test]
    fn what_cannot_be_removed_is_told() {
        let at = tempfile::tempdir().unwrap();
        let folder = dead(at.path(), 0, None);
        // Folders deeper than any run makes them.
        fs::create_dir_all(folder.join("2-refuses/a/b/c/d")).unwrap();
        let told = remove_stale(at.path());
        assert!(told.len() == 1 && told[0].contains("cannot be removed"), "{told:?}");
        assert!(told[0].starts_with(folder.to_str().unwrap()), "{told:?}");
        assert!(folder.join(MARKER).exists(), "the marker goes last");
        fs::remove_dir_all(folder.join("2-refuses")).unwrap();
        assert_eq!(remove_stale(at.path()), [""; 0]);
        assert!(!folder.exists());
        // Nobody's right to look is nobody's trouble.
        let closed = at.path().join("closed");
        fs::create_dir(&closed).unwrap();
        fs::set_permissions(&closed, fs::Permissions::from_mode(0o300)).unwrap();
        assert_eq!(remove_stale(&closed), [""; 0]);
    }
}
