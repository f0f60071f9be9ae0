//! The stage `graded`: so many points stay, or as many as a tolerance asks for, where they say most
//! of the surface.

mod certain;
mod correct;
mod figures;
mod fill;
mod knee;
mod ladder;
mod rank;
mod refine;
mod settings;
mod sides;
mod work;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Keep;
use crate::expression::Weight;
use crate::point::{Units, names};
use crate::quantity::Length;
use crate::report::{Grouped, Tally};
use crate::stage::{
    GridBeside, Lattice, Needs, NextRound, Role, RoleName, RoundFound, RoundOp, RoundTile,
    ScanFacts, SoFar, StageKind, StagePlace, TileOp,
};
use crate::store::KeptPoints;
use crate::tile::Tile;
use crate::{Error, Result};

use certain::Certain;
use figures::Judgement;
use knee::{Knee, KneeNext};
pub(super) use ladder::SHORTENED_BY;
use ladder::{Ladder, Manner, too_few};
pub use rank::KEEP_RANK;
pub(super) use rank::Rung;
pub use settings::Effort;
use sides::{grid_beside, steps, voxel_side};
use work::RoundWork;

/// Keeps the points that say most of the surface: so many of them, or as many as a tolerance asks
/// for. It looks at nothing but positions, so no stage needs to come before it. Copies of a
/// position weigh as one, and one record of them stays.
///
/// With `keep` exactly so many records stay (or all positions, where these are fewer). First
/// positions are kept until none is farther from a kept one than about the side of the voxel grid
/// that would keep as many: that much coverage is left everywhere. What is left of the number is
/// kept in rounds where the surface is told worst. In each, every removed position asks its twelve
/// nearest kept ones how far it is from the plane of the nearest 5, 8 and 12 of them; the positions
/// that have the same nearest kept point are a cell, with the score mean(e⁴) · mean(d²) of their
/// errors e and distances d; and of the worst cells of the whole scan the position of largest e · d
/// is kept, where e² counts no more than three times the mean of the cell, since what is much
/// farther off than all around it is noise. No cut into tiles shows in what is kept.
///
/// `keep = "auto"` looks for the number: of a 128th, a 64th, a 32nd of the positions it takes the
/// smallest of which twice as many would lower the mean error of a sample by less than a quarter,
/// or else an eighth. The report has the errors that were measured.
///
/// With `tolerance` every removed position is within it of the surface: of the least-squares plane
/// of its 8 nearest surface points, and all that are as near as the eighth, within four times
/// `max_spacing`; where fewer than 5 are, or they are almost on a line, of the nearest one. Surface
/// points are added where that does not hold until more of them do not pay; what is still off is
/// kept as an exception, which is no surface point. The report counts these as `graded_exceptions`,
/// and its largest deviation is the largest error. Below the noise of a scan a tolerance keeps
/// nearly everything.
///
/// With both, the tolerance is kept where it needs no more points than `keep`; else so many points
/// are kept, and the report says which came first.
///
/// The report's deviations are distances to that surface. Beside them stand those that a voxel grid
/// of as many points would leave, to the surface of its points.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Graded {
    /// How many records stay: a share of those that the stage decides about ("10%"), a number
    /// (500000, "250k", "5M"), or "auto": the knee of the error over the number.
    pub keep: Option<Keep>,
    /// How far from the surface no removed point may be: a length.
    pub tolerance: Option<Length>,
    /// How far from the nearest kept point no removed point may be: a length. Without it, with
    /// `keep` what the number allows; with `tolerance` the side of a voxel grid that keeps one of
    /// 256 positions.
    pub max_spacing: Option<Length>,
    /// What the error of a record counts: a number, by conditions that hold for it, as in
    /// "Classification == 6 ? 3 : 1". The square of the error is so many times as large. Of copies
    /// of a position the first condition counts that holds for one of them.
    pub weight: Option<Weight>,
    /// True to keep the borders of the scan: what lies beyond all kept points around it counts as
    /// off the surface by a fourth of that distance.
    pub borders: bool,
    /// How much is computed.
    pub effort: Effort,
    /// True to give every kept point a `KeepRank`, which outputs write by `dimensions`: the points
    /// of low ranks are a coarser reduction, and `cut` makes it. The rounds are then those that do
    /// for any number.
    pub ranks: bool,
    /// Of equally good choices, which are made.
    pub seed: u64,
    /// The world units of a lattice step, and the records and positions of the scan.
    #[serde(skip)]
    step: f64,
    #[serde(skip)]
    scan: (u64, u64),
    #[serde(skip)]
    course: Option<RoundsCourse>,
    #[serde(skip)]
    kept: Option<Arc<KeptPoints>>,
    /// The largest number that is kept, where a tolerance may come first.
    #[serde(skip)]
    most: Option<u64>,
    /// Numbers that were tried on the way to the knee, and their mean errors in steps.
    #[serde(skip)]
    tried: Vec<(u64, f64)>,
}

