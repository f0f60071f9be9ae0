//! What the next point is predicted from: recent differences, and the place of a return in its
//! pulse.

/// The median of about five recent values.
#[derive(Clone, Copy)]
pub struct RunningMedian {
    /// Ascending.
    values: [i32; 5],
    /// The largest value makes way next, not the smallest.
    high: bool,
}

impl RunningMedian {
    /// Of zeros.
    pub const NEW: RunningMedian = RunningMedian { values: [0; 5], high: true };

    /// The median.
    #[inline(always)]
    pub fn get(&self) -> i32 {
        self.values[2]
    }

    /// Puts `value` in place of the largest or the smallest: of the other one next time if it lies
    /// on that side of the median.
    #[inline(always)]
    pub fn add(&mut self, value: i32) {
        let first = usize::from(!self.high);
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| self.values[first + i]);
        let median = self.values[2];
        self.high = (value < median) | (!self.high & (value == median));
        let between = |low: i32, high: i32| low.max(high.min(value));
        self.values = [a.min(value), between(a, b), between(b, c), between(c, d), d.max(value)];
    }
}

/// A number for each combination of returns of a pulse (up to 7) and return number; formats 0 to 5.
pub const RETURNS: [[u8; 8]; 8] = [
    [15, 14, 13, 12, 11, 10, 9, 8],
    [14, 0, 1, 3, 6, 10, 10, 9],
    [13, 1, 2, 4, 7, 11, 11, 10],
    [12, 3, 4, 5, 8, 12, 12, 11],
    [11, 6, 7, 8, 9, 13, 13, 12],
    [10, 10, 11, 12, 13, 14, 14, 13],
    [9, 10, 11, 12, 13, 14, 15, 14],
    [8, 9, 10, 11, 12, 13, 14, 15],
];

/// The same for up to 15 returns, six kinds; formats 6 to 10.
pub const RETURN_KINDS: [[u8; 16]; 16] = [
    [0, 1, 2, 3, 4, 5, 3, 4, 4, 5, 5, 5, 5, 5, 5, 5],
    [1, 0, 1, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3],
    [2, 1, 2, 4, 4, 4, 4, 4, 4, 4, 4, 3, 3, 3, 3, 3],
    [3, 3, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [4, 3, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [5, 3, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [3, 3, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [4, 3, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4],
    [4, 3, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4],
    [5, 3, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4],
    [5, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 4, 4, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5],
];

/// How many returns lie between a return and the last of its pulse, up to 7.
#[inline(always)]
pub fn level(returns: usize, number: usize) -> usize {
    returns.abs_diff(number).min(7)
}
