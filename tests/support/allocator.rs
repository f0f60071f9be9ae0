//! An allocator that counts what each thread holds, and refuses what no input could need.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Bytes that a thread may hold while it takes an input, beyond those before. What asks for more gets nothing, so that the
/// machine stays usable; code that cannot do without ends the process.
const REFUSED: isize = 2 << 30;

thread_local! {
    static LIVE: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
    /// What the thread held when the work began that is watched. What it holds at all says little: memory
    /// that another thread gives back is counted there.
    static WATCHED: Cell<Option<isize>> = const { Cell::new(None) };
}

/// Bytes that this thread holds more than it gave back.
pub fn live() -> isize {
    LIVE.get()
}

/// Runs `work`; its result and the most bytes that this thread held meanwhile beyond those before.
/// May be nested.
pub fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let (start, outer) = (LIVE.get(), PEAK.replace(LIVE.get()));
    let watched = WATCHED.get();
    WATCHED.set(watched.or(Some(start)));
    let result = work();
    WATCHED.set(watched);
    let peak = PEAK.get();
    PEAK.set(outer.max(peak));
    (result, usize::try_from(peak - start).unwrap_or(0))
}

/// Counts, and hands everything to the system's allocator.
pub struct Counted;

/// Enters a change; false if it is to be refused.
fn count(change: isize) -> bool {
    // The thread's storage is gone while the thread ends.
    LIVE.try_with(|live| {
        let now = live.get() + change;
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(now)));
        let start = WATCHED.try_with(Cell::get).ok().flatten();
        if change > 0 && start.is_some_and(|start| now - start > REFUSED) {
            return false;
        }
        live.set(now);
        true
    })
    .unwrap_or(true)
}

// SAFETY: every call goes to the system's allocator as it came, or is refused by a null pointer.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !count(layout.size() as isize) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !count(layout.size() as isize) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if !count(size as isize - layout.size() as isize) {
            return std::ptr::null_mut();
        }
        unsafe { System.realloc(at, layout, size) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static COUNTED: Counted = Counted;
