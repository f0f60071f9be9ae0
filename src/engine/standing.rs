//! What stands behind a pass: states, columns and counts, which the passes behind it go on from.
//!
//! Several passes may go on from one, on branches of their own, so what stands is cloned and never
//! changed: what is large in it is shared.

use std::sync::Arc;

use super::chunks::StoredGathered;
use super::compared::{Compared, ComparedGrid};
use super::grind::Milled;
use super::job::Job;
use super::pass::Pass;
use super::survey::Measured;
use crate::point::NORMAL;
use crate::report::{PassFigures, Tally};
use crate::tile::Sieve;

/// What a pass leaves, and those before it on its branch.
#[derive(Clone, Default)]
pub(crate) struct Standing {
    pub sieve: Sieve,
    /// Records that the next pass finds, and that are written if none follows.
    pub alive: u64,
    pub kept: u64,
    pub passes: Vec<PassFigures>,
    /// Grids to compare with, from the first pass that decided by normals or in rounds.
    pub compared: Option<Arc<Compared>>,
    pub tally: Tally,
}

impl Standing {
    /// Enters what was measured of grids in a pass over what it leaves, if it is the first.
    pub fn compare(&mut self, with: ComparedGrid) {
        if self.compared.is_none() {
            self.compared = Some(Arc::new(Compared::new(with, self.alive)));
        }
    }

    /// Enters what planes of what its last pass left were measured.
    pub fn tell_planes(&mut self, measured: &Measured) {
        let Some(pass) = self.passes.last_mut() else { return };
        pass.tile_plane = measured.totals.tile_plane.after;
        pass.scan_plane = measured.totals.scan_plane.after;
    }

    /// What it is behind another pass, which came to `milled` and counted `tally`; and what a first
    /// phase gathered in it.
    pub fn behind(
        mut self,
        job: &Job<'_>,
        pass: &Pass,
        milled: Milled,
        tally: &Tally,
    ) -> (Standing, StoredGathered) {
        self.tally.merge(tally);
        if let Some(baseline) = milled.baseline {
            self.compare(ComparedGrid::Levels { baseline, decided: milled.decided });
        }
        let called = pass.calls.iter().map(|call| job.ops[call.op].kind.clone());
        let streamed = pass.filters.iter().map(|&filter| job.task.filters[filter].kind.clone());
        let chosen = pass.chooses.map(|op| format!("{}.where", job.ops[op].kind));
        let (stages, after) = (called.chain(streamed).chain(chosen), milled.counts.alive);
        let (tile_plane, scan_plane) = (None, None);
        let (stages, before) = (stages.collect(), self.alive);
        self.passes.push(PassFigures { stages, before, after, tile_plane, scan_plane });
        self.sieve.states = Some(milled.stored.states);
        self.sieve.fates = Some(milled.stored.fates);
        let columns = milled.stored.columns;
        if columns.iter().any(|(kind, _)| *kind == NORMAL.kind()) {
            self.sieve.oriented = milled.oriented;
        }
        self.sieve.columns.retain(|(kind, _)| columns.iter().all(|(newer, _)| newer != kind));
        self.sieve.columns.extend(columns);
        (self.alive, self.kept) = (after, milled.counts.written);
        (self, milled.stored.gathered)
    }
}
