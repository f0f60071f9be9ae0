//! From products that come in any order to a file in one order: what several threads deliver is
//! committed in turn, cut into chunks, encoded by whoever has time, and appended in turn again.
//!
//! Nobody waits while there is something to encode, and whoever is to deliver next never waits at
//! all, so the threads cannot wait for each other.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::stage::{Encoded, Sink, SinkSummary};
use crate::tile::lock;
use crate::{Error, Result};

/// A product's place in the order: its tile or part, and which product of it.
pub type Place = (u64, u64);

/// What threads share while they deliver products `R`, which are cut into chunks `P`.
pub struct Outlet<R, P> {
    state: Mutex<State<R, P>>,
    changed: Condvar,
    /// Products that may wait for their turn, and chunks that may wait to be encoded.
    window: usize,
}

struct State<R, P> {
    turn: Place,
    waiting: BTreeMap<Place, (R, bool)>,
    committing: bool,
    chunks: VecDeque<(u64, P)>,
    numbered: u64,
    encoded: BTreeMap<u64, Encoded>,
    appended: u64,
    sink: Option<Box<dyn Sink>>,
    stopped: bool,
}

/// The two things that a thread does with what it takes from an outlet.
pub struct Hands<'a, R, P> {
    /// Cuts a product, in its turn, into complete chunks; called by one thread at a time.
    pub commit: &'a (dyn Fn(R) -> Result<Vec<P>> + Sync),
    /// Encodes a chunk.
    pub encode: &'a mut dyn FnMut(P) -> Result<Encoded>,
}

impl<R, P> Outlet<R, P> {
    /// An outlet into `sink` for `threads` threads.
    pub fn new(sink: Box<dyn Sink>, threads: usize) -> Self {
        Outlet {
            state: Mutex::new(State {
                turn: (0, 0),
                waiting: BTreeMap::new(),
                committing: false,
                chunks: VecDeque::new(),
                numbered: 0,
                encoded: BTreeMap::new(),
                appended: 0,
                sink: Some(sink),
                stopped: false,
            }),
            changed: Condvar::new(),
            window: threads,
        }
    }

