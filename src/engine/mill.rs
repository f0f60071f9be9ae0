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
use super::chunks::FoundValues;
use super::clock::Clock;
use super::cut::{Cut, cut_again, cut_all};
use super::decode::decode;
use super::demands::Demands;
use super::finished::{Finished, FinishedBranch};
use super::forecast::{forecast, samples_capacity};
use super::grind::{DecodedScan, Milled, PassOutputs, grind};
use super::job::Job;
use super::pass::{Branch, Call, Pass};
use super::settled::{conclude, decisions, rounding, settle};
use super::shares::Shares;
use super::survey::survey;
use crate::budget::{Bytes, Holders, Lease};
use crate::geom::lattice::Lattice;
use crate::report::{Baseline, BaselineFigures, Decision, PassFigures, Tally};
use crate::stage::{Sink, SinkSummary};
use crate::store::{SealedTiles, SpillArea, seal};
use crate::tile::Sieve;
use crate::{Error, Result};

/// Runs a pipeline with tile stages (or one that only sorts) into `sinks`; none where each input
/// has an output of its own.
pub(crate) fn mill(
    job: &mut Job<'_>,
    lattice: &Lattice,
    shares: &Shares,
    demands: &Demands,
    area: &Arc<SpillArea>,
    sinks: Vec<Option<Box<dyn Sink>>>,
    clock: &mut Clock<'_>,
) -> Result<Finished> {
    clock.phase("decode", Some(job.source.points()));
    let working = job.budget.lease_all(&demands.decode(shares.run_records as u64), "decoding")?;
    let (store, starts, mut tally) = decode(job, lattice, shares, area)?;
    drop(working);
    job.check_headers()?;
    job.tell_left_out(&tally);
    tally.work("runs", store.runs() as u64);
    clock.phase("merge", Some(tally.work.get("placed").copied().unwrap_or(0)));
    let tiles = Arc::new(seal(store, job.threads, &|n| job.advance(n))?);
    tally.count("positions", tiles.positions());
    settle(job, lattice, &tiles)?;
    let field =
        DecodedScan { lattice, area: area.clone(), tiles: tiles.clone(), starts: Arc::new(starts) };
    let mut course = Course {
        forecasts: vec![None; job.ops.len()],
        written: sinks.iter().map(|_| None).collect(),
        sinks,
        tally: Tally::default(),
    };
    let decoded =
        Standing { alive: tiles.points(), kept: tiles.points(), tally, ..Standing::default() };
    let branches = course.go(job, decoded, &field, (shares, demands), clock)?;
    let unwritten = || Error::internal("an output was never written");
    let written = course.written.into_iter().map(|w| w.ok_or_else(unwritten));
    let mut tally = course.tally;
    Ok(Finished {
        read: tally.work.remove("read").unwrap_or(0),
        written: written.collect::<Result<_>>()?,
        tally,
        branches,
    })
}

/// What a pass leaves, and those before it on its branch.
#[derive(Clone, Default)]
struct Standing {
    sieve: Sieve,
    /// Records that the next pass finds, and that are written if none follows.
    alive: u64,
    kept: u64,
    passes: Vec<PassFigures>,
    /// Grids to compare with, from the first pass that decided by normals.
    compared: Option<Arc<Compared>>,
    tally: Tally,
}

/// See [`Standing::compared`].
struct Compared {
    baseline: Baseline,
    /// Records that the pass decided about, and that it found.
    decided: u64,
    found: u64,
}

impl Standing {
    /// What a grid would have done that leaves as many of the records that the passes decided
    /// about.
    fn baseline(&self, lattice: &Lattice) -> Option<BaselineFigures> {
        let Compared { baseline, decided, found } = self.compared.as_deref()?;
        let removed = found.checked_sub(self.alive)?;
        baseline.figures(decided.checked_sub(removed)?, *decided, lattice)
    }

