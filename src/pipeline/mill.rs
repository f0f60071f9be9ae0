//! The mill: decode into the tile store, then tile after tile through the stages, in canonical
//! order into the sink.

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::chunks::{Chunk, Cutter, Product};
use super::clock::Clock;
use super::cut::{cut, neighbors, reach};
use super::outlet::{Hands, Outlet};
use super::rounded::Rounded;
use super::run::{Finished, Job, StopOnDrop};
use super::shares::{BATCH, Demands, Shares};
use super::survey::{FATE_BYTES, survey};
use crate::Result;
use crate::geom::lattice::{Lattice, Misplaced};
use crate::point::PointBatch;
use crate::report::{Decision, Tally};
use crate::stage::{Encoded, ScanFacts, Sink};
use crate::tile::{
    Fetch, Intake, Loader, Pieces, SealedTiles, SpillArea, TileKey, TileStore, lock, parallel, seal,
};

/// Runs a pipeline with tile stages (or one that only sorts) into `sink`.
pub(super) fn mill(
    job: &mut Job<'_>,
    lattice: &Lattice,
    shares: &Shares,
    demands: &Demands,
    area: &Arc<SpillArea>,
    sink: Box<dyn Sink>,
    clock: &mut Clock<'_>,
) -> Result<Finished> {
    clock.phase("decode", Some(job.source.points()));
    let (store, mut tally) = decode(job, lattice, shares, area)?;
    tally.work("runs", store.runs() as u64);
    clock.phase("merge", Some(tally.work.get("placed").copied().unwrap_or(0)));
    let tiles = Arc::new(seal(store, job.threads, &|n| job.advance(n))?);
    tally.count("positions", tiles.positions());
    let decisions = settle(job, lattice, &tiles)?;
    let (keys, capacity) = cut(job, lattice, shares, demands, &tiles)?;
    tally.work("tiles", keys.len() as u64);
    let levels: std::collections::BTreeSet<u32> = keys.iter().map(|key| key.level).collect();
    tally.work("tile_levels", levels.len() as u64);
    clock.phase("mill", Some(tiles.positions()));
    let working = job.budget.lease(demands.mill_bytes(capacity as u64), "the mill")?;
    let milled = grind(job, lattice, capacity, area, &tiles, &keys, sink)?;
    drop(working);
    tally.merge(&milled.tally);
    clock.phase("survey", Some(2 * tiles.positions()));
    let measured = survey(job, lattice, area, &tiles, &milled.fates)?;
    Ok(Finished {
        read: tally.work.remove("read").unwrap_or(0),
        kept: milled.kept,
        written: milled.written,
        tally,
        decisions,
        measured: Some(measured),
    })
}

fn decode(
    job: &Job<'_>,
    lattice: &Lattice,
    shares: &Shares,
    area: &Arc<SpillArea>,
) -> Result<(TileStore, Tally)> {
    let _working = job.budget.lease(shares.work, "decoding")?;
    let store = TileStore::new(area, &job.budget, job.source.schema().stride);
    let total = Mutex::new(Tally::default());
    let next = AtomicUsize::new(0);
    job.parallel(|| {
        let mut tally = Tally::default();
        let mut intake = Intake::new(&store, job.run_records.unwrap_or(shares.run_records));
        let mut batch = PointBatch::new(job.source.schema().clone(), BATCH);
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= job.source.parts() {
                break;
            }
            let mut part = job.source.part(index)?;
            while job.read(&mut *part, &mut batch, &mut tally)? {
                take(job, lattice, &batch, &mut intake, &mut tally)?;
            }
        }
        intake.flush()?;
        lock(&total).merge(&tally);
        Ok(())
    })?;
    let tally = std::mem::take(&mut *lock(&total));
    Ok((store, tally))
}

/// Places a batch's records on the lattice and hands them to the intake.
fn take(
    job: &Job<'_>,
    lattice: &Lattice,
    batch: &PointBatch,
    intake: &mut Intake<'_>,
    tally: &mut Tally,
) -> Result<()> {
    let stride = batch.schema().stride;
    let records = batch.records();
    let (mut outcome, mut misplaced, mut placed) = (Ok(()), Vec::new(), 0);
    lattice.place(
        batch.schema(),
        records,
        |i, position| {
            if outcome.is_ok() {
                placed += 1;
                outcome = intake.push(position, &records[i * stride..(i + 1) * stride]);
            }
        },
        |i, why| misplaced.push((i, why)),
    );
    outcome?;
    for (i, why) in misplaced {
        if why == Misplaced::NotFinite && job.drop_nonfinite {
            tally.remove(&job.source_kind, "not finite", 1);
        } else {
            return Err(job.misplaced(batch, i, why));
        }
    }
    tally.work("placed", placed);
    Ok(())
}

