//! The records of outputs that are one for each input, sorted by input while tiles leave their
//! products.
//!
//! All inputs are one scan, so that neighbours are found across them, and a tile has records of
//! several. Each entry goes to the list of its input: a few kibibytes are in memory and the rest is
//! in the spill, so that thousands of inputs cost no more than a few. What is listed is where a
//! record is stored and not the record, which is fetched once, when its output is written.

use std::sync::Arc;

use super::product::RecordEntry;
use super::row::RowLayout;
use crate::budget::Bytes;
use crate::stage::Input;
use crate::store::{RecordState, Spill, SpillArea, StoredStretch, Tag};
use crate::{Error, Result};

/// Bytes that all lists of records hold in memory before they go to the spill.
pub const LISTS_BYTES: usize = 8 << 20;
/// What the list of one input holds at least and at most.
const LIST: (usize, usize) = (512, 64 << 10);
/// Bytes of an entry of a list, its row aside: number, count, state.
const ENTRY: usize = 8 + 4 + 1;

/// The rank of each input by its name: what tells equal records of two inputs apart, so that the
/// order in which inputs are named decides nothing.
pub fn ranks(inputs: &[Input]) -> Vec<u32> {
    let mut order: Vec<usize> = (0..inputs.len()).collect();
    order.sort_by_key(|&i| (inputs[i].path.file_name(), &inputs[i].path));
    let mut ranks = vec![0; inputs.len()];
    for (rank, i) in order.into_iter().enumerate() {
        ranks[i] = u32::try_from(rank).unwrap_or(u32::MAX);
    }
    ranks
}

/// Bytes that sorting by so many inputs holds.
pub fn lists_bytes(inputs: usize) -> Bytes {
    Bytes::of(inputs as u64, list_bytes(inputs) + size_of::<InputList>())
}

fn list_bytes(inputs: usize) -> usize {
    (LISTS_BYTES / inputs.max(1)).clamp(LIST.0, LIST.1)
}

/// The records of one input that were not yet stored, and where the others are.
#[derive(Debug, Default)]
struct InputList {
    open: Vec<u8>,
    stretches: Vec<StoredStretch>,
    records: u64,
}

/// The records that an output gets, sorted by input; within one they stay in their order.
pub(crate) struct ByInput {
    /// Which output.
    pub sink: usize,
    /// The rows of its entries.
    pub layout: RowLayout,
    /// True if it takes what was there before the pass.
    before: bool,
    spill: Spill,
    lists: Vec<InputList>,
    list_bytes: usize,
}

impl ByInput {
    /// Output `sink`, for so many inputs, without a record.
    pub fn new(
        area: &Arc<SpillArea>,
        sink: usize,
        inputs: usize,
        layout: &RowLayout,
        before: bool,
    ) -> Self {
        let layout = layout.clone();
        let spill = Spill::new(area, "inputs");
        let mut lists = Vec::new();
        lists.resize_with(inputs, InputList::default);
        ByInput { sink, layout, before, spill, lists, list_bytes: list_bytes(inputs) }
    }

    /// Takes what becomes of an entry with its row, if it has one.
    pub fn take(&mut self, entry: &RecordEntry, row: &[u8]) -> Result<()> {
        let state = if self.before { entry.was } else { entry.now };
        if !state.is_written() {
            return Ok(());
        }
        let rank = entry.tag.input(self.lists.len()) as usize;
        let list = self.lists.get_mut(rank).ok_or_else(|| {
            Error::internal(format!("a record of input {rank} came, which there is not"))
        })?;
        list.open.extend_from_slice(&entry.number.to_le_bytes());
        list.open.extend_from_slice(&entry.count.to_le_bytes());
        list.open.push(state.0);
        self.layout.enter(row, &mut list.open);
        list.records += u64::from(entry.count);
        if list.open.len() + ENTRY + self.layout.bytes() > self.list_bytes {
            list.stretches.push(self.spill.store(&list.open)?);
            list.open.clear();
        }
        Ok(())
    }

    /// Calls `visit` with the entries of the input of `rank` and their rows, in canonical order.
    pub fn each(
        &self,
        rank: usize,
        mut visit: impl FnMut(&RecordEntry, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let Some(list) = self.lists.get(rank) else { return Ok(()) };
        let mut bytes = Vec::new();
        let mut visit_all = |bytes: &[u8]| {
            bytes.chunks_exact(ENTRY + self.layout.bytes()).try_for_each(|item| {
                let (entry, row) = item.split_at(ENTRY);
                visit(&unpack(entry), row)
            })
        };
        for stretch in &list.stretches {
            self.spill.load(stretch, &mut bytes)?;
            visit_all(&bytes)?;
        }
        visit_all(&list.open)
    }

    /// Records of all inputs.
    pub fn records(&self) -> u64 {
        self.lists.iter().map(|list| list.records).sum()
    }
}

/// An entry as stored.
fn unpack(item: &[u8]) -> RecordEntry {
    let word = |at: usize| {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(&item[at..at + 4]);
        u32::from_le_bytes(bytes)
    };
    let state = RecordState(item[12]);
    let number = u64::from(word(0)) | u64::from(word(4)) << 32;
    RecordEntry { number, count: word(8), tag: Tag::default(), was: state, now: state }
}
