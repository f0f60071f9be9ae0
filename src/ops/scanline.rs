//! The stage `scanline`: along each scan line, points within a tolerance of the chord between two
//! others go.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::lengths::Square;
use super::whole::Rows;
use crate::geom::plane::dot;
use crate::point::{Column, Position, Units, distance2, names};
use crate::quantity::{Angle, Length};
use crate::report::Tally;
use crate::stage::{
    Gathered, Needs, Role, RoleName, ScanFacts, ScanOp, StageKind, StagePlace, TileOp,
};
use crate::tile::Tile;
use crate::{Error, Result};

const TIME: Column<f64> = Column::new(names::GPS_TIME, &[]);
const COLUMN: Column<f64> = Column::new(names::COLUMN, &[]);
/// Points that one chord spans at most: what a chord costs grows with the square of it.
const MOST: usize = 256;
/// Bytes that a position of the scan takes while lines are followed: what was gathered of it, its
/// place in its line, how far it is from its chord.
const HELD_BYTES: usize = Rows::<LinePoint>::BYTES + size_of::<u32>() + size_of::<f32>();

/// The sequential reduction of Fujimoto and Kariya, with which the paper compares: each scan line
/// is followed from its first point to its last, and points go as long as what is left tells where
/// they were.
///
/// From a point that stays, the chord goes to the farthest along the line for which all points
/// between them lie within `max_distance` of it and, if `max_angle` is given, all steps from one
/// point to the next turn from it by no more than that; that one stays, and the next chord begins
/// there. A chord spans 256 points at most. The first and the last point of a line stay. The report
/// tells as deviation how far each point that went is from its chord.
///
/// A line is made of points in the order of their GPS time; `lines` says what else divides them,
/// and `gap` how far apart two points are that are not on one line. An organised scan, whose points
/// have the dimensions `Row` and `Column`, has no need of times: with `lines = ["row"]` each of its
/// rows is a line, in the order of its columns. Nothing depends on the order of the file. Of
/// several returns of one pulse, which have one time, the first in canonical order comes first:
/// where there are such, `where = "ReturnNumber == 1"` lets the stage work on first returns alone.
/// Copies of a point count as one, and one record of a position stays.
///
/// Lines cross the whole scan, so that all positions are in memory at once, with 64 bytes each; a
/// scan that is too large for the run's memory is refused before any work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scanline {
    /// How far from its chord a point may be that goes, a length above 0.
    pub max_distance: Length,
    /// By how much a step along the line may turn from the chord; none: by any angle.
    #[serde(default)]
    pub max_angle: Option<Angle>,
    /// What ends a line, besides its own end: none, or several.
    #[serde(default = "ends_of_las")]
    pub lines: Vec<LineEnd>,
    /// How far apart two points in order are at least if they are on two lines; none by default.
    #[serde(default)]
    pub gap: Option<Length>,
    #[serde(skip)]
    settled: Option<Tolerance>,
    #[serde(skip)]
    found: Option<FoundLines>,
}

/// What ends a line: another value of a dimension.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum LineEnd {
    /// `PointSourceId`: lines of one flight line, of one scan position. Points of different ones
    /// are in order of time apart from each other.
    Source,
    /// `ScannerChannel`, as `source`.
    Channel,
    /// `ScanDirectionFlag`: the mirror turns back.
    Direction,
    /// `EdgeOfFlightLine`, the last point before it does: a line ends behind a point that has it,
    /// unless it began with that point.
    Edge,
    /// `Row` of an organised scan, as `source`; its points are in the order of `Column`.
    Row,
}

impl LineEnd {
    const ALL: [LineEnd; 5] =
        [LineEnd::Source, LineEnd::Channel, LineEnd::Direction, LineEnd::Edge, LineEnd::Row];

    fn column(self) -> Column<f64> {
        match self {
            LineEnd::Source => const { Column::new(names::POINT_SOURCE_ID, &[]) },
            LineEnd::Channel => const { Column::new(names::SCANNER_CHANNEL, &[]) },
            LineEnd::Direction => const { Column::new(names::SCAN_DIRECTION_FLAG, &[]) },
            LineEnd::Edge => const { Column::new(names::EDGE_OF_FLIGHT_LINE, &[]) },
            LineEnd::Row => const { Column::new(names::ROW, &[]) },
        }
    }

