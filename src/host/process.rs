//! This process and its memory, as the system tells of them (proc(5), cgroups(7)).

use std::fs;
use std::path::{Component, Path};

use rustix::time::{ClockId, clock_gettime};

/// What is taken for the machine's memory where the system does not tell.
const ASSUMED_MEMORY: u64 = 4 << 30;

/// The most memory that was resident in this process at once (VmHWM), in bytes; None where the
/// system does not tell.
pub fn peak_memory() -> Option<u64> {
    kibibytes(&fs::read_to_string("/proc/self/status").ok()?, "VmHWM")
}

/// The memory that is resident in this process now (VmRSS), in bytes; None where the system does
/// not tell.
pub fn resident_now() -> Option<u64> {
    kibibytes(&fs::read_to_string("/proc/self/status").ok()?, "VmRSS")
}

/// CPU seconds, user and system, that this process has used so far on all its threads.
pub fn cpu_seconds() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 / 1e9
}

/// A figure of the form `name:  123 kB`, in bytes.
fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let figure = field(text, name)?.strip_suffix("kB")?.trim();
    figure.parse::<u64>().ok()?.checked_mul(1024)
}

/// The value of the first line `name : value`.
pub fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.lines()
        .filter_map(|line| line.split_once(':'))
        .find(|(key, _)| key.trim() == name)
        .map(|(_, value)| value.trim())
}

/// Threads that the machine runs at once; 1 where it does not tell.
pub fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The budget of a run that names none: half of the machine's memory or of the smallest limit of a
/// control group around this process, whichever is less.
pub fn default_memory() -> u64 {
    let installed = fs::read_to_string("/proc/meminfo").ok().and_then(|text| total_memory(&text));
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let limit = group_limit(Path::new("/sys/fs/cgroup"), &groups).unwrap_or(u64::MAX);
    installed.unwrap_or(ASSUMED_MEMORY).min(limit) / 2
}

/// `MemTotal` of /proc/meminfo (proc(5)), in bytes.
fn total_memory(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// The smallest memory limit of the control groups that /proc/self/cgroup names (cgroups(7)) and of
/// those around them, mounted at `root`. A line is `hierarchy:controllers:path`; version 2 has
/// number 0 and no controllers.
fn group_limit(root: &Path, groups: &str) -> Option<u64> {
    let mut smallest = None;
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':');
        let (Some(number), Some(controllers), Some(path)) =
            (fields.next(), fields.next(), fields.next())
        else {
            continue;
        };
        let limits = if number == "0" && controllers.is_empty() {
            // Beside version 1, version 2 is mounted at `unified`.
            [(root.to_owned(), "memory.max"), (root.join("unified"), "memory.max")]
                .map(|(mount, file)| limit_along(&mount, path, file))
        } else if controllers.split(',').any(|name| name == "memory") {
            [limit_along(&root.join("memory"), path, "memory.limit_in_bytes"), None]
        } else {
            continue;
        };
        smallest = limits.into_iter().flatten().chain(smallest).min();
    }
    smallest
}

/// The smallest figure in `file` of the group at `path` and of every group around it. A group that
/// is not visible in this mount (a container's) is passed over.
fn limit_along(mount: &Path, path: &str, file: &str) -> Option<u64> {
    let names = Path::new(path).components().filter_map(|part| match part {
        Component::Normal(name) => Some(name),
        _ => None,
    });
    let mut folder = mount.to_owned();
    let mut smallest = limit_in(&folder.join(file));
    for name in names {
        folder.push(name);
        smallest = limit_in(&folder.join(file)).into_iter().chain(smallest).min();
    }
    smallest
}

/// The figure in a limit's file; None if there is none or it says `max`.
fn limit_in(file: &Path) -> Option<u64> {
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_work_of_all_threads_is_counted() {
        let before = cpu_seconds();
        let work = || (0..2_000_000u64).fold(1, |sum, n| std::hint::black_box(sum ^ (n * sum)));
        std::thread::spawn(work).join().unwrap();
        assert!(cpu_seconds() > before + 1e-4);
    }

    #[test]
    fn figures_of_the_status_file_are_read_in_bytes() {
        let text =
            "Name:\tx\nVmHWM:\t    1234 kB\nVmRSS:\t 12 MB\nVmSwap: 99999999999999999999 kB\n";
        assert_eq!(kibibytes(text, "VmHWM"), Some(1234 * 1024));
        assert_eq!(kibibytes(text, "VmRSS"), None);
        assert_eq!(kibibytes(text, "VmSwap"), None);
        assert_eq!(kibibytes(text, "VmPeak"), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_peak_is_at_least_what_is_resident_and_sees_an_allocation() {
        let before = resident_now().unwrap();
        assert!(peak_memory().unwrap() >= before);
        // Used, or an optimised build would leave it out.
        let held = std::hint::black_box(vec![1u8; 64 << 20]);
        let peak = peak_memory().unwrap();
        assert!(peak >= held.len() as u64, "{peak}");
    }

    #[test]
    fn the_default_is_half_of_some_memory() {
        assert!(default_memory() > 16 << 20 && default_memory() <= u64::MAX / 2);
        assert_eq!(
            total_memory("MemTotal:       16316284 kB\nMemFree: 1 kB\n"),
            Some(16316284 << 10)
        );
        assert_eq!(total_memory("MemFree: 1 kB\n"), None);
    }

    #[test]
    fn the_smallest_limit_of_nested_groups_counts() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        assert_eq!(group_limit(root.path(), "0::/a/b\n"), None);
        write("memory.max", "max\n");
        write("a/memory.max", "5000\n");
        write("a/b/memory.max", "max\n");
        assert_eq!(group_limit(root.path(), "0::/a/b\n"), Some(5000));
        assert_eq!(group_limit(root.path(), "0::/a/b/c\n"), Some(5000));
        assert_eq!(group_limit(root.path(), "0::/\n"), None);
        write("memory/memory.limit_in_bytes", "9223372036854771712\n");
        write("memory/x/memory.limit_in_bytes", "4000\n");
        let both = "9:name=systemd:/a\n4:cpu,memory:/x/y\n0::/../a\n";
        assert_eq!(group_limit(root.path(), both), Some(4000));
        assert_eq!(group_limit(root.path(), "4:memory:/elsewhere\n"), Some(9223372036854771712));
    }
}
