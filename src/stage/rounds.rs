//! Stages that choose in rounds: what one round keeps decides what the next one looks for.

use std::sync::Arc;

use super::tile_op::TileOp;
use crate::Result;
use crate::expression::Weight;
use crate::point::{Bounds, Position};
use crate::store::{KeptPoints, Levels};

/// Chooses the points that stay in rounds over the whole scan, and then runs as a [`TileOp`] that
/// knows them. Each round sees what those before it kept.
///
/// A round goes over tiles, of which each holds positions of the scan and kept points around its
/// cube. What it decides of its cube may depend on nothing farther away than the round says, so
/// that no cut into tiles shows.
pub trait RoundOp: TileOp {
    /// Called before each round with what those before it came to, and until it ends the rounds.
    ///
    /// # Errors
    ///
    /// What it was asked for and the scan does not allow.
    fn next(&mut self, so_far: &SoFar<'_>) -> Result<NextRound>;

    /// Called for every tile of a round, from several threads at once.
    ///
    /// # Errors
    ///
    /// Broken promises of the engine; the run ends.
    fn round(&self, tile: &RoundTile<'_>, found: &mut RoundFound) -> Result<()>;

    /// What positions weigh, of its key of this name: told from the records as they are decoded.
    /// [`RoundTile::weights`] has it.
    fn weight(&self) -> Option<(&'static str, &Weight)> {
        None
    }

    /// Called behind the last round: which voxel grid the report shows beside what is kept. It is
    /// for stages that [measure](crate::stage::Needs::measures) what they remove by the surface of
    /// the eight nearest kept points; none for others.
    fn beside(&self, _so_far: &SoFar<'_>) -> Option<GridBeside> {
        None
    }

    /// Called once behind the last round, with all that is kept.
    fn chosen(&mut self, kept: Arc<KeptPoints>);
}

/// What the rounds came to so far.
#[non_exhaustive]
pub struct SoFar<'a> {
    /// Occupied cubes of the positions that the stage decides about, of every power-of-two side.
    pub levels: &'a Levels,
    /// Records that the stage decides about.
    pub records: u64,
    /// Tight box of the scan.
    pub bounds: Bounds,
    /// Points that are kept.
    pub kept: u64,
    /// Those among them that the last round kept.
    pub added: u64,
    /// What the tiles of the last round [counted](RoundFound::counted).
    pub counted: u64,
    /// The lowest score of the offers that had the first say in it; 0 if it had none.
    pub least: f64,
}

/// A voxel grid that is compared with what a stage keeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridBeside {
    /// How many positions stay, of the stage and of the grid.
    pub keeps: u64,
    /// About the side of such a grid in lattice steps.
    pub side: f64,
}

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NextRound {
    /// A round.
    Round(Round),
    /// Of what the last round kept, only so many stay that this many are kept in all: those whose
    /// hash by the seed is smallest.
    Shorten {
        /// How many are kept in all.
        to: u64,
        /// Which of all hashes of positions it is.
        seed: u64,
    },
    /// What the last rounds kept is not kept.
    Undo {
        /// How many rounds: one or two, behind the last of which nothing else was asked for.
        rounds: usize,
    },
    /// Nothing is kept, and all begins anew.
    Again,
    /// No more rounds.
    Done,
}

/// What a round looks at, and how it chooses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Which positions of the scan it looks at.
    pub looks: Looks,
    /// How far around its cube a tile has these.
    pub reach: i64,
    /// How far around its cube a tile has kept points.
    pub kept_reach: i64,
    /// Who is kept of what its tiles find.
    pub choice: RoundChoice,
}

/// Which positions of the scan a round looks at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Looks {
    /// Those whose hash by `seed` is at most `most`: a sample that is a function of the positions.
    Sample {
        /// Of all hashes, that part.
        most: u64,
        /// Which of all hashes of positions it is.
        seed: u64,
    },
    /// Those that have no kept point nearer than `apart`, about so many of all as such a sample
    /// has.
    Uncovered {
        /// A distance in lattice steps.
        apart: i64,
        /// As for a sample.
        most: u64,
    },
}