    /// True if points of different values are no neighbours in order.
    fn divides(self) -> bool {
        matches!(self, LineEnd::Source | LineEnd::Channel | LineEnd::Row)
    }
}

fn ends_of_las() -> Vec<LineEnd> {
    vec![LineEnd::Source, LineEnd::Direction, LineEnd::Edge]
}

/// What is gathered of a position.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LinePoint {
    /// Its time, or its column.
    along: f64,
    /// Source, channel, direction, edge and row; 0 where nobody asks for it.
    ends: [u32; LineEnd::ALL.len()],
    /// What makes it whole words.
    unused: u32,
}

/// What a chord must hold to, in steps of the lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tolerance {
    /// The square of the largest distance.
    distance2: f64,
    /// Cosine of the largest angle, if one is given.
    cosine: Option<f64>,
    /// The smallest squared distance of two lines.
    gap2: u128,
}

/// What came of the lines.
#[derive(Debug, Clone, PartialEq)]
struct FoundLines {
    lines: u64,
    /// How far each position is from its chord in steps; NaN for one that stays.
    rows: Rows<f32>,
}

impl StageKind for Scanline {
    const KIND: &'static str = "scanline";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Keeps of every scan line the points that tell where it goes.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        let twice = |(n, end): (usize, &LineEnd)| self.lines[..n].contains(end);
        if self.lines.iter().enumerate().any(twice) {
            let error = Error::pipeline("`scanline.lines` has a word twice");
            return Err(at.blame("lines", error.help("leave it out once")));
        }
        Ok(Role::ScanOp(Box::new(self)))
    }
}

impl Scanline {
    /// What points of a line are in the order of.
    fn along(&self) -> &'static Column<f64> {
        if self.lines.contains(&LineEnd::Row) { &COLUMN } else { &TIME }
    }
}

impl TileOp for Scanline {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).removes(None).measures()
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        self.max_distance = self.max_distance.in_scan(units, "scanline.max_distance")?;
        let gap = self.gap.map(|gap| gap.in_scan(units, "scanline.gap"));
        self.gap = gap.transpose()?;
        Ok(())
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        let gap = self.gap.map(|gap| ("scanline.gap", gap));
        [("scanline.max_distance", self.max_distance)].into_iter().chain(gap).collect()
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        let steps = |length: Length| length.value() / scan.lattice.step;
        let distance = steps(self.max_distance);
        self.settled = Some(Tolerance {
            distance2: distance * distance,
            cosine: self.max_angle.map(|angle| libm::cos(angle.in_radians())),
            gap2: self.gap.map_or(u128::MAX, |gap| Square::of(steps(gap)).at_least()),
        });
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let unfound = || Error::internal("the stage scanline ran before lines were followed");
        let rows = &self.found.as_ref().ok_or_else(unfound)?.rows;
        rows.thin(tile, Self::KIND, tally)
    }

    fn decisions(&self) -> Vec<(String, Value)> {
        self.found.iter().map(|found| ("lines".into(), found.lines.into())).collect()
    }
}

impl ScanOp for Scanline {
    type Summary = Rows<LinePoint>;

    fn gather_needs(&self) -> Needs {
        let needs = Needs::none().looks_at(names::XYZ).reads(self.along());
        let needs = self.lines.iter().fold(needs, |needs, end| needs.reads(&end.column()));
        // As they are gathered, and as they are stored.
        needs.bytes_per_point(2 * Rows::<LinePoint>::BYTES).holds(HELD_BYTES)
    }

    fn gather(&self, tile: &mut Tile, _: &mut Tally) -> Result<Rows<LinePoint>> {
        let along = tile.columns.get(self.along())?;
        let mut columns = [None; LineEnd::ALL.len()];
        for (column, end) in columns.iter_mut().zip(LineEnd::ALL) {
            if self.lines.contains(&end) {
                *column = Some(tile.columns.get(&end.column())?);
            }
        }
        Ok(Rows::of_core(tile, |i| LinePoint {
            along: along[i],
            ends: columns.map(|column| column.map_or(0, |values| values[i] as u32)),
            unused: 0,
        }))
    }