    /// The same behind another pass, which came to `milled` and counted `tally`; and what a first
    /// phase found in it.
    fn behind(
        mut self,
        job: &Job<'_>,
        pass: &Pass,
        milled: Milled,
        tally: &Tally,
    ) -> (Standing, FoundValues) {
        self.tally.merge(tally);
        if let (Some(baseline), None) = (milled.baseline, &self.compared) {
            let (decided, found) = (milled.decided, self.alive);
            self.compared = Some(Arc::new(Compared { baseline, decided, found }));
        }
        let called = pass.calls.iter().map(|call| job.ops[call.op].kind.clone());
        let streamed = pass.filters.iter().map(|&filter| job.filters[filter].kind.clone());
        let (stages, after) = (called.chain(streamed).collect(), milled.counts.alive);
        self.passes.push(PassFigures { stages, before: self.alive, after });
        self.sieve.states = Some(milled.stored.states);
        self.sieve.fates = Some(milled.stored.fates);
        self.sieve.figures = milled.stored.figures;
        if milled.stored.normals.is_some() {
            self.sieve.oriented = milled.oriented;
        }
        self.sieve.normals = milled.stored.normals.or(self.sieve.normals.take());
        (self.alive, self.kept) = (after, milled.counts.written);
        (self, milled.stored.found)
    }
}

/// What a mill holds beside what its passes leave.
struct Course {
    /// For each stage, what it said is to be expected.
    forecasts: Vec<Option<Vec<(String, Value)>>>,
    sinks: Vec<Option<Box<dyn Sink>>>,
    /// For each file of each sink, how many records it was given, and what it said in the end.
    written: Vec<Option<Vec<(u64, SinkSummary)>>>,
    /// Counts of all passes.
    tally: Tally,
}

