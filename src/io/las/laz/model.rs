//! What a symbol is likely to be: adaptive distributions, which the encoder and the decoder learn
//! alike from the symbols so far.
//!
//! The arithmetic is the format's own and has to be kept to the bit. How a symbol is looked up in a
//! distribution is free, and that is where a decoder spends its time: a table from the upper bits
//! of the code value gives a symbol that is right in most cases, and a scan upwards mends the
//! others. LASzip has tables with four symbols an entry on average and searches by halving, whose
//! branches nothing can foresee; entries for less than a symbol make most scans end where they
//! begin.
//!
//! Source: A. Said, "Introduction to Arithmetic Coding – Theory and Practice", HPL-2004-76, section
//! 3; the constants are those of the LAZ specification 1.4.

/// Bits of a probability.
pub const BITS: u32 = 15;
/// Counts are halved when their sum exceeds this.
const MOST: u32 = 1 << BITS;
/// Behind the last symbol: more than any code value.
pub const BEHIND: u16 = u16::MAX;

/// The distribution of a symbol below `N` - 1, with a table of `T` entries (a power of two).
#[derive(Clone)]
pub struct Model<const N: usize, const T: usize> {
    /// Counted symbols after which the distribution is computed again.
    left: u16,
    cycle: u16,
    total: u16,
    symbols: u16,
    /// Lowest code value of each symbol, then [`BEHIND`].
    pub lows: [u16; N],
    counts: [u16; N],
    /// The symbol at the lowest code value of each entry.
    pub table: [u16; T],
}

impl<const N: usize, const T: usize> Model<N, T> {
    /// Bits of a code value below those that choose an entry.
    pub const SHIFT: u32 = BITS - T.ilog2();

    /// All of `symbols`, fewer than `N`, alike.
    pub const fn new(symbols: usize) -> Self {
        assert!(symbols >= 2 && symbols < N && T.is_power_of_two());
        let mut counts = [0; N];
        let mut symbol = 0;
        while symbol < symbols {
            counts[symbol] = 1;
            symbol += 1;
        }
        let mut model = Model {
            left: 0,
            cycle: 0,
            total: symbols as u16,
            symbols: symbols as u16,
            lows: [BEHIND; N],
            counts,
            table: [0; T],
        };
        model.distribute();
        model.cycle = (symbols as u16 + 6) >> 1;
        model.left = model.cycle;
        model
    }

    /// Counts a symbol that was read.
    #[inline(always)]
    pub fn count(&mut self, symbol: usize) {
        self.counts[symbol] += 1;
        self.left -= 1;
        if self.left == 0 {
            self.update();
        }
    }

    #[cold]
    #[inline(never)]
    fn update(&mut self) {
        let mut total = u32::from(self.total) + u32::from(self.cycle);
        if total > MOST {
            total = 0;
            for count in self.counts.iter_mut().take(usize::from(self.symbols)) {
                *count = (*count + 1) >> 1;
                total += u32::from(*count);
            }
        }
        self.total = total as u16;
        self.distribute();
        let most = (self.symbols + 6) << 3;
        self.cycle = ((5 * u32::from(self.cycle)) >> 2).min(u32::from(most)) as u16;
        self.left = self.cycle;
    }

    /// Computes code values and table from the counts.
    const fn distribute(&mut self) {
        let scale = 0x8000_0000 / self.total as u32;
        let mut sum = 0;
        let mut symbol = 0;
        self.table = [0; T];
        while symbol < self.symbols as usize && symbol < N {
            let low = (scale * sum) >> (31 - BITS);
            self.lows[symbol] = low as u16;
            sum += self.counts[symbol] as u32;
            let entry = (low as usize + (1 << Self::SHIFT) - 1) >> Self::SHIFT;
            if entry < T {
                self.table[entry] = symbol as u16;
            }
            symbol += 1;
        }
        let mut entry = 0;
        let mut last = 0;
        while entry < T {
            let symbol = self.table[entry];
            last = if symbol > last { symbol } else { last };
            self.table[entry] = last;
            entry += 1;
        }
    }
}

/// A model that is made when it is first used.
#[inline(always)]
pub fn learned<const N: usize, const T: usize>(
    model: &mut Option<Box<Model<N, T>>>,
    symbols: usize,
) -> &mut Model<N, T> {
    model.get_or_insert_with(
        #[cold]
        || Box::new(Model::new(symbols)),
    )
}

/// Bits of the probability of a bit.
pub const BIT_BITS: u32 = 13;

/// The distribution of a bit.
#[derive(Clone)]
pub struct Bit {
    /// Probability of 0, in units of 2^-13.
    pub zero: u32,
    zeros: u32,
    total: u32,
    cycle: u32,
    left: u32,
}

impl Bit {
    /// Both alike.
    pub const fn new() -> Self {
        Bit { zero: 1 << (BIT_BITS - 1), zeros: 1, total: 2, cycle: 4, left: 4 }
    }

    /// Counts a bit that was read.
    #[inline(always)]
    pub fn count(&mut self, bit: bool) {
        self.zeros += u32::from(!bit);
        self.left -= 1;
        if self.left == 0 {
            self.update();
        }
    }

    #[cold]
    #[inline(never)]
    fn update(&mut self) {
        self.total += self.cycle;
        if self.total > 1 << BIT_BITS {
            self.total = (self.total + 1) >> 1;
            self.zeros = (self.zeros + 1) >> 1;
            if self.zeros == self.total {
                self.total += 1;
            }
        }
        let scale = 0x8000_0000 / self.total;
        self.zero = (self.zeros * scale) >> (31 - BIT_BITS);
        self.cycle = ((5 * self.cycle) >> 2).min(64);
        self.left = self.cycle;
    }
}
