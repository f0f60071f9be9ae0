//! A sink whose batches go to the program.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use crossbeam_channel::{Receiver, Sender, bounded};

use crate::point::{ColumnKind, Columns, ComputedDimension, Metadata, PointBatch, Schema};
use crate::stage::{ChunkSize, CreateSink, Encode, Encoded, Order, Sink, SinkSummary};
use crate::{Error, Result};

/// Records of a batch; the last may have fewer.
const CHUNK: usize = 1 << 14;
/// What reports and messages call it.
const CALLED: &str = "channel";

/// A sink that sends what it is given over a channel; see [`channel`].
#[derive(Debug)]
pub struct ChannelSink {
    sender: Mutex<Option<Sender<PointBatch>>>,
    columns: Vec<String>,
    order: Order,
}

/// The batches that a [`ChannelSink`] sends, in order: an iterator that ends with the run.
#[derive(Debug)]
pub struct Received(Receiver<PointBatch>);

/// A sink and what it sends: batches of up to 16,384 records as the source has them, and beside
/// them the columns with a number among `columns`, such as `NormalX`.
///
/// The channel holds `bound` batches (at least one) and the run waits while it is full. A run whose
/// receiver is gone ends as interrupted.
pub fn channel(bound: usize, columns: &[&str]) -> (ChannelSink, Received) {
    let (sender, receiver) = bounded(bound.max(1));
    let columns = columns.iter().map(|name| (*name).to_owned()).collect();
    let sink = ChannelSink { sender: Mutex::new(Some(sender)), columns, order: Order::default() };
    (sink, Received(receiver))
}

impl ChannelSink {
    /// The same with records in this order.
    #[must_use]
    pub fn in_order(self, order: Order) -> ChannelSink {
        ChannelSink { order, ..self }
    }
}

impl Iterator for Received {
    type Item = PointBatch;

    fn next(&mut self) -> Option<PointBatch> {
        self.0.recv().ok()
    }
}

impl CreateSink for ChannelSink {
    fn path(&self) -> &Path {
        Path::new(CALLED)
    }

    fn is_file(&self) -> bool {
        false
    }

    fn order(&self) -> Order {
        self.order
    }

    fn computed(&self) -> &[String] {
        &self.columns
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        let row = schema.stride + columns(metadata).iter().map(ColumnKind::bytes).sum::<usize>();
        // Once as bytes, once as the batch that they become.
        Ok(ChunkSize { points: CHUNK, bytes: (2 * CHUNK * row) as u64 })
    }

    fn create(
        &self,
        _: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        _: bool,
    ) -> Result<Box<dyn Sink>> {
        let sender = self.sender.lock().unwrap_or_else(PoisonError::into_inner).take();
        let sender = sender.ok_or_else(|| {
            Error::pipeline("this channel was written to before: each run needs one of its own")
        })?;
        let encoder = Arc::new(ChannelEncoder { columns: columns(metadata) });
        Ok(Box::new(OpenChannel { schema: schema.clone(), sender, encoder, points: 0 }))
    }
}

/// The columns of the computed dimensions that an output is to have, each once.
fn columns(metadata: &Metadata) -> Vec<ColumnKind> {
    let mut columns = Vec::new();
    for ComputedDimension { column, .. } in &metadata.computed {
        if !columns.contains(column) {
            columns.push(*column);
        }
    }
    columns
}

struct OpenChannel {
    schema: Arc<Schema>,
    sender: Sender<PointBatch>,
    encoder: Arc<ChannelEncoder>,
    points: u64,
}

struct ChannelEncoder {
    columns: Vec<ColumnKind>,
}

impl Encode for ChannelEncoder {
    /// The records, then each column.
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let mut bytes = batch.records().to_vec();
        for column in &self.columns {
            let missing = || Error::internal(format!("{} is not computed", column.name()));
            bytes.extend_from_slice(batch.columns.bytes_of(*column).ok_or_else(missing)?);
        }
        Ok(Encoded::new(bytes, batch.len() as u64))
    }
}

impl Sink for OpenChannel {
    fn chunk_points(&self) -> usize {
        CHUNK
    }

    fn chunk_bytes(&self) -> u64 {
        let columns = self.encoder.columns.iter().map(ColumnKind::bytes).sum::<usize>();
        (2 * CHUNK * (self.schema.stride + columns)) as u64
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.encoder.clone()
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        let points = chunk.points as usize;
        let mut batch = PointBatch::new(self.schema.clone(), points);
        let (records, mut rest) = chunk.bytes.split_at(points * self.schema.stride);
        batch.extend(records);
        let mut columns = Columns::default();
        columns.declare(&self.encoder.columns);
        for column in &self.encoder.columns {
            let (values, later) = rest.split_at(points * column.bytes());
            columns.append(*column, 0, std::iter::once(values));
            rest = later;
        }
        batch.columns = columns;
        self.points += chunk.points;
        self.sender.send(batch).map_err(|_| Error::interrupted())
    }

    fn finish(self: Box<Self>) -> Result<SinkSummary> {
        Ok(SinkSummary::new(self.points, 0))
    }
}
