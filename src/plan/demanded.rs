//! What a run depends on in its memory, as far as headers and stages tell.

use std::num::NonZeroUsize;
use std::sync::Arc;

use super::order::WriteOrder;
use super::passes::Passes;
use super::sorted::{Sorted, blame};
use crate::budget::Bytes;
use crate::engine::pass::{ColumnBytes, Op, Pass, standings};
use crate::engine::shares::{Arranging, Demands};
use crate::engine::{by_input, by_rank, by_split};
use crate::geom::lattice::Lattice;
use crate::graph::{MOST_THREADS, RunSettings};
use crate::host::process::{default_memory, processors};
use crate::point::{Metadata, Schema};
use crate::stage::{ChunkSize, CreateSink, OutputSplit, Source};
use crate::{Error, Result};

/// What a run depends on in its memory.
pub(super) fn demands(
    sorted: &Sorted,
    Passes { passes, computed, .. }: &Passes,
    (source, schema): (&dyn Source, &Arc<Schema>),
    (order, lattice): (&WriteOrder, &Option<Lattice>),
    files: FilesOfOutputs<'_>,
    settings: &RunSettings,
) -> Result<Demands> {
    let threads = threads(settings)?;
    let limit = settings.memory.unwrap_or_else(default_memory);
    let metadata: Vec<Metadata> = computed
        .iter()
        .map(|computed| Metadata { computed: computed.clone(), ..source.metadata().clone() })
        .collect();
    let chunks = chunks(sorted, &metadata, schema)?;
    let columns = passes.iter().map(|pass| pass.column_bytes(computed));
    let ranked =
        order.in_input_order.iter().filter(|ranked| **ranked && order.mills).count() as u64;
    let at_once = |sink: usize| files.at_once(sink, source.points()).min(threads as u64);
    let arranging = lattice.as_ref().map(|on| arranging(sorted, &metadata, (schema, on), at_once));
    Ok(Demands {
        arranging: arranging.transpose()?.unwrap_or_default(),
        lists: by_rank::lists_bytes(source.points()) * ranked + lists_bytes(files),
        ranked: ranked > 0,
        mills: order.mills,
        filters: passes.iter().any(Pass::streams),
        standings: standings(passes),
        columns: columns.fold(ColumnBytes::default(), ColumnBytes::larger),
        passes: passes.iter().map(|pass| pass.needs(&sorted.ops).collect()).collect(),
        run_most: settings.tile_points.map(|points| (points.get() as u64).saturating_mul(4)),
        gathers: sorted.ops.iter().any(|stage| matches!(stage.op, Op::Scan(_))),
        is_plain: is_plain(sorted, (source, schema))?,
        // What chooses in rounds reaches as far around a tile as its rounds come to ask.
        has_cells: sorted
            .ops
            .iter()
            .any(|stage| stage.op.tile().needs().cells || matches!(stage.op, Op::Round(_))),
        ..Demands::of(source, &chunks, limit, threads)
    })
}

/// The files of outputs that are several.
#[derive(Clone, Copy)]
pub(super) struct FilesOfOutputs<'a> {
    /// For each sink those that are one for each input.
    pub each: &'a [Vec<Box<dyn CreateSink>>],
    /// For each sink how it is split, if it is.
    pub splits: &'a [Option<OutputSplit>],
    /// The rank of each input.
    pub ranks: &'a [u32],
}

impl FilesOfOutputs<'_> {
    /// How many `sink` has at most, as far as that is known of so many points.
    fn at_once(&self, sink: usize, points: u64) -> u64 {
        match (self.splits.get(sink), self.each.get(sink)) {
            (Some(Some(OutputSplit::Points(most))), _) => points.div_ceil((*most).max(1)).max(1),
            (Some(Some(_)), _) => points.max(1),
            (_, Some(each)) => each.len().max(1) as u64,
            _ => 1,
        }
    }
}

/// What open outputs hold that arrange points on `lattice`, where of the files of a sink so many
/// are open `at_once`.
fn arranging(
    sorted: &Sorted,
    metadata: &[Metadata],
    (schema, lattice): (&Arc<Schema>, &Lattice),
    at_once: impl Fn(usize) -> u64,
) -> Result<Arranging> {
    let mut arranging = Arranging::default();
    let sinks = sorted.sinks.iter().zip(&sorted.endings).zip(metadata);
    for (n, ((sink, written), metadata)) in sinks.enumerate() {
        let held = sink.arranged(lattice, schema, metadata);
        let held = Bytes(held.map_err(|error| blame(&**written, error))?.unwrap_or(0));
        let held = held * at_once(n);
        match sink.is_split() {
            true => arranging.of_split = held.max(arranging.of_split),
            false => arranging.milled += held,
        }
    }
    Ok(arranging)
}

/// True if an output has records of a known size.
fn is_plain(sorted: &Sorted, (source, schema): (&dyn Source, &Arc<Schema>)) -> Result<bool> {
    let sizes = sorted.sinks.iter().map(|sink| sink.disk_bytes(schema, source.metadata()));
    let sizes: Vec<[u64; 2]> = sizes.collect::<Result<_>>()?;
    Ok(sizes.iter().any(|[each, _]| *each > 0))
}

/// Bytes of the lists of outputs that are a file for each input, or that are split.
fn lists_bytes(FilesOfOutputs { each, splits, ranks }: FilesOfOutputs<'_>) -> Bytes {
    let folders = each.iter().filter(|each| !each.is_empty()).count() as u64;
    let split = splits.iter().flatten().count() as u64;
    by_input::lists_bytes(ranks.len()) * folders + by_split::lists_bytes() * split
}

/// Threads that work at once.
fn threads(settings: &RunSettings) -> Result<usize> {
    match settings.threads.map(NonZeroUsize::get) {
        Some(threads) if threads > MOST_THREADS => {
            let told = format!("a run has at most {MOST_THREADS} threads, not {threads}");
            Err(Error::pipeline(told).help("leave `run.threads` out: all processors work"))
        }
        Some(threads) => Ok(threads),
        None => Ok(processors().min(MOST_THREADS)),
    }
}

/// The chunks of all outputs.
fn chunks(sorted: &Sorted, metadata: &[Metadata], schema: &Arc<Schema>) -> Result<Vec<ChunkSize>> {
    let (mut chunks, mut wrong) = (Vec::new(), Vec::new());
    let sinks = sorted.sinks.iter().zip(&sorted.endings);
    for ((sink, written), metadata) in sinks.zip(metadata) {
        match sink.chunk(schema, metadata) {
            Ok(chunk) => chunks.push(chunk),
            Err(error) => wrong.push(blame(&**written, error)),
        }
    }
    Error::all(wrong).map(|()| chunks)
}
