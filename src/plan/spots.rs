//! Where a trial works: in a few squares along the two axes along which a scan is widest, each with
//! all of its height and all of the records that lie there, so that each has the neighbours that it
//! has in the scan. Records thinned evenly would not.
//!
//! The records of one place may be all over the input, as strips of an airborne scan that overlap
//! are. So the squares are chosen first, by the first records of every part, and then those parts
//! are read whose footprints meet one of them, wherever in the input they are.

use std::ops::Range;

/// Places of a look that are remembered.
const PLACES: usize = 64;
/// Bits of a place along an axis.
const BITS: u32 = 16;
/// A footprint without extent is so wide, as a part of the scan's width.
const NARROWEST: f64 = 1e-6;
/// Squares hold so many times as many records by their footprints as are wanted.
const SLACK: f64 = 1.5;
/// Squares are made wider by this factor until they do.
const WIDER: f64 = 1.25;
/// Steps from the narrowest square to one that holds any scan.
const WIDTHS: i32 = 80;

/// What the first records of a part tell.
#[derive(Debug, Clone)]
pub(super) struct PartLook {
    pub part: usize,
    /// Number of the input.
    pub input: u32,
    lo: [f64; 3],
    hi: [f64; 3],
    places: Vec<[f64; 3]>,
}

impl PartLook {
    /// A look at records at these places, in their order; None where none is anywhere.
    pub fn of(part: usize, input: u32, places: &[[f64; 3]]) -> Option<PartLook> {
        let finite = || places.iter().filter(|at| at.iter().all(|x| x.is_finite()));
        let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for at in finite() {
            for axis in 0..3 {
                lo[axis] = lo[axis].min(at[axis]);
                hi[axis] = hi[axis].max(at[axis]);
            }
        }
        let places: Vec<[f64; 3]> =
            finite().step_by(places.len().div_ceil(PLACES).max(1)).copied().collect();
        (!places.is_empty()).then_some(PartLook { part, input, lo, hi, places })
    }
}

/// Where parts that follow each other are, as far as looks tell.
#[derive(Debug, Clone)]
pub(super) struct Footprint {
    pub parts: Range<usize>,
    /// How many records these have.
    pub records: f64,
    lo: [f64; 2],
    hi: [f64; 2],
}

impl Footprint {
    /// The part of it that a square covers: of one that is thin along an axis, as if it was spread.
    fn within(&self, square: &SpotSquare) -> f64 {
        (0..2)
            .map(|axis| {
                let [lo, hi] =
                    [square.middle[axis] - square.half, square.middle[axis] + square.half];
                let common = hi.min(self.hi[axis]) - lo.max(self.lo[axis]);
                (common / (self.hi[axis] - self.lo[axis])).max(0.0)
            })
            .product()
    }

    /// True if records of it may be in a square. Looks do not see all of a part, so it is taken to
    /// be twice as wide as they tell.
    fn meets(&self, square: &SpotSquare) -> bool {
        (0..2).all(|axis| {
            let more = (self.hi[axis] - self.lo[axis]) / 2.0 + square.half;
            self.lo[axis] - more <= square.middle[axis]
                && square.middle[axis] <= self.hi[axis] + more
        })
    }
}

/// A square along two axes, of any height.
#[derive(Debug, Clone, Copy)]
struct SpotSquare {
    middle: [f64; 2],
    half: f64,
}

/// The squares.
#[derive(Debug, Clone)]
pub(super) struct Spots {
    axes: [usize; 2],
    squares: Vec<SpotSquare>,
}

/// The plane of the two widest axes of a scan, with what looks tell of it.
pub(super) struct Overview {
    looks: Vec<PartLook>,
    axes: [usize; 2],
    lo: [f64; 2],
    width: f64,
}

