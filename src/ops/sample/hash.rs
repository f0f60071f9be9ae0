//! Numbers that look random and are a function of what they are of: the finisher of SplitMix64
//! (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014) after each word.

/// What was made of the words so far.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hash(u64);

impl Hash {
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

    pub fn value(self) -> u64 {
        self.0
    }
}
