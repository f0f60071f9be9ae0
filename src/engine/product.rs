//! What a tile leaves behind: what becomes of each record of its core, and the columns that later
//! passes read.
//!
//! A product is small against the tile that it comes from, so a thread can go on with its next tile
//! while products wait for their turn. Records of one position that share what becomes of them are
//! one entry, since a position may have millions of copies. The rim is not in it: another tile
//! decides about that.

use super::pass::Pass;
use super::row::RowLayout;
use super::survey::fate_code;
use crate::point::{ColumnKind, Mark};
use crate::store::{ASIDE, FATE_BYTES, Fetch, RecordState, SealedTiles, Tag};
use crate::tile::{Core, Fate, RecordRun, Tile};
use crate::{Error, Result};

/// Records of one position that follow one another and share what becomes of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RecordEntry {
    /// Number of the first.
    pub number: u64,
    /// How many.
    pub count: u32,
    /// What accompanies them.
    pub tag: Tag,
    /// Their state before the pass and behind it.
    pub was: RecordState,
    pub now: RecordState,
}

/// What a tile leaves behind.
#[derive(Debug, Default)]
pub(crate) struct Product {
    /// All records of the core, in canonical order.
    pub entries: Vec<RecordEntry>,
    /// A row for each entry, where sinks write columns.
    pub rows: Vec<u8>,
    /// Fates of the core's positions, as stored, and the columns that the pass stores.
    pub fates: Vec<u8>,
    pub columns: Vec<Vec<u8>>,
    /// Of every record that is written before or behind the pass, in order, where it is stored and
    /// its place in the input; empty if nobody asks for the input's order.
    pub places: Vec<(u64, u64)>,
    /// What a first phase gathered.
    pub summary: Option<Vec<u8>>,
}

impl Product {
    /// Bytes of a product for each position of the core, columns and what a first phase gathers
    /// aside.
    pub const BYTES_PER_POINT: usize = size_of::<RecordEntry>() + FATE_BYTES;

    /// Bytes more where places in the input are looked up.
    pub const PLACE_BYTES: usize = 2 * size_of::<(u64, u64)>();

    /// What `tile` leaves behind, whose core has the records `core`, where entries have the rows of
    /// `layout`.
    pub fn of(tile: &Tile, core: &Core, pass: &Pass, layout: &RowLayout) -> Result<Self> {
        let records = tile.core.len();
        let mut product = Product {
            entries: Vec::with_capacity(records),
            rows: Vec::with_capacity(records * layout.bytes()),
            fates: Vec::with_capacity(records * FATE_BYTES),
            ..Product::default()
        };
        let columns = !pass.stores.is_empty() || layout.bytes() > 0;
        if let Some(first_records) = core.first_records()
            && !(columns || pass.decided != 0 || pass.mark.is_some())
        {
            product.enter_all(tile, first_records, pass.removes);
            return Ok(product);
        }
        let stored_columns = StoredColumn::all(&pass.stores, tile)?;
        let row_columns = StoredColumn::all(layout.kinds(), tile)?;
        product.columns = stored_columns.iter().map(|column| column.capacity(records)).collect();
        core.each(tile, |runs, stored| {
            let slot = runs.first().map_or(RecordRun::UNSEEN, |run| run.slot);
            let fate = match slot {
                RecordRun::UNSEEN => Fate::Kept,
                slot => tile.fates[slot as usize],
            };
            match (fate, stored) {
                (Fate::Kept, Some(code)) => product.fates.extend_from_slice(&code),
                (fate, _) => product.fates.extend_from_slice(&fate_code(fate)),
            }
            let at = (slot != RecordRun::UNSEEN).then_some(slot as usize);
            for (column, bytes) in stored_columns.iter().zip(&mut product.columns) {
                bytes.extend_from_slice(column.value(at));
            }
            let entries = product.entries.len();
            product.enter(runs, fate, pass);
            for _ in entries..product.entries.len() {
                row_columns.iter().for_each(|column| {
                    product.rows.extend_from_slice(column.value(at));
                });
            }
            Ok(())
        })?;
        Ok(product)
    }

