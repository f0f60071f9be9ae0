//! From chunks to bytes: records are fetched, put in order, edited and encoded, by any thread.
//!
//! Encoding takes as long as all that the stages compute, so it must not wait for one thread. A
//! chunk depends on nothing but its own records; only appending its bytes has an order. Records are
//! copied from where the decode left them: what no stage changed is written with the bytes that it
//! was read with.

use std::sync::Arc;

use super::by_time::ByTime;
use super::chunk::OutputChunk;
use super::job::Job;
use crate::budget::Bytes;
use crate::point::{Edit, PointBatch};
use crate::report::{KEY_POINTS, Tally};
use crate::stage::{Encode, Encoded, Sink};
use crate::store::{Fetch, RecordState, SealedTiles};
use crate::{Error, Result};

/// What threads need to encode chunks.
pub(crate) struct ChunkEncoders<'a> {
    job: &'a Job<'a>,
    tiles: &'a SealedTiles,
    encoders: Vec<Arc<dyn Encode>>,
    /// For each, how the records of a chunk are ordered, if not as they come.
    by_time: Vec<Option<ByTime>>,
    /// For each, the stages that stream above it, behind the decode.
    changed_by: Vec<&'a [usize]>,
    /// For each, whether classes are counted as kept by its records: one of what all stages leave.
    counted: Vec<bool>,
    /// True if chunks tell where records are stored instead of their rank.
    stored: bool,
    chunk_points: usize,
}

impl<'a> ChunkEncoders<'a> {
    /// For chunks of these sinks.
    pub fn new(job: &'a Job<'a>, tiles: &'a SealedTiles, sinks: &[(usize, Box<dyn Sink>)]) -> Self {
        ChunkEncoders {
            job,
            tiles,
            encoders: sinks.iter().map(|(_, sink)| sink.encoder()).collect(),
            by_time: sinks
                .iter()
                .map(|(n, _)| by_time(job, job.task.sinks[*n].likes_time()))
                .collect(),
            stored: false,
            changed_by: sinks.iter().map(|(n, _)| &*job.task.changed_by[*n]).collect(),
            counted: sinks.iter().map(|(sink, _)| job.is_last(*sink)).collect(),
            chunk_points: sinks.iter().map(|(_, sink)| sink.chunk_points()).max().unwrap_or(0),
        }
    }

    /// For chunks of one output, that of sink `number`.
    pub fn of_one(
        job: &'a Job<'a>,
        tiles: &'a SealedTiles,
        number: usize,
        sink: &dyn Sink,
        likes_time: bool,
    ) -> Self {
        ChunkEncoders {
            job,
            tiles,
            encoders: vec![sink.encoder()],
            by_time: vec![by_time(job, likes_time)],
            changed_by: vec![&job.task.changed_by[number]],
            counted: vec![job.is_last(number)],
            stored: false,
            chunk_points: sink.chunk_points(),
        }
    }

    /// The same for chunks that tell where records are stored.
    pub fn of_stored(self) -> Self {
        ChunkEncoders { stored: true, ..self }
    }

    /// For the chunks of the same output, which `encoder` looks at before they are written: they
    /// are counted and ordered then.
    pub fn looked_at_by(&self, encoder: Arc<dyn Encode>) -> Self {
        ChunkEncoders {
            encoders: vec![encoder],
            by_time: vec![None],
            changed_by: self.changed_by.clone(),
            counted: vec![false],
            ..*self
        }
    }

    /// What a thread holds to encode them.
    pub fn one(&self) -> ChunkEncoder {
        ChunkEncoder::new(self.job, self.chunk_points)
    }
}

/// What a thread holds to encode chunks.
pub(crate) struct ChunkEncoder {
    numbers: Vec<u64>,
    states: Vec<RecordState>,
    fetch: Fetch,
    batch: PointBatch,
    pub tally: Tally,
}

