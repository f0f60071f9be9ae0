//! What a pass sees of the scan: the records that earlier passes left, and those that its stages
//! are limited to; and the columns that earlier passes computed.
//!
//! A pass could seal anew what the one before it left. That would take another index, another copy
//! of the positions and a map back to the records. A sieve takes a byte a record, keeps one
//! numbering for records, positions and columns, and lets the survey and the outputs see what every
//! pass did. A scan of which little is left is walked through for it: unpacking a position takes a
//! hundredth of what its normal takes.

use std::sync::Arc;

use crate::Result;
use crate::budget::{Bytes, Lease};
use crate::point::{ColumnKind, Dimension, Schema};
use crate::store::{ASIDE, CHOSEN, Pieces, RecordState, SealedTiles, Tag};

/// What a pass sees of the scan, and what earlier passes stored.
#[derive(Debug, Clone, Default)]
pub struct Sieve {
    /// A `RecordState` for every record, by rank; none before the first pass.
    pub states: Option<Arc<Pieces>>,
    /// A stored fate for every position; none before the first pass.
    pub fates: Option<Arc<Pieces>>,
    /// The columns that are stored: a value for every position.
    pub columns: Vec<(ColumnKind, Arc<Pieces>)>,
    /// True if the signs of the normals among them mean something.
    pub oriented: bool,
    /// The dimensions of the records that stages read as columns.
    pub dimensions: Option<Arc<ReadDimensions>>,
    /// The columns that stages compute.
    pub computed: Vec<ColumnKind>,
    /// True if stages look at the class of positions.
    pub classes: bool,
    /// Selections that a record must be in to be seen as a neighbour.
    pub seen: u8,
    /// Selections that a record must be in to be decided about.
    pub decided: u8,
}

impl Sieve {
    /// True if it may hold records back.
    pub fn is_fine(&self, tiles: &SealedTiles) -> bool {
        self.states.is_some() || tiles.is_tagged()
    }
}

/// Dimensions of the records that stages read as columns.
#[derive(Debug)]
pub struct ReadDimensions {
    /// What the records hold.
    pub schema: Arc<Schema>,
    /// Each with the column that it is.
    pub dimensions: Vec<(ColumnKind, Dimension)>,
}

/// Records of one position that follow one another and are alike to every stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordRun {
    /// Number of the first.
    pub number: u64,
    /// How many.
    pub count: u32,
    /// Index of the position in its tile, or [`RecordRun::UNSEEN`].
    pub slot: u32,
    /// What accompanies them.
    pub tag: Tag,
    /// What earlier passes left them in.
    pub state: RecordState,
    /// True for the first of its position.
    pub begins: bool,
}

impl RecordRun {
    /// The first of the `runs` of a position whose record stands for all in what stages look at:
    /// one that is decided about, or seen where none is.
    pub(super) fn first_of<'a>(runs: &'a [RecordRun], sieve: &Sieve) -> Option<&'a RecordRun> {
        let decided = runs.iter().find(|run| run.is_in(sieve.decided));
        decided.or_else(|| runs.iter().find(|run| run.is_in(sieve.seen)))
    }

    /// The slot of a position that a pass does not see.
    pub const UNSEEN: u32 = u32::MAX;

    /// True if it takes part in passes.
    pub fn is_alive(&self) -> bool {
        self.state.is_alive() && self.tag.selections() & ASIDE == 0
    }

    /// The selections that it is in, [`CHOSEN`] among them.
    pub fn selections(&self) -> u8 {
        let chosen = if self.state.is_chosen() { CHOSEN } else { 0 };
        self.tag.selections() & !ASIDE | chosen
    }

    /// True if it takes part and is in all of `selections`.
    pub fn is_in(&self, selections: u8) -> bool {
        self.is_alive() && self.selections() & selections == selections
    }
}

/// Memory for runs beyond those that a plan reckons with: one a position. There are more where the
/// copies of a position differ in what stages look at.
#[derive(Debug, Default)]
pub(super) struct MoreRuns(Option<Lease>);

impl MoreRuns {
    /// A run, and what the mill makes of it.
    const BYTES: usize = 3 * size_of::<RecordRun>();

