//! The last resort against a library's panic: inputs are proven first, but an arithmetic decoder
//! can only find out while it runs that its bytes are nonsense.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work`; None if it panicked, which prints nothing. What `work` changed is not to be used
/// again after that.
///
/// The process's panic hook is wrapped once, so that panics outside of `work` are told as before.
pub fn unpanicked<T>(work: impl FnOnce() -> T) -> Option<T> {
    static WRAP: Once = Once::new();
    WRAP.call_once(|| {
        let told = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !GUARDED.try_with(Cell::get).unwrap_or(false) {
                told(info);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(work)).ok();
    GUARDED.set(outer);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_none_and_a_value_passes() {
        let index = std::hint::black_box(7);
        assert_eq!(unpanicked(|| [0u8; 4][index % 5 + 2]), None);
        assert_eq!(unpanicked(|| 5), Some(5));
    }
}
