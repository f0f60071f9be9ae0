//! What stages are told of the whole scan, and what they settle by it: before the first tile,
//! behind a first phase, and for the report.
//!
//! A stage settles by figures of the scan and not by those of the first tile that it meets, so that
//! it does the same to every tile, however tiles are cut. What it settled by itself is in the
//! report, so that the same can be asked for by hand.

use std::collections::BTreeSet;

use serde_json::Value;

use super::Watch;
use super::chunks::StoredGathered;
use super::demands::{HELD_OF_SCAN, held_of_scan};
use super::job::Job;
use super::pass::{Branch, Call, Op, needs};
use super::task::GivenLengths;
use crate::geom::lattice::Lattice;
use crate::point::Bounds;
use crate::quantity::Length;
use crate::report::{Decision, Grouped, Short, Tally};
use crate::stage::{ScanFacts, StoredSummaries};
use crate::store::SealedTiles;
use crate::{Error, Result};

/// What a first phase gathered, for its stage.
struct GatheredSummaries<'a> {
    gathered: StoredGathered,
    records: u64,
    watch: &'a dyn Watch,
}

impl StoredSummaries for GatheredSummaries<'_> {
    fn each(&self, visit: &mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()> {
        self.gathered.each(visit)
    }

    fn records(&self) -> u64 {
        self.records
    }

    fn go_on(&self) -> Result<()> {
        if self.watch.cancelled() { Err(Error::interrupted()) } else { Ok(()) }
    }
}

/// Lets the stage `op` conclude from what its first phase gathered, about so many records.
pub(crate) fn conclude(
    job: &mut Job<'_>,
    op: usize,
    gathered: StoredGathered,
    records: u64,
) -> Result<()> {
    let holds = needs(&job.ops, Call { op, gathers: true });
    let bytes = held_of_scan(&holds, records).0;
    if bytes > 0 {
        job.held.push(job.budget.lease(bytes, HELD_OF_SCAN)?);
    }
    let stored = GatheredSummaries { gathered, records, watch: job.watch };
    let warning = match &mut job.ops[op].op {
        Op::Scan(op) => op.conclude_from(&stored)?,
        Op::Tile(_) | Op::Round(_) => {
            return Err(Error::internal("a stage gathered that has one phase"));
        }
    };
    warning.into_iter().for_each(|warning| job.warn(warning));
    Ok(())
}

/// Tells all stages what is known of the scan, before the first tile.
pub(crate) fn settle(job: &mut Job<'_>, lattice: &Lattice, tiles: &SealedTiles) -> Result<()> {
    let facts = ScanFacts {
        points: tiles.points(),
        positions: tiles.positions(),
        bounds: tiles.bounds(),
        lattice,
        levels: tiles.levels(),
    };
    job.ops.iter_mut().try_for_each(|stage| stage.op.tile_mut().settle(&facts))?;
    let warnings = job.ops.iter().flat_map(|stage| stage.op.tile().warnings(lattice));
    // Stages that are applied several times say it once.
    let warnings: BTreeSet<String> = warnings.collect();
    warnings.into_iter().for_each(|warning| job.warn(warning));
    Ok(())
}

/// What the lattice rounded, as a decision of the report; a warning where it rounded much.
pub(crate) fn rounding(
    job: &Job<'_>,
    lattice: &Lattice,
    bounds: &Bounds,
    tally: &Tally,
) -> Option<Decision> {
    let apart = tally.apart?;
    let count = |name| tally.counts.get(name).copied().unwrap_or(0);
    let (unequal, positions) = (count("unequal_coordinates"), count("positions"));
    if unequal > positions / 1000 {
        let finer = match lattice.finer(bounds, apart.nearest) {
            Some(step) => format!("`run.lattice = {step:e}` tells them apart"),
            None => "no step that is finer reaches the scan from its origin".to_owned(),
        };
        job.warn(format!(
            "{} of {} positions hold points of unequal coordinates, up to {} from each other: \
             the lattice has steps of {}; {finer}",
            Grouped(unequal),
            Grouped(positions),
            Short(apart.farthest),
            Short(lattice.step)
        ));
    }
    let (stage, name) = ("run".to_owned(), "unequal_coordinates_apart".to_owned());
    Some(Decision { stage, name, value: apart.farthest.into() })
}

/// What lengths in a unit of their own are in that of the scan, each under its key; and what they
/// were `given` as.
fn converted(lengths: &[(&'static str, Length)], given: &GivenLengths) -> Vec<(String, Value)> {
    let each = given.iter().flat_map(|(key, text)| {
        let value =
            lengths.iter().find(|(named, _)| named == key).map(|(_, length)| length.value());
        let name = key.rsplit('.').next().unwrap_or(key);
        [
            (format!("{name}_given"), text.clone().into()),
            (format!("{name}_converted"), value.into()),
        ]
    });
    each.collect()
}

/// What the stages of a branch settled by themselves and what they expected, in their order.
pub(crate) fn decisions(
    job: &Job<'_>,
    branch: &Branch,
    forecasts: &[Option<Vec<(String, Value)>>],
) -> Vec<Decision> {
    let each = branch.ops.iter().flat_map(|&op| {
        let (stage, expected) = (&job.ops[op], forecasts[op].clone());
        let mut settled = stage.op.tile().decisions();
        // What was chosen by samples may be among what is settled.
        let is_new = |(name, _): &(String, Value)| settled.iter().all(|(other, _)| other != name);
        let expected: Vec<_> = expected.into_iter().flatten().filter(is_new).collect();
        settled.extend(expected);
        settled.extend(converted(&stage.op.tile().lengths(), &job.task.given[op]));
        settled.into_iter().map(|(name, value)| Decision { stage: stage.kind.clone(), name, value })
    });
    each.collect()
}
