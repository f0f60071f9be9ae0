//! The division of a cell into parts whose normals agree.

use std::ops::Range;

use super::limit::Limit;
use super::settings::Split;
use crate::Result;
use crate::geom::angle::{
    cone, cosine, direction, dominant_axis, is_turned, outer_sum, range, sine2,
};
use crate::point::{Bounds, NORMAL, Position, distance2};
use crate::tile::{Partition, Tile};

/// Divisions by angle that a part may be deep, besides two for every doubling of the cell's
/// positions, before it is cut in eight.
const DEEPEST: u32 = 64;
/// Sides up to which squared distances within a cell fit in an i64.
const SHORT_SIDE: i64 = 1 << 30;

/// When and how a cell is divided.
#[derive(Debug, Clone, Copy)]
pub(super) struct DivisionRule {
    /// Direction N of the angles; none: each part's own dominant axis.
    pub(super) reference: Option<[f64; 3]>,
    pub(super) limit: Limit,
    pub(super) min_points: usize,
    /// A part longer than so many steps is divided whatever its angles.
    pub(super) max_side: u64,
    /// A part of so many steps or fewer is not divided; 0 for no such bound.
    pub(super) min_spacing: u64,
    pub(super) split: Split,
    /// Sites of a division, where there are several.
    pub(super) seeds: usize,
    /// Side of the initial cells in steps, and a corner of one of them.
    pub(super) side: i64,
    pub(super) origin: Position,
}

/// Members `start..end` of a cell, cut off by `depth` divisions by angle, the narrowest of which
/// was of the range `narrowest` (see [`range`]).
pub(super) struct CellPart {
    start: usize,
    end: usize,
    depth: u32,
    narrowest: f64,
}

impl CellPart {
    /// The part of its members `range`.
    fn child(&self, range: Range<usize>, narrowest: f64, levels: u32) -> CellPart {
        let (start, end) = (self.start + range.start, self.start + range.end);
        CellPart { start, end, depth: self.depth + levels, narrowest }
    }
}

/// The range of a part's angles, and the members with the smallest and the largest, of equal ones
/// the first.
pub(super) struct Survey {
    range: f64,
    nearest: u32,
    farthest: u32,
}

/// What is to become of a part.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Kept,
    /// Divided as its angles demand.
    ByAngle,
    /// Divided because it is too long.
    ByLength,
}

/// What divisions were made; cells by whose core has their Morton-first member.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct DivisionCounts {
    /// Initial cells.
    pub(super) initial: u64,
    /// Parts not divided further.
    pub(super) cells: u64,
    /// Initial cells that had a part so deep that it was cut in eight.
    pub(super) cut_deep: u64,
    /// Parts divided that `max_side` alone demanded to divide.
    pub(super) by_max_side: u64,
    /// Parts not divided that only `min_spacing` forbade to divide.
    pub(super) by_min_spacing: u64,
}

/// Divides cells of one tile, one after the other, in memory that it keeps.
pub(super) struct Division<'a> {
    pub(super) rule: DivisionRule,
    pub(super) positions: &'a [Position],
    pub(super) normals: &'a [[f32; 3]],
    core: Range<usize>,
    counts: DivisionCounts,
    stack: Vec<CellPart>,
    spare: Vec<u32>,
}

impl<'a> Division<'a> {
    /// Of a tile whose groups were taken out of it.
    pub(super) fn new(rule: DivisionRule, tile: &'a Tile) -> Result<Self> {
        Ok(Division {
            rule,
            positions: &tile.positions,
            normals: tile.columns.get(&NORMAL)?,
            core: tile.core.clone(),
            counts: DivisionCounts::default(),
            stack: Vec::new(),
            spare: Vec::new(),
        })
    }

    /// What was done so far.
    pub(super) fn counts(&self) -> DivisionCounts {
        self.counts
    }

    /// True if the tile's core has the Morton-first of the members from `start` on: each cell
    /// counts there, so that every cut into tiles counts alike.
    pub(super) fn owns(&self, cells: &Partition, start: usize) -> bool {
        self.core.contains(&(cells.members[start] as usize))
    }