impl Course {
    /// Runs all passes; what a branch comes to is measured as soon as its last one is done.
    fn go(
        &mut self,
        job: &mut Job<'_>,
        decoded: Standing,
        field: &DecodedScan<'_>,
        (shares, demands): (&Shares, &Demands),
        clock: &mut Clock<'_>,
    ) -> Result<Vec<FinishedBranch>> {
        let passes = std::mem::take(&mut job.passes);
        let cuts = cut_all(job, &passes, field.lattice, shares, demands, &field.tiles)?;
        let milling = |cut: &Arc<Cut>| demands.mill(cut.millers, cut.capacity as u64);
        let looking = demands.mill(job.threads.count(), samples_capacity(shares) as u64);
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
            let place = (pass, &cut, &mut held);
            let after = self.run(job, place, before, field, (shares, demands), clock)?;
            match job.branches.iter().find(|branch| branch.pass == n) {
                None => {
                    working = Some(held);
                    left.push(Some(after));
                }
                Some(branch) => {
                    drop((held, cut));
                    left.push(None);
                    finished.push(self.finish(job, branch, after, field, clock)?);
                }
            }
        }
        Ok(finished)
    }

    /// Measures what a branch came to.
    fn finish(
        &self,
        job: &Job<'_>,
        branch: &Branch,
        after: Standing,
        field: &DecodedScan<'_>,
        clock: &mut Clock<'_>,
    ) -> Result<FinishedBranch> {
        let DecodedScan { lattice, area, tiles, .. } = field;
        clock.phase("survey", Some(2 * tiles.positions()));
        let mut measured = survey(job, lattice, area, tiles, &after.sieve)?;
        measured.totals.baseline = after.baseline(lattice);
        let mut tally = after.tally;
        Ok(FinishedBranch {
            kept: after.kept,
            decisions: rounding(job, lattice, &tiles.bounds(), &tally)
                .into_iter()
                .chain(decisions(job, branch, &self.forecasts))
                .collect(),
            classes: tally.classes.take().map_or(Vec::new(), |classes| classes.figures()),
            passes: after.passes,
            tally,
            measured: Some(measured),
        })
    }

    /// Runs a pass over what those before it left.
    fn run(
        &mut self,
        job: &mut Job<'_>,
        (pass, cut, working): (&Pass, &Arc<Cut>, &mut Vec<Lease>),
        before: Standing,
        field: &DecodedScan<'_>,
        (shares, demands): (&Shares, &Demands),
        clock: &mut Clock<'_>,
    ) -> Result<Standing> {
        let tiles = &field.tiles;
        let sieve = pass.sieve(&before.sieve);
        self.foresee(job, pass, field, &sieve, shares)?;
        let held = working.iter().map(Lease::bytes).sum();
        let cut = cut_again(job, pass, field.lattice, (shares, demands), tiles, (cut, held))?;
        let milling = demands.mill(cut.millers, cut.capacity as u64);
        if milling.sum() > Bytes(held) {
            working.clear();
            *working = job.budget.lease_all(&milling, "mill")?;
        }
        let phase = if pass.gathers().is_some() { "gather" } else { "mill" };
        clock.phase(phase, Some(tiles.positions()));
        let mut tally = Tally::default();
        tally.work("tiles", cut.keys.len() as u64);
        let levels: BTreeSet<u32> = cut.keys.iter().map(|key| key.level).collect();
        tally.work("tile_levels", levels.len() as u64);
        let ((sinks, by_input, by_rank), ordered) = self.outputs(job, pass, field)?;
        let which: Vec<usize> = sinks.iter().map(|(sink, _)| *sink).collect();
        let mut milled = grind(job, (pass, &cut), field, &sieve, (sinks, by_input, by_rank))?;
        drop(sieve);
        tally.merge(&milled.tally);
        self.write_lists(job, tiles, &milled, ordered, &mut tally, clock)?;
        let said = std::mem::take(&mut milled.written);
        let outcomes = milled.counts.outputs.iter().copied().zip(said);
        for (sink, outcome) in which.into_iter().zip(outcomes) {
            self.written[sink] = Some(vec![outcome]);
        }
        self.tally.merge(&tally);
        let decided = milled.decided;
        let (after, found) = before.behind(job, pass, milled, &tally);
        if let Some(op) = pass.gathers() {
            conclude(job, op, found, decided)?;
        }
        Ok(after)
    }

    /// Lets stages of a pass that want to look at samples do so, and tells what they chose.
    fn foresee(
        &mut self,
        job: &mut Job<'_>,
        pass: &Pass,
        field: &DecodedScan<'_>,
        sieve: &Sieve,
        shares: &Shares,
    ) -> Result<()> {
        let ahead = |call: &&Call| self.forecasts[call.op].is_none();
        let ops: Vec<usize> = pass.calls.iter().filter(ahead).map(|call| call.op).collect();
        let mut chosen = Vec::new();
        for (op, foreseen) in forecast(job, pass, &ops, field, sieve, samples_capacity(shares))? {
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

    /// The outputs of a pass: those that grow while it mills, lists of those that are written
    /// behind it, and the sinks that are then written in the order of the inputs.
    fn outputs(
        &mut self,
        job: &Job<'_>,
        pass: &Pass,
        field: &DecodedScan<'_>,
    ) -> Result<(PassOutputs, Vec<Box<dyn Sink>>)> {
        let (mut sinks, mut by_input) = (Vec::new(), Vec::new());
        let (mut by_rank, mut ordered) = (Vec::new(), Vec::new());
        for &sink in pass.before.iter().chain(&pass.after) {
            let (normals, before) = (job.wants_normals[sink], pass.before.contains(&sink));
            if let Some(Some(each)) = job.each.get(sink) {
                let inputs = each.sinks.len();
                by_input.push(ByInput::new(&field.area, sink, inputs, normals, before));
                continue;
            }
            let open = self.sinks.get_mut(sink).and_then(Option::take);
            let open = open.ok_or_else(|| Error::internal("an output is written twice"))?;
            if job.in_input_order[sink] {
                by_rank.push(ByRank::new(&field.area, sink, &field.starts, normals, before));
                ordered.push(open);
            } else {
                sinks.push((sink, open));
            }
        }
        Ok(((sinks, by_input, by_rank), ordered))
    }

    /// Writes the outputs that are written behind a pass's last tile.
    fn write_lists(
        &mut self,
        job: &Job<'_>,
        tiles: &SealedTiles,
        milled: &Milled,
        ordered: Vec<Box<dyn Sink>>,
        tally: &mut Tally,
        clock: &mut Clock<'_>,
    ) -> Result<()> {
        for lists in &milled.by_input {
            clock.phase("write", Some(lists.records()));
            let unknown = || Error::internal("an output has no inputs");
            let each = job.each[lists.sink].as_ref().ok_or_else(unknown)?;
            let (written, counted) = each.write(job, tiles, lists)?;
            tally.merge(&counted);
            self.written[lists.sink] = Some(written);
        }
        for (lists, sink) in milled.by_rank.iter().zip(ordered) {
            clock.phase("write", Some(lists.records));
            let (said, counted) = lists.write(job, tiles, sink)?;
            tally.merge(&counted);
            self.written[lists.sink] = Some(vec![(lists.records, said)]);
        }
        Ok(())
    }
}
