//! Ctrl-C, and being asked to end by a signal: the first asks the run to stop, the second ends. A
//! file that may not grow further is an error and not the end.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rustix::process::Signal;
use signal_hook::flag::{register, register_conditional_shutdown};

/// A flag that is set once the user wants the run to stop.
///
/// Ctrl-C, SIGTERM and SIGHUP set it; the second of them ends the process at once with 130. A
/// signal that the process was started to ignore stays ignored: under `nohup` a run outlives its
/// terminal, and still stops when it is asked to by SIGTERM.
///
/// From then on a write beyond `ulimit -f` fails with an error of its own instead of a signal that
/// ends the process.
pub(super) fn flag() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let ignored = ignored_signals();
    for signal in [Signal::INT, Signal::TERM, Signal::HUP].map(Signal::as_raw) {
        if ignored & 1 << (signal - 1) == 0 {
            // In this order: the first signal finds the flag unset. A system that has no handlers
            // to give ends the process by the signal, as it would without.
            let _ = register_conditional_shutdown(signal, 130, Arc::clone(&flag))
                .and_then(|_| register(signal, Arc::clone(&flag)));
        }
    }
    // A handler that does nothing leaves the error to the write.
    let _ = register(Signal::XFSZ.as_raw(), Arc::default());
    flag
}

/// The signals that the process was started to ignore, a bit each, where the system tells.
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