impl Overview {
    /// Of looks, in the order of their parts; None where there are none.
    pub fn of(looks: Vec<PartLook>) -> Option<Overview> {
        looks.first()?;
        let lo: [f64; 3] = std::array::from_fn(|a| {
            looks.iter().fold(f64::INFINITY, |lo, look| lo.min(look.lo[a]))
        });
        let hi: [f64; 3] = std::array::from_fn(|a| {
            looks.iter().fold(f64::NEG_INFINITY, |hi, look| hi.max(look.hi[a]))
        });
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| (hi[b] - lo[b]).total_cmp(&(hi[a] - lo[a])));
        let axes = [axes[0], axes[1]];
        let width = hi[axes[0]] - lo[axes[0]];
        let width = if width.is_normal() { width } else { 1.0 };
        Some(Overview { looks, axes, lo: axes.map(|axis| lo[axis]), width })
    }

    /// Adds further looks.
    pub fn add(&mut self, looks: Vec<PartLook>) {
        self.looks.extend(looks);
        self.looks.sort_by_key(|look| look.part);
        self.looks.dedup_by_key(|look| look.part);
    }

    /// The footprints of all parts up to `parts`: from each look to the next one. `records` tells
    /// how many a stretch of parts has.
    pub fn footprints(
        &self,
        parts: usize,
        records: impl Fn(Range<usize>) -> f64,
    ) -> Vec<Footprint> {
        let narrowest = NARROWEST * self.width;
        let each = self.looks.iter().enumerate().map(|(n, look)| {
            let next = self.looks.get(n + 1);
            let parts = look.part..next.map_or(parts, |next| next.part);
            // What comes last in its input goes on as what comes before it.
            let before = n.checked_sub(1).map(|before| &self.looks[before]);
            let same = |other: &&PartLook| other.input == look.input;
            let other = next.filter(same).or(before.filter(same)).unwrap_or(look);
            let [lo, hi] = [
                self.axes.map(|axis| look.lo[axis].min(other.lo[axis])),
                self.axes.map(|axis| look.hi[axis].max(other.hi[axis])),
            ];
            let hi = std::array::from_fn(|axis| hi[axis].max(lo[axis] + narrowest));
            Footprint { records: records(parts.clone()), parts, lo, hi }
        });
        each.collect()
    }

    /// The middles of `count` squares, spread evenly over the records.
    fn middles(&self, footprints: &[Footprint], count: usize) -> Vec<[f64; 2]> {
        let mut places: Vec<(u32, f64, [f64; 2])> = Vec::new();
        for (look, footprint) in self.looks.iter().zip(footprints) {
            let weight = footprint.records / look.places.len() as f64;
            places.extend(look.places.iter().map(|at| {
                let at = self.axes.map(|axis| at[axis]);
                (self.code(at), weight, at)
            }));
        }
        places.sort_by_key(|(code, ..)| *code);
        let all: f64 = places.iter().map(|(_, weight, _)| weight).sum();
        let (mut middles, mut behind) = (Vec::new(), 0.0);
        for (_, weight, at) in places {
            behind += weight;
            let next = (2 * middles.len() + 1) as f64 / (2 * count) as f64;
            if middles.len() < count && behind >= all * next {
                middles.push(at);
            }
        }
        middles
    }

    /// The number of a place along a curve that keeps near what is near.
    fn code(&self, at: [f64; 2]) -> u32 {
        let most = f64::from((1u32 << BITS) - 1);
        let [a, b] = [0, 1].map(|n| ((at[n] - self.lo[n]) / self.width * most) as u32);
        (0..BITS).fold(0, |code, bit| {
            code | (a >> bit & 1) << (2 * bit + 1) | (b >> bit & 1) << (2 * bit)
        })
    }

    /// `count` squares that hold about `records` each, or more, by the footprints.
    pub fn spots(&self, footprints: &[Footprint], count: usize, records: f64) -> Spots {
        let enough = SLACK * records;
        let square = |middle| {
            let wide = |n| SpotSquare { middle, half: self.width * WIDER.powi(n - WIDTHS) };
            let held = |square: &SpotSquare| -> f64 {
                footprints
                    .iter()
                    .map(|footprint| footprint.records * footprint.within(square))
                    .sum()
            };
            let is_enough = |square: &SpotSquare| held(square) >= enough;
            (0..WIDTHS).map(wide).find(is_enough).unwrap_or(wide(WIDTHS))
        };
        let squares = self.middles(footprints, count).into_iter().map(square).collect();
        Spots { axes: self.axes, squares }
    }
}

impl Spots {
    /// How many squares there are.
    pub fn count(&self) -> usize {
        self.squares.len()
    }

