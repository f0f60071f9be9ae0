//! The mill: decode into the tile store, then pass after pass over the tiles, in canonical order
//! into the sinks.
//!
//! Everything goes through one sealed scan: passes read it and leave states, fates and columns
//! beside it, so nothing is merged or sorted a second time, and branches share what is stored. What
//! a pass left is kept until the last pass that goes on from it is done. A scan that fits in memory
//! takes the same road as one that does not; only the spill then stays in memory.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::Value;

use super::by_input::ByInput;
use super::by_rank::ByRank;
use super::chunks::Lists;
use super::clock::Clock;
use super::compared::ComparedGrid;
use super::cut::{TileCut, cut_again, cut_all};
use super::decode::decode;
use super::finished::{Finished, FinishedBranch};
use super::forecast::{forecast, samples_capacity};
use super::grind::{DecodedScan, Numbered, grind};
use super::job::Job;
use super::mesh::connect;
use super::pass::{Call, Pass};
use super::phase::RunPhase;
use super::rounds::choose;
use super::settled::{conclude, decisions, rounding, settle};
use super::standing::Standing;
use super::survey::survey;
use super::task::Task;
use crate::budget::{Bytes, Holders, Lease};
use crate::geom::lattice::Lattice;
use crate::point::{ColumnKind, SHIFT};
use crate::report::{Decision, Tally};
use crate::stage::{Extent, Sink, SinkSummary};
use crate::store::{Pieces, SealedTiles, seal};
use crate::tile::Sieve;
use crate::{Error, Result};

/// Runs a pipeline with tile stages (or one that only sorts) into `sinks`; none where each input
/// has an output of its own.
pub(crate) fn mill(
    job: &mut Job<'_>,
    lattice: &Lattice,
    mut sinks: Vec<Option<Box<dyn Sink>>>,
    clock: &mut Clock<'_>,
) -> Result<Finished> {
    clock.begin(RunPhase::Decode, Some(job.task.source.points()))?;
    let decoding = job.task.demands.decode(job.shares.run_records as u64);
    let working = job.budget.lease_all(&decoding, "decoding")?;
    let (store, starts, mut tally) = decode(job, lattice)?;
    drop(working);
    job.check_headers()?;
    job.tell_left_out(&tally);
    tally.work("runs", store.runs() as u64);
    clock.begin(RunPhase::Merge, Some(tally.work.get("placed").copied().unwrap_or(0)))?;
    let tiles = Arc::new(seal(store, job.threads, &|n| job.advance(n))?);
    tally.count("positions", tiles.positions());
    let extent = Extent::new(lattice.clone(), tiles.bounds());
    sinks.iter_mut().flatten().try_for_each(|sink| sink.arrange(&extent))?;
    settle(job, lattice, &tiles)?;
    let field = DecodedScan { lattice, tiles: tiles.clone(), starts: Arc::new(starts) };
    let mut course = Course {
        clock,
        forecasts: vec![None; job.ops.len()],
        written: sinks.iter().map(|_| None).collect(),
        sinks,
        tally: Tally::default(),
    };
    let decoded =
        Standing { alive: tiles.points(), kept: tiles.points(), tally, ..Standing::default() };
    let branches = course.go(job, decoded, &field)?;
    let unwritten = || Error::internal("an output was never written");
    let written = course.written.into_iter().map(|w| w.ok_or_else(unwritten));
    let mut tally = course.tally;
    Ok(Finished {
        read: tally.work.remove("read").unwrap_or(0),
        written: written.collect::<Result<_>>()?,
        split: Vec::new(),
        tally,
        branches,
    })
}

/// What a mill holds beside what its passes leave.
struct Course<'c, 'w> {
    clock: &'c mut Clock<'w>,
    /// For each stage, what it said is to be expected.
    forecasts: Vec<Option<Vec<(String, Value)>>>,
    sinks: Vec<Option<Box<dyn Sink>>>,
    /// For each file of each sink, how many records it was given, and what it said in the end.
    written: Vec<Option<Vec<(u64, SinkSummary)>>>,
    /// Counts of all passes.
    tally: Tally,
}

/// The outputs of a pass.
struct PassOutputs {
    /// Those that grow while it mills.
    growing: Vec<Numbered>,
    lists: Lists,
    /// Those that are written by rank behind it, in the order of these lists.
    ordered: Vec<Box<dyn Sink>>,
}

