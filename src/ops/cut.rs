//! The stage `cut`: a coarser reduction from one whose points have ranks.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Keep;
use super::graded::SHORTENED_BY;
use super::removal::{keep_once, remove};
use crate::geom::hash::of_position;
use crate::geom::select::nth_largest;
use crate::point::{Column, names};
use crate::report::Tally;
use crate::stage::{Gathered, Needs, Role, RoleName, ScanOp, StageKind, StagePlace, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// The ranks that the records have.
const RANK: Column<f64> = Column::new("KeepRank", &[]);

/// Cuts a coarser reduction off one that `graded` made with `ranks`: the points of the lowest
/// `KeepRank` stay, and of the last rank that is not kept as a whole those whose position has the
/// smallest hash. What stays is what `graded` with `ranks` would have kept of the original scan for
/// that number, and nothing is computed for it. (Where the reduction was written in another format
/// than the scan is in, positions may be on another lattice, and others of the last rank stay.)
/// Several outputs of several numbers take one read, each on a branch of its own.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// How many positions stay: a share of those that there are ("10%"), or a number (500000,
    /// "250k", "5M").
    pub keep: Keep,
    #[serde(skip)]
    limit: Option<u64>,
}

impl Cut {
    /// A reduction to that many positions.
    pub fn new(keep: Keep) -> Cut {
        Cut { keep, limit: None }
    }
}

/// Bytes a position.
const BYTES: usize = 2 * size_of::<u64>();

/// What orders positions: the larger, the sooner one stays. The rank, and of one rank the 48
/// highest bits of the hash, which no two of a scan are likely to share.
fn order(tile: &Tile, ranks: &[f64], i: usize) -> u64 {
    // What is no rank is a large one.
    let highest = f64::from(u16::MAX);
    let rank = if ranks[i].is_nan() { highest } else { ranks[i].clamp(0.0, highest) };
    let hash = of_position(SHORTENED_BY, tile.positions[i]);
    (u64::from(u16::MAX) - rank as u64) << 48 | !hash >> 16
}

impl StageKind for Cut {
    const KIND: &'static str = "cut";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Cuts a coarser reduction off one whose points have ranks.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        if self.keep == Keep::Auto {
            let told = "`cut.keep = \"auto\"` is not known: it takes a share or a number";
            let error = Error::pipeline(told).help("give `cut.keep = \"10%\"`");
            return Err(at.blame("keep", error));
        }
        Ok(Role::ScanOp(Box::new(self)))
    }
}

impl TileOp for Cut {
    fn needs(&self) -> Needs {
        let looks = Needs::none().looks_at(names::XYZ).reads(&RANK);
        looks.bytes_per_point(BYTES).removes(None)
    }

    fn for_share(&mut self, share: f64) {
        if let Keep::Records(count) = &mut self.keep {
            *count = ((*count as f64 * share).round() as u64).max(1);
        }
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let early = || Error::internal("the stage cut ran before its limit was known");
        let limit = self.limit.ok_or_else(early)?;
        let ranks = tile.columns.take(&RANK)?;
        let (mut coincident, mut gone) = (0, 0);
        for i in tile.core.clone().filter(|i| tile.copies[*i] > 0).collect::<Vec<usize>>() {
            if !tile.is_chosen(i) {
                continue;
            }
            if order(tile, &ranks, i) >= limit {
                coincident += keep_once(tile, i);
            } else {
                gone += remove(tile, i);
            }
        }
        tile.columns.put(ranks);
        tally.remove("cut", "coincident", coincident);
        tally.remove("cut", "rank", gone);
        Ok(())
    }
}

impl ScanOp for Cut {
    type Summary = Vec<u64>;

    fn gather_needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).reads(&RANK).bytes_per_point(BYTES)
    }

    fn gather(&self, tile: &mut Tile, _: &mut Tally) -> Result<Vec<u64>> {
        let ranks = tile.columns.get(&RANK)?;
        let chosen = tile.core.clone().filter(|i| tile.is_chosen(*i));
        let mut all = Vec::with_capacity(tile.core.len());
        all.extend(chosen.map(|i| order(tile, ranks, i)));
        Ok(all)
    }

    fn conclude(&mut self, gathered: &dyn Gathered<Vec<u64>>) -> Result<Option<String>> {
        let mut all = 0;
        gathered.each(&mut |tile| {
            all += tile.len() as u64;
            Ok(())
        })?;
        let want = self.keep.of(all);
        let (least, _) = nth_largest(want.min(all).max(1), |visit| {
            gathered.each(&mut |tile| {
                tile.into_iter().for_each(&mut *visit);
                Ok(())
            })
        })?;
        self.limit = Some(least);
        Ok((want > all).then(|| {
            format!("`cut.keep` asks for {want} points, and there are {all}: all of them stay")
        }))
    }
}
