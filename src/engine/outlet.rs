//! From products that come in any order to files in one order: what several threads deliver is
//! committed in turn, cut into chunks, encoded by any thread that has time, and appended in turn
//! again.
//!
//! Encoding takes as long as milling, and neither tiles nor chunks take equally long. A thread for
//! each of the two would therefore idle while the other works. Here every thread does what is next:
//! it mills until too much waits, and then encodes.
//!
//! What waits is bounded: products and chunks by the number of threads, and encoding goes no
//! further ahead of what is appended than twice that, however slow the disk or another thread is.
//!
//! The threads cannot wait for each other: the thread that is to deliver next never waits for its
//! turn, and the one that encodes or appends the next chunk waits for nothing. Waiting blocks the
//! thread, which is right in the items of a phase (`host/threads.rs` says why). A thread that
//! leaves early must call [`Outlet::stop`], or the others would wait for what it owes.
//!
//! One mutex guards all of it. A queue without locks would not do: products and chunks are taken by
//! number and not as they come, and a thread that waits does so for any of three things to change.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::host::lock;
use crate::stage::{Encoded, Sink, SinkSummary};
use crate::{Error, Result};

/// What each thread has in an outlet at most of every sort: of products, of chunks to encode and of
/// encoded chunks, one that it is at and one that waits for its turn.
pub const A_THREAD: u64 = 2;

/// A product's place in the order: its item (a tile, a part), and which product of it.
pub type ProductPlace = (u64, u64);

/// Cuts a product, in its turn, into complete chunks; called by one thread at a time.
pub type Commit<'a, R, P> = dyn Fn(R) -> Result<Vec<P>> + Sync + 'a;

/// Encodes a chunk and says for which of the sinks; each thread has its own.
pub type EncodeChunk<'a, P> = dyn FnMut(P) -> Result<(usize, Encoded)> + 'a;

/// What sinks say when they are finished.
pub fn finished(sinks: Vec<Box<dyn Sink>>) -> Result<Vec<SinkSummary>> {
    sinks.into_iter().map(|sink| sink.finish()).collect()
}

/// What threads share while they deliver products `R`, which are cut into chunks `P`.
pub struct Outlet<'a, R, P> {
    commit: &'a Commit<'a, R, P>,
    state: Mutex<OutletState<R, P>>,
    changed: Condvar,
    /// Products that may wait for their turn, and chunks that may wait to be encoded.
    window: usize,
    /// Chunks that may be encoded, or being encoded, and not yet appended.
    ahead: u64,
}

struct OutletState<R, P> {
    turn: ProductPlace,
    waiting: BTreeMap<ProductPlace, (R, bool)>,
    committing: bool,
    chunks: VecDeque<(u64, P)>,
    numbered: u64,
    encoded: BTreeMap<u64, (usize, Encoded)>,
    appended: u64,
    sinks: Option<Vec<Box<dyn Sink>>>,
    stopped: bool,
}

impl<'a, R, P> Outlet<'a, R, P> {
    /// An outlet into `sinks` for `threads` threads.
    pub fn new(sinks: Vec<Box<dyn Sink>>, threads: usize, commit: &'a Commit<'a, R, P>) -> Self {
        Outlet {
            commit,
            state: Mutex::new(OutletState {
                turn: (0, 0),
                waiting: BTreeMap::new(),
                committing: false,
                chunks: VecDeque::new(),
                numbered: 0,
                encoded: BTreeMap::new(),
                appended: 0,
                sinks: Some(sinks),
                stopped: false,
            }),
            changed: Condvar::new(),
            window: threads * (A_THREAD as usize - 1),
            ahead: A_THREAD * threads.max(1) as u64,
        }
    }

