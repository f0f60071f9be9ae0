//! One pass: every tile goes through the stages, and what they leave goes into stored columns and
//! sinks.
//!
//! A tile is an item: a thread loads it into its arena, runs all stages of the pass on it there,
//! and hands a small product to the outlet, which commits products in the order of the tiles. So
//! the large things, positions and neighbourhoods, never leave the thread that loaded them, and no
//! stage is run over the whole scan before the next begins: between two stages nothing would have
//! to be stored.
//!
//! What a tile leaves must not depend on where the tiles are cut. A stage may therefore look at the
//! rim, but only what it decides about the core is kept.

use std::sync::{Arc, Mutex};

use serde::{Deserialize, Serialize};

use super::by_rank::Starts;
use super::chunk::{Open, OutputChunk};
use super::chunks::{Counts, Cutter, GrowingOutcome, Lists, Stored};
use super::cut::{TileCut, neighbors, reach};
use super::encoding::ChunkEncoders;
use super::filtering::Filtering;
use super::job::Job;
use super::outlet::Outlet;
use super::pass::{Op, Pass, put_to_work};
use super::product::Product;
use super::rounded::Rounded;
use super::row::RowLayout;
use crate::geom::lattice::Lattice;
use crate::host::{Threads, lock};
use crate::report::{Baseline, Tally};
use crate::stage::Sink;
use crate::store::{Fetch, SealedTiles, TileKey};
use crate::tile::{Loader, RecordRun, Sieve, Tile};
use crate::{Error, Result};

/// What all passes go over.
pub(crate) struct DecodedScan<'a> {
    pub lattice: &'a Lattice,
    pub tiles: Arc<SealedTiles>,
    /// Where the parts of the input begin, if an output asks for its order.
    pub starts: Arc<Starts>,
}

/// What a pass came to.
pub(crate) struct Milled {
    pub tally: Tally,
    pub stored: Stored,
    pub counts: Counts,
    /// The sinks of the pass, which have all their points.
    pub written: Vec<Numbered>,
    pub lists: Lists,
    /// Records that the pass's stages decide about.
    pub decided: u64,
    /// True if the pass oriented normals.
    pub oriented: bool,
    /// Grids to compare the pass with, if it decides by normals.
    pub baseline: Option<Baseline>,
}

/// A sink with its number.
pub(crate) type Numbered = (usize, Box<dyn Sink>);

/// Runs `pass` over the tiles of `cut`, into the `sinks` with their numbers and into `lists`.
pub(crate) fn grind(
    job: &Job<'_>,
    pass: &Pass,
    cut: &TileCut,
    field: &DecodedScan<'_>,
    sieve: &Sieve,
    sinks: Vec<Numbered>,
    lists: Lists,
) -> Result<Milled> {
    let tiles = &field.tiles;
    let layout = pass.row(&job.task.computed);
    let outputs = sinks.iter().enumerate().map(|(n, (sink, open))| {
        let before = pass.before.contains(sink);
        Open::new(n, open.chunk_points(), &job.layout(*sink, &layout), before)
    });
    let growing = GrowingOutcome::new(&job.area, tiles.positions(), tiles.points(), &pass.stores)?;
    let cutter = Cutter::new(growing, layout.bytes(), outputs.collect(), lists);
    let cutter = Mutex::new(Some(cutter));
    let commit = |product: Product| match &mut *lock(&cutter) {
        Some(cutter) => cutter.cut(&product),
        None => Err(Error::internal("a tile came behind the last")),
    };
    let encoders = ChunkEncoders::new(job, tiles, &sinks);
    let (which, sinks): (Vec<usize>, _) = sinks.into_iter().unzip();
    let threads = job.threads.at_most(cut.millers);
    let outlet = Outlet::new(sinks, threads.count(), &commit);
    let side = pass.compares(&job.ops);
    let worker = || Worker {
        baseline: side.map(|side| Baseline::new(side, tiles.levels())),
        ..Worker::new(job, pass, field, sieve, cut.capacity, &layout)
    };
    let (sum, baseline) = mill_tiles(threads, &cut.keys, worker, &encoders, &outlet)?;
    let TileTally { mut tally, decided, oriented } = sum;
    let unfinished = || Error::internal("a pass was finished twice");
    let (rest, stored, lists, counts) = lock(&cutter).take().ok_or_else(unfinished)?.finish()?;
    let mut encoder = encoders.one();
    let sinks = outlet.close(rest, &mut |chunk| encoder.encode(&encoders, &chunk))?;
    let written = which.into_iter().zip(sinks).collect();
    tally.merge(&encoder.tally);
    Ok(Milled { tally, stored, counts, written, lists, decided, oriented, baseline })
}

