//! Ctrl-C, and being asked to end by a signal: the first asks the run to stop, the second ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that is set once the user wants the run to stop.
///
/// Ctrl-C, SIGTERM and SIGHUP set it; the second of them ends the process at once with 130. Under
/// `nohup` (SIGHUP is ignored) signals keep their meaning: a run must outlive its terminal, and one
/// that is killed leaves at most its scratch folder, which the next run removes.
pub(super) fn flag() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    if hangups_are_ignored() {
        return flag;
    }
    let set = Arc::clone(&flag);
    let handler = move || {
        if set.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    };
    // An embedding program that has its own handler keeps it.
    let _ = ctrlc::set_handler(handler);
    flag
}

/// True if the process was started with SIGHUP (signal 1) ignored, where the system tells.
fn hangups_are_ignored() -> bool {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return false };
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|m| m & 1 == 1)
}
