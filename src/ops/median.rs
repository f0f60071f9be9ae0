//! The stage `median`: of every cell the point with the median angle stays.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::removal::{RemovalAccount, keep_once, represent_by};
use super::smooth::rounded_mean;
use crate::geom::angle::{cosine, dominant_axis, is_known, outer_sum, sine2};
use crate::geom::wide::Wide;
use crate::point::{Mark, NORMAL, Position, SHIFT};
use crate::quantity::Whole;
use crate::report::Tally;
use crate::stage::{Needs, Role, RoleName, ScanFacts, StageKind, StagePlace, TileOp};
use crate::tile::{Partition, Tile};
use crate::{Error, Result};

/// Bytes a position: an angle and an index.
const BYTES: usize = 16;
/// Most passes that the stage takes.
pub const MAX_PASSES: usize = 16;

/// Keeps one record of every cell (the paper's third step).
///
/// A cell's positions are sorted by their angle θ to the partition's direction (to the cell's own
/// dominant axis where `cells` has `measure = "cone"`); the lower median stays: of m positions that
/// at index (m − 1) / 2. Among positions of exactly that angle it is the one nearest to the centre
/// of mass of the cell's positions, then the first in Morton order. Copies weigh as one position
/// and are removed as coincident. A position without a normal is in no cell and keeps one record.
/// With `pick = "center"` the angles only divide: of each cell the position nearest to its centre
/// of mass stays. With `pick = "centroid"` that record is moved to the centre of mass itself,
/// rounded to whole steps of the lattice: a point that no scanner saw. Such a record has its
/// synthetic flag set where the format has one, the report counts it as `median_moved`, and
/// `ShiftX`, `ShiftY` and `ShiftZ` in `write.dimensions` tell by how much. Deviations are measured
/// from where it has gone. No stage that works on tiles stands behind such a one, and `passes` is
/// 1: stages work on the positions that were read.
///
/// With `passes` above 1, what one pass leaves is the scan of the next: normals, cells and
/// selection again, with the same keys. A cell's side, once chosen, stays.
///
/// With `mark`, every record is written and the decision is in the records: `"key-point"` sets the
/// key-point flag of those that stay and clears it of the others, `"withheld"` sets the withheld
/// flag of the others, 7 and 18 make that their class. The report counts the others as
/// `median_marked`, and those that got the key-point flag as `key_points`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Median {
    /// How often the stages from the last `normals` to this one are applied (the paper's degree of
    /// reduction), 1 to 16.
    #[serde(deserialize_with = "checked_passes")]
    #[schemars(with = "Whole<1, { MAX_PASSES as u64 }>")]
    pub passes: usize,
    /// Which position of a cell stays.
    pub pick: Representative,
    /// How records are marked, instead of removing any.
    pub mark: Option<Mark>,
    /// World units of a lattice step, once that is known.
    #[serde(skip)]
    step: f64,
}

/// Which position of a cell stays; of equally good ones the first in Morton order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Representative {
    /// That of the median angle (the paper's).
    #[default]
    Median,
    /// The nearest to the centre of mass of the cell's positions.
    Center,
    /// That one, moved to the centre of mass.
    Centroid,
}

impl Default for Median {
    fn default() -> Self {
        Median { passes: 1, pick: Representative::Median, mark: None, step: 1.0 }
    }
}

impl Median {
    /// Refuses passes outside 1 to 16; names the key to blame.
    pub(crate) fn check(&self) -> Result<(), (&'static str, Error)> {
        let wrong = |told: String| ("passes", Error::pipeline(told));
        check_passes(self.passes as u64).map_err(wrong)?;
        if self.pick == Representative::Centroid && self.passes > 1 {
            let told = "`median.pick = \"centroid\"` moves points, and a further pass of \
                        `median.passes` would work on where they were";
            let help = "leave one of the two out, or run the pipeline once for each pass";
            return Err(("passes", Error::pipeline(told).help(help)));
        }
        if let (Representative::Centroid, Some(_)) = (self.pick, self.mark) {
            let told = "`median.pick = \"centroid\"` moves the records that stay, and \
                        `median.mark` changes no other byte of any";
            return Err(("mark", Error::pipeline(told).help("leave one of the two out")));
        }
        Ok(())
    }
}

