//! A graph with other ends: records of a program for its sources, and sinks that write the same to
//! where nobody looks.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::Path;
use std::sync::{Arc, Mutex};

use crate::Result;
use crate::engine::scratch::Scratch;
use crate::graph::{Graph, GraphStage};
use crate::host::lock;
use crate::io::ends::CountedSink;
use crate::memory::Records;
use crate::point::{Metadata, Schema, Units};
use crate::stage::{
    ChunkSize, CreateSink, Encode, EncodeTriangles, Encoded, Extent, Lattice, Order, PointsAhead,
    Role, Sink, SinkSummary, Source, Triangulation,
};

/// What each sink was given, by its number among the sinks.
pub(super) type WrittenFiles = Arc<Mutex<BTreeMap<usize, SinkSummary>>>;

/// The same graph that takes `records` instead of what its sources give.
pub(super) fn on_records(graph: Graph, records: Records) -> Graph {
    let mut graph = graph.without_merges();
    let is_source = |stage: &GraphStage| matches!(stage.role, Role::Source(_));
    let sources: Vec<bool> = graph.stages.iter().map(is_source).collect();
    let first = sources.iter().position(|is_source| *is_source);
    let is_further = |n: usize| sources[n] && Some(n) != first;
    // Without the further sources, whose points are in the records.
    let number = |n: usize| n - (0..n).filter(|before| is_further(*before)).count();
    for stage in &mut graph.stages {
        stage.from.retain(|from| !is_further(*from));
        stage.from.iter_mut().for_each(|from| *from = number(*from));
    }
    if let Some(source) = first.and_then(|first| graph.stages.get_mut(first)) {
        source.role = Role::Source(Box::new(records));
    }
    let kept = (0..sources.len()).map(|n| !is_further(n)).zip(graph.stages);
    let stages = kept.filter(|(is_kept, _)| *is_kept).map(|(_, stage)| stage).collect();
    graph.stages = stages;
    graph
}

/// The same graph, tried on a `share` of the scan: its sinks write files in `scratch`, and enter in
/// `written` how much that was.
pub(super) fn rehearsed(
    mut graph: Graph,
    share: f64,
    source: &dyn Source,
    scratch: &Arc<Scratch>,
    written: &WrittenFiles,
) -> Result<Graph> {
    let (mut number, inputs) = (0, &source.inputs());
    let mut rehearse = |role: Role| {
        Ok(match role {
            Role::Sink(sink) => {
                let of_one = match sink.split(source.schema(), &source.metadata().units)? {
                    Some(split) => Some(sink.of_split([0, 0], &split)?),
                    None => sink.each_input(inputs)?.and_then(|each| each.into_iter().next()),
                };
                number += 1;
                let (scratch, written) = (scratch.clone(), written.clone());
                let sink = RehearsedSink { sink, of_one, number, scratch, written };
                Role::Sink(Box::new(sink))
            }
            Role::TileOp(mut op) => {
                op.for_share(share);
                Role::TileOp(op)
            }
            Role::ScanOp(mut op) => {
                op.for_share(share);
                Role::ScanOp(op)
            }
            Role::RoundOp(mut op) => {
                op.for_share(share);
                Role::RoundOp(op)
            }
            other => other,
        })
    };
    let stages = std::mem::take(&mut graph.stages).into_iter();
    let stages = stages.map(|stage| Ok(GraphStage { role: rehearse(stage.role)?, ..stage }));
    graph.stages = stages.collect::<Result<_>>()?;
    Ok(graph)
}

/// A sink that writes what another would into a scratch file, and enters how much that was. Where
/// each input has an output or one is split, it writes one for all.
struct RehearsedSink {
    sink: Box<dyn CreateSink>,
    /// That of the first input or of a split, where there is one.
    of_one: Option<Box<dyn CreateSink>>,
    number: usize,
    scratch: Arc<Scratch>,
    written: WrittenFiles,
}

impl RehearsedSink {
    fn one(&self) -> &dyn CreateSink {
        self.of_one.as_deref().unwrap_or(&*self.sink)
    }
}

impl CreateSink for RehearsedSink {
    fn path(&self) -> &Path {
        self.sink.path()
    }

    fn extension(&self) -> Option<&OsStr> {
        self.sink.extension()
    }

    fn is_file(&self) -> bool {
        false
    }

    fn settled(&self, ahead: &PointsAhead<'_>) -> Result<Option<Box<dyn CreateSink>>> {
        let Some(sink) = self.sink.settled(ahead)? else { return Ok(None) };
        let of_one = self.of_one.as_ref().map(|one| one.settled(ahead));
        let of_one = of_one.transpose()?.flatten();
        let (scratch, written) = (self.scratch.clone(), self.written.clone());
        Ok(Some(Box::new(RehearsedSink { sink, of_one, number: self.number, scratch, written })))
    }

    fn order(&self) -> Order {
        if self.sink.is_folder() { Order::Canonical } else { self.sink.order() }
    }

    fn triangulation(&self, units: &Units) -> Result<Option<Triangulation>> {
        if self.sink.is_file() { self.sink.triangulation(units) } else { Ok(None) }
    }

    fn likes_time(&self) -> bool {
        self.one().likes_time()
    }

    fn computed(&self) -> &[String] {
        self.sink.computed()
    }

    fn unread(&self) -> &[String] {
        self.sink.unread()
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        self.sink.chunk(schema, metadata)
    }

    fn arranged(
        &self,
        lattice: &Lattice,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Option<u64>> {
        self.sink.arranged(lattice, schema, metadata)
    }

    fn create(
        &self,
        _: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>> {
        let sink: Box<dyn Sink> = match self.sink.is_file() {
            true => self.one().create(&self.scratch.path("output")?, schema, metadata, whole)?,
            // What a program takes is not for a trial.
            false => Box::new(CountedSink::new(self.sink.chunk(schema, metadata)?)),
        };
        let (number, written) = (self.number, self.written.clone());
        Ok(Box::new(Rehearsed { sink, number, written }))
    }
}

/// An open sink of a rehearsal.
struct Rehearsed {
    sink: Box<dyn Sink>,
    number: usize,
    written: WrittenFiles,
}

impl Sink for Rehearsed {
    fn chunk_points(&self) -> usize {
        self.sink.chunk_points()
    }

    fn chunk_bytes(&self) -> u64 {
        self.sink.chunk_bytes()
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.sink.encoder()
    }

    fn arrange(&mut self, extent: &Extent) -> Result<()> {
        self.sink.arrange(extent)
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.sink.append(chunk)
    }

    fn triangles(&mut self) -> Result<Arc<dyn EncodeTriangles>> {
        self.sink.triangles()
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        let summary = self.sink.finish()?;
        lock(&self.written).insert(self.number, summary.clone());
        Ok(summary)
    }
}