/// Mills the tiles `keys` into the outlet: what they come to in all, and the grids to compare with.
fn mill_tiles<'a>(
    threads: Threads<'_>,
    keys: &[TileKey],
    worker: impl Fn() -> Worker<'a> + Sync,
    encoders: &ChunkEncoders<'_>,
    outlet: &Outlet<'_, Product, OutputChunk>,
) -> Result<(TileTally, Option<Baseline>)> {
    let mut sum = TileTally::default();
    let left = threads.items(keys.len(), || outlet.stop()).run(
        || (worker(), encoders.one()),
        |(worker, encoder), index| {
            let (product, tally) = worker.mill(keys[index])?;
            let positions = product.positions();
            let mut encode = |chunk| encoder.encode(encoders, &chunk);
            outlet.deliver((index as u64, 0), product, true, &mut encode)?;
            worker.job.advance(positions)?;
            Ok(tally)
        },
        |tally| sum.merge(&tally),
        |(worker, mut encoder)| {
            outlet.drain(keys.len(), &mut |chunk| encoder.encode(encoders, &chunk))?;
            Ok((encoder.tally, worker.baseline))
        },
    )?;
    let mut baseline: Option<Baseline> = None;
    for (tally, part) in left {
        sum.tally.merge(&tally);
        match (&mut baseline, part) {
            (Some(all), Some(part)) => all.merge(&part),
            (_, part) => baseline = part,
        }
    }
    Ok((sum, baseline))
}

/// What a tile comes to, besides its product.
#[derive(Debug, Default, Serialize, PartialEq, Deserialize)]
struct TileTally {
    tally: Tally,
    /// Records that the pass's stages decide about.
    decided: u64,
    /// True if the pass oriented normals.
    oriented: bool,
}

impl TileTally {
    fn merge(&mut self, other: &TileTally) {
        self.tally.merge(&other.tally);
        self.decided += other.decided;
        self.oriented |= other.oriented;
    }
}

/// What a thread needs to mill tiles.
pub(crate) struct Worker<'a> {
    job: &'a Job<'a>,
    pass: &'a Pass,
    loader: Loader,
    reach: i64,
    neighbors: usize,
    layout: RowLayout,
    /// True if records of the pass go to an output in the order of the inputs.
    ranks: bool,
    fetch: Fetch,
    /// Where positions are rounded, and unequal coordinates that share one are counted.
    rounded: Option<Rounded<'a>>,
    first: bool,
    filtering: Option<Filtering<'a>>,
    sum: TileTally,
    /// Grids to compare the pass with, of the tiles so far.
    baseline: Option<Baseline>,
}

