//! What samples decide for cells: the values of keys that are "auto". A function of the points
//! alone.

use serde_json::Value;

use super::keys::{Cells, MAX_ANGLE};
use super::settings::Side;
use super::target::Keep;
use crate::ops::lengths::LARGEST_SIDE;
use crate::ops::scatter::SMOOTH;
use crate::quantity::Setting;

/// Scatters that the angle is wide. Of the 32 normals of a cube of noise the farthest is off by
/// 1.9 scatters, and the range of angles to the axis is twice that: noise alone divides few.
const SCATTERS: f64 = 4.0;
/// The widest angle that noise leads to, in radians: beyond, edges would go with the noise.
const WIDEST: f64 = 1.0;
/// Initial cells that are to be spread, and `min_spacing`, in sides of a grid of as many points.
/// Measured by `cargo bench --bench quality`, whose table is in docs/paper.md.
const SPREAD: f64 = 1.25;
const SPACING: f64 = 0.75;
/// Where more than one of so many positions stays, such cells could be more than the points to
/// keep: they are nearly as small as the distance of neighbours.
const SPREADABLE: u64 = 3;
/// Without a number to keep: `min_spacing` in sides of the initial cells.
const SPACING_OF_SIDE: f64 = 0.25;

/// Angles in radians at which samples are divided, where their number is left to the scan.
pub(super) const LADDER: [f64; 6] = [MAX_ANGLE, 0.2, 0.35, 0.5, 0.7, WIDEST];

/// What samples say of the scan.
pub(super) struct Sampled {
    /// How far normals scatter, in radians; none where nothing is planar.
    pub(super) scatter: Option<f64>,
    /// Share of the positions that the stage decides about.
    pub(super) chosen: f64,
    /// Share of those that stays at each angle of [`LADDER`], where that was looked at.
    pub(super) shares: Option<[f64; LADDER.len()]>,
}

impl Sampled {
    /// The angle that noise asks for.
    fn angle(&self) -> f64 {
        let angle = self.scatter.map_or(MAX_ANGLE, |scatter| SCATTERS * scatter);
        (angle.clamp(MAX_ANGLE, WIDEST) * 1e4).round() / 1e4
    }

    /// True if there are planes, and no noise on them: cells may be as small as edges need.
    fn is_clean(&self) -> bool {
        self.scatter.is_some_and(|scatter| scatter <= SMOOTH)
    }

    /// Share that stays at that angle: between the two next ones, by powers.
    fn share(&self) -> Option<f64> {
        let (angle, shares) = (self.angle(), self.shares?);
        let at = LADDER.windows(2).position(|step| angle <= step[1])?;
        let part = libm::log2(angle / LADDER[at]) / libm::log2(LADDER[at + 1] / LADDER[at]);
        let (from, to) = (libm::log2(shares[at]), libm::log2(shares[at + 1]));
        Some(libm::exp2(from + part * (to - from)))
    }
}

/// A count in three digits: more say nothing, and a user may want to give it by hand.
fn rounded(count: u64) -> u64 {
    let unit = 10u64.pow(count.max(1).ilog10().saturating_sub(2));
    (count / unit).max(1) * unit
}

/// Settles what is left to it; returns the keys and values.
pub(super) fn choose(cells: &mut Cells, sampled: &Sampled) -> Vec<(String, Value)> {
    let (Some(outlook), Some(mut settled)) = (&cells.outlook, cells.settled) else {
        return Vec::new();
    };
    let mut chosen: Vec<(String, Value)> = Vec::new();
    if cells.max_angle.is_some_and(Setting::is_auto) {
        settled.max_angle = sampled.angle();
        chosen.push(("max_angle".into(), settled.max_angle.into()));
    }
    // Of a selection no more is known than its share: its cubes are at most those of all.
    let records = (outlook.records() as f64 * sampled.chosen) as u64;
    if cells.keep == Some(Keep::Auto) {
        let share = sampled.share().unwrap_or(1.0);
        // No more than can be spread.
        let most = (outlook.positions() / SPREADABLE).min(records);
        let count = ((share * records as f64).round() as u64).clamp(1, most.max(1));
        settled.target = Some(rounded(count));
        chosen.push(("keep".into(), rounded(count).into()));
    }
    let keep = settled.target.map(Keep::Records).or(cells.keep);
    let count = keep.map(|keep| keep.of(records.max(1)));
    let is_few = |count: &u64| *count <= outlook.positions() / SPREADABLE;
    let grid = count.filter(is_few).map(|count| outlook.grid_side(count));
    if let (Side::Spread, Some(grid)) = (cells.side, grid) {
        settled.steps = ((SPREAD * grid) as i64).clamp(1, LARGEST_SIDE);
        settled.length = settled.steps as f64 * outlook.step();
        chosen.push(("side".into(), settled.length.into()));
    }
    if cells.min_spacing.is_some_and(Setting::is_auto) {
        let spacing = match grid {
            _ if sampled.chosen < 1.0 || sampled.is_clean() => 0.0,
            Some(grid) => SPACING * grid,
            None if count.is_some() => 0.0,
            None => SPACING_OF_SIDE * settled.steps as f64,
        };
        settled.min_spacing = (spacing as u64).min(settled.max_side);
        let value = match settled.min_spacing {
            0 => Value::from("none"),
            steps => Value::from(steps as f64 * outlook.step()),
        };
        chosen.push(("min_spacing".into(), value));
    }
    cells.settled = Some(settled);
    chosen
}
