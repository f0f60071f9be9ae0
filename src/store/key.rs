//! Morton order of lattice positions, and octree nodes as cubes of it.
//!
//! In Morton order every octree node is one stretch of the sequence, so one sorted sequence serves
//! tiles, cells, boxes of the index and counts of every cube size. Other curves keep neighbours
//! closer, but their nodes have to be computed along the way from the root, where here a comparison
//! of two positions takes a few operations on their bits.

use crate::point::{Bounds, Position};

/// Bit 63 set: i64 order becomes u64 order, and bit patterns become octree paths.
const SIGN: u64 = 1 << 63;

/// The highest bit in which two positions differ on any axis; None if they are equal.
pub fn split_level(a: Position, b: Position) -> Option<u32> {
    let difference = ((a[0] ^ b[0]) | (a[1] ^ b[1]) | (a[2] ^ b[2])) as u64;
    difference.checked_ilog2()
}

/// Levels of the octree that one u64 key holds.
const PREFIX_LEVELS: u32 = 21;

/// The path of `p` through the upper 21 levels below a cube of side 2^`level` that holds it: for
/// positions of that cube, keys compare as the positions do in Morton order, or are equal.
pub fn morton_prefix(p: Position, level: u32) -> u64 {
    let below = level.saturating_sub(PREFIX_LEVELS);
    let [x, y, z] =
        p.map(|v| spread(((v as u64 ^ SIGN) >> below.min(63)) & ((1 << PREFIX_LEVELS) - 1)));
    x | y << 1 | z << 2
}

/// The Morton-first of all positions that have the [`morton_prefix`] of `p` below a cube of that
/// `level`.
pub fn first_of_prefix(p: Position, level: u32) -> Position {
    let below = level.saturating_sub(PREFIX_LEVELS);
    p.map(|v| v >> below << below)
}

/// The path of `p` as in [`morton_prefix`], or its upper `bits` bits if it has more.
pub fn morton_path(p: Position, level: u32, bits: u32) -> u64 {
    morton_prefix(p, level) >> (3 * level.min(PREFIX_LEVELS)).saturating_sub(bits)
}

/// Bit i of a 21-bit number goes to bit 3i.
fn spread(v: u64) -> u64 {
    let v = (v | v << 32) & 0x001f_0000_0000_ffff;
    let v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    let v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    let v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// An octree node: the cube of side 2^`level` that holds a position. Level 64 is all of the
/// lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileKey {
    /// Smallest corner.
    pub corner: Position,
    /// Binary logarithm of the side in lattice steps.
    pub level: u32,
}

impl TileKey {
    /// The cube of side 2^`level` around `p`.
    pub fn around(p: Position, level: u32) -> Self {
        let mask = if level >= 64 { 0 } else { u64::MAX << level };
        let corner = p.map(|v| (((v as u64 ^ SIGN) & mask) ^ SIGN) as i64);
        TileKey { corner, level }
    }

    /// The smallest cube that holds both corners of `bounds`.
    pub fn holding(bounds: &Bounds) -> Self {
        let level = split_level(bounds.lo, bounds.hi).map_or(0, |bit| bit + 1);
        TileKey::around(bounds.lo, level)
    }

    /// The eight halves in Morton order; None for a single position.
    pub fn children(&self) -> Option<[TileKey; 8]> {
        let level = self.level.checked_sub(1)?;
        Some(std::array::from_fn(|octant| {
            let corner = std::array::from_fn(|axis| {
                let far = (octant >> axis & 1) as u64;
                (((self.corner[axis] as u64 ^ SIGN) | (far << level)) ^ SIGN) as i64
            });
            TileKey { corner, level }
        }))
    }

    /// The cube as a box.
    pub fn cube(&self) -> Bounds {
        let span = if self.level >= 64 { u64::MAX } else { (1 << self.level) - 1 };
        Bounds {
            lo: self.corner,
            hi: self.corner.map(|v| (((v as u64 ^ SIGN) | span) ^ SIGN) as i64),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cmp::Ordering;

    use super::*;
    use crate::geom::morton::morton_cmp;

    fn interleaved(p: Position) -> [u8; 192] {
        let mut bits = [0; 192];
        for level in 0..64 {
            for axis in 0..3 {
                let bit = (p[axis] as u64 ^ SIGN) >> (63 - level) & 1;
                bits[level * 3 + (2 - axis)] = bit as u8;
            }
        }
        bits
    }

    proptest::proptest! {
        #[test]
        fn morton_order_is_that_of_interleaved_bits(
            a in proptest::array::uniform3(-20i64..20),
            b in proptest::array::uniform3(proptest::num::i64::ANY),
            c in proptest::array::uniform3(-20i64..20),
        ) {
            for (p, q) in [(a, b), (a, c), (b, c), (a, a)] {
                proptest::prop_assert_eq!(morton_cmp(&p, &q), interleaved(p).cmp(&interleaved(q)));
            }
        }

        #[test]
        fn prefixes_never_contradict_morton_order(
            corner in proptest::array::uniform3(proptest::num::i64::ANY), level in 0u32..=64,
            a in proptest::array::uniform3(proptest::num::u64::ANY),
            b in proptest::array::uniform3(proptest::num::u64::ANY),
        ) {
            let cube = TileKey::around(corner, level).cube();
            let inside = |v: [u64; 3]| -> Position {
                std::array::from_fn(|i| {
                    let span = cube.hi[i].abs_diff(cube.lo[i]);
                    let v = if span == u64::MAX { v[i] } else { v[i] % (span + 1) };
                    cube.lo[i].wrapping_add(v as i64)
                })
            };
            let (p, q) = (inside(a), inside(b));
            let keys = morton_prefix(p, level).cmp(&morton_prefix(q, level));
            proptest::prop_assert!(keys == Ordering::Equal || keys == morton_cmp(&p, &q));
            if level <= PREFIX_LEVELS {
                proptest::prop_assert_eq!(keys, morton_cmp(&p, &q));
            }
            let first = first_of_prefix(p, level);
            proptest::prop_assert_eq!(morton_prefix(first, level), morton_prefix(p, level));
            if keys == Ordering::Equal {
                proptest::prop_assert_ne!(morton_cmp(&first, &q), Ordering::Greater);
            }
        }

        #[test]
        fn a_cube_holds_what_it_was_made_around(
            p in proptest::array::uniform3(proptest::num::i64::ANY), level in 0u32..=64,
        ) {
            let key = TileKey::around(p, level);
            proptest::prop_assert!(key.cube().contains(p));
            if let Some(children) = key.children() {
                let holding = children.iter().filter(|c| c.cube().contains(p)).count();
                proptest::prop_assert_eq!(holding, 1);
                for pair in children.windows(2) {
                    let order = morton_cmp(&pair[0].corner, &pair[1].corner);
                    proptest::prop_assert_eq!(order, Ordering::Less);
                }
            }
        }
    }
}