/// The rounds towards a number or a tolerance.
#[derive(Debug, Clone)]
enum RoundsCourse {
    Knee(Knee),
    Count(Ladder),
    Tolerance(Certain),
}

/// Bytes a position.
const BYTES: usize = 96;
/// Where nothing says how far apart kept points are with a tolerance: a voxel grid that keeps one
/// of so many positions.
const SPARSE: u64 = 256;
/// Where kept points may be anywhere, in steps.
const FARTHEST: i64 = 1 << 60;
/// Cubes of it at least.
const FEWEST: u64 = 64;

impl Graded {
    /// A reduction to that many points.
    pub fn new(keep: Keep) -> Graded {
        Graded { keep: Some(keep), ..Graded::default() }
    }

    /// Refuses keys that do not go together, with the key to blame.
    fn check(&self) -> Result<(), (&'static str, Error)> {
        match (self.keep, self.tolerance) {
            (None, None) => {
                let told = "`graded` does not say how many points stay";
                let help = "give `graded.keep = \"10%\"`, or `graded.tolerance = 0.005`";
                Err(("keep", Error::pipeline(told).help(help)))
            }
            (Some(Keep::Auto), Some(_)) => {
                let told = "`graded.keep = \"auto\"` and `graded.tolerance` both say how many stay";
                Err(("keep", Error::pipeline(told).help("give one of them, or a number")))
            }
            (None, Some(_)) if self.weight.is_some() || self.borders => {
                let key = if self.weight.is_some() { "weight" } else { "borders" };
                let told = format!(
                    "`graded.{key}` is for `graded.keep`: a tolerance holds for all points alike"
                );
                Err((key, Error::pipeline(told).help(format!("leave `graded.{key}` out"))))
            }
            _ => Ok(()),
        }
    }

    /// A length in steps of the lattice.
    fn in_steps(&self, length: Length) -> f64 {
        length.value() / self.step
    }

    /// The whole steps of a length.
    fn whole(&self, length: Length) -> i64 {
        steps(self.in_steps(length).floor())
    }

    /// Twice as many points where that is free, since `spacing` takes more than `most`.
    fn spaced(&mut self, spacing: Length, most: u64, so_far: &SoFar<'_>) -> Result<NextRound> {
        if self.keep == Some(Keep::Auto) {
            let more = most.saturating_mul(2).min(so_far.levels.positions());
            (self.most, self.course) = (Some(more), Some(self.count(more, so_far)));
            return Ok(NextRound::Again);
        }
        Err(too_few(spacing.value(), most))
    }

