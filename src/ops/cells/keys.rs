//! What `cells` is told, and what is settled of it once the scan is known.

use std::num::NonZeroUsize;

use schemars::JsonSchema;
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use super::division::DivisionRule;
use super::limit::Limit;
use super::outlook::Outlook;
use super::settings::{By, MOST_SEEDS, Measure, Reference, Side, Split};
use super::target::Keep;
use super::threshold::Threshold;
use crate::geom::angle::MaxAngle;
use crate::quantity::{Angle, Length, OrNone, Setting};
use crate::store::Levels;
use crate::{Error, Result};

/// Largest range of angles where nothing is said, in radians.
pub(super) const MAX_ANGLE: f64 = 0.1;
/// Positions that an occupied cube holds on average, at least, where the side is chosen by itself.
pub(in crate::ops) const POSITIONS_PER_CUBE: u64 = 32;
/// Sites of a division where nothing is said.
const SEEDS: usize = 4;

/// Partitions the tile into cells of agreeing normals (the paper's second step).
///
/// The initial cells are cubes of side `side`, anchored at world 0. Normals have no meaningful
/// sign, so those of a cell are turned to the side of its dominant axis: the eigenvector of the
/// largest eigenvalue of Σnnᵀ, its largest component positive. A cell in which the angles θ to N
/// span more than `max_angle`, and which has more than `min_points` positions, is divided; then
/// each part alike, with an axis of its own: beside a roof of many points, the few normals of a
/// wall keep signs that mean nothing.
///
/// It counts distinct positions, never records: copies of a point weigh as one.
///
/// `split = "voronoi"` (and `"dirichlet"`) needs at most m − 1 divisions for m positions, but where
/// each division separates only a few their cost is quadratic. No surface does that; to bound the
/// time of data that does, parts more than 64 + 2 log₂ m divisions deep are cut in eight instead
/// (`cells_cut_deep` of the report counts the initial cells with such parts).
///
/// Two lengths bound the density. A part whose tight box is longer than `max_side` is cut in eight
/// whatever its angles and however few its positions, so that flat regions stay covered; one no
/// longer than `min_spacing` is not divided. `cells_by_max_side` of the report counts the parts
/// that were divided for that reason alone, `cells_by_min_spacing` those that were not.
///
/// With `keep` the largest angle is found instead of given. Where a cell is divided does not depend
/// on that angle, so all divisions are made once, those of the widest ranges count first, and of
/// those of exactly the last range the first in canonical order (initial cells by their
/// Morton-first position; each part before its own parts): as many as leave the number of records
/// asked for. A position without a normal keeps a record and is among them. With
/// `split = "voronoi"` the number is met exactly, as each division adds one record; a cut in eight
/// adds up to seven, one among several sites up to one less than there are, and the first in that
/// order that would exceed the number ends it. If all divisions leave fewer, all are made. A
/// division needs angles that differ: of a perfect plane no more can be kept than its initial
/// cells.
///
/// Before a run it looks at a sample of the scan: `normal_scatter` of the report is how far, in
/// radians, normals are off their linear trend where the scan is planar (root of the mean square,
/// the median of the samples). Where that exceeds `max_angle` noise divides cells that are flat,
/// and the run says so.
///
/// What is "auto" is settled then, by the points alone, and told in the report: a run with the
/// values found gives the same bytes.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Cells {
    /// Side of the initial cells: a length, rounded to whole lattice steps; or "auto": the smallest
    /// 2^j steps for which occupied cubes hold 32 positions on average; with `keep` also large
    /// enough that there are at most half as many cubes as records are to stay. Or "spread": with
    /// `keep` 1.25 sides of a grid that keeps as many points, so that more than half of them are
    /// spread evenly and flat regions stay covered; without, or to keep more than a third, the same
    /// as "auto".
    pub side: Side,
    /// Largest θ_max − θ_min of a cell (the paper's α): radians from 0 to π, "6deg" or "0.1rad"; or
    /// "auto": four times `normal_scatter`, 0.1 to 1. Not together with `keep`.
    pub max_angle: Option<Setting<Angle>>,
    /// How many records are to stay, instead of `max_angle`: a share of those that the stage
    /// decides about ("10%", to six decimals, rounded to whole records), a number (500000, "250k",
    /// "5M"), or "auto": as many as `max_angle = "auto"` would leave of the cubes of
    /// `side = "auto"` with a quarter of their side as `min_spacing`, by samples, a third at most.
    /// The angle is found again for what `side` and `min_spacing` come to then.
    pub keep: Option<Keep>,
    /// Cells of so many positions or fewer are not divided (the paper's β).
    pub min_points: NonZeroUsize,
    /// Length beyond which no cell is kept whole; or "none".
    #[serde(deserialize_with = "Length::or_none")]
    #[schemars(with = "OrNone<Length>")]
    pub max_side: Option<Length>,
    /// Length up to which no cell is divided; or "auto": with `keep` 0.75 sides of a grid that
    /// keeps as many points, without a quarter of `side`, and none to keep more than a third, where
    /// planes have no noise (`normal_scatter` up to 0.01), or where `classes` or flags select some
    /// of the points; or "none".
    #[serde(deserialize_with = "Setting::or_none")]
    #[schemars(with = "OrNone<Setting<Length>>")]
    pub min_spacing: Option<Setting<Length>>,
    /// What all positions of a cell have in common besides its cube: nothing, or
    /// ["Classification"]. A position has the class of its first record in canonical order.
    pub by: Vec<By>,
    /// How a cell is divided.
    pub split: Split,
    /// Of `split = "dirichlet"`: how many sites a division is among, 2 to 64, or as many as there
    /// are positions; 4 where nothing is said.
    #[schemars(range(min = 2, max = 64))]
    pub seeds: Option<usize>,
    /// What the range of angles of a cell is.
    pub measure: Measure,
    /// Direction N that `measure = "axis"` takes angles to: an axis, or a vector of any length. Not
    /// with `measure = "cone"`, which has no use for it.
    pub reference: Option<Reference>,
    #[serde(skip)]
    pub(super) settled: Option<SettledCells>,
    /// What is known of the scan, for what samples decide.
    #[serde(skip)]
    pub(super) outlook: Option<Outlook>,
    #[serde(skip)]
    pub(super) threshold: Option<Threshold>,
}

