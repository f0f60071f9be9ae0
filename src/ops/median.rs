//! The stage `median`: of every cell the point with the median angle stays.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::geom::angle::{cosine, dominant_axis, is_known, outer_sum, sine2};
use crate::point::Position;
use crate::report::Tally;
use crate::stage::{Needs, TileOp};
use crate::tile::{Cells as Partition, Fate, Tile};

/// Bytes a position: an angle and an index.
const BYTES: usize = 16;

/// Keeps one record of every cell (the paper's third step).
///
/// A cell's positions are sorted by their angle θ to the partition's direction (to the cell's own
/// dominant axis where `cells` has `measure = "cone"`); the lower median stays: of m positions that at index (m − 1) / 2. Among positions of exactly that angle it is the
/// one nearest to the centre of mass of the cell's positions, then the first in Morton order. Copies
/// weigh as one position and are removed as coincident. A position without a normal is in no cell
/// and keeps one record.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Median {}

impl TileOp for Median {
    fn needs(&self) -> Needs {
        Needs {
            reads: vec!["Cell".into(), "Normal".into()],
            bytes_per_point: BYTES,
            removes: true,
            ..Needs::default()
        }
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let core = tile.core.clone();
        let (mut coincident, mut represented) = (0, 0);
        for i in core.clone() {
            if !is_known(tile.normals[i]) {
                coincident += keep_once(tile, i);
            }
        }
        let mut angles = Vec::new();
        let mut start = 0;
        for g in 0..tile.cells.ends.len() {
            let group = start..tile.cells.ends[g] as usize;
            start = group.end;
            if !tile.cells.members[group.clone()].iter().any(|&i| core.contains(&(i as usize))) {
                continue;
            }
            let kept = median(tile, group.clone(), &mut angles);
            for at in group {
                let i = tile.cells.members[at] as usize;
                if !core.contains(&i) {
                    continue;
                } else if i == kept {
                    coincident += keep_once(tile, i);
                } else {
                    represented += represent(tile, i, kept);
                }
            }
        }
        tally.remove("median", "coincident", coincident);
        tally.remove("median", "represented", represented);
        Ok(())
    }
}

/// The position of `group` with the lower median angle. `angles` is memory to work in.
fn median(tile: &Tile, group: Range<usize>, angles: &mut Vec<(f64, u32)>) -> usize {
    let Partition { members, turned, reference, .. } = &tile.cells;
    if let [only] = members[group.clone()] {
        return only as usize;
    }
    angles.clear();
    let normal = |i: u32| tile.normals[i as usize];
    match reference {
        Some(reference) => angles.extend(group.clone().map(|at| {
            let i = members[at];
            (cosine(*reference, normal(i), turned[at]), i)
        })),
        None => {
            let axis = dominant_axis(outer_sum(members[group.clone()].iter().map(|&i| normal(i))));
            angles.extend(members[group.clone()].iter().map(|&i| (-sine2(axis, normal(i)), i)));
        }
    }
    // Ascending angles are descending cosines, and descending −sin² up to a right angle.
    let middle = (angles.len() - 1) / 2;
    let cosine = angles.select_nth_unstable_by(middle, |a, b| b.0.total_cmp(&a.0)).1.0;
    angles.retain(|angle| angle.0 == cosine);
    if let [(_, only)] = angles[..] {
        return only as usize;
    }
    let center = Center::of(members[group].iter().map(|&i| tile.positions[i as usize]));
    // Indices are in Morton order.
    let first =
        angles.iter().min_by_key(|(_, i)| (center.distance2(tile.positions[*i as usize]), *i));
    first.map_or(0, |(_, i)| *i as usize)
}

/// Keeps one record of position `i`; returns how many copies that removes.
fn keep_once(tile: &mut Tile, i: usize) -> u64 {
    if tile.fates[i] == Fate::Kept && tile.copies[i] > 1 {
        tile.fates[i] = Fate::KeptOnce;
        return u64::from(tile.copies[i] - 1);
    }
    0
}

/// Lets `kept` stand for position `i`; returns how many records that removes.
fn represent(tile: &mut Tile, i: usize, kept: usize) -> u64 {
    let records = match tile.fates[i] {
        Fate::Kept => u64::from(tile.copies[i]),
        Fate::KeptOnce => 1,
        Fate::Removed | Fate::Represented { .. } => return 0,
    };
    let normal = tile.normals[kept].map(f64::from);
    let (p, q) = (tile.positions[i], tile.positions[kept]);
    let [x, y, z]: [f64; 3] =
        std::array::from_fn(|axis| p[axis].saturating_sub(q[axis]) as f64 * normal[axis]);
    tile.fates[i] = Fate::Represented { deviation: (x + y + z).abs() as f32 };
    records
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

    /// Exact squared distance of `p`, times n²: the upper and the lower 128 bits.
    fn distance2(&self, p: Position) -> (u128, u128) {
        let mut total = (0, 0);
        for (sum, v) in self.sum.iter().zip(p) {
            // Below 2^32 positions of 63 bits: an offset has less than 97.
            let offset = (self.count * i128::from(v) - sum).unsigned_abs();
            total = add(total, square(offset));
        }
        total
    }
}

/// v² for v < 2^127: the upper and the lower 128 bits.
fn square(v: u128) -> (u128, u128) {
    let (high, low) = (v >> 64, v & u128::from(u64::MAX));
    if high == 0 {
        return (0, low * low);
    }
    let cross = 2 * high * low;
    add((high * high + (cross >> 64), cross << 64), (0, low * low))
}

/// The sum of two numbers of 256 bits.
fn add(a: (u128, u128), b: (u128, u128)) -> (u128, u128) {
    let (low, carry) = a.1.overflowing_add(b.1);
    (a.0 + b.0 + u128::from(carry), low)
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn squares_of_256_bits_are_exact(a in 0u64.., b in 0u32..) {
            // (a + b·2^64)² in pieces of 32 bits, by hand.
            let v = u128::from(a) + (u128::from(b) << 64);
            let digits: Vec<u128> = (0..4).map(|i| v >> (32 * i) & 0xffff_ffff).collect();
            let mut pieces = [0u128; 9];
            for i in 0..4 {
                for j in 0..4 {
                    pieces[i + j] += digits[i] * digits[j];
                }
            }
            for i in 0..8 {
                pieces[i + 1] += pieces[i] >> 32;
                pieces[i] &= 0xffff_ffff;
            }
            let number = |range: Range<usize>| {
                pieces[range].iter().rev().fold(0u128, |number, piece| number << 32 | piece)
            };
            proptest::prop_assert_eq!(square(v), (number(4..8), number(0..4)));
        }
    }

    #[test]
    fn the_center_of_far_positions_is_exact() {
        let far = (1 << 62) - 1;
        let positions = [[far; 3], [-far; 3], [far, far, far - 1], [1, 0, 0]];
        let center = Center::of(positions.into_iter());
        let [a, _, c, d] = positions.map(|p| center.distance2(p));
        assert!(c < a, "one step nearer at 2^62");
        assert!(d < c);
        assert!(a.0 > 0, "beyond 128 bits");
    }

    #[test]
    fn the_stage_has_no_keys() {
        assert!(toml::from_str::<Median>("").is_ok());
        assert!(toml::from_str::<Median>("keep = 2").is_err());
    }
}
