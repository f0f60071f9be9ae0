//! Random trouble on many threads: every run ends, in order or with its error.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::*;
use crate::ErrorKind;
use crate::host::Threads;
use crate::stage::Encode;

/// Where something goes wrong, and after how many calls.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wrong {
    Nothing,
    Work(usize),
    Commit(usize),
    Encode(usize),
    Append(usize),
}

/// What goes wrong, how, and a generator for delays.
struct Trouble {
    wrong: Wrong,
    panics: bool,
    calls: [AtomicUsize; 4],
    seed: AtomicUsize,
}

impl Trouble {
    fn random(&self) -> usize {
        let z = self.seed.fetch_add(0x9e37_79b9_7f4a_7c15, Ordering::Relaxed);
        let z = (z ^ z >> 31).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 29
    }

    /// Takes a while, and fails if its turn has come.
    fn meet(&self, which: usize, after: impl Fn(Wrong) -> Option<usize>) -> Result<()> {
        match self.random() % 8 {
            0 => std::thread::sleep(Duration::from_micros(self.random() as u64 % 200)),
            1..4 => std::thread::yield_now(),
            _ => {}
        }
        let call = self.calls[which].fetch_add(1, Ordering::Relaxed);
        match after(self.wrong) == Some(call) {
            // Unlike `panic!`, says nothing on stderr.
            true if self.panics => resume_unwind(Box::new("trouble")),
            true => Err(Error::internal("trouble")),
            false => Ok(()),
        }
    }
}

/// Takes chunks of one byte a record and counts those that are encoded, not yet appended.
struct Listing {
    trouble: Arc<Trouble>,
    listed: Arc<Mutex<Vec<u8>>>,
    held: Arc<AtomicUsize>,
}

impl Sink for Listing {
    fn chunk_points(&self) -> usize {
        1
    }
    fn chunk_bytes(&self) -> u64 {
        1
    }
    fn encoder(&self) -> Arc<dyn Encode> {
        unreachable!("the test encodes by itself")
    }
    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.trouble.meet(3, |w| if let Wrong::Append(n) = w { Some(n) } else { None })?;
        lock(&self.listed).extend(chunk.bytes);
        self.held.fetch_sub(1, Ordering::SeqCst);
        Ok(())
    }
    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        Ok(SinkSummary { points: lock(&self.listed).len() as u64, ..SinkSummary::default() })
    }
}

struct Outcome {
    result: Result<SinkSummary>,
    listed: Vec<u8>,
    most_held: usize,
}

/// Delivers for every tile as many products as `tiles` says, each of `each` chunks.
fn run(threads: usize, tiles: &[u8], each: usize, trouble: Trouble) -> Outcome {
    let trouble = Arc::new(trouble);
    let (listed, held) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicUsize::new(0)));
    let most_held = AtomicUsize::new(0);
    let sink = Listing { trouble: trouble.clone(), listed: listed.clone(), held: held.clone() };
    let commit = |product: u8| {
        trouble.meet(1, |w| if let Wrong::Commit(n) = w { Some(n) } else { None })?;
        Ok(vec![product; each])
    };
    let encode = |chunk: u8| {
        most_held.fetch_max(held.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
        trouble.meet(2, |w| if let Wrong::Encode(n) = w { Some(n) } else { None })?;
        Ok((0, Encoded { bytes: vec![chunk], points: 1, ..Encoded::default() }))
    };
    let outlet = Outlet::new(vec![Box::new(sink)], threads, &commit);
    let deliver = |tile: usize| {
        let products = tiles[tile];
        for n in 0..products {
            trouble.meet(0, |w| if let Wrong::Work(n) = w { Some(n) } else { None })?;
            let place = (tile as u64, u64::from(n));
            outlet.deliver(place, tile as u8, n + 1 == products, &mut |chunk| encode(chunk))?;
        }
        Ok(())
    };
    let result = Threads::start(threads, |threads| {
        threads.items(tiles.len(), || outlet.stop()).run(
            || (),
            |(), tile| deliver(tile),
            |()| {},
            |()| outlet.drain(tiles.len(), &mut |chunk| encode(chunk)),
        )
    });
    let result = result.and_then(|_| outlet.close(vec![255], &mut |chunk| encode(chunk)));
    let result = result.and_then(finished);
    let listed = lock(&listed).clone();
    let result = result.map(|mut all| all.pop().unwrap_or_default());
    Outcome { result, listed, most_held: most_held.into_inner() }
}