fn settle(job: &mut Job<'_>, lattice: &Lattice, tiles: &SealedTiles) -> Result<Vec<Decision>> {
    let facts = ScanFacts {
        points: tiles.points(),
        positions: tiles.positions(),
        bounds: tiles.bounds(),
        lattice,
        levels: tiles.levels(),
    };
    let mut decisions = Vec::new();
    for (kind, op) in job.ops.iter_mut() {
        op.settle(&facts)?;
        decisions.extend(op.decisions().into_iter().map(|(name, value)| Decision {
            stage: kind.clone(),
            name,
            value,
        }));
    }
    Ok(decisions)
}

struct Milled {
    tally: Tally,
    fates: Pieces,
    kept: u64,
    written: crate::stage::SinkSummary,
}

fn grind(
    job: &Job<'_>,
    lattice: &Lattice,
    capacity: usize,
    area: &Arc<SpillArea>,
    tiles: &Arc<SealedTiles>,
    keys: &[TileKey],
    sink: Box<dyn Sink>,
) -> Result<Milled> {
    let (encoder, chunk_points) = (sink.encoder(), sink.chunk_points());
    let outlet: Outlet<Product, Chunk> = Outlet::new(sink, job.threads);
    let fates = Pieces::new(area, "fates", FATE_BYTES);
    fates.reserve(tiles.positions());
    let cutter = Mutex::new(Cutter::new(&fates, chunk_points, job.wants_normals));
    let commit = |product: Product| lock(&cutter).cut(product);
    let encode = |chunk: Chunk, bench: &mut Bench| -> Result<Encoded> {
        bench.batch.clear();
        chunk.number(&mut bench.numbers);
        tiles.fetch(&bench.numbers, &mut bench.fetch, &mut bench.batch)?;
        bench.batch.normals = chunk.spread_normals();
        encoder.encode(&bench.batch)
    };
    let bench = || Bench {
        numbers: Vec::with_capacity(chunk_points),
        fetch: Fetch::default(),
        batch: PointBatch::new(job.source.schema().clone(), chunk_points),
    };
    let total = Mutex::new(Tally::default());
    let next = AtomicUsize::new(0);
    parallel(job.threads, |_| {
        let guard = StopOnDrop::new(|| outlet.stop());
        let mut bench = bench();
        let mut encode = |chunk| encode(chunk, &mut bench);
        let mut hands = Hands { commit: &commit, encode: &mut encode };
        let mut worker = Worker::new(job, lattice, tiles, capacity);
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(&key) = keys.get(index) else { break };
            let product = worker.mill(key)?;
            let positions = product.positions();
            outlet.deliver((index as u64, 0), product, true, &mut hands)?;
            job.advance(positions)?;
        }
        outlet.drain(&mut hands, |turn| turn.0 >= keys.len() as u64)?;
        lock(&total).merge(&worker.tally);
        guard.disarm();
        Ok(())
    })?;
    let (rest, kept) = lock(&cutter).finish()?;
    let mut bench = bench();
    let mut encode = |chunk| encode(chunk, &mut bench);
    let written = outlet.close(rest, &mut Hands { commit: &commit, encode: &mut encode })?;
    let tally = std::mem::take(&mut *lock(&total));
    drop(cutter);
    Ok(Milled { tally, fates, kept, written })
}

/// What a thread needs to encode chunks.
struct Bench {
    numbers: Vec<u64>,
    fetch: Fetch,
    batch: PointBatch,
}

/// What a thread needs to mill tiles.
struct Worker<'a> {
    job: &'a Job<'a>,
    loader: Loader,
    reach: i64,
    neighbors: usize,
    /// Where positions are rounded, and unequal coordinates that share one are counted.
    rounded: Option<Rounded<'a>>,
    tally: Tally,
}

impl<'a> Worker<'a> {
    fn new(
        job: &'a Job<'a>,
        lattice: &Lattice,
        tiles: &'a Arc<SealedTiles>,
        capacity: usize,
    ) -> Self {
        let neighbors = neighbors(&job.ops);
        let mut loader = Loader::new(tiles, capacity);
        if let Some(points) = job.tile_points {
            // Half for the zone, half for the rim, as where memory decides.
            loader.limit_rim(points.saturating_mul(2));
        }
        if neighbors > 0 {
            loader.tile().0.around.reserve(capacity);
        }
        let rounded = lattice.rounds().then(|| Rounded::new(tiles, job.source.schema()));
        let reach = reach(&job.ops);
        Worker { job, loader, reach, neighbors, rounded, tally: Tally::default() }
    }

    fn mill(&mut self, key: TileKey) -> Result<Product> {
        self.loader.load(key, self.reach, self.neighbors)?;
        let (tile, first_records) = self.loader.tile();
        for (_, op) in &self.job.ops {
            op.run(tile, &mut self.tally)?;
        }
        if let Some(rounded) = &mut self.rounded {
            let copies = tile.copies[tile.core.clone()].iter().copied();
            let unequal = rounded.count(first_records.iter().copied().zip(copies))?;
            self.tally.count("unequal_coordinates", unequal);
        }
        self.tally.work("rim_positions", (tile.positions.len() - tile.core.len()) as u64);
        self.tally.work("unproven", tile.around.take_unproven());
        self.tally.work("tied", tile.around.take_tied());
        Ok(Product::of(tile, first_records, self.job.wants_normals))
    }
}