    /// The entries of records that are written so far, with their numbers.
    pub fn written(&self) -> impl Iterator<Item = (usize, &RecordEntry)> + '_ {
        self.entries.iter().enumerate().filter(|(_, entry)| entry.now.is_written())
    }

    /// The row of entry `number`.
    pub fn row(&self, number: usize, layout: &RowLayout) -> &[u8] {
        &self.rows[number * layout.bytes()..(number + 1) * layout.bytes()]
    }

    /// Gives each of the [written](Product::written) records its state of `states`.
    pub fn replace(&mut self, states: &[RecordState], layout: &RowLayout) {
        let (mut entries, mut rows) = (Vec::with_capacity(self.entries.len()), Vec::new());
        let mut states = states.iter();
        for (n, entry) in self.entries.iter().enumerate() {
            let begin = entries.len();
            match entry.now.is_written() {
                false => entries.push(*entry),
                true => (0..entry.count).zip(&mut states).for_each(|(i, &now)| {
                    let number = entry.number + u64::from(i);
                    match entries.last_mut() {
                        Some(RecordEntry { count, now: before, .. }) if i > 0 && *before == now => {
                            *count += 1;
                        }
                        _ => entries.push(RecordEntry { number, count: 1, now, ..*entry }),
                    }
                }),
            }
            let row = self.row(n, layout);
            (begin..entries.len()).for_each(|_| rows.extend_from_slice(row));
        }
        (self.entries, self.rows) = (entries, rows);
    }

    /// Looks up [`places`](Product::places).
    pub fn find_places(&mut self, tiles: &SealedTiles, fetch: &mut Fetch) -> Result<()> {
        let mut numbers = Vec::new();
        for entry in self.entries.iter().filter(|entry| entry.was.is_written()) {
            numbers.extend(entry.number..entry.number + u64::from(entry.count));
        }
        tiles.places(&numbers, fetch, &mut self.places)
    }

    /// Positions of the tile's core.
    pub fn positions(&self) -> u64 {
        (self.fates.len() / FATE_BYTES) as u64
    }

    /// Enters the records of all positions of the core, which are alike to every stage and follow
    /// their first.
    fn enter_all(&mut self, tile: &Tile, first_records: &[u64], removes: bool) {
        let core = tile.core.clone();
        let each = first_records.iter().zip(&tile.copies[core.clone()]).zip(&tile.fates[core]);
        for ((&number, &count), &fate) in each {
            self.fates.extend_from_slice(&fate_code(fate));
            let kept = match fate {
                _ if !removes => count,
                Fate::Kept => count,
                Fate::KeptOnce => count.min(1),
                Fate::Removed | Fate::Represented { .. } => 0,
            };
            let entry = RecordEntry {
                number,
                count: kept,
                tag: Tag::default(),
                was: RecordState::ALIVE,
                now: RecordState::ALIVE,
            };
            if kept > 0 {
                self.entries.push(entry);
            }
            if count > kept {
                let (number, count) = (number + u64::from(kept), count - kept);
                self.entries.push(RecordEntry {
                    number,
                    count,
                    now: RecordState::REMOVED,
                    ..entry
                });
            }
        }
    }

    /// Enters the records of one position.
    fn enter(&mut self, runs: &[RecordRun], fate: Fate, pass: &Pass) {
        // How many of the records that the pass decides about are still to be kept.
        let mut keep = match fate {
            Fate::Kept => u32::MAX,
            Fate::KeptOnce => 1,
            Fate::Removed | Fate::Represented { .. } => 0,
        };
        for run in runs {
            let was = match run.tag.selections() & ASIDE {
                0 => run.state,
                _ if run.state.is_alive() => RecordState::ASIDE,
                _ => run.state,
            };
            let RecordRun { mut number, count, tag, .. } = *run;
            let mut push = |count: u32, now: RecordState| {
                if count > 0 {
                    self.entries.push(RecordEntry { number, count, tag, was, now });
                    number += u64::from(count);
                }
            };
            if !pass.removes || run.slot == RecordRun::UNSEEN || !run.is_in(pass.decided) {
                push(count, was);
                continue;
            }
            let kept = count.min(keep);
            if keep != u32::MAX {
                keep -= kept;
            }
            push(kept, marked(pass.mark, true, was));
            push(count - kept, marked(pass.mark, false, was));
        }
    }
}

/// The values of a column of a tile, as bytes.
struct StoredColumn<'a> {
    values: &'a [u8],
    bytes: usize,
    unknown: Vec<u8>,
}

impl<'a> StoredColumn<'a> {
    fn all(kinds: &[ColumnKind], tile: &'a Tile) -> Result<Vec<Self>> {
        let of = |kind: &ColumnKind| {
            let missing = || {
                Error::internal(format!(
                    "a stage took the column {} and did not put it back",
                    kind.name()
                ))
            };
            let values = tile.columns.bytes_of(*kind);
            let whole = values.filter(|v| v.len() == tile.positions.len() * kind.bytes());
            let values = whole.ok_or_else(missing)?;
            Ok(StoredColumn { values, bytes: kind.bytes(), unknown: kind.unknown() })
        };
        kinds.iter().map(of).collect()
    }

    /// The value of the position with an index; of one that is not seen if there is none.
    fn value(&self, at: Option<usize>) -> &[u8] {
        at.map_or(&self.unknown, |i| &self.values[i * self.bytes..(i + 1) * self.bytes])
    }

    fn capacity(&self, values: usize) -> Vec<u8> {
        Vec::with_capacity(values * self.bytes)
    }
}

/// The state of a record that was in `state` and is kept, or would be removed.
fn marked(mark: Option<Mark>, kept: bool, state: RecordState) -> RecordState {
    let Some(mark) = mark else { return if kept { state } else { RecordState::REMOVED } };
    let state = if kept { state } else { state.aside() };
    mark.edit(kept).map_or(state, |edit| state.edited(edit))
}