/// What is fixed once the scan is known.
#[derive(Debug, Clone, Copy)]
pub(super) struct SettledCells {
    /// Side of the initial cells in lattice steps.
    pub steps: i64,
    /// The same in world units.
    pub length: f64,
    /// `max_side` and `min_spacing` in lattice steps; the largest number and 0 where there is none.
    pub max_side: u64,
    pub min_spacing: u64,
    /// The largest range of angles in radians, where none is to be found.
    pub max_angle: f64,
    /// How many records are to stay, where samples decide.
    pub target: Option<u64>,
}

impl SettledCells {
    pub(crate) fn is_aligned(self) -> bool {
        self.steps.count_ones() == 1
    }
}

impl Default for Cells {
    fn default() -> Self {
        Cells {
            side: Side::Auto,
            max_angle: None,
            keep: None,
            min_points: NonZeroUsize::MIN,
            max_side: None,
            min_spacing: None,
            by: Vec::new(),
            split: Split::Voronoi,
            seeds: None,
            measure: Measure::Axis,
            reference: None,
            settled: None,
            outlook: None,
            threshold: None,
        }
    }
}

/// The keys; `max_angle` and `reference` as what they are where they were not given.
impl Serialize for Cells {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut keys = serializer.serialize_struct("Cells", 11)?;
        keys.serialize_field("side", &self.side)?;
        keys.serialize_field("max_angle", &self.angle())?;
        keys.serialize_field("keep", &self.keep)?;
        keys.serialize_field("min_points", &self.min_points)?;
        keys.serialize_field("max_side", &self.max_side)?;
        keys.serialize_field("min_spacing", &self.min_spacing)?;
        keys.serialize_field("by", &self.by)?;
        keys.serialize_field("split", &self.split)?;
        let seeds = (self.split == Split::Dirichlet).then(|| self.seeds());
        keys.serialize_field("seeds", &seeds)?;
        keys.serialize_field("measure", &self.measure)?;
        keys.serialize_field("reference", &self.direction())?;
        keys.end()
    }
}

impl Cells {
    /// Sites of a division among several.
    pub(super) fn seeds(&self) -> usize {
        self.seeds.unwrap_or(SEEDS)
    }

