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
use crate::Result;
use crate::store::{PIECE, Pieces, Spill, SpillArea, StoredStretch};

/// A stored column while it grows, item after item.
struct Column {
    pieces: Arc<Pieces>,
    item: usize,
    open: Vec<u8>,
    stored: u64,
}

impl Column {
    fn new(area: &Arc<SpillArea>, name: &'static str, item: usize, items: u64) -> Result<Self> {
        let pieces = Arc::new(Pieces::new(area, name, item));
        pieces.reserve(items)?;
        Ok(Column { pieces, item, open: Vec::with_capacity(PIECE * item), stored: 0 })
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
    pub normals: Option<Arc<Pieces>>,
    pub figures: Option<Arc<Pieces>>,
    pub found: FoundValues,
}

/// What a first phase found, in the order of the tiles.
pub(crate) struct FoundValues {
    spill: Spill,
    stretches: Vec<StoredStretch>,
    open: Vec<u8>,
}

/// Found entries are handed to the spill in stretches of about this size.
const FOUND_AT_ONCE: usize = 1 << 18;

impl FoundValues {
    fn add(&mut self, entries: &[[u64; 2]]) -> Result<()> {
        for [a, b] in entries {
            self.open.extend_from_slice(&a.to_le_bytes());
            self.open.extend_from_slice(&b.to_le_bytes());
            if self.open.len() >= FOUND_AT_ONCE {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<()> {
        if !self.open.is_empty() {
            self.stretches.push(self.spill.store(&self.open)?);
            self.open.clear();
        }
        Ok(())
    }

    /// Calls `visit` with all entries, stretch after stretch.
    pub fn each(&self, visit: &mut dyn FnMut(&[[u64; 2]]) -> Result<()>) -> Result<()> {
        let (mut bytes, mut entries) = (Vec::new(), Vec::new());
        for stretch in &self.stretches {
            self.spill.load(stretch, &mut bytes)?;
            entries.clear();
            entries.extend(bytes.chunks_exact(16).map(|pair| {
                let (a, b) = pair.split_at(8);
                [a, b].map(|half| {
                    let mut word = [0; 8];
                    word.copy_from_slice(half);
                    u64::from_le_bytes(word)
                })
            }));
            visit(&entries)?;
        }
        Ok(())
    }
}

/// Cuts records into chunks of the outputs by their rank, and stores columns.
pub(crate) struct Cutter {
    states: Column,
    fates: Column,
    normals: Option<Column>,
    figures: Option<Column>,
    found: FoundValues,
    outputs: Vec<Open>,
    by_input: Vec<ByInput>,
    by_rank: Vec<ByRank>,
    counts: Counts,
}

/// What is written behind the last tile: by input, and in the order of the inputs.
pub(crate) type Lists = (Vec<ByInput>, Vec<ByRank>);

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
    /// A cutter for a scan of so many positions and records, into `outputs`, `by_input` where each
    /// input has its own, and `by_rank` where the input's order is wanted; the last two columns are
    /// stored if they are wanted.
    pub fn new(
        area: &Arc<SpillArea>,
        (positions, records): (u64, u64),
        (normals, figures): (bool, bool),
        (outputs, by_input, by_rank): (Vec<Open>, Vec<ByInput>, Vec<ByRank>),
    ) -> Result<Self> {
        use crate::store::{FATE_BYTES, FIGURE_BYTES, NORMAL_BYTES};
        let column = |name, item| Column::new(area, name, item, positions);
        Ok(Cutter {
            states: Column::new(area, "states", 1, records)?,
            fates: column("fates", FATE_BYTES)?,
            normals: normals.then(|| column("normals", NORMAL_BYTES)).transpose()?,
            figures: figures.then(|| column("figures", FIGURE_BYTES)).transpose()?,
            found: FoundValues {
                spill: Spill::new(area, "found"),
                stretches: Vec::new(),
                open: Vec::new(),
            },
            outputs,
            by_input,
            by_rank,
            counts: Counts::default(),
        })
    }

    /// The chunks that the next product completes.
    pub fn cut(&mut self, product: &Product) -> Result<Vec<OutputChunk>> {
        self.fates.add(&product.fates)?;
        if let Some(normals) = &mut self.normals {
            normals.add(&product.normals)?;
        }
        if let Some(figures) = &mut self.figures {
            figures.add(&product.figures)?;
        }
        self.found.add(&product.found)?;
        let (mut full, mut places) = (Vec::new(), &product.places[..]);
        for (n, entry) in product.entries.iter().enumerate() {
            self.states.repeat(entry.now.0, entry.count)?;
            self.counts.alive += if entry.now.is_alive() { u64::from(entry.count) } else { 0 };
            self.counts.written += if entry.now.is_written() { u64::from(entry.count) } else { 0 };
            let normal = product.entry_normals.as_ref().map(|normals| normals[n]);
            for output in &mut self.outputs {
                output.take(entry, normal, &mut full);
            }
            self.by_input.iter_mut().try_for_each(|lists| lists.take(entry, normal))?;
            if entry.was.is_written() && !places.is_empty() {
                let (now, later) = places.split_at(places.len().min(entry.count as usize));
                self.by_rank.iter_mut().try_for_each(|lists| lists.take(entry, now, normal))?;
                places = later;
            }
        }
        Ok(full)
    }

    /// The last chunks, the columns, the lists by input, and what was counted.
    pub fn finish(mut self) -> Result<(Vec<OutputChunk>, Stored, Lists, Counts)> {
        let columns = [Some(&mut self.states), Some(&mut self.fates)];
        let more = [self.normals.as_mut(), self.figures.as_mut()];
        columns.into_iter().chain(more).flatten().try_for_each(Column::flush)?;
        self.found.flush()?;
        let rest = self.outputs.iter_mut().filter_map(Open::rest).collect();
        self.counts.outputs = self.outputs.iter().map(|output| output.written).collect();
        let stored = Stored {
            states: self.states.pieces,
            fates: self.fates.pieces,
            normals: self.normals.map(|column| column.pieces),
            figures: self.figures.map(|column| column.pieces),
            found: self.found,
        };
        Ok((rest, stored, (self.by_input, self.by_rank), self.counts))
    }
}

#[cfg(test)]
mod tests;