    /// Those of the footprints that may have records in a square.
    pub fn met<'a>(&self, footprints: &'a [Footprint]) -> Vec<&'a Footprint> {
        let is_met = |f: &&Footprint| self.squares.iter().any(|square| f.meets(square));
        footprints.iter().filter(is_met).collect()
    }

    /// The first square that holds a place, and how far from its middle that is: 1 at its edge.
    pub fn holding(&self, at: [f64; 3]) -> Option<(usize, f64)> {
        let at = self.axes.map(|axis| at[axis]);
        let away = |square: &SpotSquare| {
            let [x, y] = [0, 1].map(|n| (at[n] - square.middle[n]).abs() / square.half);
            // What is no number is in none.
            if x <= 1.0 && y <= 1.0 { Some(x.max(y)) } else { None }
        };
        self.squares.iter().enumerate().find_map(|(n, square)| Some((n, away(square)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strips over a thousand metres each way, a record a square metre and strip, flown there and
    /// back, each over half of the one before it: parts of 10,000 records.
    fn strips() -> Vec<Vec<[f64; 3]>> {
        let at = |strip: u32, n: u32| {
            let (line, across) = (n / 200, f64::from(n % 200));
            let along = if strip.is_multiple_of(2) { line } else { 999 - line };
            [f64::from(strip) * 100.0 + across, 0.01 * across, f64::from(along)]
        };
        let strip = |strip| (0..200_000).map(|n| at(strip, n)).collect::<Vec<_>>();
        (0..9)
            .flat_map(|n| strip(n).chunks(10_000).map(<[_]>::to_vec).collect::<Vec<_>>())
            .collect()
    }

    fn overview(parts: &[Vec<[f64; 3]>], step: usize) -> Overview {
        let looks = (0..parts.len()).step_by(step);
        let looks = looks.filter_map(|n| PartLook::of(n, 0, &parts[n][..500]));
        Overview::of(looks.collect()).unwrap()
    }

    #[test]
    fn squares_have_all_of_their_records_in_few_parts() {
        let parts = strips();
        let overview = overview(&parts, 1);
        let footprints = overview.footprints(parts.len(), |parts| 10_000.0 * parts.len() as f64);
        assert_eq!(footprints.len(), 180);
        let spots = overview.spots(&footprints, 4, 5_000.0);
        assert_eq!(spots.count(), 4);
        let met: Vec<usize> = spots.met(&footprints).iter().map(|f| f.parts.start).collect();
        assert!((8..90).contains(&met.len()), "{met:?}");
        let mut held = [0; 4];
        for (n, part) in parts.iter().enumerate() {
            let spot = |at: &[f64; 3]| spots.holding(*at).map(|(spot, _)| spot);
            part.iter().filter_map(spot).for_each(|spot| held[spot] += 1);
            let some = part.iter().any(|at| spot(at).is_some());
            assert!(!some || met.contains(&n), "part {n} has records in a square");
        }
        assert!(held.iter().all(|held| (5_000..25_000).contains(held)), "{held:?}");
    }

    #[test]
    fn looks_at_some_parts_tell_of_those_between() {
        let parts = strips();
        let mut overview = overview(&parts, 5);
        let records = |parts: Range<usize>| 10_000.0 * parts.len() as f64;
        let coarse = overview.footprints(parts.len(), records);
        assert_eq!((coarse.len(), coarse[35].parts.clone()), (36, 175..180));
        let spots = overview.spots(&coarse, 3, 5_000.0);
        let among: Vec<usize> = spots.met(&coarse).iter().flat_map(|f| f.parts.clone()).collect();
        let more = among.iter().filter_map(|&n| PartLook::of(n, 0, &parts[n][..500]));
        overview.add(more.collect());
        let fine = overview.footprints(parts.len(), records);
        let met: Vec<usize> = spots.met(&fine).iter().flat_map(|f| f.parts.clone()).collect();
        assert!(met.len() < among.len(), "{met:?} of {among:?}");
        for (n, part) in parts.iter().enumerate() {
            let some = part.iter().any(|at| spots.holding(*at).is_some());
            assert!(!some || met.contains(&n), "part {n} has records in a square");
        }
    }

    #[test]
    fn one_place_and_no_number_are_no_trouble() {
        let nowhere = [f64::NAN, 0.0, f64::INFINITY];
        assert!(PartLook::of(0, 0, &[nowhere; 5]).is_none() && Overview::of(Vec::new()).is_none());
        let look = PartLook::of(0, 0, &[[1.0; 3], nowhere, [1.0; 3]]).unwrap();
        let overview = Overview::of(vec![look]).unwrap();
        let footprints = overview.footprints(1, |_| 3.0);
        let spots = overview.spots(&footprints, 2, 10.0);
        assert_eq!(spots.count(), 2);
        assert!(spots.holding([1.0; 3]).is_some() && spots.holding(nowhere).is_none());
        assert_eq!(spots.met(&footprints).len(), 1);
    }
}