impl Course<'_, '_> {
    /// Runs all passes; what a branch comes to is measured as soon as its last one is done.
    fn go(
        &mut self,
        job: &mut Job<'_>,
        decoded: Standing,
        field: &DecodedScan<'_>,
    ) -> Result<Vec<FinishedBranch>> {
        let Task { passes, branches, demands, .. } = job.task;
        let cuts = cut_all(job, field.lattice, &field.tiles)?;
        let milling = |cut: &Arc<TileCut>| demands.mill(cut.millers, cut.capacity as u64);
        let looking = demands.mill(job.threads.count(), samples_capacity(&job.shares) as u64);
        let most = cuts.iter().map(milling).fold(looking, Holders::larger);
        self.tally.merge(&decoded.tally);
        // What the decode left comes first, then what each pass leaves.
        let mut left: Vec<Option<Standing>> = vec![Some(decoded)];
        let (mut finished, mut working) = (Vec::new(), None);
        for (n, (pass, cut)) in passes.iter().zip(cuts).enumerate() {
            let from = pass.behind.map_or(0, |behind| behind + 1);
            let is_last = passes[n + 1..].iter().all(|later| later.behind != pass.behind);
            let slot = left.get_mut(from);
            let before = slot.and_then(|slot| if is_last { slot.take() } else { slot.clone() });
            let before = before.ok_or_else(|| Error::internal("a pass goes on from nothing"))?;
            let mut held = match working.take() {
                Some(held) => held,
                None => job.budget.lease_all(&most, "mill")?,
            };
            let mut after = self.run(job, n, &cut, &mut held, before, field)?;
            // How far points were moved is asked for where the branch is measured.
            let is_loaded = |kind: &ColumnKind| {
                *kind == SHIFT.kind()
                    || passes[n + 1..].iter().any(|pass| pass.loads.contains(kind))
            };
            after.sieve.columns.retain(|(kind, _)| is_loaded(kind));
            match branches.iter().position(|branch| branch.pass == n) {
                None if pass.is_repeated && !job.task.traits.skips_survey => {
                    drop((held, cut));
                    self.clock.begin(RunPhase::Measure(n), Some(2 * field.tiles.positions()))?;
                    after.tell_planes(&survey(job, field.lattice, &field.tiles, &after.sieve)?);
                    left.push(Some(after));
                }
                None => {
                    working = Some(held);
                    left.push(Some(after));
                }
                Some(branch) => {
                    drop((held, cut));
                    left.push(None);
                    finished.push(self.finish(job, branch, after, field)?);
                }
            }
        }
        Ok(finished)
    }

    /// Measures what branch `number` came to.
    fn finish(
        &mut self,
        job: &Job<'_>,
        number: usize,
        mut after: Standing,
        field: &DecodedScan<'_>,
    ) -> Result<FinishedBranch> {
        let DecodedScan { lattice, tiles, .. } = field;
        let mut measured = None;
        if !job.task.traits.skips_survey {
            self.clock.begin(RunPhase::Survey(number), Some(2 * tiles.positions()))?;
            let measured = measured.insert(survey(job, lattice, tiles, &after.sieve)?);
            if job.task.passes[job.task.branches[number].pass].is_repeated {
                after.tell_planes(measured);
            }
            let compared = after.compared.as_deref();
            measured.totals.baseline = compared.and_then(|c| c.figures(after.alive, lattice));
        }
        let mut tally = after.tally;
        Ok(FinishedBranch {
            kept: after.kept,
            decisions: rounding(job, lattice, &tiles.bounds(), &tally)
                .into_iter()
                .chain(decisions(job, &job.task.branches[number], &self.forecasts))
                .collect(),
            classes: tally.classes.take().map_or(Vec::new(), |classes| classes.figures()),
            passes: after.passes,
            tally,
            measured,
        })
    }

    /// Runs pass `number` over what those before it left.
    fn run(
        &mut self,
        job: &mut Job<'_>,
        number: usize,
        cut: &Arc<TileCut>,
        working: &mut Vec<Lease>,
        mut before: Standing,
        field: &DecodedScan<'_>,
    ) -> Result<Standing> {
        let (tiles, pass) = (&field.tiles, &job.task.passes[number]);
        let sieve = pass.sieve(&before.sieve, job.task.schema());
        self.clock.begin(RunPhase::Look(number), None)?;
        self.foresee(job, pass, field, &sieve)?;
        let held = working.iter().map(Lease::bytes).sum();
        let cut = cut_again(job, pass, field.lattice, tiles, cut, held)?;
        let milling = job.task.demands.mill(cut.millers, cut.capacity as u64);
        if milling.sum() > Bytes(held) {
            working.clear();
            *working = job.budget.lease_all(&milling, "mill")?;
        }
        if !pass.by_rounds.is_empty() {
            self.clock.begin(RunPhase::Choose(number), None)?;
        }
        for &op in &pass.by_rounds {
            let grid = choose(job, op, field, &sieve, cut.capacity)?;
            grid.into_iter().for_each(|grid| before.compare(ComparedGrid::OfAsMany(grid)));
        }
        let phase = if pass.gathers().is_some() { RunPhase::Gather } else { RunPhase::Mill };
        self.clock.begin(phase(number), Some(tiles.positions()))?;
        let mut tally = Tally::default();
        tally.work("tiles", cut.keys.len() as u64);
        let levels: BTreeSet<u32> = cut.keys.iter().map(|key| key.level).collect();
        tally.work("tile_levels", levels.len() as u64);
        let PassOutputs { growing, lists, ordered } = self.outputs(job, pass, field)?;
        let mut milled = grind(job, pass, &cut, field, &sieve, growing, lists)?;
        drop(sieve);
        tally.merge(&milled.tally);
        if !ordered.is_empty() {
            // The arenas of the tiles are gone.
            working.clear();
            *working = job.budget.lease_all(&job.task.demands.ordering(), "ordering")?;
        }
        self.write_lists(job, tiles, &milled.lists, ordered, &mut tally)?;
        let written = std::mem::take(&mut milled.written);
        for ((sink, open), given) in written.into_iter().zip(milled.counts.outputs.clone()) {
            let is_before = pass.before.contains(&sink);
            let now = Some(milled.stored.states.clone());
            let states = if is_before { before.sieve.states.clone() } else { now };
            let said =
                self.close((sink, open), given, (job, field, states), working, &mut tally)?;
            self.written[sink] = Some(vec![(given, said)]);
        }
        self.tally.merge(&tally);
        let decided = milled.decided;
        let (after, gathered) = before.behind(job, pass, milled, &tally);
        if let Some(op) = pass.gathers() {
            conclude(job, op, gathered, decided)?;
        }
        Ok(after)
    }

