//! What fields beside a point of formats 6 to 10 were in each scanner channel.
//!
//! The point tells the other fields its channel. Version 3 does so only where the channel changes,
//! and takes the value before from the channel before unless the new one is new: faults of LASzip
//! that its files hold, and that version 4 is without.

/// The value before, and what is learned, of each of four scanner channels.
pub struct Contexts<V, M> {
    version: u16,
    now: usize,
    last: [V; 4],
    models: [Option<Box<M>>; 4],
}

impl<V: Clone + Default, M> Contexts<V, M> {
    /// Of version 3 or 4.
    pub fn new(version: u16) -> Self {
        let last = std::array::from_fn(|_| V::default());
        Contexts { version, now: 0, last, models: [None, None, None, None] }
    }

    /// Begins with the first value of a chunk.
    pub fn begin(&mut self, context: usize, first: V, new: impl FnOnce() -> Box<M>) {
        self.models = [None, None, None, None];
        self.now = context & 3;
        self.models[self.now] = Some(new());
        self.last[self.now] = first;
    }

    /// The value before the next one, which is to be put in its place, and what is learned.
    #[inline(always)]
    pub fn turn(&mut self, context: usize, new: impl FnOnce() -> Box<M>) -> (&mut V, &mut M) {
        let (before, now) = (self.now, context & 3);
        let mut last = before;
        if before != now {
            self.now = now;
            let is_new = self.models[now].is_none();
            if is_new {
                self.last[now] = self.last[before].clone();
            }
            if is_new || self.version != 3 {
                last = now;
            }
        }
        (&mut self.last[last], self.models[now].get_or_insert_with(new))
    }
}
