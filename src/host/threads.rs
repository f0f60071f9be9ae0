//! The threads of a run, and the one way in which they share the work of a phase.
//!
//! The work of a phase is numbered items that need nothing of each other: parts of the input,
//! ranges of Morton order, tiles. Each thread makes its arena once (what it works with, of which
//! memory is planned for as many as there are threads), takes the number that comes next, does that
//! item and takes the next. What items came to is committed in the order of their numbers, so that
//! nothing depends on which thread was faster.
//!
//! The threads are those of a `rayon` pool, but items are not handed out by its iterators: these
//! halve a range ahead of time, so that threads work far apart from each other. Taken one after the
//! other, items end about in their order, outputs grow while few results wait for their turn, and a
//! thread never has more than one arena. Items are large, so that the one counter costs nothing.
//!
//! An item may wait until the items before it are done, as the outlet of the engine does. A
//! broadcast calls its function on every thread of the pool, and whoever waits in it blocks its
//! thread and takes up nothing else; items before it were taken before, so that other threads are
//! at work on them. Nobody may wait for a thread that has no item yet: in a pool that a program
//! lends, it may be busy with something else. For the same reason no item may itself call `rayon`,
//! which would take up other work inside of the item and could wait for itself.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::{ThreadBuilder, ThreadPool, ThreadPoolBuilder};

use super::tallies::{ItemTally, handed_over};
use crate::{Error, ErrorKind, Result};

/// Locks, also after a panic of another thread: what is guarded here is never left half-changed.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Threads that work together on one phase after the other.
#[derive(Debug, Clone, Copy)]
pub struct Threads<'a> {
    pool: &'a ThreadPool,
    count: usize,
}

impl<'a> Threads<'a> {
    /// Starts `count` threads for `work`; they have ended when it returns.
    ///
    /// # Errors
    ///
    /// Those of `work`; fails if the system refuses to start so many threads.
    pub fn start<T>(count: usize, work: impl FnOnce(Threads<'_>) -> Result<T>) -> Result<T> {
        let builder = ThreadPoolBuilder::new().num_threads(count.max(1));
        let done = builder.build_scoped(ThreadBuilder::run, |pool| work(Threads::of(pool, count)));
        done.unwrap_or_else(|cause| {
            let error = Error::new(ErrorKind::Io, "the system refuses to start so many threads");
            // Its text alone: the cause of a pool's error is an error of the same text.
            Err(error.because(cause.to_string()).help("give fewer `run.threads`"))
        })
    }

    /// `count` of the threads of `pool`, or all if it has fewer.
    pub fn of(pool: &'a ThreadPool, count: usize) -> Self {
        Threads { pool, count: count.clamp(1, pool.current_num_threads()) }
    }

    /// `count` of these threads, or all if they are fewer.
    pub fn at_most(self, count: usize) -> Self {
        Threads { count: count.clamp(1, self.count), ..self }
    }

    /// How many threads work.
    pub fn count(self) -> usize {
        self.count
    }

    /// The `count` items of a phase. `stop` is called by each thread that fails or panics: it makes
    /// the other threads give up items that are long or that wait.
    pub fn items<F: Fn() + Sync>(self, count: usize, stop: F) -> PhaseItems<'a, F> {
        PhaseItems { threads: self, count, stop }
    }
}

/// Numbered items to be done, each once. See [`Threads::items`].
#[derive(Debug)]
pub struct PhaseItems<'a, F> {
    threads: Threads<'a>,
    count: usize,
    stop: F,
}

impl<F: Fn() + Sync> PhaseItems<'_, F> {
    /// Does all items. Every thread makes an `arena`, does each `item` that it takes with it, and
    /// in the `end` says what is left in it; these are returned, one for each thread. What items
    /// came to is given to `commit` in the order of the items.
    ///
    /// # Errors
    ///
    /// Once a thread fails or panics, no other takes another item. The first error is returned that
    /// is not merely a thread giving up because another failed ([`ErrorKind::Interrupted`]).
    pub fn run<A, T: ItemTally, S: ItemTally>(
        &self,
        arena: impl Fn() -> A + Sync,
        item: impl Fn(&mut A, usize) -> Result<T> + Sync,
        commit: impl FnMut(T) + Send,
        end: impl Fn(A) -> Result<S> + Sync,
    ) -> Result<Vec<S>> {
        let next = AtomicUsize::new(0);
        let done = Mutex::new(InOrder { turn: 0, waiting: BTreeMap::new(), commit });
        let work = || {
            let mut arena = arena();
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= self.count {
                    return end(arena).map(handed_over);
                }
                let result = item(&mut arena, number)?;
                lock(&done).take(number, handed_over(result));
            }
        };
        let guarded = || {
            let panicked = |_| Err(Error::internal("a worker thread panicked"));
            let outcome = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(panicked);
            if outcome.is_err() {
                next.store(self.count, Ordering::Relaxed);
                (self.stop)();
            }
            outcome
        };
        let Threads { pool, count } = self.threads;
        let outcomes = pool.broadcast(|thread| (thread.index() < count).then(guarded));
        first_error(outcomes.into_iter().flatten())
    }
}

/// Results that come in any order and are committed in the order of their items.
struct InOrder<T, C> {
    turn: usize,
    waiting: BTreeMap<usize, T>,
    commit: C,
}

impl<T, C: FnMut(T)> InOrder<T, C> {
    fn take(&mut self, number: usize, result: T) {
        self.waiting.insert(number, result);
        while let Some(result) = self.waiting.remove(&self.turn) {
            self.turn += 1;
            (self.commit)(result);
        }
    }
}

/// All that threads came to, or the first error that says what went wrong.
fn first_error<S>(outcomes: impl Iterator<Item = Result<S>>) -> Result<Vec<S>> {
    let (mut all, mut failed) = (Vec::new(), None::<Error>);
    for outcome in outcomes {
        match outcome {
            Ok(one) => all.push(one),
            Err(error) if failed.as_ref().is_none_or(|e| e.kind() == ErrorKind::Interrupted) => {
                failed = Some(error);
            }
            Err(_) => {}
        }
    }
    failed.map_or(Ok(all), Err)
}

#[cfg(test)]
mod tests;
