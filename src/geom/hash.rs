//! Numbers that look random and are a function of what they are of: the finisher of SplitMix64
//! (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014) after each word.

use std::hash::{BuildHasher, Hasher};

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

/// Makes hashes of the places of cubes for tables of the standard library, several times as fast as
/// its own, which withstand chosen keys: here a bad choice of keys costs time alone.
#[derive(Debug, Default, Clone, Copy)]
pub struct PlaceHashes;

impl BuildHasher for PlaceHashes {
    type Hasher = PlaceHasher;

    fn build_hasher(&self) -> PlaceHasher {
        PlaceHasher(0)
    }
}

/// See [`PlaceHashes`].
#[derive(Debug)]
pub struct PlaceHasher(u64);

impl Hasher for PlaceHasher {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }

    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u64(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(26) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn write_i64(&mut self, word: i64) {
        self.write_u64(word as u64);
    }

    fn write_usize(&mut self, word: usize) {
        self.write_u64(word as u64);
    }
}