    /// Refuses keys that do not go together, naming one of them.
    pub(crate) fn check(&self) -> Result<(), (&'static str, Error)> {
        if self.keep.is_some() && self.max_angle.is_some() {
            let error = Error::pipeline(
                "`cells.keep` finds the largest angle, and `cells.max_angle` gives it",
            );
            return Err(("keep", error.help("give one of them")));
        }
        match self.seeds {
            Some(_) if self.split != Split::Dirichlet => {
                let told = "`cells.seeds` belongs to `cells.split = \"dirichlet\"`";
                let error = Error::pipeline(told).help("give that too, or leave `cells.seeds` out");
                return Err(("seeds", error));
            }
            Some(seeds) if !(2..=MOST_SEEDS).contains(&seeds) => {
                let told = format!("seeds must be 2 to {MOST_SEEDS}, not {seeds}");
                return Err(("seeds", Error::pipeline(told)));
            }
            _ => {}
        }
        match (self.max_side, self.min_spacing) {
            (Some(most), Some(Setting::Given(least))) if most.is_less_than(least) => {
                let told = format!(
                    "`cells.max_side` is {most}, less than `cells.min_spacing`, {least}: cells \
                     between the two would have to be divided and must not be"
                );
                Err(("max_side", Error::pipeline(told)))
            }
            _ if self.reference.is_some_and(|given| given.direction().is_none()) => {
                Err(("reference", Error::pipeline("`cells.reference` has no direction")))
            }
            _ if self.reference.is_some() && self.measure == Measure::Cone => {
                let error = Error::pipeline(
                    "`cells.reference` needs `cells.measure = \"axis\"`: the measure is \"cone\", \
                     which takes angles to each cell's own axis",
                );
                let help = "add `cells.measure = \"axis\"`, or leave `cells.reference` out";
                Err(("reference", error.help(help)))
            }
            _ => Ok(()),
        }
    }

    /// The largest range of angles as it was given, or the default; none where a target decides.
    pub(super) fn angle(&self) -> Option<Setting<Angle>> {
        let default = || Angle::radians(MAX_ANGLE).map(Setting::Given);
        self.max_angle.or_else(|| if self.keep.is_none() { default() } else { None })
    }

    /// The direction that angles are taken to, as it was given, or the default; none where each
    /// cell has its own.
    pub(super) fn direction(&self) -> Option<Reference> {
        (self.measure == Measure::Axis).then(|| self.reference.unwrap_or(Reference::X))
    }

    /// The largest range of angles in radians, where none is to be found and before samples decide.
    pub(super) fn max_angle(&self) -> f64 {
        self.max_angle.and_then(Setting::given).map_or(MAX_ANGLE, Angle::in_radians)
    }

    /// Binary logarithm of the side that is chosen by itself.
    pub(super) fn auto_level(&self, levels: &Levels, records: u64) -> u32 {
        let fewest = levels.occupied(62);
        let most = match self.keep {
            None | Some(Keep::Auto) => u64::MAX,
            Some(keep) => keep.of(records) / 2,
        };
        let level = levels.smallest_side(POSITIONS_PER_CUBE);
        (level..62)
            .find(|&level| [fewest, most].iter().any(|&n| levels.occupied(level) <= n))
            .unwrap_or(62)
    }

    pub(super) fn settled(&self) -> Result<SettledCells> {
        self.settled
            .ok_or_else(|| Error::internal("the stage cells ran before its side was settled"))
    }

    /// Which divisions a run makes.
    pub(super) fn limit(&self) -> Result<Limit> {
        match (self.keep, &self.threshold) {
            (None, _) => {
                Ok(Limit { max_angle: MaxAngle::new(self.settled()?.max_angle), ties: None })
            }
            (Some(_), Some(threshold)) => Ok(threshold.limit()),
            (Some(_), None) => {
                Err(Error::internal("the stage cells ran before its largest angle was found"))
            }
        }
    }

    pub(super) fn rule(&self, limit: Limit) -> Result<DivisionRule> {
        let SettledCells { steps: side, max_side, min_spacing, .. } = self.settled()?;
        let reference = self.direction().and_then(Reference::direction);
        let (min_points, split) = (self.min_points.get(), self.split);
        Ok(DivisionRule {
            reference,
            limit,
            min_points,
            max_side,
            min_spacing,
            split,
            seeds: self.seeds(),
            side,
            origin: [0; 3],
        })
    }
}
