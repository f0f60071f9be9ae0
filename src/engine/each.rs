//! One output for each input: a file is an item, which one thread writes from begin to end.
//!
//! While tiles leave their products, the records that such outputs get are sorted by input
//! (`by_input.rs`). The files could grow from there, but of thousands of inputs that would be as
//! many open files and half-filled chunks. Written behind the last tile, no more are open than
//! there are threads.

use std::sync::Arc;

use super::arranged::FileExtent;
use super::by_input::ByInput;
use super::chunk::{Open, OutputChunk};
use super::encoding::{ChunkEncoder, ChunkEncoders};
use super::job::Job;
use super::product::RecordEntry;
use super::task::Task;
use crate::point::Metadata;
use crate::report::Tally;
use crate::stage::SinkSummary;
use crate::store::SealedTiles;
use crate::{Error, Result};

impl ByInput {
    /// Writes every input's output, each thread one at a time; for each input, the records that its
    /// output was given and what it said.
    pub fn write(
        &self,
        job: &Job<'_>,
        tiles: &SealedTiles,
    ) -> Result<(Vec<(u64, SinkSummary)>, Tally)> {
        let Task { sinks, demands, .. } = job.task;
        let chunk = sinks[self.sink].chunk(job.task.schema(), &job.task.metadata(self.sink, None));
        let chunk_points = chunk.map_or(demands.chunk.points, |chunk| chunk.points);
        let (mut written, mut total) = (Vec::new(), Tally::default());
        job.items(job.task.files(self.sink).len()).run(
            || ChunkEncoder::new(job, chunk_points),
            |encoder, input| {
                job.advance(0)?;
                let summary = self.write_one(job, tiles, input, encoder)?;
                Ok((summary, std::mem::take(&mut encoder.tally)))
            },
            |(summary, tally)| {
                written.push(summary);
                total.merge(&tally);
            },
            |_| Ok(()),
        )?;
        Ok((written, total))
    }

    fn write_one(
        &self,
        job: &Job<'_>,
        tiles: &SealedTiles,
        input: usize,
        encoder: &mut ChunkEncoder,
    ) -> Result<(u64, SinkSummary)> {
        let (task, number) = (job.task, self.sink);
        let missing = || Error::internal(format!("input {input} has no output"));
        let create = task.files(number).get(input).ok_or_else(missing)?;
        let staged = job.outputs[number].get(input).ok_or_else(missing)?;
        let rank = *task.ranks.get(input).ok_or_else(missing)? as usize;
        let pipeline = Some(task.pipeline(number));
        let computed = task.computed[number].clone();
        let said = task.said(task.source.metadata_of(input)?);
        let note = job.note(number, create.path());
        let metadata = Metadata { pipeline, note, computed, ..said };
        let mut sink = create.create(staged.file(), task.schema(), &metadata, false)?;
        let points = sink.chunk_points();
        let encoders = ChunkEncoders::of_one(job, tiles, number, &*sink, create.likes_time());
        if let Some(extent) = FileExtent::of(job, &**create, &metadata)? {
            // What is listed of a record is its number, and stages may move it on its way here.
            let extent = Arc::new(extent);
            let look = encoders.looked_at_by(extent.clone());
            self.each_chunk(rank, points, |chunk| {
                encoder.encode(&look, &chunk)?;
                job.advance(0)
            })?;
            sink.arrange(&extent.told())?;
        }
        let given = self.each_chunk(rank, points, |chunk| {
            let (_, encoded) = encoder.encode(&encoders, &chunk)?;
            sink.append(encoded)?;
            job.advance(0)
        })?;
        Ok((given, sink.finish()?))
    }

    /// Calls `visit` with the records of the input of `rank` in chunks of so many; how many there
    /// were.
    fn each_chunk(
        &self,
        rank: usize,
        points: usize,
        mut visit: impl FnMut(OutputChunk) -> Result<()>,
    ) -> Result<u64> {
        let mut open = Open::new(0, points, &self.layout, false);
        let (mut given, mut full) = (0, Vec::new());
        self.each(rank, |entry: &RecordEntry, row| {
            given += u64::from(entry.count);
            open.take(entry, row, &mut full);
            full.drain(..).try_for_each(&mut visit)
        })?;
        open.rest().map_or(Ok(()), visit)?;
        Ok(given)
    }
}
