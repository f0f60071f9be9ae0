//! Numbers that look random and are a function of what they are of: the finisher of SplitMix64
//! (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014) after each word.

use crate::point::Position;

/// What was made of the words so far.
#[derive(Debug, Clone, Copy)]
pub struct Hash(u64);

impl Hash {
    /// Of a seed alone.
    pub fn of(seed: u64) -> Self {
        Hash(0).and(seed)
    }

    /// And of one more word.
    #[inline]
    pub fn and(self, word: u64) -> Self {
        let mut z = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ word;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Hash(z ^ (z >> 31))
    }

    /// A number that looks random.
    pub fn value(self) -> u64 {
        self.0
    }
}

/// The hash of a position by a seed: who is visited first, and who is in a sample, by chance and
/// yet a function of the position alone.
#[inline]
pub fn of_position(seed: u64, p: Position) -> u64 {
    p.into_iter().fold(Hash::of(seed), |hash, v| hash.and(v as u64)).value()
}
