//! An allocator that counts what the process and each thread hold, and refuses what no input could
//! need. A program of tests that measures takes it as its own.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Bytes that a thread may hold while it takes an input, beyond those before. What asks for more gets
/// nothing, so that the machine stays usable; code that cannot do without ends the process.
const REFUSED: isize = 2 << 30;

thread_local! {
    static LIVE: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
    /// What the thread held when the work began that is watched. What it holds at all says little:
    /// memory that another thread gives back is counted there.
    static WATCHED: Cell<Option<isize>> = const { Cell::new(None) };
}

/// Bytes that the process holds, and the most that it held since [`held`] last began.
static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);
/// The largest request of the process since [`alone`].
static LARGEST: AtomicUsize = AtomicUsize::new(0);

/// A turn at measuring what the process holds: tests run side by side, and it is one number.
pub fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    let turn = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    LARGEST.store(0, Relaxed);
    turn
}

/// The largest request since the turn began.
pub fn largest() -> usize {
    LARGEST.load(Relaxed)
}

/// Bytes that the process held at most during `work`, beyond those before.
pub fn held<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let before = HELD.load(Relaxed);
    MOST.store(before, Relaxed);
    let result = work();
    (result, MOST.load(Relaxed).saturating_sub(before))
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

/// Enters a request of `size` bytes in the place of `before`; false if it is to be refused.
fn grow(size: usize, before: usize) -> bool {
    if !count(size as isize - before as isize) {
        return false;
    }
    LARGEST.fetch_max(size, Relaxed);
    MOST.fetch_max(HELD.fetch_add(size, Relaxed).wrapping_add(size).wrapping_sub(before), Relaxed);
    HELD.fetch_sub(before, Relaxed);
    true
}

/// Enters a change of what the thread holds; false if it is to be refused.
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
        if !grow(layout.size(), 0) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !grow(layout.size(), 0) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if !grow(size, layout.size()) {
            return std::ptr::null_mut();
        }
        unsafe { System.realloc(at, layout, size) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        HELD.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(at, layout) }
    }
}