    fn conclude(&mut self, gathered: &dyn Gathered<Rows<LinePoint>>) -> Result<Option<String>> {
        let unsettled = || Error::internal("the stage scanline gathered before it was settled");
        let tolerance = self.settled.ok_or_else(unsettled)?;
        let rows = Rows::of_scan(gathered)?;
        let mut order: Vec<u32> = (0..rows.positions.len() as u32).collect();
        let divided = |point: &LinePoint| {
            let divides = |end: LineEnd| if end.divides() { point.ends[end as usize] } else { 0 };
            LineEnd::ALL.map(divides)
        };
        order.sort_unstable_by(|&a, &b| {
            let [one, two] = [a, b].map(|i| &rows.values[i as usize]);
            divided(one).cmp(&divided(two)).then(one.along.total_cmp(&two.along)).then(a.cmp(&b))
        });
        let mut distances = vec![f32::NAN; order.len()];
        let (mut lines, mut start) = (0, 0);
        for n in 1..=order.len() {
            let before = order[n - 1] as usize;
            let is_end = order.get(n).is_none_or(|&next| {
                let next = next as usize;
                let [one, two] = [before, next].map(|i| rows.values[i].ends);
                let differs = |end: LineEnd| one[end as usize] != two[end as usize];
                let at_edge = one[LineEnd::Edge as usize] != 0 && n - 1 > start;
                LineEnd::ALL.into_iter().any(|end| end != LineEnd::Edge && differs(end))
                    || at_edge
                    || distance2(rows.positions[before], rows.positions[next]) >= tolerance.gap2
            });
            if is_end {
                lines += 1;
                tolerance.follow(&order[start..n], &rows.positions, &mut distances);
                start = n;
            }
        }
        self.found = Some(FoundLines { lines, rows: rows.with(distances) });
        Ok(None)
    }
}

impl Tolerance {
    /// Follows a line of positions; enters how far each that goes is from its chord.
    fn follow(&self, line: &[u32], positions: &[Position], distances: &mut [f32]) {
        let at = |n: usize| positions[line[n] as usize];
        let mut from = 0;
        while from + 1 < line.len() {
            let farthest = line.len().min(from + MOST + 1);
            let mut to = from + 1;
            while to + 1 < farthest && self.holds(from..to + 1, at) {
                to += 1;
            }
            for n in from + 1..to {
                distances[line[n] as usize] =
                    chord_distance2(at(from), at(to), at(n)).sqrt() as f32;
            }
            from = to;
        }
    }

    /// True if the chord from the first of these places along a line to the end of the range does
    /// for all between them.
    fn holds(&self, Range { start, end }: Range<usize>, at: impl Fn(usize) -> Position) -> bool {
        let (from, to) = (at(start), at(end));
        let is_near = |n: usize| chord_distance2(from, to, at(n)) <= self.distance2;
        if !(start + 1..end).all(is_near) {
            return false;
        }
        let Some(cosine) = self.cosine else { return true };
        let chord = offset(from, to);
        let turns = |n: usize| {
            let step = offset(at(n), at(n + 1));
            dot(step, chord) >= cosine * (dot(step, step) * dot(chord, chord)).sqrt()
        };
        (start..end).all(turns)
    }
}

fn offset(from: Position, to: Position) -> [f64; 3] {
    [0, 1, 2].map(|axis| to[axis].saturating_sub(from[axis]) as f64)
}

/// The squared distance of a position to a chord, in steps.
fn chord_distance2(from: Position, to: Position, p: Position) -> f64 {
    let (chord, away) = (offset(from, to), offset(from, p));
    let along = (dot(away, chord) / dot(chord, chord)).clamp(0.0, 1.0);
    let rest = [0, 1, 2].map(|axis| away[axis] - along * chord[axis]);
    dot(rest, rest)
}

#[cfg(test)]
mod tests;
