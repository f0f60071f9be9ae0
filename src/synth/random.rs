//! Random numbers that are a function of a seed and a number alone, so that any point can be made
//! without the ones before it, and with the same bits on every machine.

/// The odd constant nearest to 2^64 / golden ratio: the step of SplitMix64.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finalizer of SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators,
/// OOPSLA 2014): a bijection whose output bits depend on all input bits.
pub fn mix(value: u64) -> u64 {
    let mut z = value;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A key for one purpose, so that two purposes of one seed share no number.
pub fn key(seed: u64, purpose: u64) -> u64 {
    mix(mix(seed.wrapping_add(STEP)).wrapping_add(purpose.wrapping_mul(STEP)))
}

/// A short sequence of random numbers.
pub struct Random {
    state: u64,
}

impl Random {
    /// The sequence of item `index` under `key`. Starts are mixed, because sequences that start one
    /// step apart would be the same numbers shifted.
    pub fn new(key: u64, index: u64) -> Self {
        Random { state: mix(key.wrapping_add(index.wrapping_mul(STEP))) }
    }

    /// The sequence of the cell (`x`, `y`) of a plan under `key`.
    pub fn of_cell(key: u64, x: i64, y: i64) -> Self {
        Random::new(mix(key ^ (x as u64).wrapping_mul(0xd6e8_feb8_6659_fd93)), y as u64)
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(STEP);
        mix(self.state)
    }

    /// Uniform in [0, 1), in steps of 2^-53.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [`lo`, `hi`).
    pub fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.unit()
    }

    /// A point uniform in the unit disc without its centre, and its squared distance to the centre.
    pub fn in_disc(&mut self) -> ([f64; 2], f64) {
        loop {
            let [u, v] = [self.between(-1.0, 1.0), self.between(-1.0, 1.0)];
            let square = u * u + v * v;
            if square > 0.0 && square < 1.0 {
                return ([u, v], square);
            }
        }
    }

    /// Cosine and sine of a uniform angle.
    pub fn direction(&mut self) -> [f64; 2] {
        let ([u, v], square) = self.in_disc();
        let length = square.sqrt();
        [u / length, v / length]
    }

    /// Two independent numbers of the standard normal distribution (Marsaglia's polar method); none
    /// is further than 12 from 0.
    pub fn gaussians(&mut self) -> [f64; 2] {
        let ([u, v], square) = self.in_disc();
        let stretch = (-2.0 * libm::log(square) / square).sqrt();
        [u * stretch, v * stretch]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_have_the_moments_of_the_normal_distribution() {
        let pairs = 100_000;
        let (mut sum, mut square, mut fourth) = (0.0, 0.0, 0.0);
        for i in 0..pairs {
            for g in Random::new(key(3, 4), i).gaussians() {
                sum += g;
                square += g * g;
                fourth += g * g * g * g;
            }
        }
        let n = 2.0 * pairs as f64;
        assert!((sum / n).abs() < 0.01, "mean {}", sum / n);
        assert!((square / n - 1.0).abs() < 0.02, "variance {}", square / n);
        assert!((fourth / n - 3.0).abs() < 0.15, "fourth moment {}", fourth / n);
    }

    #[test]
    fn neighbouring_items_and_seeds_share_no_numbers() {
        let mut seen = std::collections::BTreeSet::new();
        for seed in 0..20 {
            for index in 0..100 {
                let mut random = Random::new(key(seed, 1), index);
                (0..8).for_each(|_| assert!(seen.insert(random.next())));
            }
        }
        assert_eq!(seen.len(), 16_000);
    }

    #[test]
    fn uniform_numbers_fill_their_range_evenly() {
        let mut bins = [0u32; 10];
        for i in 0..100_000 {
            bins[(Random::new(key(0, 9), i).unit() * 10.0) as usize] += 1;
        }
        assert!(bins.iter().all(|&n| n.abs_diff(10_000) < 500), "{bins:?}");
    }
}
