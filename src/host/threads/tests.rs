//! A scheduler is judged by what it hands out, commits and returns, whatever its threads do.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::*;

/// Threads and items of the tests.
const THREADS: usize = 4;
const ITEMS: usize = 300;

#[test]
fn items_are_done_once_and_committed_in_their_order() {
    let (arenas, mut committed) = (AtomicUsize::new(0), Vec::new());
    let counts = Threads::start(THREADS, |threads| {
        threads.items(ITEMS, || unreachable!("nothing fails")).run(
            || {
                arenas.fetch_add(1, Ordering::Relaxed);
                0
            },
            |done, number| {
                if number % 7 == 0 {
                    std::thread::sleep(Duration::from_micros(300));
                }
                *done += 1;
                Ok(number)
            },
            |number| committed.push(number),
            Ok,
        )
    });
    assert_eq!(counts.unwrap().iter().sum::<usize>(), ITEMS);
    assert_eq!(committed, (0..ITEMS).collect::<Vec<_>>());
    assert_eq!(arenas.into_inner(), THREADS);
}

#[test]
fn an_item_may_wait_for_those_before_it() {
    let finished = Mutex::new(0);
    let changed = std::sync::Condvar::new();
    let wait = |number| {
        let mut all = lock(&finished);
        while *all < number {
            all = changed.wait(all).unwrap();
        }
        *all = number + 1;
        changed.notify_all();
        Ok(())
    };
    let phase = |threads: Threads<'_>| {
        threads.items(ITEMS, || {}).run(|| (), |(), number| wait(number), |()| {}, Ok)
    };
    Threads::start(THREADS, phase).unwrap();
    assert_eq!(*lock(&finished), ITEMS);
}

/// Runs items of which number 20 does `trouble`, and all others wait until the phase is stopped.
fn stopped_by(trouble: fn() -> Result<()>) -> (Error, Vec<usize>) {
    let (stopped, mut committed) = (AtomicBool::new(false), Vec::new());
    let stop = || stopped.store(true, Ordering::SeqCst);
    let item = |number| {
        match number {
            0..20 => return Ok(number),
            20 => trouble()?,
            _ => {}
        }
        while !stopped.load(Ordering::SeqCst) {
            std::thread::yield_now();
        }
        Err(Error::interrupted())
    };
    let failed = Threads::start(THREADS, |threads| {
        let commit = |number| committed.push(number);
        threads.items(ITEMS, stop).run(|| (), |(), number| item(number), commit, Ok)
    });
    (failed.unwrap_err(), committed)
}

#[test]
fn the_error_that_stops_a_phase_is_the_one_returned() {
    let (error, committed) = stopped_by(|| Err(Error::pipeline("trouble")));
    assert_eq!(error.kind(), ErrorKind::Pipeline, "{error}");
    assert!((0..20).collect::<Vec<_>>().starts_with(&committed), "{committed:?}");
}

#[test]
fn a_panic_of_an_item_is_an_error() {
    // Unlike `panic!`, says nothing on stderr.
    let (error, _) = stopped_by(|| std::panic::resume_unwind(Box::new("trouble")));
    assert_eq!(error.kind(), ErrorKind::Internal, "{error}");
    assert!(error.to_string().contains("a worker thread panicked"), "{error}");
}

#[test]
fn of_a_larger_pool_no_more_threads_work_than_were_asked_for() {
    let pool = ThreadPoolBuilder::new().num_threads(THREADS).build().unwrap();
    for (asked, work) in [(0, 1), (3, 3), (9, THREADS)] {
        let threads = Threads::of(&pool, asked);
        let ended = threads.items(ITEMS, || {}).run(|| (), |(), _| Ok(()), |()| {}, Ok).unwrap();
        assert_eq!((threads.count(), ended.len()), (work, work));
        assert_eq!(threads.at_most(2).count(), work.min(2));
    }
}