fn check_passes(passes: u64) -> Result<(), String> {
    if (1..=MAX_PASSES as u64).contains(&passes) {
        return Ok(());
    }
    Err(format!("passes must be 1 to {MAX_PASSES}, not {passes}"))
}

fn checked_passes<'de, D: Deserializer<'de>>(from: D) -> Result<usize, D::Error> {
    let passes = Whole::<1, { MAX_PASSES as u64 }>::deserialize(from)?;
    Ok(passes.get() as usize)
}

impl StageKind for Median {
    const KIND: &'static str = "median";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Keeps the median point of every cell.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.check().map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Median {
    fn needs(&self) -> Needs {
        let needs = Needs::none().reads(&NORMAL).takes_cells().bytes_per_point(BYTES);
        let needs = needs.removes(self.mark).measures();
        let needs = if self.pick == Representative::Centroid { needs.moves() } else { needs };
        Needs { repeats: Some((NORMAL.kind(), self.passes)), ..needs }
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.step = scan.lattice.step;
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let core = tile.core.clone();
        let mut counts = MedianCounts::default();
        let normals = tile.columns.take(&NORMAL)?;
        for i in core.clone() {
            if !is_known(normals[i]) && tile.is_chosen(i) {
                counts.coincident += keep_once(tile, i);
            }
        }
        let mut shifts = match self.pick {
            Representative::Centroid => Some(tile.columns.take(&SHIFT)?),
            Representative::Median | Representative::Center => None,
        };
        shifts.iter_mut().for_each(|shifts| shifts.fill([0.0; 3]));
        let mut angles = Vec::new();
        let mut start = 0;
        for g in 0..tile.cells.ends.len() {
            let group = start..tile.cells.ends[g] as usize;
            start = group.end;
            if !tile.cells.members[group.clone()].iter().any(|&i| core.contains(&(i as usize))) {
                continue;
            }
            let found = match self.pick {
                Representative::Median => median(tile, &normals, group.clone(), &mut angles)
                    .map(|kept| (kept, tile.positions[kept])),
                Representative::Center => {
                    central(tile, group.clone()).map(|(kept, _)| (kept, tile.positions[kept]))
                }
                Representative::Centroid => central(tile, group.clone()),
            };
            let Some((kept, place)) = found else { continue };
            if let Some(shifts) = &mut shifts {
                let by = |axis: usize| (place[axis] - tile.positions[kept][axis]) as f64;
                shifts[kept] = std::array::from_fn(|axis| by(axis) * self.step);
                counts.moved += u64::from(core.contains(&kept) && shifts[kept] != [0.0; 3]);
            }
            counts.decide(tile, group, (kept, place), normals[kept].map(f64::from));
        }
        shifts.into_iter().for_each(|shifts| tile.columns.put(shifts));
        tile.columns.put(normals);
        let account = RemovalAccount { stage: "median", marked: "median_marked", mark: self.mark };
        account.enter(tally, "coincident", counts.coincident);
        account.enter(tally, "represented", counts.represented);
        if self.pick == Representative::Centroid {
            tally.count("median_moved", counts.moved);
        }
        Ok(())
    }
}

/// What became of the positions of a tile's core.
#[derive(Default)]
struct MedianCounts {
    coincident: u64,
    represented: u64,
    moved: u64,
}

impl MedianCounts {
    /// Removes all of a group but the position that is kept and comes to lie at a place.
    fn decide(
        &mut self,
        tile: &mut Tile,
        group: Range<usize>,
        (kept, place): (usize, Position),
        normal: [f64; 3],
    ) {
        for at in group {
            let i = tile.cells.members[at] as usize;
            if !tile.core.contains(&i) || !tile.is_chosen(i) {
                continue;
            } else if i == kept {
                self.coincident += keep_once(tile, i);
            } else {
                self.represented += represent_by(tile, i, place, normal);
            }
        }
    }
}

