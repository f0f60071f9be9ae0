//! The points of a file held against what its header says of them. LAZ has no checksum: damage
//! inside a chunk decodes to other points, which the header's box and counts can tell. Knows what
//! was found, not what a run does about it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use super::fields::at;
use super::header::Header;
use crate::Result;
use crate::host::lock;
use crate::point::PointBatch;
use crate::report::{Grouped, LostPoints};
use crate::stage::{Contradiction, Part};

/// Steps that a point may lie outside of the box: writers compute it before or after they round.
const SLACK: f64 = 1.0;
/// In a plain file damage changes single points. More than one of this many is no damage.
const SINGLE: u64 = 100;

/// The box of a header in stored coordinates.
#[derive(Debug, Clone, Copy)]
struct Claimed {
    lo: [i64; 3],
    hi: [i64; 3],
}

impl Claimed {
    /// None if the header says no box: its writer left it as it was.
    fn of(header: &Header) -> Option<Claimed> {
        let [lo, hi] = header.bounds();
        let is_box = (0..3).all(|i| lo[i] <= hi[i] && (hi[i] - lo[i]).is_finite());
        if !is_box || (lo == [0.0; 3] && hi == [0.0; 3]) {
            return None;
        }
        let mut claimed = Claimed { lo: [0; 3], hi: [0; 3] };
        for (i, (scale, offset)) in header.scale().into_iter().zip(header.offset()).enumerate() {
            let largest = lo[i].abs().max(hi[i].abs()).max(offset.abs());
            let slack = SLACK + 4.0 * f64::EPSILON * largest / scale.abs();
            let [one, two] = [lo[i], hi[i]].map(|v| (v - offset) / scale);
            claimed.lo[i] = (one.min(two) - slack).ceil() as i64;
            claimed.hi[i] = (one.max(two) + slack).floor() as i64;
        }
        Some(claimed)
    }

    fn holds(&self, stored: [i32; 3]) -> bool {
        (0..3).all(|i| (self.lo[i]..=self.hi[i]).contains(&i64::from(stored[i])))
    }
}

/// What points are, in figures that a header has.
#[derive(Debug, Clone)]
pub struct Found {
    /// How many there are.
    pub points: u64,
    /// Points outside of the header's box.
    outside: u64,
    /// Smallest stored coordinates.
    pub lo: [i64; 3],
    /// Largest stored coordinates.
    pub hi: [i64; 3],
    /// Points by return number, 0 included.
    pub returns: [u64; 16],
}

impl Found {
    const NONE: Found =
        Found { points: 0, outside: 0, lo: [i64::MAX; 3], hi: [i64::MIN; 3], returns: [0; 16] };

    fn merge(&mut self, other: &Found) {
        self.points += other.points;
        self.outside += other.outside;
        for i in 0..3 {
            self.lo[i] = self.lo[i].min(other.lo[i]);
            self.hi[i] = self.hi[i].max(other.hi[i]);
        }
        self.returns.iter_mut().zip(other.returns).for_each(|(sum, n)| *sum += n);
    }
}

/// Stored coordinates and the byte of the returns of each record.
fn fields(records: &[u8], stride: usize) -> impl Iterator<Item = ([i32; 3], u8)> + '_ {
    records.chunks_exact(stride).filter_map(|record| {
        let field = record.first_chunk::<15>()?;
        let axis = |i: usize| [field[i], field[i + 1], field[i + 2], field[i + 3]];
        Some(([0, 4, 8].map(|i| i32::from_le_bytes(axis(i))), field[14]))
    })
}

/// What was found in one file, gathered from its parts.
#[derive(Debug)]
pub struct Evidence {
    claimed: Option<Claimed>,
    compressed: bool,
    /// Bits of the byte at 14 that hold the return number, and how far up the number of returns is.
    return_bits: (u8, u32),
    gathered: Mutex<VerifiedSoFar>,
}

#[derive(Debug)]
struct VerifiedSoFar {
    found: Found,
    /// Which parts were read to their end.
    read: Vec<bool>,
    warnings: Vec<String>,
    /// What is lost, each from a byte on, and of what is lost while points are read how much.
    lost: BTreeMap<u64, (LostPoints, bool)>,
}

impl Evidence {
    /// Of a file with this header, which is read in `parts` parts.
    pub fn new(header: &Header, parts: usize) -> Evidence {
        let gathered = VerifiedSoFar {
            found: Found::NONE,
            read: vec![false; parts],
            warnings: Vec::new(),
            lost: BTreeMap::new(),
        };
        Evidence {
            claimed: Claimed::of(header),
            compressed: header.compressed(),
            return_bits: if header.format() < 6 { (0b111, 3) } else { (0b1111, 4) },
            gathered: Mutex::new(gathered),
        }
    }

