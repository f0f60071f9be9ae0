//! A tile of a round: positions of the scan and kept points around a cube, in the arena of a
//! thread.

use crate::budget::{Bytes, Lease, whole_mebibytes};
use crate::engine::grind::DecodedScan;
use crate::engine::job::Job;
use crate::engine::pass::{Call, Op, put_to_work};
use crate::point::Position;
use crate::stage::{Looks, Offer, Round, RoundBefore, RoundFound, RoundTile};
use crate::store::{KeptPoints, KeptReader, TileKey};
use crate::tile::{Cover, Loader, Only, Sieve};
use crate::{Error, Result};

/// What the tiles of a round are about.
pub(super) struct RoundScan<'a> {
    pub op: usize,
    /// Of the round, from 0.
    pub number: u32,
    pub field: &'a DecodedScan<'a>,
    pub sieve: &'a Sieve,
    /// Positions that the arena of a thread takes.
    pub capacity: usize,
}

impl RoundScan<'_> {
    fn call(&self) -> Call {
        Call { op: self.op, gathers: false }
    }
}

/// What a thread needs to work on tiles of a round.
pub(super) struct RoundWorker<'a> {
    job: &'a Job<'a>,
    call: Call,
    number: u32,
    round: &'a Round,
    loader: Loader,
    capacity: usize,
    chosen: Vec<Position>,
    /// What these weigh; none where all weigh 1.
    weights: Vec<f64>,
    reader: KeptReader,
    found: RoundFound,
    more: Option<Lease>,
}

/// What a tile comes to.
pub(super) struct FoundInTile<'w> {
    /// Those that the round looked at.
    pub positions: &'w [Position],
    /// Indices of those that are kept from now on.
    pub keep: &'w [u32],
    pub offers: &'w [Offer],
    pub counted: u64,
    /// The kept points of the cube.
    pub kept: &'w KeptReader,
}

/// Bytes of a position in a tile of a round: in its place, among those that are chosen and touched,
/// in what it says and in what is searched.
pub(super) const POSITION_BYTES: usize = Loader::BYTES_PER_POINT + 2 * size_of::<Position>() + 72;
/// The same of a kept point, with its cell and its offers of this round and the one before.
const KEPT_BYTES: usize = 2 * size_of::<Position>() + 2 * size_of::<Offer>() + 72;

impl<'a> RoundWorker<'a> {
    pub fn new(
        job: &'a Job<'a>,
        scan: &RoundScan<'_>,
        round: &'a Round,
        capacity: usize,
    ) -> RoundWorker<'a> {
        let mut loader = Loader::new(&scan.field.tiles, scan.sieve, capacity);
        if job.task.traits.whole_rims {
            loader.see_all();
        }
        if let Looks::Sample { most, seed } = round.looks {
            loader.take_only(Only::Sample { most, seed });
        }
        RoundWorker {
            job,
            call: scan.call(),
            number: scan.number,
            round,
            loader,
            capacity,
            chosen: Vec::new(),
            weights: Vec::new(),
            reader: KeptReader::default(),
            found: RoundFound::default(),
            more: None,
        }
    }

    /// The positions that were loaded last.
    pub fn positions(&self) -> &[Position] {
        &self.chosen
    }

    /// Loads the positions of a tile that the stage decides about, and leaves the kept points
    /// around it in the reader. How many records they have.
    pub fn load(&mut self, key: TileKey, kept: &KeptPoints) -> Result<u64> {
        let whole = |reach: i64| match self.job.task.traits.whole_rims {
            true => key.cube().union(&self.loader.tiles().bounds()).grown(reach),
            false => key.cube().grown(reach),
        };
        let (region, covering) = (whole(self.round.kept_reach), whole(self.round.reach));
        self.more = None;
        if let Looks::Uncovered { apart, .. } = self.round.looks {
            kept.near(&covering.grown(apart), &mut self.reader)?;
            let cover = Cover::new(&self.reader.positions, apart);
            self.loader.take_only(Only::Uncovered(cover));
        }
        self.loader.load(key, self.round.reach, 0)?;
        let (tile, _) = self.loader.tile();
        // What the arena of the mill has for positions that are not there is for kept points.
        let needed = Bytes::of(tile.positions.len() as u64, POSITION_BYTES)
            + Bytes::of(kept.most_near(&region) as u64, KEPT_BYTES);
        let there = Bytes::of(self.capacity as u64, POSITION_BYTES);
        let beyond = needed.0.saturating_sub(there.0);
        let lease = self.job.budget.lease(beyond, "kept points around tiles");
        self.more = Some(lease.map_err(|error| error.help(enough(self.job, beyond)))?);
        put_to_work(tile, &self.job.ops, self.call);
        self.chosen.clear();
        self.weights.clear();
        let stage = &self.job.ops[self.call.op];
        let weight = stage.op.weight();
        let is_chosen = |i: &usize| tile.is_chosen(*i);
        let chosen = (0..tile.positions.len()).filter(is_chosen);
        let mut records = 0;
        for i in chosen {
            records += u64::from(tile.copies[i]);
            self.chosen.push(tile.positions[i]);
            if let Some((_, weight)) = weight {
                let is_in = tile.selections.get(i).copied().unwrap_or(0);
                let holds =
                    |number: usize| stage.weighed.get(number).is_some_and(|b| is_in & b > 0);
                self.weights.push(weight.of(holds));
            }
        }
        kept.near(&region, &mut self.reader)?;
        Ok(records)
    }

    /// Lets the stage work on a tile.
    /// `before` is what the round before offered there, if that can still be of use.
    pub fn run(
        &mut self,
        key: TileKey,
        kept: &KeptPoints,
        before: Option<&[Offer]>,
    ) -> Result<FoundInTile<'_>> {
        self.load(key, kept)?;
        self.found.clear();
        let RoundWorker { chosen, weights, reader, found, job, .. } = self;
        let tile = RoundTile {
            cube: key.cube(),
            round: self.round,
            positions: chosen,
            weights,
            kept: &reader.positions,
            kept_in: &reader.rounds,
            before: before.map(|offers| RoundBefore { number: self.number - 1, offers }),
            simd: job.task.simd,
        };
        let stage = &job.ops[self.call.op];
        match &stage.op {
            Op::Round(op) => op.round(&tile, found).map_err(|e| e.of_stage(&stage.kind))?,
            _ => return Err(Error::internal("a stage is to choose in rounds and does not")),
        }
        reader.keep_in(&key.cube());
        let RoundFound { keep, offers, counted } = found;
        Ok(FoundInTile { positions: chosen, keep, offers, counted: *counted, kept: reader })
    }
}

/// What helps where a tile takes so many bytes more than the arena has: as much for every thread
/// and, as other tiles may take more, a tenth of all besides.
fn enough(job: &Job<'_>, beyond: u64) -> String {
    let limit = job.task.demands.limit;
    let of_threads = beyond.saturating_mul(job.threads.count() as u64);
    let enough = whole_mebibytes(limit.saturating_add(of_threads).saturating_add(limit / 10));
    format!("give at least `run.memory = \"{enough}\"`")
}
