//! Points side by side, as their records.

use std::sync::Arc;

use super::columns::Columns;
use super::schema::Schema;
use crate::{Error, Result};

/// Up to `capacity` records of one schema, refilled rather than rebuilt.
///
/// A record is the file's own bytes, `schema.stride` long. What the mill computed for a point and a
/// writer may ask for travels beside the records.
///
/// ```
/// use std::sync::Arc;
///
/// use pointmill::point::{Dimension, Endian, Layout, PointBatch, Scalar, Schema};
///
/// let dimensions = vec![Dimension::new("Height", Scalar::F32, 0)];
/// let layout = Layout::plain("TOY");
/// let schema = Arc::new(Schema { layout, endian: Endian::Little, stride: 4, dimensions });
/// let mut batch = PointBatch::new(schema.clone(), 100);
/// batch.extend([1.5f32, 8.0, 2.5].map(f32::to_le_bytes).as_flattened());
///
/// let height = schema.find("Height").expect("it is there");
/// batch.retain(|_, record| height.world(record, schema.endian) < 5.0);
/// assert_eq!(batch.len(), 2);
/// ```
#[derive(Debug, Clone)]
pub struct PointBatch {
    schema: Arc<Schema>,
    records: Vec<u8>,
    capacity: usize,
    /// Number of the source (file, or scan within a file) that the records came from. No decision
    /// reads it.
    pub source: u32,
    /// Columns that stages computed and the output writes: a value for each record.
    pub columns: Columns,
    /// For each record its number when they were numbered, if somebody asks which are left.
    numbers: Option<Vec<u32>>,
    /// For each record its number in the input, if a stage reads it.
    in_input: Option<Vec<u64>>,
}

impl PointBatch {
    /// An empty batch that takes up to `capacity` records; allocates them at once.
    pub fn new(schema: Arc<Schema>, capacity: usize) -> Self {
        let records = Vec::with_capacity(capacity * schema.stride);
        let columns = Columns::default();
        PointBatch { schema, records, capacity, source: 0, columns, numbers: None, in_input: None }
    }

    /// What the records hold.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    /// Has the batch say that its records are of `schema`, whose fields are at the same bytes.
    pub(crate) fn relabel(&mut self, schema: &Arc<Schema>) {
        if !Arc::ptr_eq(&self.schema, schema) {
            self.schema = schema.clone();
        }
    }

    /// How many records it takes.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// How many records it holds.
    pub fn len(&self) -> usize {
        self.records.len() / self.schema.stride
    }

    /// True if it holds none.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// All records, one after the other.
    pub fn records(&self) -> &[u8] {
        &self.records
    }

    /// All records, to change in place.
    pub fn records_mut(&mut self) -> &mut [u8] {
        &mut self.records
    }

    /// The records one by one, each `stride` bytes.
    pub fn iter(&self) -> std::slice::ChunksExact<'_, u8> {
        self.records.chunks_exact(self.schema.stride)
    }

    /// Forgets the records and what was computed for them; keeps the memory.
    pub fn clear(&mut self) {
        self.records.clear();
        self.columns = Columns::default();
        self.numbers = None;
        self.in_input = None;
    }

    /// Makes the batch hold exactly `len ≤ capacity` records and returns their bytes for the
    /// caller to fill; what they hold until then is unspecified.
    pub fn refill(&mut self, len: usize) -> &mut [u8] {
        assert!(len <= self.capacity, "a batch is refilled within its capacity");
        self.columns = Columns::default();
        self.numbers = None;
        self.in_input = None;
        self.records.resize(len * self.schema.stride, 0);
        &mut self.records
    }

    /// Makes room for `more` records behind the first `len` and returns their bytes to fill.
    pub fn refill_after(&mut self, len: usize, more: usize) -> &mut [u8] {
        assert!(len + more <= self.capacity, "a batch is refilled within its capacity");
        self.records.resize((len + more) * self.schema.stride, 0);
        &mut self.records[len * self.schema.stride..]
    }

    /// The number of each record in the input, from 0 over all inputs in their order; for stages
    /// that say that they [read them](crate::stage::Needs::reads_record_numbers), None for others.
    pub fn record_numbers(&self) -> Option<&[u64]> {
        self.in_input.as_deref()
    }

    /// Tells that the records follow each other in the input from number `first` on.
    pub(crate) fn number_in_input(&mut self, first: u64) {
        self.in_input = Some((first..).take(self.len()).collect());
    }

    /// Numbers the records from 0: [`retain`](PointBatch::retain) then tells which are left.
    pub(crate) fn number_records(&mut self) {
        self.numbers = Some((0..self.len() as u32).collect());
    }

    /// The numbers of the records that are left.
    pub(crate) fn numbers(&self) -> Option<&[u32]> {
        self.numbers.as_deref()
    }

    /// Shortens the batch to its first `len` records.
    pub fn truncate(&mut self, len: usize) {
        self.records.truncate(len * self.schema.stride);
        self.columns.truncate(len);
        if let Some(numbers) = &mut self.numbers {
            numbers.truncate(len);
        }
        if let Some(numbers) = &mut self.in_input {
            numbers.truncate(len);
        }
    }

    /// Appends records (a whole number of strides).
    pub fn extend(&mut self, records: &[u8]) {
        debug_assert_eq!(records.len() % self.schema.stride, 0);
        self.records.extend_from_slice(records);
    }

    /// Lets `change` work on the records that are `chosen`, a flag for each; the others stay as
    /// they are, and where they are among those that are left.
    pub(crate) fn change_some(
        &mut self,
        chosen: &[bool],
        change: impl FnOnce(&mut PointBatch) -> Result<()>,
    ) -> Result<()> {
        if chosen.iter().all(|is_chosen| *is_chosen) {
            return change(self);
        }
        let mut some = self.clone();
        some.retain(|i, _| chosen[i]);
        let from: Vec<usize> = (0..chosen.len()).filter(|&i| chosen[i]).collect();
        some.number_records();
        change(&mut some)?;
        let left = some.numbers.take().filter(|numbers| numbers.len() == some.len());
        let left = left.ok_or_else(|| {
            Error::internal("a stage that streams removes records other than by `retain`")
        })?;
        let stride = self.schema.stride;
        let mut stays: Vec<bool> = chosen.iter().map(|is_chosen| !is_chosen).collect();
        for (&number, record) in left.iter().zip(some.records.chunks_exact(stride)) {
            let at = from[number as usize];
            self.records[at * stride..(at + 1) * stride].copy_from_slice(record);
            stays[at] = true;
        }
        if stays.contains(&false) {
            self.retain(|i, _| stays[i]);
        }
        Ok(())
    }

    /// Keeps the records for which `keep(index, record)` holds, in order.
    pub fn retain(&mut self, mut keep: impl FnMut(usize, &[u8]) -> bool) {
        let stride = self.schema.stride;
        let mut kept = 0;
        for i in 0..self.len() {
            if keep(i, &self.records[i * stride..(i + 1) * stride]) {
                if kept < i {
                    self.records.copy_within(i * stride..(i + 1) * stride, kept * stride);
                    self.columns.copy(i, kept);
                    if let Some(numbers) = &mut self.numbers {
                        numbers[kept] = numbers[i];
                    }
                    if let Some(numbers) = &mut self.in_input {
                        numbers[kept] = numbers[i];
                    }
                }
                kept += 1;
            }
        }
        self.truncate(kept);
    }
}