/// Who is kept of what the tiles of a round find.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RoundChoice {
    /// What each tile says: see [`RoundFound::keep`].
    InTile,
    /// Of all [offers](RoundFound::offers) the best.
    Best {
        /// So many offers have the first say.
        want: u64,
        /// What of a tile's cube is offered lies at most so far outside of it, as does what
        /// decides whether it [stands aside](Offer::apart).
        reach: i64,
    },
}

/// A tile of a round.
#[non_exhaustive]
pub struct RoundTile<'a> {
    /// What the tile decides.
    pub cube: Bounds,
    /// The round that it is of.
    pub round: &'a Round,
    /// The positions that the round looks at and that the stage decides about, in Morton order, of
    /// the cube and as far around it as the round reaches.
    pub positions: &'a [Position],
    /// What each weighs, by the conditions that hold for one of its records; none where all weigh
    /// 1.
    pub weights: &'a [f64],
    /// The kept points of the cube and as far around it as the round asks for, in Morton order.
    pub kept: &'a [Position],
    /// The number of the round that kept each.
    pub kept_in: &'a [u32],
    /// What the round before this one found, if it had the same tiles and looked at the same
    /// positions.
    pub before: Option<RoundBefore<'a>>,
    /// The instruction set to compute by.
    pub(crate) simd: crate::geom::simd::Simd,
}

/// What the round before found in a tile.
#[derive(Debug, Clone, Copy)]
pub struct RoundBefore<'a> {
    /// Its number: points that were kept by it are new.
    pub number: u32,
    /// What it offered.
    pub offers: &'a [Offer],
}

/// What a tile of a round finds.
#[derive(Debug, Default)]
pub struct RoundFound {
    /// Indices of the positions of the cube that are kept from now on, in ascending order.
    pub keep: Vec<u32>,
    /// What may be kept: an offer of each kept point of the cube, in their order.
    pub offers: Vec<Offer>,
    /// How many positions of the cube are counted, for what comes next.
    pub counted: u64,
}

/// A position that is offered for keeping, from around a kept point.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Offer {
    /// The larger the sooner it is kept; at 0 nothing is offered.
    pub score: f64,
    /// It stands aside for an offer of a higher score that is nearer than this, in lattice steps.
    pub apart: f64,
    /// The position.
    pub at: Position,
    /// The kept point.
    pub of: Position,
    /// A point that is kept farther from that one than this changes nothing of the offer. Where it
    /// is infinite, something changed already: what is offered is only as good as it was, and is
    /// not taken.
    pub reach: f64,
}

impl Offer {
    /// True if it may be taken.
    pub(crate) fn is_open(&self) -> bool {
        self.score > 0.0 && self.reach.is_finite()
    }
}

impl RoundFound {
    /// Forgets everything, keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.keep.clear();
        self.offers.clear();
        self.counted = 0;
    }
}

impl Round {
    /// A walk over all positions, each once.
    pub(crate) fn counting() -> Round {
        let looks = Looks::Sample { most: u64::MAX, seed: 0 };
        Round { looks, reach: 0, kept_reach: 0, choice: RoundChoice::InTile }
    }
}

impl Looks {
    /// A sample of about that share of all positions, or all.
    pub fn sample(share: f64, seed: u64) -> Looks {
        Looks::Sample { most: most_of(share), seed }
    }

    /// What has no kept point nearer than `apart`: about as many of all as that share.
    pub fn uncovered(apart: i64, share: f64) -> Looks {
        Looks::Uncovered { apart, most: most_of(share) }
    }

    /// The part of all positions that it looks at, about: above 0 and at most 1.
    pub(crate) fn share(self) -> f64 {
        let (Looks::Sample { most, .. } | Looks::Uncovered { most, .. }) = self;
        (most as f64 + 1.0) / 2f64.powi(64)
    }
}

/// The largest hash of a sample of that share.
fn most_of(share: f64) -> u64 {
    if share >= 1.0 { u64::MAX } else { (share * 2f64.powi(64)) as u64 }
}