impl<'a> Worker<'a> {
    pub fn new(
        job: &'a Job<'a>,
        pass: &'a Pass,
        field: &'a DecodedScan<'_>,
        sieve: &Sieve,
        capacity: usize,
        layout: &RowLayout,
    ) -> Self {
        let neighbors = neighbors(&job.ops, pass);
        let mut loader = Loader::new(&field.tiles, sieve, capacity);
        if let Some(points) = job.task.tile_points() {
            // Half for the zone, half for the rim, as where memory decides.
            loader.limit_rim(points.saturating_mul(2));
        }
        if job.task.traits.whole_rims {
            loader.see_all();
        }
        let tile = loader.tile().0;
        tile.compute_by(job.task.simd);
        if neighbors > 0 {
            tile.around.reserve(capacity);
        }
        // Counted once, in the first pass; fates are stored by every pass that removes.
        let first = sieve.states.is_none();
        let rounds = field.lattice.rounds() && (first || pass.removes);
        let rounded = rounds.then(|| Rounded::new(&field.tiles, field.lattice, job.task.schema()));
        let reach = reach(&job.ops, pass);
        let ranks =
            pass.before.iter().chain(&pass.after).any(|sink| job.task.in_input_order[*sink]);
        let filtering = pass.streams().then(|| Filtering::new(job, &field.tiles, pass));
        Worker {
            filtering,
            ranks,
            fetch: Fetch::default(),
            job,
            pass,
            loader,
            reach,
            neighbors,
            layout: layout.clone(),
            rounded,
            first,
            sum: TileTally::default(),
            baseline: None,
        }
    }

    /// Gives no tile a rim that makes it more than `positions`, for a look at a small cube.
    pub fn limit_rim(&mut self, positions: usize) {
        self.loader.limit_rim(positions);
    }

    /// Loads a tile and runs the stages of the pass on it, those before stage `until` if one is
    /// given.
    pub fn run(
        &mut self,
        key: TileKey,
        until: Option<usize>,
    ) -> Result<(&mut Tile, Option<Vec<u8>>)> {
        self.loader.load(key, if until.is_some() { 0 } else { self.reach }, self.neighbors)?;
        let (tile, _) = self.loader.tile();
        let mut summary = None;
        for call in self.pass.calls.iter().take_while(|call| Some(call.op) != until) {
            put_to_work(tile, &self.job.ops, *call);
            let (stage, tally) = (&self.job.ops[call.op], &mut self.sum.tally);
            let done = match (&stage.op, call.gathers) {
                (Op::Scan(op), true) => op.gather_into(tile, tally, summary.insert(Vec::new())),
                (op, _) => op.tile().run(tile, tally),
            };
            done.map_err(|error| error.of_stage(&stage.kind))?;
        }
        Ok((tile, summary))
    }

    /// What a tile leaves behind, and what it comes to.
    fn mill(&mut self, key: TileKey) -> Result<(Product, TileTally)> {
        let (_, summary) = self.run(key, None)?;
        let (tile, core) = self.loader.tile();
        self.sum.decided +=
            tile.copies[tile.core.clone()].iter().map(|&n| u64::from(n)).sum::<u64>();
        self.sum.oriented |= tile.oriented;
        self.sum.tally.work("rim_positions", (tile.positions.len() - tile.core.len()) as u64);
        self.sum.tally.work("unproven", tile.around.take_unproven());
        self.sum.tally.work("tied", tile.around.take_tied());
        if let Some(baseline) = &mut self.baseline {
            baseline.add(tile);
        }
        let mut product = Product::of(tile, core, self.pass, &self.layout)?;
        product.summary = summary;
        if let Some(rounded) = &mut self.rounded {
            let mut positions = Vec::new();
            core.each(tile, |runs, _| {
                let count = runs.iter().map(|run| run.count).sum::<u32>();
                positions.extend(runs.first().map(|run: &RecordRun| (run.number, count)));
                Ok(())
            })?;
            let mut counted = Tally::default();
            rounded.enter(&positions, &mut product.fates, &mut counted)?;
            if self.first {
                self.sum.tally.merge(&counted);
            }
        }
        if let Some(filtering) = &mut self.filtering {
            filtering.apply(&mut product, &self.layout, &mut self.sum.tally)?;
        }
        if self.ranks {
            product.find_places(self.loader.tiles(), &mut self.fetch)?;
        }
        Ok((product, std::mem::take(&mut self.sum)))
    }
}
