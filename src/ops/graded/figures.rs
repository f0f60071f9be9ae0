//! What becomes of each position, and how far what is removed is from the surface of what stays.

use super::super::removal::{keep_once, remove};
use super::correct::is_beyond;
use super::rank::{EXCEPTION, KEEP_RANK, rank_of};
use crate::Result;
use crate::geom::surface::{ASKED_RADII, SurfaceTold, ask_surface};
use crate::report::Tally;
use crate::store::{KeptPoints, KeptReader};
use crate::tile::{Fate, Tile};

/// By what positions are judged.
pub(super) struct Judgement<'a> {
    pub kept: &'a KeptPoints,
    /// No removed position is farther from a kept one, in steps.
    pub radius: i64,
    /// What is farther from the surface is kept as an exception, in steps.
    pub tolerance: Option<f64>,
    /// True if kept points have ranks.
    pub ranks: bool,
    /// Those of rounds, where they are not their numbers.
    pub of_rounds: &'a [u16],
}

impl Judgement<'_> {
    /// Keeps what was chosen and what is an exception, and removes what else is decided about with
    /// its distance to the surface.
    pub fn pass(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let mut reader = KeptReader::default();
        let within = self.radius.saturating_mul(ASKED_RADII);
        self.kept.near(&tile.cube.grown(within), &mut reader)?;
        let core = tile.core.clone();
        let mut all: Vec<Option<SurfaceTold>> = vec![None; core.len()];
        let (surface, at) = (&reader.positions, &tile.positions[core.clone()]);
        ask_surface(tile.simd(), surface, at, within, |i, told| all[i] = Some(told));
        let mut ranks = match self.ranks {
            true => Some(tile.columns.take(&KEEP_RANK)?),
            false => None,
        };
        let (mut coincident, mut represented, mut exceptions) = (0, 0, 0);
        for (i, told) in core.zip(all) {
            if !tile.is_chosen(i) {
                continue;
            }
            let is_kept = told.is_some_and(|told| told.distance2 == 0);
            let beyond = |tolerance| told.is_none_or(|told| is_beyond(told.off, tolerance));
            let is_exception = !is_kept && self.tolerance.is_some_and(beyond);
            if is_kept || is_exception {
                coincident += keep_once(tile, i);
                exceptions += u64::from(is_exception);
                let round = told.map_or(0, |told| reader.rounds[told.nearest as usize]);
                let of_round = self.of_rounds.get(round as usize).copied();
                let rank = of_round.unwrap_or_else(|| rank_of(round));
                let rank = if is_exception { EXCEPTION } else { rank };
                ranks.iter_mut().for_each(|ranks| ranks[i] = rank);
                continue;
            }
            represented += remove(tile, i);
            if let (Fate::Removed, Some(told)) = (tile.fates[i], told) {
                tile.fates[i] = Fate::Represented { deviation: told.off as f32 };
            }
        }
        if let Some(ranks) = ranks {
            tile.columns.put(ranks);
        }
        tally.remove("graded", "coincident", coincident);
        tally.remove("graded", "represented", represented);
        if self.tolerance.is_some() {
            tally.count("graded_exceptions", exceptions);
        }
        Ok(())
    }
}