    /// The rounds to begin with.
    fn begin(&mut self, so_far: &SoFar<'_>) -> RoundsCourse {
        let positions = so_far.levels.positions();
        self.most = self.keep.map(|keep| keep.of(so_far.records).min(positions));
        if self.keep == Some(Keep::Auto) {
            return RoundsCourse::Knee(Knee::new(so_far, self.seed));
        }
        match (self.tolerance, self.most) {
            (None, most) => self.count(most.unwrap_or(positions), so_far),
            (Some(tolerance), _) => {
                let spacing = self.max_spacing.map(|length| self.in_steps(length));
                let sparse = (positions / SPARSE).max(FEWEST).min(positions);
                let spacing =
                    spacing.unwrap_or_else(|| voxel_side(so_far.levels, &so_far.bounds, sparse));
                let tolerance = self.in_steps(tolerance);
                RoundsCourse::Tolerance(Certain::new(tolerance, steps(spacing.floor()), self.seed))
            }
        }
    }

    /// The rounds towards a number.
    fn count(&self, want: u64, so_far: &SoFar<'_>) -> RoundsCourse {
        let spacing = self.max_spacing.map(|length| self.whole(length));
        let with = Manner { effort: self.effort, seed: self.seed, borders: self.borders };
        RoundsCourse::Count(match self.ranks && spacing.is_none() {
            true => Ladder::ranked(want, so_far, with, self.step),
            false => Ladder::new(want, so_far, with, spacing),
        })
    }
}

impl StageKind for Graded {
    const KIND: &'static str = "graded";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str =
        "Keeps the points that say most of the surface: so many, or for a tolerance.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::RoundOp(Box::new(self)))
    }
}

impl TileOp for Graded {
    fn needs(&self) -> Needs {
        let needs =
            Needs::none().looks_at(names::XYZ).bytes_per_point(BYTES).removes(None).measures();
        if self.ranks { needs.writes(&KEEP_RANK) } else { needs }
    }

    fn for_share(&mut self, share: f64) {
        self.keep.iter_mut().for_each(|keep| keep.for_share(share));
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        for (length, key) in [
            (&mut self.tolerance, "graded.tolerance"),
            (&mut self.max_spacing, "graded.max_spacing"),
        ] {
            *length = length.map(|length| length.in_scan(units, key)).transpose()?;
        }
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        let lengths =
            [("graded.tolerance", self.tolerance), ("graded.max_spacing", self.max_spacing)];
        lengths.into_iter().filter_map(|(key, length)| Some((key, length?))).collect()
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        (self.course, self.kept, self.most) = (None, None, None);
        self.tried.clear();
        self.step = scan.lattice.step;
        self.scan = (scan.points, scan.positions);
        Ok(())
    }

    fn warnings(&self, _: &Lattice) -> Vec<String> {
        let (records, positions) = self.scan;
        let number = self.keep.filter(|keep| *keep != Keep::Auto);
        let asked = number.map_or(0, |keep| keep.of(records));
        let told = || {
            let (asked, positions) = (Grouped(asked), Grouped(positions));
            format!(
                "`graded.keep` asks for {asked} records, and the scan has {positions} positions: \
                 one record of each stays"
            )
        };
        (asked > positions).then(told).into_iter().collect()
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let early = || Error::internal("the stage graded ran before it chose");
        let kept = self.kept.as_ref().ok_or_else(early)?;
        let (radius, tolerance, of_rounds) = match self.course.as_ref().ok_or_else(early)? {
            RoundsCourse::Knee(_) => return Err(early()),
            RoundsCourse::Count(ladder) => {
                (ladder.covered().unwrap_or(FARTHEST), None, &ladder.ranks[..])
            }
            RoundsCourse::Tolerance(certain) => (certain.radius, Some(certain.tolerance), &[][..]),
        };
        Judgement { kept, radius, tolerance, ranks: self.ranks, of_rounds }.pass(tile, tally)
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        let length = |steps: i64| Value::from(steps as f64 * self.step);
        let mut all = Vec::new();
        match &self.course {
            Some(RoundsCourse::Count(ladder)) => {
                let covered = ladder.covered();
                all.extend(covered.map(|covered| ("spacing".to_owned(), length(covered))));
                if self.tolerance.is_some() {
                    all.push(("ended_by".to_owned(), "keep".into()));
                }
            }
            Some(RoundsCourse::Tolerance(certain)) => {
                all.push(("spacing".to_owned(), length(certain.radius)));
                if self.keep.is_some() {
                    all.push(("ended_by".to_owned(), "tolerance".into()));
                }
            }
            Some(RoundsCourse::Knee(_)) | None => {}
        }
        if let (Some(Keep::Auto), Some(most)) = (self.keep, self.most) {
            let tried = self.tried.iter().map(|&(points, error)| {
                serde_json::json!({ "points": points, "mean_error": error * self.step })
            });
            all.push(("keep".to_owned(), most.into()));
            all.push(("tried".to_owned(), tried.collect()));
        }
        all
    }
}