    /// Delivers the product at `place`; `last` if none of the same tile or part follows.
    pub fn deliver(
        &self,
        place: Place,
        product: R,
        last: bool,
        hands: &mut Hands<'_, R, P>,
    ) -> Result<()> {
        let mut state = lock(&self.state);
        state.waiting.insert(place, (product, last));
        loop {
            state = self.commit_waiting(state, hands)?;
            let must_wait = place > state.turn && state.waiting.len() > self.window;
            if state.chunks.len() <= self.window && !must_wait {
                return Ok(());
            }
            let (progress, next) = self.encode_one(state, hands)?;
            state = next;
            if !progress {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Encodes and appends until all that was delivered is written; each thread calls it when it
    /// has nothing more to deliver.
    pub fn drain(&self, hands: &mut Hands<'_, R, P>, done: impl Fn(Place) -> bool) -> Result<()> {
        let mut state = lock(&self.state);
        loop {
            state = self.commit_waiting(state, hands)?;
            let (progress, next) = self.encode_one(state, hands)?;
            state = next;
            let all =
                done(state.turn) && state.chunks.is_empty() && state.appended == state.numbered;
            if all && !state.committing {
                self.changed.notify_all();
                return Ok(());
            }
            if !progress {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Adds the chunks that are left when all products are committed.
    pub fn close(&self, rest: Vec<P>, hands: &mut Hands<'_, R, P>) -> Result<SinkSummary> {
        let mut state = lock(&self.state);
        state.queue(rest);
        loop {
            let (progress, next) = self.encode_one(state, hands)?;
            state = next;
            if !progress && state.appended == state.numbered {
                break;
            }
        }
        match state.sink.take() {
            Some(sink) => sink.finish(),
            None => Err(Error::internal("an output was closed twice")),
        }
    }

    /// Wakes every thread and makes it give up; for the thread that met an error.
    pub fn stop(&self) {
        lock(&self.state).stopped = true;
        self.changed.notify_all();
    }

    /// Commits the products whose turn it is, unless another thread is at it.
    fn commit_waiting<'s>(
        &'s self,
        mut state: MutexGuard<'s, State<R, P>>,
        hands: &mut Hands<'_, R, P>,
    ) -> Result<MutexGuard<'s, State<R, P>>> {
        while !state.committing && !state.stopped {
            let turn = state.turn;
            let Some((product, last)) = state.waiting.remove(&turn) else { break };
            state.committing = true;
            drop(state);
            let chunks = (hands.commit)(product);
            state = lock(&self.state);
            state.committing = false;
            state.turn = if last { (turn.0 + 1, 0) } else { (turn.0, turn.1 + 1) };
            match chunks {
                Ok(chunks) => state.queue(chunks),
                Err(error) => return Err(self.fail(state, error)),
            }
            self.changed.notify_all();
        }
        if state.stopped { Err(Error::interrupted()) } else { Ok(state) }
    }

    /// Encodes one chunk if there is one and appends what is complete; says whether it did. It does
    /// not while many encoded chunks wait for one before them, which another thread has: the file may
    /// be slow.
    fn encode_one<'s>(
        &'s self,
        mut state: MutexGuard<'s, State<R, P>>,
        hands: &mut Hands<'_, R, P>,
    ) -> Result<(bool, MutexGuard<'s, State<R, P>>)> {
        let next = state.chunks.front().map(|(number, _)| *number);
        if state.encoded.len() > self.window && next != Some(state.appended) {
            return Ok((false, state));
        }
        let Some((number, chunk)) = state.chunks.pop_front() else { return Ok((false, state)) };
        drop(state);
        let encoded = (hands.encode)(chunk);
        state = lock(&self.state);
        match encoded {
            Ok(encoded) => state.encoded.insert(number, encoded),
            Err(error) => return Err(self.fail(state, error)),
        };
        while let Some(mut sink) = state.sink.take() {
            let next = state.appended;
            let Some(encoded) = state.encoded.remove(&next) else {
                state.sink = Some(sink);
                break;
            };
            drop(state);
            let outcome = sink.append(encoded);
            state = lock(&self.state);
            state.sink = Some(sink);
            state.appended += 1;
            if let Err(error) = outcome {
                return Err(self.fail(state, error));
            }
        }
        self.changed.notify_all();
        Ok((true, state))
    }

    fn fail(&self, mut state: MutexGuard<'_, State<R, P>>, error: Error) -> Error {
        state.stopped = true;
        drop(state);
        self.changed.notify_all();
        error
    }
}

impl<R, P> State<R, P> {
    fn queue(&mut self, chunks: Vec<P>) {
        for chunk in chunks {
            self.chunks.push_back((self.numbered, chunk));
            self.numbered += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Duration;

    use super::*;
    use crate::stage::Encode;
    use crate::tile::parallel;

    /// A file so slow that everything else waits for it.
    struct Slow {
        waiting: Arc<AtomicU64>,
        written: Vec<u64>,
    }

    impl Sink for Slow {
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
            std::thread::sleep(Duration::from_millis(2));
            self.waiting.fetch_sub(1, Ordering::SeqCst);
            self.written.push(chunk.points);
            Ok(())
        }
        fn finish(self: Box<Self>) -> Result<SinkSummary> {
            assert!(self.written.is_sorted(), "{:?}", self.written);
            Ok(SinkSummary { points: self.written.len() as u64, ..SinkSummary::default() })
        }
    }

    #[test]
    fn a_slow_file_does_not_pile_up_what_is_encoded_for_it() {
        const THREADS: usize = 3;
        const PRODUCTS: u64 = 150;
        let waiting = Arc::new(AtomicU64::new(0));
        let most = AtomicU64::new(0);
        let sink = Slow { waiting: waiting.clone(), written: Vec::new() };
        let outlet: Outlet<u64, u64> = Outlet::new(Box::new(sink), THREADS);
        let next = AtomicU64::new(0);
        let commit = |product: u64| Ok(vec![2 * product, 2 * product + 1]);
        let encode = |chunk: u64| {
            most.fetch_max(waiting.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            Ok(Encoded { points: chunk, ..Encoded::default() })
        };
        parallel(THREADS, |_| {
            let mut encode = encode;
            let mut hands = Hands { commit: &commit, encode: &mut encode };
            loop {
                let product = next.fetch_add(1, Ordering::SeqCst);
                if product >= PRODUCTS {
                    return outlet.drain(&mut hands, |turn| turn.0 >= PRODUCTS);
                }
                outlet.deliver((product, 0), product, true, &mut hands)?;
            }
        })
        .unwrap();
        let mut encode = encode;
        let mut hands = Hands { commit: &commit, encode: &mut encode };
        let written = outlet.close(Vec::new(), &mut hands).unwrap();
        assert_eq!(written.points, 2 * PRODUCTS);
        // The window, those being encoded, and the one being appended.
        let most = most.into_inner();
        assert!((2..=2 * THREADS as u64 + 2).contains(&most), "{most} chunks at once");
    }
}