    /// Finishes a sink that was given so many records, of which `left` says what stands behind the
    /// pass by these states; first connects them, if it is a mesh.
    fn close(
        &mut self,
        (sink, open): Numbered,
        given: u64,
        (job, field, left): (&Job<'_>, &DecodedScan<'_>, Option<Arc<Pieces>>),
        working: &mut Vec<Lease>,
        tally: &mut Tally,
    ) -> Result<SinkSummary> {
        let Some(shape) = job.task.meshes[sink] else { return open.finish() };
        // The arenas of the tiles are gone.
        working.clear();
        self.clock.begin(RunPhase::Connect(sink), Some(given))?;
        let (said, counted) = connect(job, field, left, shape, open)?;
        tally.merge(&counted);
        Ok(said)
    }

    /// Lets stages of a pass that want to look at samples do so, and tells what they chose.
    fn foresee(
        &mut self,
        job: &mut Job<'_>,
        pass: &Pass,
        field: &DecodedScan<'_>,
        sieve: &Sieve,
    ) -> Result<()> {
        let ahead = |call: &&Call| self.forecasts[call.op].is_none();
        let ops: Vec<usize> = pass.calls.iter().filter(ahead).map(|call| call.op).collect();
        let mut chosen = Vec::new();
        for (op, foreseen) in forecast(job, pass, &ops, field, sieve)? {
            if let Some(warning) = foreseen.warning {
                job.warn(warning);
            }
            let stage = &job.ops[op].kind;
            let decision = |(name, value): &(String, Value)| Decision {
                stage: stage.clone(),
                name: name.clone(),
                value: value.clone(),
            };
            chosen.extend(foreseen.chosen.iter().map(decision));
            let all = foreseen.chosen.into_iter().chain(foreseen.decisions);
            self.forecasts[op] = Some(all.collect());
        }
        if !chosen.is_empty() {
            job.watch.chose(&chosen);
        }
        Ok(())
    }

    /// The outputs of a pass.
    fn outputs(
        &mut self,
        job: &Job<'_>,
        pass: &Pass,
        field: &DecodedScan<'_>,
    ) -> Result<PassOutputs> {
        let (mut growing, mut lists, mut ordered) = (Vec::new(), Lists::default(), Vec::new());
        let all = pass.row(&job.task.computed);
        for &sink in pass.before.iter().chain(&pass.after) {
            let (layout, before) = (job.layout(sink, &all), pass.before.contains(&sink));
            if job.task.sinks[sink].is_folder() {
                let inputs = job.task.files(sink).len();
                lists.by_input.push(ByInput::new(&job.area, sink, inputs, &layout, before));
                continue;
            }
            let open = self.sinks.get_mut(sink).and_then(Option::take);
            let open = open.ok_or_else(|| Error::internal("an output is written twice"))?;
            if job.task.in_input_order[sink] {
                let list = ByRank::new(&job.area, sink, &field.starts, &layout, before);
                lists.by_rank.push(list);
                ordered.push(open);
            } else {
                growing.push((sink, open));
            }
        }
        Ok(PassOutputs { growing, lists, ordered })
    }

    /// Writes the outputs that are written behind a pass's last tile.
    fn write_lists(
        &mut self,
        job: &Job<'_>,
        tiles: &SealedTiles,
        Lists { by_input, by_rank }: &Lists,
        ordered: Vec<Box<dyn Sink>>,
        tally: &mut Tally,
    ) -> Result<()> {
        for lists in by_input {
            self.clock.begin(RunPhase::Write(lists.sink), Some(lists.records()))?;
            let (written, counted) = lists.write(job, tiles)?;
            tally.merge(&counted);
            self.written[lists.sink] = Some(written);
        }
        for (lists, sink) in by_rank.iter().zip(ordered) {
            self.clock.begin(RunPhase::Write(lists.sink), Some(lists.records))?;
            let (said, counted) = lists.write(job, tiles, sink)?;
            tally.merge(&counted);
            self.written[lists.sink] = Some(vec![(lists.records, said)]);
        }
        Ok(())
    }
}
