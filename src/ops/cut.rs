//! The stage `cut`: a coarser reduction from one whose points have ranks.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Keep;
use super::cells::KeepGiven;
use super::graded::{Rung, SHORTENED_BY};
use super::removal::{keep_once, remove};
use crate::geom::hash::of_position;
use crate::geom::select::nth_largest;
use crate::point::{Column, Units, names};
use crate::quantity::Length;
use crate::report::Tally;
use crate::stage::{Gathered, Needs, Role, RoleName, ScanOp, StageKind, StagePlace, TileOp};
use crate::tile::Tile;
use crate::{Error, ErrorKind, Result};

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
    #[schemars(with = "Option<KeepGiven>")]
    pub keep: Option<Keep>,
    /// Instead: about how far from each other points are that stay, a length. They are those that
    /// were kept at this distance or a longer one.
    pub spacing: Option<Length>,
    #[serde(skip)]
    limit: Option<u64>,
}

impl Cut {
    /// A reduction to that many positions.
    pub fn new(keep: Keep) -> Cut {
        Cut { keep: Some(keep), spacing: None, limit: None }
    }
}

/// The key of the length.
const SPACING: &str = "cut.spacing";
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

/// The least of what orders positions of this rank.
fn least_of_rank(rank: u16) -> u64 {
    u64::from(u16::MAX - rank) << 48
}

impl Cut {
    /// Fixes which ranks stay.
    fn conclude_by_spacing(&mut self, gathered: &dyn Gathered<Vec<u64>>) -> Result<Option<String>> {
        let spacing = self.spacing.map_or(f64::INFINITY, Length::value);
        // The shortest distance that is no shorter, of which the rounding of a length is none.
        let rung = Rung::within(spacing * (1.0 + 1e-9));
        let rung = if rung.length() < spacing * (1.0 - 1e-9) { rung.coarser() } else { rung };
        let limit = least_of_rank(rung.last_rank());
        let (mut all, mut stay, mut finer) = (0, 0, false);
        gathered.each(&mut |tile| {
            all += tile.len();
            stay += tile.iter().filter(|order| **order >= limit).count();
            finer |= tile.iter().any(|order| *order < limit && *order >= least_of_rank(LAST_RANK));
            Ok(())
        })?;
        if stay == 0 && all > 0 {
            let told = format!("no points were kept as far as `{SPACING} = {spacing}` from others");
            return Err(Error::new(ErrorKind::Data, told).help("give a shorter length"));
        }
        self.limit = Some(limit);
        let told = || {
            format!(
                "`{SPACING} = {spacing}` is finer than what was kept last: all points stay but \
                 exceptions"
            )
        };
        Ok((!finer).then(told))
    }
}

/// The last rank that is none of an exception.
const LAST_RANK: u16 = u16::MAX - 1;

impl StageKind for Cut {
    const KIND: &'static str = "cut";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Cuts a coarser reduction off one whose points have ranks.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        let told = match (self.keep, self.spacing) {
            (Some(Keep::Auto), _) => {
                "`cut.keep = \"auto\"` is not known: it takes a share or a number"
            }
            (Some(_), None) | (None, Some(_)) => return Ok(Role::ScanOp(Box::new(self))),
            (None, None) => "`cut` does not say which points stay",
            (Some(_), Some(_)) => "`cut` takes one of its keys, not `keep` and `spacing`",
        };
        let help = "give one of `cut.keep = \"10%\"` and `cut.spacing = 0.5`";
        Err(at.blame("keep", Error::pipeline(told).help(help)))
    }
}

impl TileOp for Cut {
    fn needs(&self) -> Needs {
        let looks = Needs::none().looks_at(names::XYZ).reads(&RANK);
        looks.bytes_per_point(BYTES).removes(None)
    }

    fn for_share(&mut self, share: f64) {
        self.keep.iter_mut().for_each(|keep| keep.for_share(share));
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        let converted = self.spacing.map(|length| length.in_scan(units, SPACING));
        self.spacing = converted.transpose()?;
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        self.spacing.iter().map(|length| (SPACING, *length)).collect()
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
        let Some(keep) = self.keep else { return self.conclude_by_spacing(gathered) };
        let mut all = 0;
        gathered.each(&mut |tile| {
            all += tile.len() as u64;
            Ok(())
        })?;
        let want = keep.of(all);
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