impl RoundOp for Graded {
    fn next(&mut self, so_far: &SoFar<'_>) -> Result<NextRound> {
        let mut course = match self.course.take() {
            Some(course) => course,
            None => self.begin(so_far),
        };
        let (next, exceptions) = match &mut course {
            RoundsCourse::Knee(knee) => match knee.next(so_far) {
                KneeNext::Round(next) => (next, 0),
                KneeNext::Found(number) => {
                    self.tried.clone_from(&knee.tried);
                    (self.most, self.course) = (Some(number), Some(self.count(number, so_far)));
                    return Ok(NextRound::Again);
                }
            },
            RoundsCourse::Count(ladder) => (ladder.next(so_far), 0),
            RoundsCourse::Tolerance(certain) => (certain.next(so_far), certain.exceptions),
        };
        if let (NextRound::Done, RoundsCourse::Tolerance(_), Some(most)) =
            (next, &course, self.most)
            && so_far.kept + exceptions > most
        {
            self.course = Some(self.count(most, so_far));
            return Ok(NextRound::Again);
        }
        if let Some(spacing) = self.max_spacing.filter(|_| self.tolerance.is_none()) {
            let short = match (next, &course) {
                (NextRound::Shorten { to, .. }, _) => Some(to),
                (NextRound::Done, RoundsCourse::Count(ladder)) => {
                    ladder.leaves_apart(self.whole(spacing), so_far).then_some(so_far.kept)
                }
                _ => None,
            };
            if let Some(most) = short {
                return self.spaced(spacing, most, so_far);
            }
        }
        self.course = Some(course);
        Ok(next)
    }

    fn round(&self, tile: &RoundTile<'_>, found: &mut RoundFound) -> Result<()> {
        let work = match &self.course {
            Some(RoundsCourse::Knee(knee)) => knee.work(),
            Some(RoundsCourse::Count(ladder)) => ladder.work(),
            Some(RoundsCourse::Tolerance(certain)) => certain.work(),
            None => None,
        };
        match work {
            Some(RoundWork::Fill(filling)) => filling.fill(tile, found),
            Some(RoundWork::Refine(refining)) => refining.refine(tile, found),
            Some(RoundWork::Correct(correcting)) => correcting.correct(tile, found),
            Some(RoundWork::Measure(measuring)) => measuring.measure(tile, found),
            None => return Err(Error::internal("the stage graded has no round to work on")),
        }
        Ok(())
    }

    fn weight(&self) -> Option<(&'static str, &Weight)> {
        self.weight.as_ref().map(|weight| ("weight", weight))
    }

    fn beside(&self, so_far: &SoFar<'_>) -> Option<GridBeside> {
        let exceptions = match &self.course {
            Some(RoundsCourse::Tolerance(certain)) => certain.exceptions,
            _ => 0,
        };
        grid_beside(so_far.kept + exceptions, so_far)
    }

    fn chosen(&mut self, kept: Arc<KeptPoints>) {
        self.kept = Some(kept);
    }
}