/// Runs `test` and fails if it takes a minute: threads wait for each other.
fn ends<T: Send + 'static>(what: String, test: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, wait) = mpsc::channel();
    std::thread::spawn(move || done.send(test()));
    wait.recv_timeout(Duration::from_secs(60)).unwrap_or_else(|e| panic!("{what}: {e}"))
}

#[test]
fn every_run_ends_in_order_or_with_its_error() {
    let source = Trouble {
        wrong: Wrong::Nothing,
        panics: false,
        calls: Default::default(),
        seed: AtomicUsize::new(20_250),
    };
    let (mut whole, mut failed) = (0, 0);
    for case in 0..600usize {
        let threads = 1 + source.random() % 8;
        let tiles: Vec<u8> =
            (0..source.random() % 40).map(|_| 1 + (source.random() % 3) as u8).collect();
        let each = source.random() % 4;
        let after = source.random() % 60;
        let wrong = match case % 6 {
            0 => Wrong::Work(after),
            1 => Wrong::Commit(after),
            2 => Wrong::Encode(after),
            3 => Wrong::Append(after),
            _ => Wrong::Nothing,
        };
        let panics = source.random().is_multiple_of(2);
        let what = format!("case {case}: {threads} threads, {wrong:?}, {tiles:?} × {each}");
        let seed = AtomicUsize::new(case);
        let trouble = Trouble { wrong, panics, calls: Default::default(), seed };
        let products = tiles.iter().map(|&n| usize::from(n)).sum::<usize>();
        let calls = match wrong {
            Wrong::Nothing => 0,
            Wrong::Work(_) | Wrong::Commit(_) => products,
            // The chunk that is left when all are committed is another matter: a test would
            // have to catch its panic.
            Wrong::Encode(_) | Wrong::Append(_) => products * each,
        };
        if wrong != Wrong::Nothing && after >= calls {
            continue;
        }
        let mut expected: Vec<u8> = (tiles.iter().enumerate())
            .flat_map(|(tile, &n)| vec![tile as u8; usize::from(n) * each])
            .collect();
        expected.push(255);
        let outcome = ends(what.clone(), move || run(threads, &tiles, each, trouble));
        assert!(outcome.most_held <= 2 * threads, "{what}: {} held", outcome.most_held);
        match (wrong, outcome.result) {
            (Wrong::Nothing, result) => {
                assert_eq!(result.unwrap().points, expected.len() as u64, "{what}");
                assert_eq!(outcome.listed, expected, "{what}");
                whole += 1;
            }
            (_, result) => {
                let error = result.expect_err(&what);
                assert_eq!(error.kind(), ErrorKind::Internal, "{what}: {error}");
                assert!(expected.starts_with(&outcome.listed), "{what}");
                failed += 1;
            }
        }
    }
    assert!(whole > 100 && failed > 100, "{whole} whole, {failed} failed");
}

#[test]
fn chunks_do_not_pile_up_behind_a_slow_disk() {
    struct Slow(Listing);
    impl Sink for Slow {
        fn chunk_points(&self) -> usize {
            1
        }
        fn chunk_bytes(&self) -> u64 {
            1
        }
        fn encoder(&self) -> Arc<dyn Encode> {
            self.0.encoder()
        }
        fn append(&mut self, chunk: Encoded) -> Result<()> {
            std::thread::sleep(Duration::from_millis(3));
            self.0.append(chunk)
        }
        fn finish(self: Box<Self>) -> Result<SinkSummary> {
            Ok(SinkSummary::default())
        }
    }
    let trouble = Arc::new(Trouble {
        wrong: Wrong::Nothing,
        panics: false,
        calls: Default::default(),
        seed: AtomicUsize::new(1),
    });
    let held = Arc::new(AtomicUsize::new(0));
    let listed = Arc::default();
    let sink = Slow(Listing { trouble, listed, held: held.clone() });
    let commit = |product: u8| Ok(vec![product]);
    let outlet = Outlet::new(vec![Box::new(sink)], 3, &commit);
    let most = AtomicUsize::new(0);
    let encode = |chunk: u8| {
        most.fetch_max(held.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
        Ok((0, Encoded { bytes: vec![chunk], points: 1, ..Encoded::default() }))
    };
    let deliver = |tile: usize| {
        outlet.deliver((tile as u64, 0), tile as u8, true, &mut |chunk| encode(chunk))
    };
    Threads::start(3, |threads| {
        threads.items(60, || outlet.stop()).run(
            || (),
            |(), tile| deliver(tile),
            |()| {},
            |()| outlet.drain(60, &mut |chunk| encode(chunk)),
        )
    })
    .unwrap();
    assert!((2..=6).contains(&most.into_inner()));
}