    /// Delivers the product at `place`; `last` if none of the same item follows.
    pub fn deliver(
        &self,
        place: ProductPlace,
        product: R,
        last: bool,
        encode: &mut EncodeChunk<'_, P>,
    ) -> Result<()> {
        let mut state = lock(&self.state);
        state.waiting.insert(place, (product, last));
        loop {
            state = self.commit_waiting(state)?;
            let is_early = place > state.turn && state.waiting.len() > self.window;
            if !is_early && state.chunks.len() <= self.window {
                return Ok(());
            }
            let (progress, next) = self.encode_one(state, encode)?;
            state = next;
            if !progress {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Encodes and appends until the products of all so many items are written; each thread calls
    /// it when it has nothing more to deliver.
    pub fn drain(&self, items: usize, encode: &mut EncodeChunk<'_, P>) -> Result<()> {
        let mut state = lock(&self.state);
        loop {
            state = self.commit_waiting(state)?;
            let (progress, next) = self.encode_one(state, encode)?;
            state = next;
            let all = state.turn.0 >= items as u64
                && state.chunks.is_empty()
                && state.appended == state.numbered;
            if all && !state.committing {
                self.changed.notify_all();
                return Ok(());
            }
            if !progress {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Adds the chunks that are left when all products are committed; the sinks, to be finished.
    pub fn close(
        &self,
        rest: Vec<P>,
        encode: &mut EncodeChunk<'_, P>,
    ) -> Result<Vec<Box<dyn Sink>>> {
        let mut state = lock(&self.state);
        state.queue(rest);
        loop {
            let (progress, next) = self.encode_one(state, encode)?;
            state = next;
            if !progress && state.appended == state.numbered {
                break;
            }
        }
        state.sinks.take().ok_or_else(|| Error::internal("an output was closed twice"))
    }

    /// Wakes every thread and makes it give up; for the thread that met an error.
    pub fn stop(&self) {
        lock(&self.state).stopped = true;
        self.changed.notify_all();
    }

    /// Commits the products whose turn it is, unless another thread is at it.
    fn commit_waiting<'s>(
        &'s self,
        mut state: MutexGuard<'s, OutletState<R, P>>,
    ) -> Result<MutexGuard<'s, OutletState<R, P>>> {
        while !state.committing && !state.stopped {
            let turn = state.turn;
            let Some((product, last)) = state.waiting.remove(&turn) else { break };
            state.committing = true;
            drop(state);
            let chunks = (self.commit)(product);
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

    /// Encodes one chunk if there is one within reach and appends what is complete; says whether it
    /// did. One beyond reach means that another thread is at the chunk that is appended next.
    fn encode_one<'s>(
        &'s self,
        mut state: MutexGuard<'s, OutletState<R, P>>,
        encode: &mut EncodeChunk<'_, P>,
    ) -> Result<(bool, MutexGuard<'s, OutletState<R, P>>)> {
        let reach = state.appended + self.ahead;
        if state.chunks.front().is_none_or(|(number, _)| *number >= reach) {
            return Ok((false, state));
        }
        let Some((number, chunk)) = state.chunks.pop_front() else { return Ok((false, state)) };
        drop(state);
        let encoded = encode(chunk);
        state = lock(&self.state);
        match encoded {
            Ok(encoded) => state.encoded.insert(number, encoded),
            Err(error) => return Err(self.fail(state, error)),
        };
        while !state.stopped
            && let Some(mut sinks) = state.sinks.take()
        {
            let next = state.appended;
            let Some((to, encoded)) = state.encoded.remove(&next) else {
                state.sinks = Some(sinks);
                break;
            };
            drop(state);
            let outcome = match sinks.get_mut(to) {
                Some(sink) => sink.append(encoded),
                None => Err(Error::internal("a chunk is for a sink that is not there")),
            };
            state = lock(&self.state);
            state.sinks = Some(sinks);
            state.appended += 1;
            if let Err(error) = outcome {
                return Err(self.fail(state, error));
            }
            self.changed.notify_all();
        }
        self.changed.notify_all();
        Ok((true, state))
    }

    fn fail(&self, mut state: MutexGuard<'_, OutletState<R, P>>, error: Error) -> Error {
        state.stopped = true;
        drop(state);
        self.changed.notify_all();
        error
    }
}

impl<R, P> OutletState<R, P> {
    fn queue(&mut self, chunks: Vec<P>) {
        for chunk in chunks {
            self.chunks.push_back((self.numbered, chunk));
            self.numbered += 1;
        }
    }
}

#[cfg(test)]
mod tests;
