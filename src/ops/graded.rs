//! The stage `graded`: so many points stay, where they say most of the surface.

mod fill;
mod figures;
mod ladder;
mod refine;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Keep;
use crate::point::names;
use crate::report::Tally;
use crate::stage::{
    Found, Needs, NextRound, Role, RoleName, RoundOp, RoundTile, ScanFacts, SoFar, StageKind,
    StagePlace, TileOp,
};
use crate::store::KeptPoints;
use crate::tile::Tile;
use crate::{Error, Result};

use figures::measure;
use ladder::{Ladder, Work};

/// Keeps so many points, and those that say most of the surface.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Graded {
    /// How many records stay.
    pub keep: Keep,
    /// Of equally good choices, which are made.
    #[serde(default)]
    pub seed: u64,
    #[serde(skip)]
    ladder: Option<Ladder>,
    #[serde(skip)]
    kept: Option<Arc<KeptPoints>>,
}

/// Bytes a position.
const BYTES: usize = 64;

impl Graded {
    /// A reduction to that many points.
    pub fn new(keep: Keep) -> Graded {
        Graded { keep, seed: 0, ladder: None, kept: None }
    }
}

impl StageKind for Graded {
    const KIND: &'static str = "graded";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Keeps so many points, and those that say most of the surface.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::RoundOp(Box::new(self)))
    }
}

impl TileOp for Graded {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).bytes_per_point(BYTES).removes(None)
    }

    fn for_share(&mut self, share: f64) {
        if let Keep::Records(count) = &mut self.keep {
            *count = ((*count as f64 * share).round() as u64).max(1);
        }
    }

    fn settle(&mut self, _: &ScanFacts) -> Result<()> {
        (self.ladder, self.kept) = (None, None);
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let early = || Error::internal("the stage graded ran before it chose");
        let kept = self.kept.as_ref().ok_or_else(early)?;
        let ladder = self.ladder.as_ref().ok_or_else(early)?;
        measure(tile, kept, ladder.last(), tally)
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        let ladder = self.ladder.iter();
        ladder.map(|ladder| ("spacing_steps".into(), ladder.last().into())).collect()
    }
}

impl RoundOp for Graded {
    fn next(&mut self, so_far: &SoFar<'_>) -> Result<NextRound> {
        let (keep, seed) = (self.keep, self.seed);
        let ladder = self.ladder.get_or_insert_with(|| {
            Ladder::new(keep.of(so_far.records), so_far.levels, &so_far.bounds, seed)
        });
        Ok(ladder.next(so_far))
    }

    fn round(&self, tile: &RoundTile<'_>, found: &mut Found) -> Result<()> {
        match self.ladder.as_ref().and_then(Ladder::work) {
            Some(Work::Fill(filling)) => {
                filling.fill(tile, found);
                Ok(())
            }
            Some(Work::Refine(refining)) => refining.refine(tile, found),
            None => Err(Error::internal("the stage graded has no round to work on")),
        }
    }

    fn chosen(&mut self, kept: Arc<KeptPoints>) {
        self.kept = Some(kept);
    }
}