    /// Divides the initial cell `members[start..end]` of `cells`: reorders the members part by
    /// part, each in Morton order, says which of their normals are turned, and adds the end of each
    /// part. Tells `log` of every division by angle: of which range, and how many parts more it
    /// makes.
    pub(super) fn run(
        &mut self,
        Range { start, end }: Range<usize>,
        cells: &mut Partition,
        mut log: impl FnMut(f64, u64),
    ) {
        self.make_room(end - start);
        let mine = self.owns(cells, start);
        let deepest = DEEPEST + 2 * (end - start).max(1).ilog2();
        let mut ties = self.rule.limit.ties(self.positions[cells.members[start] as usize]);
        let mut cut_deep = false;
        self.stack.push(CellPart { start, end, depth: 0, narrowest: f64::NEG_INFINITY });
        while let Some(part) = self.stack.pop() {
            let whole = part.start..part.end;
            let (members, turned) = (&mut cells.members[whole.clone()], &mut cells.turned[whole]);
            if let &mut [only] = members {
                // Half of all parts where cells are divided to the last; its own normal is the
                // axis.
                turned[0] = is_turned([0.0; 3], self.normals[only as usize]);
                self.close(cells, &part);
                continue;
            }
            let survey = self.survey(members, turned);
            let narrowest = part.narrowest.max(survey.range);
            let pushed = self.stack.len();
            match self.verdict(members, narrowest, ties) {
                Verdict::Kept => {}
                Verdict::ByLength => {
                    self.cut_in_eight(members, |range| part.child(range, part.narrowest, 0))
                }
                Verdict::ByAngle => {
                    let child = |range| part.child(range, narrowest, 1);
                    let is_deep = part.depth >= deepest && self.rule.split != Split::Octant;
                    cut_deep |= is_deep;
                    match self.rule.split {
                        Split::Voronoi if !is_deep => self.bisect(members, turned, &survey, child),
                        Split::Dirichlet if !is_deep => {
                            self.part_among(members, turned, &survey, child)
                        }
                        _ => self.cut_in_eight(members, child),
                    }
                    let parts = self.stack.len() - pushed;
                    if parts > 1 {
                        log(narrowest, parts as u64 - 1);
                        ties -= u64::from(self.rule.limit.is_tie(narrowest));
                    }
                }
            }
            if self.stack.len() - pushed < 2 {
                // Only positions that are not distinct cannot be told apart.
                self.stack.truncate(pushed);
                self.close(cells, &part);
            }
        }
        self.counts.initial += u64::from(mine);
        self.counts.cut_deep += u64::from(mine && cut_deep);
    }

    /// Ends a part that is not divided further.
    fn close(&mut self, cells: &mut Partition, part: &CellPart) {
        self.counts.cells += u64::from(self.owns(cells, part.start));
        cells.ends.push(part.end as u32);
    }

    fn make_room(&mut self, members: usize) {
        if self.spare.len() < members {
            self.spare.reserve_exact(members - self.spare.len());
            self.spare.resize(members, 0);
        }
    }

    /// Decides about a part whose angles, and those of all parts above it, span `narrowest` or
    /// more.
    fn verdict(&mut self, part: &[u32], narrowest: f64, ties: u64) -> Verdict {
        let DivisionRule { limit, min_points, max_side, min_spacing, .. } = self.rule;
        let is_wide = part.len() > min_points && limit.allows(narrowest, ties);
        let by_angle = if is_wide { Verdict::ByAngle } else { Verdict::Kept };
        if max_side == u64::MAX && (min_spacing == 0 || !is_wide) {
            return by_angle;
        }
        let positions = part.iter().map(|&i| self.positions[i as usize]);
        let [x, y, z] = Bounds::of(positions).extent();
        let length = x.max(y).max(z);
        let mine = u64::from(self.core.contains(&(part[0] as usize)));
        if length > max_side {
            self.counts.by_max_side += mine * u64::from(!is_wide);
            Verdict::ByLength
        } else if is_wide && length <= min_spacing {
            // One of exactly the last range may be among those that stay whole in any case.
            self.counts.by_min_spacing += mine * u64::from(!limit.is_tie(narrowest));
            Verdict::Kept
        } else {
            by_angle
        }
    }

    /// Turns the normals of a part to its own dominant axis and finds what their angles span.
    fn survey(&self, part: &[u32], turned: &mut [bool]) -> Survey {
        let normals = self.normals;
        let normal = |i: u32| normals[i as usize];
        let axis = dominant_axis(outer_sum(part.iter().map(|&i| normal(i))));
        let Some(reference) = self.rule.reference else {
            return self.survey_cone(axis, part, turned);
        };
        let mut smallest = (f64::NEG_INFINITY, 0);
        let mut largest = (f64::INFINITY, 0);
        for (&i, turned) in part.iter().zip(turned) {
            *turned = is_turned(axis, normal(i));
            let cosine = cosine(reference, normal(i), *turned);
            if cosine > smallest.0 {
                smallest = (cosine, i);
            }
            if cosine < largest.0 {
                largest = (cosine, i);
            }
        }
        Survey { range: range(smallest.0, largest.0), nearest: smallest.1, farthest: largest.1 }
    }