/// The position of `group` with the lower median angle among those that the stage decides about;
/// none if there are none. `angles` is memory to work in.
fn median(
    tile: &Tile,
    normals: &[[f32; 3]],
    group: Range<usize>,
    angles: &mut Vec<(f64, u32)>,
) -> Option<usize> {
    let Partition { members, turned, reference, .. } = &tile.cells;
    angles.clear();
    let normal = |i: u32| normals[i as usize];
    let decided = group.clone().filter(|&at| tile.is_chosen(members[at] as usize));
    match reference {
        Some(reference) => angles.extend(decided.map(|at| {
            let i = members[at];
            (cosine(*reference, normal(i), turned[at]), i)
        })),
        None => {
            let axis = dominant_axis(outer_sum(members[group.clone()].iter().map(|&i| normal(i))));
            angles.extend(decided.map(|at| (-sine2(axis, normal(members[at])), members[at])));
        }
    }
    if let [] | [_] = angles[..] {
        return angles.first().map(|(_, only)| *only as usize);
    }
    // Ascending angles are descending cosines, and descending −sin² up to a right angle.
    let middle = (angles.len() - 1) / 2;
    let cosine = angles.select_nth_unstable_by(middle, |a, b| b.0.total_cmp(&a.0)).1.0;
    angles.retain(|angle| angle.0 == cosine);
    if let [(_, only)] = angles[..] {
        return Some(only as usize);
    }
    let voters = members[group].iter().map(|&i| i as usize).filter(|&i| tile.is_chosen(i));
    let center = Center::of(voters.map(|i| tile.positions[i]));
    // Indices are in Morton order.
    let first =
        angles.iter().min_by_key(|(_, i)| (center.distance2(tile.positions[*i as usize]), *i));
    first.map(|(_, i)| *i as usize)
}

/// The position of `group` nearest to the centre of mass among those that the stage decides about,
/// and that centre in whole steps; none if there are none.
fn central(tile: &Tile, group: Range<usize>) -> Option<(usize, Position)> {
    let members = || tile.cells.members[group.clone()].iter().map(|&i| i as usize);
    let decided = || members().filter(|&i| tile.is_chosen(i));
    let center = Center::of(decided().map(|i| tile.positions[i]));
    let nearest = decided().min_by_key(|&i| (center.distance2(tile.positions[i]), i))?;
    Some((nearest, center.place()))
}

/// The centre of mass of a group, in whole numbers: n·x − Σx instead of x − Σx / n.
struct Center {
    count: i128,
    sum: [i128; 3],
}

impl Center {
    fn of(positions: impl Iterator<Item = Position>) -> Self {
        let mut center = Center { count: 0, sum: [0; 3] };
        for p in positions {
            center.count += 1;
            for (sum, v) in center.sum.iter_mut().zip(p) {
                *sum += i128::from(v);
            }
        }
        center
    }

    /// Where it is, in whole steps.
    fn place(&self) -> Position {
        self.sum.map(|sum| rounded_mean(sum, self.count.max(1)))
    }

    /// Exact squared distance of `p`, times n².
    fn distance2(&self, p: Position) -> Wide {
        let mut total = Wide::ZERO;
        for (sum, v) in self.sum.iter().zip(p) {
            // Below 2^32 positions of 63 bits: an offset has less than 97.
            let offset = (self.count * i128::from(v) - sum).unsigned_abs();
            total = total.plus(Wide::square(offset));
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_center_of_far_positions_is_exact() {
        let far = (1 << 62) - 1;
        let positions = [[far; 3], [-far; 3], [far, far, far - 1], [1, 0, 0]];
        let center = Center::of(positions.into_iter());
        let [a, _, c, d] = positions.map(|p| center.distance2(p));
        assert!(c < a, "one step nearer at 2^62");
        assert!(d < c);
        assert!(a > Wide::from(u128::MAX));
    }

    #[test]
    fn passes_are_1_to_16() {
        assert_eq!(toml::from_str::<Median>("").unwrap(), Median::default());
        let stage: Median = toml::from_str("passes = 16").unwrap();
        assert_eq!(stage.needs().repeats, Some((NORMAL.kind(), 16)));
        for wrong in ["passes = 0", "passes = 17", "passes = -1", "keep = 2", "mark = 6"] {
            assert!(toml::from_str::<Median>(wrong).is_err(), "{wrong}");
        }
        for text in ["passes = 2", "mark = 7", "passes = 2\nmark = 'withheld'"] {
            assert!(toml::from_str::<Median>(text).unwrap().check().is_ok(), "{text}");
        }
        assert!(Median { passes: 17, ..Median::default() }.check().is_err());
    }

    #[test]
    fn a_mark_removes_nothing() {
        let needs = Median { mark: Some(Mark::KeyPoint), ..Median::default() }.needs();
        assert!(!needs.removes && needs.mark == Some(Mark::KeyPoint));
        let needs = Median::default().needs();
        assert!(needs.removes && needs.mark.is_none());
    }
}
