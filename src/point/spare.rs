//! Buffers that are used again: what the system gives anew it must clear first, page by page, which
//! costs as much as filling it.

use std::sync::{Mutex, PoisonError};

/// Buffers that nobody uses just now. It holds no more than were in use at one time, so that a plan
/// of the memory counts those alone.
#[derive(Debug)]
pub struct Spare<T>(Mutex<Vec<T>>);

impl<T> Default for Spare<T> {
    fn default() -> Self {
        Spare(Mutex::new(Vec::new()))
    }
}

impl<T> Spare<T> {
    /// A buffer that was put back, or one that `make` makes.
    pub fn take(&self, make: impl FnOnce() -> T) -> T {
        let found = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        found.unwrap_or_else(make)
    }

    /// Puts a buffer back; what it holds is unspecified when it is taken again.
    pub fn put(&self, buffer: T) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_put_back_is_taken_before_one_is_made() {
        let spare = Spare::default();
        let first = spare.take(|| vec![1]);
        let second = spare.take(|| vec![2]);
        spare.put(first);
        assert_eq!(spare.take(|| vec![3]), [1]);
        spare.put(second);
        assert_eq!(spare.take(|| vec![3]), [2]);
        assert_eq!(spare.take(|| vec![3]), [3]);
    }
}
