//! The points that a stage keeps in rounds, in Morton order, each with the round that kept it.
//!
//! They are a store of their own beside the scan. As a column of the scan they would be found only
//! by loading all points around them, and what a round looks at around its points is many times as
//! wide as the spacing of those that are kept. A few in a hundred, packed as the scan is, they take
//! little to write anew in each round.

use std::sync::Arc;

use super::block::{BLOCK, Block};
use super::spill::{Spill, SpillArea};
use crate::Result;
use crate::budget::{Bytes, Lease};
use crate::point::{Bounds, Position};

/// Points in Morton order with the number of the round that kept each.
#[derive(Debug)]
pub struct KeptPoints {
    spill: Spill,
    blocks: Vec<Block>,
    count: u64,
    index: Lease,
}

/// Some kept points, and what reading them needs.
#[derive(Debug, Default)]
pub struct KeptReader {
    /// In Morton order.
    pub positions: Vec<Position>,
    /// The round that kept each.
    pub rounds: Vec<u32>,
    buffer: Vec<u8>,
}

impl KeptReader {
    /// Drops those outside of `region`.
    pub fn keep_in(&mut self, region: &Bounds) {
        self.keep_behind(0, region);
    }

    /// Drops those from number `begin` on that are outside of `region`.
    fn keep_behind(&mut self, begin: usize, region: &Bounds) {
        let mut end = begin;
        for i in begin..self.positions.len() {
            if region.contains(self.positions[i]) {
                self.positions.swap(end, i);
                self.rounds.swap(end, i);
                end += 1;
            }
        }
        self.positions.truncate(end);
        self.rounds.truncate(end);
    }
}

impl KeptPoints {
    /// None yet.
    pub fn new(area: &Arc<SpillArea>) -> Self {
        let index = area.budget().open("index of kept points");
        KeptPoints { spill: Spill::new(area, "kept"), blocks: Vec::new(), count: 0, index }
    }

    /// Packs points for [`enter`](KeptPoints::enter); from several threads at once.
    ///
    /// # Errors
    ///
    /// Those of writing to the spill.
    pub fn pack(&self, positions: &[Position], rounds: &[u32]) -> Result<Vec<Block>> {
        let (mut packed, mut blocks) = (Vec::new(), Vec::new());
        for (positions, rounds) in positions.chunks(BLOCK).zip(rounds.chunks(BLOCK)) {
            blocks.push(Block::pack(positions, rounds, &mut packed));
        }
        let stretch = self.spill.append(&packed)?;
        let placed = blocks.into_iter().map(|(mut block, start)| {
            block.placed(stretch, start, &packed);
            block
        });
        Ok(placed.collect())
    }

    /// Enters packed points, which come behind all that are there in Morton order.
    ///
    /// # Errors
    ///
    /// An index that there is no memory for.
    pub fn enter(&mut self, blocks: Vec<Block>) -> Result<()> {
        self.index.grow(Bytes::of(blocks.len() as u64, size_of::<Block>()).0)?;
        self.count += blocks.iter().map(|block| block.len() as u64).sum::<u64>();
        self.blocks.extend(blocks);
        Ok(())
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Blocks of them.
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// How many lie in the blocks that meet a region: at least as many as are in it.
    pub fn most_near(&self, region: &Bounds) -> usize {
        let meeting = self.blocks.iter().filter(|block| block.bounds.meets(region));
        meeting.map(Block::len).sum()
    }

    /// Leaves in `reader` those in `region`.
    ///
    /// # Errors
    ///
    /// Those of reading the spill.
    pub fn near(&self, region: &Bounds, reader: &mut KeptReader) -> Result<()> {
        reader.positions.clear();
        reader.rounds.clear();
        for block in self.blocks.iter().filter(|block| block.bounds.meets(region)) {
            let before = reader.positions.len();
            self.append(block, reader)?;
            if !region.holds(&block.bounds) {
                reader.keep_behind(before, region);
            }
        }
        Ok(())
    }

    /// Leaves in `reader` those of block `number`.
    ///
    /// # Errors
    ///
    /// Those of reading the spill.
    pub fn block(&self, number: usize, reader: &mut KeptReader) -> Result<()> {
        reader.positions.clear();
        reader.rounds.clear();
        self.append(&self.blocks[number], reader)
    }

    fn append(&self, block: &Block, reader: &mut KeptReader) -> Result<()> {
        let KeptReader { positions, rounds, buffer } = reader;
        block.read(&self.spill, buffer, positions, Some(rounds))
    }
}
