//! An allocator that counts what each thread holds, for programs that measure their stages.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

thread_local! {
    /// Bytes that the thread holds more than it gave back.
    static HELD: Cell<isize> = const { Cell::new(0) };
    /// The most of that since it was set back last.
    static MOST: Cell<isize> = const { Cell::new(0) };
}

/// The system's allocator, and a count of what each thread holds. The program of your tests takes
/// it as its own, so that a check can say how much memory a stage works with:
///
/// ```
/// use pointmill::testing::CountingAllocator;
///
/// #[global_allocator]
/// static COUNTING: CountingAllocator = CountingAllocator;
/// # fn main() {}
/// ```
///
/// What a stage allocates on threads of its own is not seen.
#[derive(Debug, Clone, Copy, Default)]
pub struct CountingAllocator;

/// True if the program counts what it allocates.
pub(super) fn counts() -> bool {
    measured(|| drop(black_box(Vec::<u8>::with_capacity(black_box(64))))).1 > 0
}

/// Does `work`; the most bytes that this thread held meanwhile beyond those before.
pub(super) fn measured<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let (before, outer) = (HELD.get(), MOST.get());
    MOST.set(before);
    let result = work();
    let most = MOST.get();
    MOST.set(outer.max(most));
    (result, u64::try_from(most - before).unwrap_or(0))
}

/// Enters a change of what the thread holds.
fn count(change: isize) {
    // The thread's storage may be gone while the thread ends.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + change);
        let _ = MOST.try_with(|most| most.set(most.get().max(held.get())));
    });
}

// SAFETY: every call goes to the system's allocator as it came, and what is counted allocates
// nothing.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        unsafe { System.realloc(at, layout, size) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(at, layout) }
    }
}