    /// Tells the user something that turned up while the points were read.
    pub fn warn(&self, warning: String) {
        let warnings = &mut lock(&self.gathered).warnings;
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }

    /// Takes down points that the file does not have.
    pub fn lose(&self, lost: LostPoints) {
        lock(&self.gathered).lost.insert(lost.byte, (lost, false));
    }

    /// Takes down points that are lost as they are read: a part may be read more than once.
    pub fn lose_while_read(&self, lost: LostPoints) {
        lock(&self.gathered).lost.insert(lost.byte, (lost, true));
    }

    /// What is lost, in the order of the file.
    pub fn lost(&self) -> Vec<LostPoints> {
        lock(&self.gathered).lost.values().map(|(lost, _)| lost.clone()).collect()
    }

    /// How many points are lost of those that the parts were to have.
    pub fn lost_while_read(&self) -> u64 {
        let gathered = lock(&self.gathered);
        gathered.lost.values().filter(|(_, is_read)| *is_read).map(|(lost, _)| lost.points).sum()
    }

    /// What turned up while the points were read.
    pub fn warnings(&self) -> Vec<String> {
        lock(&self.gathered).warnings.clone()
    }

    /// What all points come to; None before all of them were read.
    pub fn found(&self) -> Option<Found> {
        let gathered = lock(&self.gathered);
        (!gathered.read.contains(&false)).then(|| gathered.found.clone())
    }

    /// True if `records`, which no header counts, can be points of this file: they are in its box
    /// and no return number exceeds the number of returns. False where there is no box to tell.
    pub fn are_likely(&self, records: &[u8], stride: usize) -> bool {
        let (mask, shift) = self.return_bits;
        self.claimed.is_some_and(|claimed| {
            fields(records, stride).all(|(stored, returns)| {
                let (number, of) = (returns & mask, returns >> shift & mask);
                claimed.holds(stored) && (number <= of || of == 0)
            })
        })
    }

    /// True unless one of `records` cannot be a point of this file, as far as its header tells.
    pub fn are_possible(&self, records: &[u8], stride: usize) -> bool {
        self.claimed.is_none() || self.are_likely(records, stride)
    }

    fn look(&self, found: &mut Found, records: &[u8], stride: usize, shift: [i64; 3]) {
        let (mut lo, mut hi) = ([i32::MAX; 3], [i32::MIN; 3]);
        // Two histograms: most points have one return number, and would wait for each other.
        let mut counts = [[0u32; 16]; 2];
        for (n, (stored, returns)) in fields(records, stride).enumerate() {
            for i in 0..3 {
                lo[i] = lo[i].min(stored[i]);
                hi[i] = hi[i].max(stored[i]);
            }
            counts[n & 1][usize::from(returns & self.return_bits.0)] += 1;
        }
        let points = (records.len() / stride.max(1)) as u64;
        let (mut these, [one, two]) = (Found { points, ..Found::NONE }, counts);
        these.returns = std::array::from_fn(|i| u64::from(one[i]) + u64::from(two[i]));
        for i in 0..3 {
            these.lo[i] = i64::from(lo[i]) - shift[i];
            these.hi[i] = i64::from(hi[i]) - shift[i];
        }
        if let Some(claimed) = self.claimed.filter(|c| points > 0 && !c.hold(&these)) {
            let outside = fields(records, stride).filter(|(stored, _)| {
                (0..3).any(|i| {
                    let own = i64::from(stored[i]) - shift[i];
                    own < claimed.lo[i] || own > claimed.hi[i]
                })
            });
            these.outside = outside.count() as u64;
        }
        found.merge(&these);
    }

    fn end(&self, part: usize, found: &Found) {
        let gathered = &mut *lock(&self.gathered);
        if let Some(read) = gathered.read.get_mut(part).filter(|read| !**read) {
            *read = true;
            gathered.found.merge(found);
        }
    }

    /// What the header says of the points and is not so; nothing before all of them were read.
    pub fn contradictions(&self, path: &Path, header: &Header) -> Vec<Contradiction> {
        let gathered = lock(&self.gathered);
        if gathered.read.contains(&false) {
            return Vec::new();
        }
        let found = &gathered.found;
        let unset = (self.claimed.is_none() && found.points > 0).then(|| {
            let told =
                "the header has no box of the points: programs that go by it will not find them";
            (at::BOX, told.to_owned(), false)
        });
        let told = [unset, self.of_box(header, found), self.of_returns(header, found)];
        let contradiction = |(byte, message, is_damage): (usize, String, bool)| Contradiction {
            path: path.to_owned(),
            byte: byte as u64,
            message,
            is_damage,
        };
        told.into_iter().flatten().map(contradiction).collect()
    }

