//! Threads: starting them, and what one that panicked leaves behind.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::{Error, ErrorKind, Result};

/// Locks, also after a panic of another thread: what is guarded here is never left half-changed.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `work` on `threads` threads, each told its number, and returns the first error that is not
/// merely a thread giving up because another failed. A panic is an error, on one thread too.
pub fn parallel(threads: usize, work: impl Fn(usize) -> Result<()> + Sync) -> Result<()> {
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.max(1))
            .map(|n| {
                let work = &work;
                std::thread::Builder::new().spawn_scoped(scope, move || work(n))
            })
            .collect();
        let mut result: Result<()> = Ok(());
        for worker in workers {
            let outcome = match worker.map(|worker| worker.join()) {
                Ok(Ok(outcome)) => outcome,
                Ok(Err(_)) => Err(Error::internal("a worker thread panicked")),
                Err(cause) => {
                    let told = "the system refuses to start so many threads";
                    Err(Error::new(ErrorKind::Io, told)
                        .because(cause)
                        .help("give fewer `run.threads`"))
                }
            };
            let given_up = matches!(&result, Err(e) if e.kind() == ErrorKind::Interrupted);
            if result.is_ok() || given_up && outcome.is_err() {
                result = outcome;
            }
        }
        result
    })
}
