//! What tiles leave behind becomes chunks of the outputs, cut by rank, and stored columns.
//!
//! Products arrive in the order of the tiles, which is that of the positions. So a column that is
//! stored for later passes is only appended to, item after item, and is found by the rank of a
//! position afterwards; no pass needs an index of its own. One thread at a time does this work,
//! which is copying: what takes long, fetching and encoding, is left to all threads.

use std::sync::Arc;

use super::by_input::ByInput;
use super::by_rank::ByRank;
use super::chunk::{Open, OutputChunk};
use super::product::Product;
use crate::point::ColumnKind;
use crate::store::{FATE_BYTES, PIECE, Pieces, Spill, SpillArea, StoredStretch};
use crate::{Error, Result};

/// A stored column while it grows, item after item.
struct GrowingColumn {
    pieces: Arc<Pieces>,
    item: usize,
    open: Vec<u8>,
    stored: u64,
}

impl GrowingColumn {
    fn new(area: &Arc<SpillArea>, name: &'static str, item: usize, items: u64) -> Result<Self> {
        let pieces = Arc::new(Pieces::new(area, name, item));
        pieces.reserve(items)?;
        Ok(GrowingColumn { pieces, item, open: Vec::with_capacity(PIECE * item), stored: 0 })
    }

    fn add(&mut self, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let room = PIECE * self.item - self.open.len();
            let (now, later) = bytes.split_at(room.min(bytes.len()));
            self.open.extend_from_slice(now);
            bytes = later;
            if self.open.len() == PIECE * self.item {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Adds `count` items of one byte.
    fn repeat(&mut self, byte: u8, mut count: u32) -> Result<()> {
        if count == 1 && self.open.len() + 1 < PIECE {
            self.open.push(byte);
            return Ok(());
        }
        while count > 0 {
            let now = (PIECE - self.open.len()).min(count as usize);
            self.open.resize(self.open.len() + now, byte);
            count -= now as u32;
            if self.open.len() == PIECE {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<()> {
        if !self.open.is_empty() {
            self.pieces.put(self.stored, &self.open)?;
            self.stored += (self.open.len() / self.item) as u64;
            self.open.clear();
        }
        Ok(())
    }
}

/// What a pass stores.
pub(crate) struct Stored {
    /// See [`Sieve`](crate::tile::Sieve).
    pub states: Arc<Pieces>,
    pub fates: Arc<Pieces>,
    pub columns: Vec<(ColumnKind, Arc<Pieces>)>,
    pub gathered: StoredGathered,
}

/// What a first phase gathered of each tile, in the order of the tiles.
pub(crate) struct StoredGathered {
    spill: Spill,
    stretches: Vec<StoredStretch>,
    /// Summaries, each behind its length.
    open: Vec<u8>,
}

/// Summaries are handed to the spill in stretches of about this size.
const GATHERED_AT_ONCE: usize = 1 << 18;
/// Bytes that say how long a summary is.
const LENGTH: usize = size_of::<u64>();

impl StoredGathered {
    fn new(area: &Arc<SpillArea>) -> Self {
        let spill = Spill::new(area, "gathered");
        StoredGathered { spill, stretches: Vec::new(), open: Vec::new() }
    }

    fn add(&mut self, summary: &[u8]) -> Result<()> {
        self.open.extend_from_slice(&(summary.len() as u64).to_le_bytes());
        self.open.extend_from_slice(summary);
        if self.open.len() >= GATHERED_AT_ONCE { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        if !self.open.is_empty() {
            self.stretches.push(self.spill.store(&self.open)?);
            self.open.clear();
        }
        Ok(())
    }

    /// Calls `visit` with every summary.
    pub fn each(&self, visit: &mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let mut bytes = Vec::new();
        for stretch in &self.stretches {
            self.spill.load(stretch, &mut bytes)?;
            let mut rest = &bytes[..];
            while let Some((length, behind)) = rest.split_first_chunk::<LENGTH>() {
                let length = u64::from_le_bytes(*length) as usize;
                let cut_off = || Error::internal("what a first phase gathered is cut off");
                let (summary, later) = behind.split_at_checked(length).ok_or_else(cut_off)?;
                visit(summary)?;
                rest = later;
            }
        }
        Ok(())
    }
}

/// What a pass stores, while it grows.
pub(crate) struct GrowingOutcome {
    states: GrowingColumn,
    fates: GrowingColumn,
    columns: Vec<(ColumnKind, GrowingColumn)>,
    gathered: StoredGathered,
}

impl GrowingOutcome {
    /// Nothing yet, of a scan of so many positions and records: the columns `stores`, and what is
    /// stored in every pass.
    pub fn new(
        area: &Arc<SpillArea>,
        positions: u64,
        records: u64,
        stores: &[ColumnKind],
    ) -> Result<Self> {
        let column = |name, item| GrowingColumn::new(area, name, item, positions);
        let columns = stores.iter().map(|kind| Ok((*kind, column("columns", kind.bytes())?)));
        Ok(GrowingOutcome {
            states: GrowingColumn::new(area, "states", 1, records)?,
            fates: column("fates", FATE_BYTES)?,
            columns: columns.collect::<Result<_>>()?,
            gathered: StoredGathered::new(area),
        })
    }

    /// Adds what a product has for every position.
    fn add(&mut self, product: &Product) -> Result<()> {
        self.fates.add(&product.fates)?;
        for ((_, column), bytes) in self.columns.iter_mut().zip(&product.columns) {
            column.add(bytes)?;
        }
        product.summary.iter().try_for_each(|summary| self.gathered.add(summary))
    }

    fn finish(mut self) -> Result<Stored> {
        let columns = self.columns.iter_mut().map(|(_, column)| column);
        let all = [&mut self.states, &mut self.fates].into_iter().chain(columns);
        all.into_iter().try_for_each(GrowingColumn::flush)?;
        self.gathered.flush()?;
        Ok(Stored {
            states: self.states.pieces,
            fates: self.fates.pieces,
            columns: self.columns.into_iter().map(|(kind, c)| (kind, c.pieces)).collect(),
            gathered: self.gathered,
        })
    }
}

/// Cuts records into chunks of the outputs by their rank, and stores columns.
pub(crate) struct Cutter {
    growing: GrowingOutcome,
    /// Bytes of a row.
    row: usize,
    outputs: Vec<Open>,
    lists: Lists,
    counts: Counts,
}

/// What goes to outputs that are written behind the last tile.
#[derive(Default)]
pub(crate) struct Lists {
    /// Those that are one for each input.
    pub by_input: Vec<ByInput>,
    /// Those in the order of the inputs.
    pub by_rank: Vec<ByRank>,
}

/// Records behind a pass.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Those that later passes look at.
    pub alive: u64,
    /// Those that are not removed.
    pub written: u64,
    /// Those that each output of the pass was given.
    pub outputs: Vec<u64>,
}

impl Cutter {
    /// A cutter into `growing`, `outputs` and `lists`, of entries that have rows of so many bytes.
    pub fn new(growing: GrowingOutcome, row: usize, outputs: Vec<Open>, lists: Lists) -> Self {
        Cutter { growing, row, outputs, lists, counts: Counts::default() }
    }

    /// The chunks that the next product completes.
    pub fn cut(&mut self, product: &Product) -> Result<Vec<OutputChunk>> {
        self.growing.add(product)?;
        let Lists { by_input, by_rank } = &mut self.lists;
        let (mut full, mut places) = (Vec::new(), &product.places[..]);
        for (n, entry) in product.entries.iter().enumerate() {
            self.growing.states.repeat(entry.now.0, entry.count)?;
            self.counts.alive += if entry.now.is_alive() { u64::from(entry.count) } else { 0 };
            self.counts.written += if entry.now.is_written() { u64::from(entry.count) } else { 0 };
            let row = &product.rows[n * self.row..(n + 1) * self.row];
            for output in &mut self.outputs {
                output.take(entry, row, &mut full);
            }
            by_input.iter_mut().try_for_each(|lists| lists.take(entry, row))?;
            if entry.was.is_written() && !places.is_empty() {
                let (now, later) = places.split_at(places.len().min(entry.count as usize));
                by_rank.iter_mut().try_for_each(|lists| lists.take(entry, now, row))?;
                places = later;
            }
        }
        Ok(full)
    }

    /// The last chunks, the columns, the lists, and what was counted.
    pub fn finish(mut self) -> Result<(Vec<OutputChunk>, Stored, Lists, Counts)> {
        let rest = self.outputs.iter_mut().filter_map(Open::rest).collect();
        self.counts.outputs = self.outputs.iter().map(|output| output.written).collect();
        Ok((rest, self.growing.finish()?, self.lists, self.counts))
    }
}

#[cfg(test)]
mod tests;
