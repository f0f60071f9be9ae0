//! The machine and the process: what the report says of where a run took place.

use std::fs;

use serde::Serialize;

/// Where a run took place.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// Operating system and processor architecture, as in `linux x86_64`.
    pub system: String,
    /// Model name of the processor; None where the system does not tell.
    pub processor: Option<String>,
    /// Threads that can run at once, by the process's affinity and quota.
    pub cores: usize,
}

impl Machine {
    /// This machine.
    pub fn this() -> Self {
        let processor = fs::read_to_string("/proc/cpuinfo").ok();
        Machine {
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            processor: processor.and_then(|text| field(&text, "model name").map(str::to_owned)),
            cores: std::thread::available_parallelism().map_or(1, |n| n.get()),
        }
    }
}

/// The most memory that was resident in this process at once (VmHWM), in bytes; None where the system
/// does not tell.
pub fn peak_memory() -> Option<u64> {
    kibibytes(&fs::read_to_string("/proc/self/status").ok()?, "VmHWM")
}

/// The memory that is resident in this process now (VmRSS), in bytes; None where the system does not
/// tell.
pub fn resident_now() -> Option<u64> {
    kibibytes(&fs::read_to_string("/proc/self/status").ok()?, "VmRSS")
}

/// CPU seconds, user and system, that this process has used so far on all its threads; None where
/// the system does not tell.
pub fn cpu_seconds() -> Option<f64> {
    let ticks = cpu_ticks(&fs::read_to_string("/proc/self/stat").ok()?)?;
    Some(ticks as f64 / rustix::param::clock_ticks_per_second() as f64)
}

/// utime + stime of /proc/self/stat (proc(5)): fields 14 and 15, the second of which, the name in
/// parentheses, may hold blanks.
fn cpu_ticks(stat: &str) -> Option<u64> {
    let (_, behind_name) = stat.rsplit_once(')')?;
    let mut fields = behind_name.split_whitespace().skip(11);
    let (user, system): (u64, u64) = (fields.next()?.parse().ok()?, fields.next()?.parse().ok()?);
    user.checked_add(system)
}

/// A figure of the form `name:  123 kB`, in bytes.
fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let figure = field(text, name)?.strip_suffix("kB")?.trim();
    figure.parse::<u64>().ok()?.checked_mul(1024)
}

/// The value of the first line `name : value`.
fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.lines()
        .filter_map(|line| line.split_once(':'))
        .find(|(key, _)| key.trim() == name)
        .map(|(_, value)| value.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_time_is_read_behind_any_name() {
        let stat = "7 (a ) name) R 1 2 3 4 5 6 7 8 9 10 250 30 0 0 20 0";
        assert_eq!(cpu_ticks(stat), Some(280));
        assert_eq!(cpu_ticks("7 (short) R 1"), None);
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
    fn this_machine_has_a_core() {
        assert!(Machine::this().cores >= 1);
    }
}