    /// The same where angles are those to the part's own axis.
    fn survey_cone(&self, axis: [f64; 3], part: &[u32], turned: &mut [bool]) -> Survey {
        let mut largest = (f64::NEG_INFINITY, 0);
        for (&i, turned) in part.iter().zip(turned) {
            let normal = self.normals[i as usize];
            *turned = is_turned(axis, normal);
            let sine2 = sine2(axis, normal);
            if sine2 > largest.0 {
                largest = (sine2, i);
            }
        }
        Survey { range: cone(largest.0), nearest: largest.1, farthest: largest.1 }
    }

    /// The member whose normal is farthest in angle from that of `from`, both turned; of equal ones
    /// the first. Chords of unit normals compare as their angles do.
    fn opposite(&self, from: u32, part: &[u32], turned: &[bool]) -> u32 {
        let unit = |i: u32| direction(self.normals[i as usize].map(f64::from));
        let sign_of = |turned: bool| if turned { -1.0 } else { 1.0 };
        let is_turned = part.iter().zip(turned).any(|(&i, &turned)| i == from && turned);
        let (a, sign) = (unit(from).unwrap_or_default(), sign_of(is_turned));
        let mut largest = (f64::NEG_INFINITY, from);
        for (&i, &turned) in part.iter().zip(turned) {
            let (b, sign) = (unit(i).unwrap_or_default(), sign * sign_of(turned));
            let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| a[axis] - sign * b[axis]);
            let chord2 = x * x + y * y + z * z;
            if chord2 > largest.0 {
                largest = (chord2, i);
            }
        }
        largest.1
    }

    /// Parts the members by the bisector of the two sites; equally far ones go to the smallest
    /// angle's, or, where angles are those to the part's own axis, to that of the second site.
    pub(super) fn bisect(
        &mut self,
        part: &mut [u32],
        turned: &[bool],
        survey: &Survey,
        child: impl Fn(Range<usize>) -> CellPart,
    ) {
        let positions = self.positions;
        let nearest = match self.rule.reference {
            Some(_) => survey.nearest,
            None => self.opposite(survey.farthest, part, turned),
        };
        let [nearest, farthest] = [nearest, survey.farthest].map(|i| positions[i as usize]);
        let cut = if self.rule.side <= SHORT_SIDE {
            // |x − a|² ≤ |x − b|² as 2 (x − a)·(b − a) ≤ |b − a|², exact as every term is below
            // 2^61.
            let apart: [i64; 3] = std::array::from_fn(|axis| farthest[axis] - nearest[axis]);
            let apart2: i64 = apart.iter().map(|d| d * d).sum();
            self.part_in_two(part, |i| {
                let p = positions[i as usize];
                let along: i64 = (0..3).map(|axis| (p[axis] - nearest[axis]) * apart[axis]).sum();
                2 * along <= apart2
            })
        } else {
            self.part_in_two(part, |i| {
                let p = positions[i as usize];
                distance2(p, nearest) <= distance2(p, farthest)
            })
        };
        for range in [cut..part.len(), 0..cut] {
            if !range.is_empty() {
                self.stack.push(child(range));
            }
        }
    }

    /// Brings the members for which `first` holds to the front, both parts in the order they had;
    /// returns how many there are.
    fn part_in_two(&mut self, part: &mut [u32], first: impl Fn(u32) -> bool) -> usize {
        let (mut front, mut back) = (0, 0);
        for at in 0..part.len() {
            // Both are written and one is counted: no branch to mispredict.
            let i = part[at];
            part[front] = i;
            self.spare[back] = i;
            let is_first = usize::from(first(i));
            front += is_first;
            back += 1 - is_first;
        }
        part[front..].copy_from_slice(&self.spare[..back]);
        front
    }

    /// Parts the members by the kind that each is of, below `ENDS` − 1, all in the order they had.
    pub(super) fn distribute<const ENDS: usize>(
        &mut self,
        part: &mut [u32],
        kind: impl Fn(u32) -> usize,
        child: impl Fn(Range<usize>) -> CellPart,
    ) {
        let mut bounds = [0; ENDS];
        part.iter().for_each(|&i| bounds[kind(i) + 1] += 1);
        for i in 1..ENDS {
            bounds[i] += bounds[i - 1];
        }
        let mut next = bounds;
        let spare = &mut self.spare[..part.len()];
        spare.copy_from_slice(part);
        for &mut i in spare {
            let kind = kind(i);
            part[next[kind]] = i;
            next[kind] += 1;
        }
        for range in bounds.windows(2).rev().filter(|range| range[0] < range[1]) {
            self.stack.push(child(range[0]..range[1]));
        }
    }
}