impl ChunkEncoder {
    /// Bytes that it holds for chunks of `points` records of `stride` bytes: the records with their
    /// numbers and columns of `row` bytes, and what fetching them takes.
    pub fn bytes(points: u64, stride: usize, row: usize) -> Bytes {
        let more = size_of::<u64>() + row;
        Bytes::of(points, stride) + Bytes::of(points, more) + Fetch::bytes(points, stride)
    }

    /// For chunks of up to `chunk_points` records.
    pub fn new(job: &Job<'_>, chunk_points: usize) -> Self {
        ChunkEncoder {
            numbers: Vec::with_capacity(chunk_points),
            states: Vec::with_capacity(chunk_points),
            fetch: Fetch::default(),
            batch: PointBatch::new(job.task.schema().clone(), chunk_points),
            tally: Tally::default(),
        }
    }

    /// The chunk's records, encoded, and for which of the sinks.
    pub fn encode(
        &mut self,
        all: &ChunkEncoders<'_>,
        chunk: &OutputChunk,
    ) -> Result<(usize, Encoded)> {
        self.batch.clear();
        chunk.number(&mut self.numbers);
        chunk.states(&mut self.states);
        match all.stored {
            false => all.tiles.fetch(&self.numbers, &mut self.fetch, &mut self.batch)?,
            true => all.tiles.fetch_stored(&self.numbers, &mut self.fetch, &mut self.batch)?,
        }
        if all.counted.get(chunk.sink) == Some(&true) {
            all.job.classes.keep_by_state(&self.batch, &self.states, &mut self.tally);
            count_key_points(&self.states, &mut self.tally);
        }
        self.batch.columns = chunk.columns();
        if let Some(by_time) = all.by_time.get(chunk.sink).and_then(Option::as_ref) {
            by_time.sort(&mut self.batch, &mut self.states);
        }
        edit(&mut self.batch, &self.states)?;
        let changed_by = all.changed_by.get(chunk.sink).copied().unwrap_or_default();
        change(all.job, changed_by, &mut self.batch)?;
        let encoder = all.encoders.get(chunk.sink);
        let encoder = encoder.ok_or_else(|| Error::internal("a chunk is for no sink"))?;
        Ok((chunk.sink, encoder.encode(&self.batch)?))
    }
}

fn by_time(job: &Job<'_>, likes_time: bool) -> Option<ByTime> {
    likes_time.then(|| ByTime::of(job.task.schema())).flatten()
}

/// Counts the records that are written with the key-point flag because they stay.
fn count_key_points(states: &[RecordState], tally: &mut Tally) {
    let is_set = |state: &&RecordState| state.edits() & Edit::SetKeyPoint as u8 != 0;
    match states.iter().filter(is_set).count() as u64 {
        0 => {}
        some => tally.count(KEY_POINTS, some),
    }
}

/// Applies stages that stream to records that they keep, whose columns are those that they saw.
pub(crate) fn change(job: &Job<'_>, filters: &[usize], batch: &mut PointBatch) -> Result<()> {
    let records = batch.len();
    for &filter in filters {
        let stage = &job.task.filters[filter];
        // What it counts was counted when it was first applied.
        stage.apply(batch, &mut Tally::default())?;
        if batch.len() != records {
            let told = format!("the stage {} removes records that it kept before", stage.kind);
            return Err(Error::internal(told));
        }
    }
    Ok(())
}

/// Writes the edits of `states` into the records.
pub(crate) fn edit(batch: &mut PointBatch, states: &[RecordState]) -> Result<()> {
    let schema = batch.schema().clone();
    for (record, state) in batch.records_mut().chunks_exact_mut(schema.stride).zip(states) {
        for edit in Edit::of(state.edits()) {
            let field = schema.find(edit.dimension());
            if !field.is_some_and(|field| edit.write(field, &schema, record)) {
                let name = edit.dimension();
                return Err(Error::pipeline(format!("the records cannot hold the mark in {name}")));
            }
        }
    }
    Ok(())
}
