//! What comes out of the merge of a range: blocks of distinct positions, and the order of records.
//!
//! Records are not moved: 8 bytes say where each one, in canonical order, lies among the runs.
//! Records are long, 20 to 70 bytes and more, and most of them are removed in the end, so moving
//! them would read and write all of them for the sake of few.

use serde::{Deserialize, Serialize};

use super::Levels;
use super::block::{BLOCK, Block};
use super::key::split_level;
use super::pieces::{PIECE, Pieces};
use super::record::ref_bytes;
use super::spill::Spill;
use crate::point::Position;
use crate::{Error, Result};

/// Blocks packed before they are handed to the spill.
const BLOCKS_AT_ONCE: usize = 64;

pub(crate) struct MergeOutput {
    pub positions: Spill,
    pub refs: Pieces,
    pub tagged: bool,
}

/// What a range came to.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Merged {
    pub blocks: Vec<Block>,
    pub records: u64,
    pub levels: Levels,
    pub ends: Option<(Position, Position)>,
}

/// Packs what comes out of the merge into blocks and pieces.
pub(crate) struct Emitter<'a> {
    out: &'a MergeOutput,
    merged: Merged,
    positions: Vec<Position>,
    copies: Vec<u32>,
    packed: Vec<u8>,
    unplaced: Vec<usize>,
    refs: Vec<u8>,
    first_ref: u64,
    refs_stored: u64,
    block_first: u64,
}

impl<'a> Emitter<'a> {
    /// Bytes that an emitter holds.
    pub const BYTES: usize =
        (BLOCKS_AT_ONCE + 2) * BLOCK * Block::BYTES_PER_POSITION + PIECE * ref_bytes(true);

    /// An emitter of at most `most_records` records.
    pub fn new(out: &'a MergeOutput, most_records: u64) -> Result<Self> {
        let first_ref = out.refs.reserve(most_records)?;
        Ok(Emitter {
            out,
            merged: Merged {
                blocks: Vec::new(),
                records: 0,
                levels: Levels::default(),
                ends: None,
            },
            positions: Vec::with_capacity(BLOCK),
            copies: Vec::with_capacity(BLOCK),
            packed: Vec::with_capacity(BLOCKS_AT_ONCE * BLOCK * Block::BYTES_PER_POSITION),
            unplaced: Vec::with_capacity(BLOCKS_AT_ONCE),
            refs: Vec::with_capacity(PIECE * ref_bytes(out.tagged)),
            first_ref,
            refs_stored: 0,
            block_first: 0,
        })
    }

    /// Takes the next records, numbered from `first_record` on among all of the store: their
    /// positions, and their tags if they have any.
    pub fn take(&mut self, positions: &[Position], first_record: u64, tags: &[u32]) -> Result<()> {
        let Some(&end) = positions.last() else { return Ok(()) };
        let mut new = positions;
        let mut last = match self.merged.ends {
            Some((_, last)) => last,
            None => {
                self.merged.ends = Some((positions[0], positions[0]));
                self.open(positions[0])?;
                new = &positions[1..];
                positions[0]
            }
        };
        for &position in new {
            match split_level(last, position) {
                Some(level) => {
                    self.merged.levels.split(level);
                    self.open(position)?;
                    last = position;
                }
                None => self.copy()?,
            }
        }
        self.merged.ends = self.merged.ends.map(|(first, _)| (first, end));
        self.merged.records += positions.len() as u64;
        self.refer(first_record, positions.len(), tags)
    }

    /// Begins a position.
    fn open(&mut self, position: Position) -> Result<()> {
        if self.positions.len() == BLOCK {
            self.close_block()?;
        }
        self.positions.push(position);
        self.copies.push(1);
        Ok(())
    }

    /// Counts another record of the last position.
    fn copy(&mut self) -> Result<()> {
        let copies = self.copies.last_mut().and_then(|n| Some((n.checked_add(1)?, n)));
        let Some((more, copies)) = copies else {
            return Err(Error::new(
                crate::ErrorKind::Data,
                "more than 2^32 records share one position",
            ));
        };
        *copies = more;
        Ok(())
    }

    /// Enters `count` records, numbered from `first` on, into the canonical order.
    fn refer(&mut self, mut first: u64, mut count: usize, mut tags: &[u32]) -> Result<()> {
        let each = ref_bytes(self.out.tagged);
        while count > 0 {
            let start = self.refs.len();
            let now = count.min(PIECE - start / each);
            self.refs.resize(start + now * each, 0);
            let refs = self.refs[start..].chunks_exact_mut(each).zip(first..);
            if self.out.tagged {
                let (head, rest) = tags.split_at(now);
                for ((entry, number), tag) in refs.zip(head) {
                    entry[..8].copy_from_slice(&number.to_le_bytes());
                    entry[8..].copy_from_slice(&tag.to_le_bytes());
                }
                tags = rest;
            } else {
                refs.for_each(|(entry, number)| entry.copy_from_slice(&number.to_le_bytes()));
            }
            (first, count) = (first + now as u64, count - now);
            if self.refs.len() == PIECE * each {
                self.store_refs()?;
            }
        }
        Ok(())
    }

    fn store_refs(&mut self) -> Result<()> {
        if !self.refs.is_empty() {
            self.out.refs.put(self.first_ref + self.refs_stored, &self.refs)?;
            self.refs_stored += (self.refs.len() / ref_bytes(self.out.tagged)) as u64;
            self.refs.clear();
        }
        Ok(())
    }

    fn close_block(&mut self) -> Result<()> {
        if self.positions.is_empty() {
            return Ok(());
        }
        let (mut block, start) = Block::pack(&self.positions, &self.copies, &mut self.packed);
        block.first_record = self.first_ref + self.block_first;
        self.block_first += self.copies.iter().map(|&n| u64::from(n)).sum::<u64>();
        self.merged.blocks.push(block);
        self.unplaced.push(start);
        self.positions.clear();
        self.copies.clear();
        if self.unplaced.len() == BLOCKS_AT_ONCE { self.place() } else { Ok(()) }
    }

    fn place(&mut self) -> Result<()> {
        if self.packed.is_empty() {
            return Ok(());
        }
        let address = self.out.positions.append(&self.packed)?;
        let begin = self.merged.blocks.len() - self.unplaced.len();
        for (block, start) in self.merged.blocks[begin..].iter_mut().zip(self.unplaced.drain(..)) {
            block.placed(address, start, &self.packed);
        }
        self.packed.clear();
        Ok(())
    }

    /// Stores what is left.
    pub fn finish(mut self) -> Result<Merged> {
        self.close_block()?;
        self.place()?;
        self.store_refs()?;
        Ok(self.merged)
    }
}
