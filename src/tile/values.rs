//! Values of columns that a tile did not compute itself: dimensions of the records, and whatever
//! neighbours have that lie beyond the tile.
//!
//! A tile loads a column for all that it loads, so almost every neighbour's value is at hand. The
//! few neighbours that were searched for in the whole scan are looked up one by one: to load a rim
//! wide enough for all of them would cost more, as it would for their positions.

use std::sync::Arc;

use bytemuck::pod_read_unaligned;

use super::remote::FoundPosition;
use super::sieve::{ReadDimensions, RecordRun, Runs, Sieve};
use crate::budget::Bytes;
use crate::point::{ColumnKind, ColumnValue, Columns, PointBatch};
use crate::store::{Fetch, Pieces, Reader, SealedTiles, first_of_each};
use crate::{Error, Result};

/// Records that are read together.
const AT_ONCE: usize = 4096;

/// Reads dimensions of records as columns; one a thread.
#[derive(Debug)]
pub(super) struct DimensionReader {
    read: Arc<ReadDimensions>,
    fetch: Fetch,
    batch: PointBatch,
    values: Vec<u8>,
}

impl DimensionReader {
    pub(super) fn new(read: &Arc<ReadDimensions>, at_once: usize) -> Self {
        let batch = PointBatch::new(read.schema.clone(), at_once);
        DimensionReader { read: read.clone(), fetch: Fetch::default(), batch, values: Vec::new() }
    }

    /// Gives `columns` the values of the records with these numbers, which ascend.
    fn read(&mut self, tiles: &SealedTiles, numbers: &[u64], columns: &mut Columns) -> Result<()> {
        let mut done = 0;
        for numbers in numbers.chunks(AT_ONCE) {
            self.batch.clear();
            tiles.fetch(numbers, &mut self.fetch, &mut self.batch)?;
            for (column, dimension) in &self.read.dimensions {
                let world = |record| dimension.world(record, self.read.schema.endian);
                self.values.clear();
                self.values.extend(self.batch.iter().flat_map(|r| world(r).to_ne_bytes()));
                columns.append(*column, done, std::iter::once(&self.values[..]));
            }
            done += numbers.len();
        }
        Ok(())
    }
}

/// Fills the columns of tiles that are dimensions of their records.
#[derive(Debug)]
pub(super) struct DimensionColumns {
    reader: DimensionReader,
    /// For each position of the tile, the record that stands for all of its records.
    pub(super) numbers: Vec<u64>,
}

impl DimensionColumns {
    pub(super) fn new(read: &Arc<ReadDimensions>) -> Self {
        DimensionColumns { reader: DimensionReader::new(read, AT_ONCE), numbers: Vec::new() }
    }

    /// The columns that it fills.
    pub(super) fn kinds(&self) -> Vec<ColumnKind> {
        self.reader.read.dimensions.iter().map(|(column, _)| *column).collect()
    }

    /// Fills them for the positions whose `numbers` are known.
    pub(super) fn fill(&mut self, tiles: &SealedTiles, columns: &mut Columns) -> Result<()> {
        self.reader.read(tiles, &self.numbers, columns)
    }

    /// Bytes that it holds for records of `stride` bytes, those for each position aside.
    pub(super) fn bytes(stride: usize) -> Bytes {
        let values = Bytes::of(AT_ONCE as u64, size_of::<f64>());
        Bytes::of(AT_ONCE as u64, stride) + Fetch::bytes(AT_ONCE as u64, stride) + values
    }
}

/// The values of one column at neighbours that lie beyond a tile.
pub(super) struct ValuesBeyond {
    column: ColumnKind,
    /// None if the tile is all there is.
    scan: Option<(Arc<SealedTiles>, Sieve)>,
    /// Where the value of one neighbour is found and put.
    lookup: ValueLookup,
}

/// What looking up values one by one keeps from one to the next.
#[derive(Default)]
struct ValueLookup {
    reader: Reader,
    runs: Runs,
    dimensions: Option<DimensionReader>,
    columns: Columns,
    buffer: Vec<u8>,
    /// The value looked up last.
    bytes: Vec<u8>,
}

impl ValuesBeyond {
    pub(super) fn new(column: ColumnKind, scan: Option<(Arc<SealedTiles>, Sieve)>) -> Self {
        ValuesBeyond { column, scan, lookup: ValueLookup::default() }
    }

    /// Appends the value of each of `found` to `values`.
    pub(super) fn read<T: ColumnValue>(
        &mut self,
        found: &[FoundPosition],
        values: &mut Vec<T>,
    ) -> Result<()> {
        let ValuesBeyond { column, scan, lookup } = self;
        let Some((tiles, sieve)) = scan else {
            return Err(Error::internal("a neighbour lies beyond a tile that is all there is"));
        };
        let stored = sieve.columns.iter().find(|(kind, _)| kind == column);
        for found in found {
            match stored {
                Some((_, pieces)) => lookup.stored(tiles, pieces, found)?,
                None => lookup.of_record(tiles, sieve, *column, found)?,
            }
            if lookup.bytes.len() != size_of::<T>() {
                return Err(Error::internal("a neighbour's value is of another type"));
            }
            values.push(pod_read_unaligned(&lookup.bytes));
        }
        Ok(())
    }
}

impl ValueLookup {
    fn stored(
        &mut self,
        tiles: &SealedTiles,
        pieces: &Pieces,
        found: &FoundPosition,
    ) -> Result<()> {
        let number = tiles.block(found.block).first_position + u64::from(found.index);
        pieces.collect(number, 1, &mut self.buffer, &mut self.bytes)
    }

    fn of_record(
        &mut self,
        tiles: &SealedTiles,
        sieve: &Sieve,
        column: ColumnKind,
        found: &FoundPosition,
    ) -> Result<()> {
        let ValueLookup { reader, runs, dimensions, columns, bytes, .. } = self;
        let undeclared = || Error::internal("a stage asks for a column that nobody stored");
        let read = sieve.dimensions.as_ref().ok_or_else(undeclared)?;
        let (_, copies) = tiles.read(found.block, reader)?;
        let index = found.index as usize;
        let mut number = first_of_each(tiles.block(found.block).first_record, copies).nth(index);
        if sieve.is_fine(tiles) {
            runs.read(tiles, sieve, found.block, copies)?;
            number = RecordRun::first_of(runs.of(index), sieve).map(|run| run.number).or(number);
        }
        let unknown = || Error::internal("a neighbour is no position of its block");
        let number = number.ok_or_else(unknown)?;
        columns.declare(&[column]);
        columns.clear_values();
        let dimensions = dimensions.get_or_insert_with(|| DimensionReader::new(read, 1));
        dimensions.read(tiles, &[number], columns)?;
        bytes.clear();
        bytes.extend_from_slice(columns.bytes_of(column).unwrap_or_default());
        Ok(())
    }
}
