//! What comes out of the merge of a range: blocks of distinct positions, and the order of records.

use super::Levels;
use super::block::{BLOCK, Block};
use super::sealed::ref_bytes;
use super::spill::{PIECE, Pieces, Spill};
use crate::point::Position;
use crate::{Error, Result};

/// Blocks packed before they are handed to the spill.
const BLOCKS_AT_ONCE: usize = 64;

pub(super) struct Output {
    pub positions: Spill,
    pub refs: Pieces,
    pub tagged: bool,
}

/// What a range came to.
pub(super) struct Merged {
    pub blocks: Vec<Block>,
    pub records: u64,
    pub levels: Levels,
    pub ends: Option<(Position, Position)>,
}

/// Packs what comes out of the merge into blocks and pieces.
pub(super) struct Emitter<'a> {
    out: &'a Output,
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
    pub const BYTES: usize = BLOCKS_AT_ONCE * BLOCK * 28 + PIECE * 12 + 2 * BLOCK * 28;

    /// An emitter of at most `most_records` records.
    pub fn new(out: &'a Output, most_records: u64) -> Self {
        Emitter {
            out,
            merged: Merged {
                blocks: Vec::new(),
                records: 0,
                levels: Levels::default(),
                ends: None,
            },
            positions: Vec::with_capacity(BLOCK),
            copies: Vec::with_capacity(BLOCK),
            packed: Vec::with_capacity(BLOCKS_AT_ONCE * BLOCK * 28),
            unplaced: Vec::with_capacity(BLOCKS_AT_ONCE),
            refs: Vec::with_capacity(PIECE * ref_bytes(out.tagged)),
            first_ref: out.refs.reserve(most_records),
            refs_stored: 0,
            block_first: 0,
        }
    }

    /// Takes the next record: its position, its number among all of the store, and its tag.
    pub fn emit(&mut self, position: Position, record: u64, tag: u32) -> Result<()> {
        match (&mut self.merged.ends, self.copies.last_mut()) {
            (Some((_, last)), Some(copies)) if *last == position => {
                *copies = copies.checked_add(1).ok_or_else(|| {
                    Error::new(crate::ErrorKind::Data, "more than 2^32 records share one position")
                })?;
            }
            (ends, _) => {
                match ends {
                    None => *ends = Some((position, position)),
                    Some((_, last)) => {
                        self.merged.levels.add(Some(*last), position);
                        *last = position;
                    }
                }
                if self.positions.len() == BLOCK {
                    self.close_block()?;
                }
                self.positions.push(position);
                self.copies.push(1);
            }
        }
        self.merged.records += 1;
        self.refs.extend_from_slice(&record.to_le_bytes());
        if self.out.tagged {
            self.refs.extend_from_slice(&tag.to_le_bytes());
        }
        if self.refs.len() == PIECE * ref_bytes(self.out.tagged) {
            self.store_refs()?;
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
            block.placed(address, start);
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