    /// Points outside of the box. A wider box than needed is that of a file that once had more
    /// points.
    ///
    /// Behind damage, a compressed chunk is other points, while the first of each chunk is stored
    /// as it is: a box that holds no point at all is its writer's mistake. In a plain file, single
    /// points are damaged.
    fn of_box(&self, header: &Header, found: &Found) -> Option<(usize, String, bool)> {
        let claimed = self.claimed.filter(|_| found.outside > 0)?;
        let [lo, hi] = header.bounds();
        let (scale, offset) = (header.scale(), header.offset());
        let wrong = |i: &usize| found.lo[*i] < claimed.lo[*i] || found.hi[*i] > claimed.hi[*i];
        let axis = |i: usize| {
            let ends = [found.lo[i], found.hi[i]].map(|v| v as f64 * scale[i] + offset[i]);
            let (one, two) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            let steps = |digits: &usize| scale[i].abs() * 10f64.powi(*digits as i32) >= 0.999;
            let digits = (0..9).find(steps).unwrap_or(9);
            let name = ["x", "y", "z"][i];
            format!(
                "{name} from {} to {} there and from {one:.digits$} to {two:.digits$} in the \
                 points",
                lo[i], hi[i]
            )
        };
        let first = (0..3).find(wrong)?;
        let axes: Vec<String> = (0..3).filter(wrong).map(axis).collect();
        let Found { points, outside, .. } = *found;
        let told = format!(
            "{} of {} points lie outside of the header's box: {}",
            Grouped(outside),
            Grouped(points),
            axes.join(", ")
        );
        let is_damage = match self.compressed {
            true => outside < points,
            false => outside.saturating_mul(SINGLE) <= points,
        };
        Some((at::BOX + 16 * first, told, is_damage))
    }

    /// Counts of points by return that are others than the header's. One that has none, or whose
    /// counts exceed its points, was not kept up by its writer, and points without return numbers
    /// say nothing: some writers count those among the first returns.
    fn of_returns(&self, header: &Header, found: &Found) -> Option<(usize, String, bool)> {
        let (field, width, counts) = header.returns();
        let sum = counts.iter().fold(0u64, |sum, n| sum.saturating_add(*n));
        let numbered = found.points - found.returns[0];
        if sum == 0 || sum > found.points || numbered == 0 {
            return None;
        }
        let pairs = || counts.iter().zip(&found.returns[1..]);
        let first = pairs().position(|(said, is)| said != is)?;
        let differ: u64 = pairs().map(|(said, is)| said.abs_diff(*is)).sum();
        let (said, is) = (counts[first], found.returns[first + 1]);
        let unnumbered = found.returns[0];
        let as_first = unnumbered > 0 && first == 0 && said.checked_sub(is) == Some(unnumbered);
        let as_first = as_first && differ == unnumbered;
        let besides = match as_first {
            true => format!(", besides {unnumbered} without a return number"),
            false => String::new(),
        };
        let told = format!(
            "the header counts {said} points of return {}, and {is} were found{besides}",
            first + 1
        );
        // A point that changed its return is missed at one and too many at another.
        let few = differ.div_ceil(2).saturating_mul(SINGLE) <= found.points;
        let is_damage = !as_first && (self.compressed || few);
        Some((field + width * first, told, is_damage))
    }
}

impl Claimed {
    fn hold(&self, found: &Found) -> bool {
        (0..3).all(|i| found.lo[i] >= self.lo[i] && found.hi[i] <= self.hi[i])
    }
}

/// A part of a file whose points are looked at as they are read.
pub struct Watched {
    inner: Box<dyn Part>,
    evidence: Arc<Evidence>,
    /// Number among the parts of its file.
    number: usize,
    /// How far `inner` moves stored coordinates.
    shift: [i64; 3],
    found: Found,
}

impl Watched {
    /// Part `number` of the file that `evidence` is about.
    pub fn new(
        inner: Box<dyn Part>,
        evidence: Arc<Evidence>,
        number: usize,
        shift: [i64; 3],
    ) -> Self {
        Watched { inner, evidence, number, shift, found: Found::NONE }
    }
}

impl Part for Watched {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        self.inner.read(batch)?;
        let stride = batch.schema().stride;
        match batch.is_empty() {
            true => self.evidence.end(self.number, &self.found),
            false => self.evidence.look(&mut self.found, batch.records(), stride, self.shift),
        }
        Ok(())
    }
}