    /// Holds memory for `runs` in all, of which `planned` are reckoned with. Fails as
    /// [`Budget::lease`](crate::budget::Budget::lease) does for `most`, as many as there may be.
    pub(super) fn hold(
        &mut self,
        tiles: &SealedTiles,
        runs: usize,
        planned: usize,
        most: u64,
    ) -> Result<()> {
        let more = Bytes::of(runs.saturating_sub(planned) as u64, Self::BYTES).0;
        if self.0.as_ref().map_or(0, Lease::bytes) >= more {
            return Ok(());
        }
        let what = "list of a tile's copies that differ in class or flags";
        // What is held goes back first, so that a refusal counts it once.
        self.0 = None;
        self.0 = match tiles.budget().try_lease(more, what) {
            None => Some(tiles.budget().lease(Bytes::of(most, Self::BYTES).0.max(more), what)?),
            lease => lease,
        };
        Ok(())
    }

    /// Gives back what it holds, and with it the memory of `runs`.
    pub(super) fn give_back(&mut self, runs: &mut Vec<RecordRun>) {
        runs.clear();
        if self.0.take().is_some() {
            *runs = Vec::new();
        }
    }
}

/// Reads the runs of blocks; keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Runs {
    more: MoreRuns,
    buffer: Vec<u8>,
    states: Vec<u8>,
    tags: Vec<u8>,
    runs: Vec<RecordRun>,
    ends: Vec<usize>,
}

impl Runs {
    /// Reads the runs of block `index`, whose positions have `copies` records each.
    pub(super) fn read(
        &mut self,
        tiles: &SealedTiles,
        sieve: &Sieve,
        index: usize,
        copies: &[u32],
    ) -> Result<()> {
        /// Records read at once: a position may have millions.
        const AT_ONCE: u64 = 4096;
        self.more.give_back(&mut self.runs);
        self.ends.clear();
        let (mut number, mut rank) = (tiles.block(index).first_record, tiles.rank_of_block(index));
        let end = number + copies.iter().map(|&n| u64::from(n)).sum::<u64>();
        let mut window = 0..0;
        for &count in copies {
            let mut begins = true;
            for _ in 0..count {
                if !window.contains(&number) {
                    window = number..end.min(number + AT_ONCE);
                    let runs = self.runs.len().saturating_add(AT_ONCE as usize);
                    // Each record that is left may be a run, here and in the list of the tile.
                    let most = (runs as u64).saturating_add(end - number).saturating_mul(2);
                    self.more.hold(tiles, runs, 2 * AT_ONCE as usize, most)?;
                    self.fill(tiles, sieve, number, rank, (window.end - number) as usize)?;
                }
                let at = (number - window.start) as usize;
                let state = RecordState(self.states.get(at).copied().unwrap_or_default());
                let tag = match self.tags.get(4 * at..4 * at + 4) {
                    Some(&[a, b, c, d]) => Tag(u32::from_le_bytes([a, b, c, d])),
                    _ => Tag::default(),
                };
                self.push(begins, number, state, tag);
                begins = false;
                number += 1;
                rank += 1;
            }
            self.ends.push(self.runs.len());
        }
        Ok(())
    }

    fn push(&mut self, begins: bool, number: u64, state: RecordState, tag: Tag) {
        match self.runs.last_mut() {
            Some(run) if !begins && run.state == state && run.tag == tag => run.count += 1,
            _ => {
                let slot = RecordRun::UNSEEN;
                self.runs.push(RecordRun { number, count: 1, slot, tag, state, begins });
            }
        }
    }

    fn fill(
        &mut self,
        tiles: &SealedTiles,
        sieve: &Sieve,
        number: u64,
        rank: u64,
        count: usize,
    ) -> Result<()> {
        self.states.clear();
        if let Some(stored) = &sieve.states {
            stored.collect(rank, count as u64, &mut self.buffer, &mut self.states)?;
        }
        tiles.tags(number, count, &mut self.buffer, &mut self.tags)
    }

    /// The runs of the `j`-th position of the block.
    pub(super) fn of(&self, j: usize) -> &[RecordRun] {
        let start = if j == 0 { 0 } else { self.ends[j - 1] };
        &self.runs[start..self.ends[j]]
    }
}
