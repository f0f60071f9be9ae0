//! Disks without room for an output: refused before any work where that can be known, else an error
//! in the end; what was there stays, and nothing is half-written.

use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::Command;

use crate::support::assert_holds;
use crate::support::command::{done, fails};

/// A small LAS file in `folder`, and the bytes of its records.
fn scan(folder: &Path, points: &str) -> u64 {
    done(folder, &["synth", "part", "-n", points, "-o", "in.las"]);
    let mut length = [0; 2];
    File::open(folder.join("in.las")).unwrap().read_exact_at(&mut length, 105).unwrap();
    u64::from(u16::from_le_bytes(length))
}

#[test]
fn an_output_that_the_disk_has_no_room_for_is_refused_before_any_work() {
    let at = tempfile::tempdir().unwrap();
    let path = at.path();
    let record = scan(path, "1000");
    // As many points as the disk has room for and some, of which it holds none: the file is sparse.
    let figures = rustix::fs::statvfs(path).unwrap();
    let free = figures.f_bavail * figures.f_frsize;
    let points = free / record + (64 << 20);
    let file = File::options().write(true).open(path.join("in.las")).unwrap();
    file.set_len(1 << 16).unwrap();
    file.set_len((1 << 16) + points * record).unwrap();
    file.write_all_at(&[0; 4], 107).unwrap();
    file.write_all_at(&points.to_le_bytes(), 247).unwrap();
    for arguments in [
        &["convert", "in.las", "-o", "out.las"][..],
        &["convert", "in.las", "-o", "out.ply", "--encoding", "binary"],
    ] {
        let told =
            ["outputs will take ", "at least, and only ", " are free here", "write elsewhere"];
        fails(path, arguments, 1, &told);
        assert_holds(path, &["in.las"]);
    }
}

/// A file system of `kibibytes` in memory, until it is dropped.
struct Disk(tempfile::TempDir);

/// True if this process may mount: it holds CAP_SYS_ADMIN, number 21.
fn may_mount() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let held = status.lines().find_map(|line| line.strip_prefix("CapEff:")).unwrap();
    u64::from_str_radix(held.trim(), 16).unwrap() >> 21 & 1 == 1
}

impl Disk {
    /// None only where the process may not mount.
    fn of(kibibytes: u32) -> Option<Disk> {
        if !may_mount() {
            println!("not run: without CAP_SYS_ADMIN nothing can be mounted");
            return None;
        }
        let at = tempfile::tempdir().unwrap();
        let size = format!("size={kibibytes}k");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &size, "none"])
            .arg(at.path())
            .status();
        assert!(mounted.unwrap().success(), "this needs the right to mount");
        Some(Disk(at))
    }

    fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let unmounted = Command::new("umount").arg(self.0.path()).status();
        println!("{}: {unmounted:?}", self.0.path().display());
    }
}

#[test]
#[ignore = "mounts a small file system in memory: needs root"]
fn a_disk_that_is_really_full_ends_a_run_with_an_error_and_nothing_half_written() {
    let at = tempfile::tempdir().unwrap();
    scan(at.path(), "150000");
    let Some(disk) = Disk::of(512) else { return };
    let path = disk.path();
    for name in ["out.laz", "out.las"] {
        fs::write(path.join(name), "old").unwrap();
    }
    let names = ["out.las", "out.laz"];
    let input = at.path().join("in.las");
    let input = input.to_str().unwrap();
    let full = "No space left on device";
    let spill = "run.spill=always";
    // More than is free is known before any work, unless only the encoded points tell.
    fails(path, &["convert", input, "-o", "out.las"], 1, &["outputs will take ", "are free here"]);
    assert_holds(path, &names);
    fails(path, &["convert", input, "-o", "out.laz"], 1, &[full, "free some disk space"]);
    assert_holds(path, &names);
    let reduce = ["reduce", input, "-o", "out.las", "--memory", "1GiB"];
    fails(path, &[&reduce[..], &["--keep", "90%"]].concat(), 1, &[full, "free some disk space"]);
    assert_holds(path, &names);
    let text = format!(
        "[[stage]]\nkind = 'read'\npath = {input:?}\n[[stage]]\nkind = 'grid'\nside = 0.5\n\
         [[stage]]\nkind = 'write'\npath = 'out.laz'\n"
    );
    fs::write(at.path().join("spills.toml"), text).unwrap();
    let spills = at.path().join("spills.toml");
    let spills = ["run", spills.to_str().unwrap(), "--set", spill];
    fails(path, &spills, 1, &["the scan will spill about ", "are free here", "--scratch"]);
    assert_holds(path, &names);
    for name in names {
        assert_eq!(fs::read(path.join(name)).unwrap(), b"old");
    }
    // With room it is done.
    done(at.path(), &["convert", "in.las", "-o", "out.laz"]);
}

#[test]
#[ignore = "mounts a small file system in memory: needs root"]
fn a_second_copy_for_other_colours_is_counted_before_the_work() {
    let at = tempfile::tempdir().unwrap();
    // A vertex takes 54 bytes with colours of 8 bits and 57 with 16: the disk has room for one file.
    colored(at.path(), 150_000);
    let input = at.path().join("in.las");
    let Some(disk) = Disk::of(12 << 10) else { return };
    let convert = ["convert", input.to_str().unwrap(), "-o", "out.ply"];
    let told = [" in all: `--colors` says how many", "No space left on device"];
    fails(disk.path(), &convert, 1, &told);
    assert_holds(disk.path(), &[]);
    done(disk.path(), &[&convert[..], &["--colors", "16bit"]].concat());
    assert_holds(disk.path(), &["out.ply"]);
}

/// A LAS file whose colours are 8 bits but in its last record.
fn colored(folder: &Path, points: usize) {
    scan(folder, &points.to_string());
    let bytes = fs::read(folder.join("in.las")).unwrap();
    let at = |from: usize| u32::from_le_bytes(bytes[from..from + 4].try_into().unwrap()) as usize;
    let (start, record) = (at(96), usize::from(u16::from_le_bytes([bytes[105], bytes[106]])));
    println!("format {} of {record} bytes from {start}", bytes[104]);
    let mut colored = bytes[..start].to_vec();
    colored[104] = 7;
    colored[105..107].copy_from_slice(&36u16.to_le_bytes());
    for (i, one) in bytes[start..].chunks_exact(record).take(points).enumerate() {
        colored.extend_from_slice(&one[..30]);
        let color: u16 = if i + 1 == points { 12_345 } else { 257 };
        (0..3).for_each(|_| colored.extend(color.to_le_bytes()));
    }
    fs::write(folder.join("in.las"), colored).unwrap();
}
